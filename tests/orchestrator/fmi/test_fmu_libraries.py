"""Libraries that cannot be loaded or are not what their description says: each is refused with its reason."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.fmi.component import Component
from orchestrator.fmi.instance import Instance
from specs.errors import InputError, RunError
from tests.orchestrator.every import Every, every

VERSIONS = pytest.mark.parametrize("version", [2, 3], ids=["FMI2", "FMI3"])


def refused(built: Every, component: Component | None = None) -> str:
    """The reason for which an FMU is refused, or a component that is like it."""
    component = component or built.component
    with pytest.raises(InputError) as caught:
        Instance(component)
    message = str(caught.value)
    assert message.isprintable()
    start = f"FMU of component every ({component.library.name}) cannot be instantiated: "
    assert message.startswith(start)
    return message.removeprefix(start)


@VERSIONS
def test_a_wrong_token_is_refused_with_the_words_of_the_fmu(version: int, tmp_path: Path) -> None:
    assert refused(every(version, tmp_path, token="another")).startswith("wrong token")


@VERSIONS
def test_without_words_of_the_fmu_that_is_said(version: int, tmp_path: Path) -> None:
    assert refused(every(version, tmp_path, "-DMUTE", token="another")) == "it gave no reason"


@VERSIONS
def test_a_library_without_a_needed_function_is_refused(version: int, tmp_path: Path) -> None:
    built = every(version, tmp_path, "-DNO_DOSTEP", "-Wno-unused-function")
    assert refused(built) == f"its library lacks the function fmi{version}DoStep"


@VERSIONS
def test_a_function_that_may_be_missing_is_named_when_it_is_called(version: int, tmp_path: Path) -> None:
    built = every(version, tmp_path, "-DNO_STRINGS")
    with Instance(built.component) as instance:
        for call in (lambda: instance.values(["String.in"]), lambda: instance.set_values({"String.in": "a"})):
            with pytest.raises(RunError, match=rf"lacks the function fmi{version}[GS]etString"):
                call()


@VERSIONS
def test_a_library_of_another_version_is_refused(version: int, tmp_path: Path) -> None:
    built = every(version, tmp_path, '-DVERSION="1.0"')
    assert refused(built) == f"its library says it is of FMI 1.0, its description {version}.0"


@VERSIONS
def test_a_library_whose_version_is_null_is_refused(version: int, tmp_path: Path) -> None:
    built = every(version, tmp_path, "-DVERSION=0")
    assert refused(built) == f"its library says it is of FMI (none), its description {version}.0"


@VERSIONS
def test_a_library_that_does_not_tell_its_version_is_taken(version: int, tmp_path: Path) -> None:
    built = every(version, tmp_path, "-DNO_VERSION")
    Instance(built.component).free()


@pytest.mark.parametrize("platform", ['"special"', "0"])
def test_other_types_of_fmi2_are_refused(platform: str, tmp_path: Path) -> None:
    built = every(2, tmp_path, f"-DPLATFORM={platform}")
    assert re.fullmatch(r"its library uses the types '(special|)', not 'default'", refused(built))


def test_a_library_of_the_other_fmi_version_is_refused(tmp_path: Path) -> None:
    built = every(3, tmp_path)
    other = replace(built.component, model=replace(built.component.model, fmi_version=2))
    assert refused(built, other) == "its library lacks the function fmi2Instantiate"


@pytest.mark.parametrize("content", [b"", b"not a library", b"\x7fELF" + b"\0" * 200])
@VERSIONS
def test_what_is_no_library_is_refused(version: int, content: bytes, tmp_path: Path) -> None:
    built = every(version, tmp_path)
    built.component.library.write_bytes(content)
    assert re.search("too short|invalid ELF|only ET_DYN|no version|ELF", refused(built))


def test_a_library_that_is_gone_is_refused(tmp_path: Path) -> None:
    built = every(2, tmp_path)
    built.component.library.unlink()
    assert "No such file" in refused(built)


def test_folders_with_unusual_names_are_no_obstacle(tmp_path: Path) -> None:
    folder = tmp_path / "Prüfstand 3 #1%20"
    folder.mkdir()
    built = every(2, folder)  # it checks that its resources are given as a URI
    copied = replace(built.component, folder=folder / "fmu", library=folder / "every.so")
    copied.library.write_bytes(built.component.library.read_bytes())
    Instance(copied).free()
