"""Reading a bundle: whatever was done to it after it was built is found, and said."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime import bundle as form, image
from runtime.control import ControlCore
from specs.errors import InputError
from tests.runtime.bundles import built, core


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of a bundle, to be tampered with."""
    return Path(shutil.copytree(built().folder, tmp_path / "bundle"))


def edit(folder: Path, change: Callable[[dict], object]) -> None:
    path = folder / form.MANIFEST
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def test_an_untouched_copy_is_accepted(copy: Path) -> None:
    assert form.load(copy).digest == built().digest


def test_every_changed_file_is_named(copy: Path) -> None:
    for name in form.hashes(copy):
        path = copy / name
        before = path.read_bytes()
        path.write_bytes(before[:-1] + bytes([before[-1] ^ 1]))
        with pytest.raises(InputError, match=f"{name} was changed since it was built"):
            form.load(copy)
        path.write_bytes(before)
    form.load(copy)


def test_a_missing_and_an_added_file_are_named(copy: Path) -> None:
    (copy / "extra.onnx").write_bytes(b"x")
    with pytest.raises(InputError, match=r"extra\.onnx is not in its manifest"):
        form.load(copy)
    (copy / "extra.onnx").unlink()
    (copy / "parameters.json").unlink()
    with pytest.raises(InputError, match=r"parameters\.json is missing"):
        form.load(copy)


MANIFESTS = {
    "other layout": (lambda c: c.update(layout="0" * 16), r"layout 0+: specs/signals\.toml has changed"),
    "other version": (lambda c: c.update(slewright="0.0.1"), r"slewright 0\.0\.1: here it is"),
    "other format": (lambda c: c.update(format=99), "format 99: here it is 1"),
    "no identity": (lambda c: c.pop("identity"), "identity is missing or no str"),
    "no files": (lambda c: c.update(files=[]), "files is missing or no table"),
    "no platforms": (lambda c: c.update(platforms="x86_64-linux"), "platforms is missing or no list"),
}


@pytest.mark.parametrize("case", MANIFESTS)
def test_a_wrong_manifest_is_refused(case: str, copy: Path) -> None:
    change, said = MANIFESTS[case]
    edit(copy, change)
    with pytest.raises(InputError, match=said):
        form.load(copy)


@pytest.mark.parametrize(("text", "said"), [("{", "is no JSON"), ("[]", "holds no object")])
def test_a_broken_manifest_is_refused(text: str, said: str, copy: Path) -> None:
    (copy / form.MANIFEST).write_text(text)
    with pytest.raises(InputError, match=said):
        form.load(copy)


def test_no_bundle_at_all(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is no bundle: manifest\.json cannot be read"):
        form.load(tmp_path / "nothing")


def test_another_platform_is_said_with_those_there_are() -> None:
    with pytest.raises(InputError, match=r"no core for sparc-linux; it has"):
        built().library("sparc-linux")


def test_a_core_of_another_bundle_is_refused(copy: Path) -> None:
    """Consistent hashes do not help when the machine code is not what the manifest says."""
    edit(copy, lambda c: c.update(identity="f" * 64))
    with pytest.raises(InputError, match=r"its core has identity .*, not f+"):
        ControlCore(form.load(copy))


def test_a_core_of_another_image_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    made = built()
    monkeypatch.setattr(image, "token", lambda: "0" * 16)
    with pytest.raises(InputError, match="layout"):
        form.load(made.folder)


def test_a_library_that_is_none_is_refused(copy: Path) -> None:
    name = form.load(copy).library().name
    (copy / name).write_bytes(b"no library")
    edit(copy, lambda c: c["files"].update({name: form.digest(b"no library")}))
    with pytest.raises(InputError, match=f"{name} cannot be loaded"):
        ControlCore(form.load(copy))


def test_a_snapshot_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="a snapshot of 3 bytes"):
        core().restore(b"abc")


def damaged(copy: Path, text: str) -> form.Bundle:
    """The bundle with other parameters, and a manifest that says so."""
    (copy / form.PARAMETERS).write_text(text)
    edit(copy, lambda c: c["files"].update({form.PARAMETERS: form.digest(text.encode())}))
    return form.load(copy)


def without_lut(text: str) -> str:
    return json.dumps({k: v for k, v in json.loads(text).items() if not k.startswith("lut_")})


PARAMETERS = {
    "no JSON": (lambda text: text[:-20], r"parameters\.json is no JSON"),
    "no table": (lambda text: "[]", r"parameters\.json holds no table of parameters"),
    "no number": (
        lambda text: text.replace('"value": ', '"value": "x", "was": ', 1),
        r"parameters\.json: \w+ has no number as its value",
    ),
    "no LUT": (without_lut, r"its core has parameters \(SHA-256 of parameters\.json\) \w+, not"),
    "another LUT": (lambda text: text.replace("1.", "2."), r"its core has parameters .*, not"),
}


@pytest.mark.parametrize("case", PARAMETERS)
def test_parameters_that_are_not_the_cores_are_refused(case: str, copy: Path) -> None:
    change, said = PARAMETERS[case]
    with pytest.raises(InputError, match=said):
        ControlCore(damaged(copy, change((copy / form.PARAMETERS).read_text())))
