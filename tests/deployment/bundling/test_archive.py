"""The signed archive of a real bundle: the same bytes each time, an SBOM, and on a machine the same core."""

import importlib.util
import json
import re
import uuid
from importlib import metadata
from pathlib import Path

import pytest

from deployment.bundling import archive as signing, sbom
from runtime.archive import container, keys
from runtime.archive.names import BUNDLE, CONFIGURATION, SBOM
from runtime.archive.signed import Signed
from runtime.bundle import digest
from specs.errors import InputError
from tests.runtime.archive.made import key
from tests.runtime.bundles import built


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Signed]:
    """An archive of the controller pi."""
    path = tmp_path_factory.mktemp("archive") / "pi.slwb"
    return path, signing.write(built("pi"), path, key(), "1.0")


def test_it_holds_the_bundle_and_reads_back(made: tuple[Path, Signed]):
    path, signed = made
    files = container.read(path)
    assert files == signed.files
    folder = built("pi").folder
    inside = {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    assert {n.removeprefix(BUNDLE): d for n, d in files.items() if n.startswith(BUNDLE)} == inside
    assert (signed.release, signed.manifest["controller"]) == ("1.0", "pi")
    assert sorted(p.name for p in path.parent.iterdir()) == ["pi.slwb"]


def test_the_same_input_gives_the_same_bytes(made: tuple[Path, Signed], tmp_path: Path):
    signing.write(built("pi"), tmp_path / "again.slwb", key(), "1.0")
    assert (tmp_path / "again.slwb").read_bytes() == made[0].read_bytes()


def test_the_sbom_has_what_cyclonedx_asks_for(made: tuple[Path, Signed]):
    """The rules of schema bom-1.6 for what is used of it: required keys, enumerations, uniqueness."""
    bom = json.loads(made[1].files[SBOM])
    assert (bom["bomFormat"], bom["specVersion"], bom["version"]) == ("CycloneDX", "1.6", 1)
    assert uuid.UUID(bom["serialNumber"]).urn == bom["serialNumber"]
    parts = [bom["metadata"]["component"], *bom["components"]]
    assert {c["type"] for c in parts} <= {"application", "library", "file", "machine-learning-model"}
    assert all(c["name"] for c in parts)
    references = [c["bom-ref"] for c in parts]
    assert len(references) == len(set(references))
    named = {r for d in bom["dependencies"] for r in (d["ref"], *d["dependsOn"])}
    assert named == set(references)
    for text in re.findall(r'"content": "([^"]*)"', json.dumps(bom)):
        assert re.fullmatch("[0-9a-f]{64}", text)
    assert "timestamp" not in bom["metadata"]


def test_the_sbom_lists_every_file_and_what_the_runtime_needs(made: tuple[Path, Signed]):
    signed = made[1]
    bom = json.loads(signed.files[SBOM])
    files = {c["name"]: c["hashes"][0]["content"] for c in bom["components"] if c["type"] == "file"}
    told = set(signed.files) - {SBOM, "release.json", "release.sig"}
    assert files == {name: digest(signed.files[name]) for name in told}
    packages = {c["name"]: c for c in bom["components"] if c["type"] == "library"}
    assert {"slewright", "numpy", "cryptography", "python-can", "pymodbus", "mcap", "cffi"} <= packages.keys()
    assert not {"torch", "casadi", "pytest"} & packages.keys()
    assert packages["numpy"]["version"] == metadata.version("numpy")
    assert packages["numpy"]["purl"] == f"pkg:pypi/numpy@{metadata.version('numpy')}"
    locked = packages["cryptography"]["externalReferences"][0]["hashes"]
    assert {h["content"] for h in locked} == set(
        sbom.locked("cryptography", metadata.version("cryptography"))
    )
    assert locked


def test_onnxruntime_is_listed_where_it_evaluates_the_policy():
    assert "onnxruntime" not in sbom.runtime_packages("native")
    if importlib.util.find_spec("onnxruntime"):
        assert "onnxruntime" in sbom.runtime_packages("onnxruntime")


def test_hashes_of_another_version_are_not_given():
    assert sbom.locked("numpy", "0.0.1") == []
    assert sbom.locked("num", metadata.version("numpy")) == []


def test_a_configuration_is_carried_and_read_strictly(tmp_path: Path):
    config = tmp_path / "machine.toml"
    config.write_text('[can]\ninterface = "socketcan"\nchannel = "can0"\n[store]\nfolder = "s"\n')
    signed = signing.write(built("pi"), tmp_path / "a.slwb", key(), "", config)
    assert signed.files[CONFIGURATION] == config.read_bytes()
    config.write_text("[can]\n")
    private = tmp_path / "k.pem"
    keys.new(private)
    with pytest.raises(InputError, match=r"machine\.toml: missing can\.interface"):
        signing.check(tmp_path / "b.slwb", private, "", config, str)


def test_nothing_half_written_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(container, "MOST", 3)
    with pytest.raises(InputError, match="at most 3 files"):
        signing.write(built("pi"), tmp_path / "a.slwb", key())
    assert list(tmp_path.iterdir()) == []
