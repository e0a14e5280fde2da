"""Archives, FMUs and libraries that are damaged, foreign or hostile; and what the command makes of it."""

import errno
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus.compiler import host
from orchestrator.check import load_system
from records.record import read, recording_path
from specs.errors import InputError, RunError
from tests.conftest import ROOT, Command
from tests.orchestrator.systems import (
    OSCILLATOR,
    component,
    connection,
    connector,
    fmu,
    load,
    refused,
    ssd,
    write_ssp,
)

NAMES = ["position", "speed"]


# ---- files ----


def test_missing_and_foreign_files(tmp_path: Path) -> None:
    for name, content, words in (
        ("none.ssp", None, "does not exist"),
        ("text.ssp", b"no zip", "is truncated or not a zip archive"),
    ):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=words):
            load_system(tmp_path / name)


def test_a_package_without_a_default_structure(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.ssp", "w") as archive:
        archive.writestr("Other.ssd", OSCILLATOR)
    with pytest.raises(InputError, match=r"holds no SystemStructure\.ssd"):
        load_system(tmp_path / "a.ssp")


@pytest.mark.parametrize("keep", [0.3, 0.95])
def test_a_truncated_fmu(tmp_path: Path, keep: float) -> None:
    whole = fmu("speed").read_bytes()
    cut = tmp_path / "cut.fmu"
    cut.write_bytes(whole[: int(len(whole) * keep)])
    message = refused(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": cut})
    assert "FMU resources/speed.fmu of component speed is truncated or not a zip archive" in message


def repacked(folder: Path, source: Path, change: dict[str, bytes | None]) -> Path:
    """A copy of an FMU with entries replaced, or left out (None: all that start so)."""
    out = folder / "changed.fmu"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            if not any(content is None and name.startswith(key) for key, content in change.items()):
                new.writestr(name, change.get(name) or old.read(name))
    return out


def test_an_fmu_for_another_platform(tmp_path: Path) -> None:
    mine = f"binaries/{host().fmi2_folder}/speed{host().suffix}"
    foreign = repacked(tmp_path, fmu("speed"), {mine: None})
    with zipfile.ZipFile(foreign, "a") as archive:
        archive.writestr("binaries/vax64/speed.exe", b"x")
    message = refused(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": foreign})
    assert "FMU resources/speed.fmu of component speed has no binary for this platform" in message
    assert f"({host().fmi2_folder}); it has: vax64" in message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"<fmiModelDescription", "is not valid XML"),
        (b'<fmiModelDescription fmiVersion="1.0"/>', "has FMI version '1.0'; valid: 2.0, 3.0"),
        (b'<fmiModelDescription fmiVersion="2.0" guid="g"/>', "offers no co-simulation"),
        (b'<fmiModelDescription fmiVersion="2.0"><CoSimulation modelIdentifier="a"/></fmiModelDescription>',
         "has no 'guid'"),
    ],
)  # fmt: skip
def test_a_wrong_model_description(tmp_path: Path, content: bytes, words: str) -> None:
    broken = repacked(tmp_path, fmu("speed"), {"modelDescription.xml": content})
    message = refused(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": broken})
    assert words in message
    assert "component speed" in message


def test_a_library_that_is_none_and_one_that_refuses(tmp_path: Path) -> None:
    from orchestrator.simulate import simulate

    library = f"binaries/{host().fmi2_folder}/speed{host().suffix}"
    broken = repacked(tmp_path, fmu("speed"), {library: b"no library"})
    system = load(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": broken})
    with pytest.raises(InputError, match=r"FMU of component speed: speed.* cannot be loaded"):
        simulate(system, 1)

    with zipfile.ZipFile(fmu("speed")) as archive:
        xml = archive.read("modelDescription.xml").decode()
    guid = xml.split('guid="')[1].split('"')[0]
    wrong = repacked(tmp_path, fmu("speed"), {"modelDescription.xml": xml.replace(guid, "{other}").encode()})
    system = load(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": wrong})
    with pytest.raises(InputError, match="component speed cannot be instantiated"):
        simulate(system, 1)


@pytest.mark.parametrize("name", ["../evil", "/evil", "a/../../evil", "c:evil"])
def test_archives_that_leave_their_folder(tmp_path: Path, name: str) -> None:
    path = tmp_path / "evil.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, b"x")
    with pytest.raises(InputError, match="leaves the archive"):
        load_system(path)
    assert not (tmp_path.parent / "evil").exists()


def test_links_in_archives(tmp_path: Path) -> None:
    path = tmp_path / "link.ssp"
    entry = zipfile.ZipInfo("SystemStructure.ssd")
    entry.external_attr = 0o120777 << 16
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(entry, "/etc/passwd")
    with pytest.raises(InputError, match="is a link"):
        load_system(path)


# ---- through the command ----


def test_the_command_says_it_in_one_line_with_exit_code_2(tmp_path: Path, slewright: Command) -> None:
    path = write_ssp(tmp_path, OSCILLATOR.replace('startElement="speed"', 'startElement="sped"', 1), NAMES)
    out = tmp_path / "r.parquet"
    done = slewright("simulate", path, "--out", out, "--stop", "1")
    assert done.returncode == 2
    assert "unknown element 'sped'; did you mean speed?" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("r.parquet*"))


def test_a_failing_fmu_gives_exit_code_3_and_a_record(tmp_path: Path, slewright: Command) -> None:
    text = ssd(
        [component("bomb", "burst", connector("count", "output"))],
        [connection("bomb.count", "count")],
        [connector("count", "output")],
    )
    path, out = write_ssp(tmp_path, text, ["burst"]), tmp_path / "r.parquet"
    done = slewright("simulate", path, "--out", out, "--stop", "1")
    assert done.returncode == 3
    assert "component bomb failed in the step from t = 0.03 s" in done.stderr
    assert "Traceback" not in done.stderr
    assert out.exists()


def test_ctrl_c_ends_with_130_and_a_readable_record(tmp_path: Path) -> None:
    path, out = write_ssp(tmp_path, OSCILLATOR, NAMES), tmp_path / "r.parquet"
    command = [
        sys.executable,
        "-m",
        "slewright",
        "simulate",
        str(path),
        "--out",
        str(out),
        "--stop",
        "100000",
    ]
    running = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60.0
    while not (recording_path(out).exists() and recording_path(out).stat().st_size > 100_000):
        assert running.poll() is None, "it ended by itself"
        assert time.monotonic() < deadline, "nothing was recorded"
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130
    assert "Traceback" not in err
    record = read(out)
    assert (record.complete, record.reason) == (False, "interrupted")
    assert len(record) > 1000
    np.testing.assert_array_equal(record.time, np.arange(len(record)) * 0.01)


def test_no_room_to_unpack_is_no_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk is told apart from a damaged archive: exit code 3, not 2."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "extractall", full)
    with pytest.raises(RunError, match=r"cannot be unpacked into .*: No space left on device"):
        load(tmp_path, OSCILLATOR, NAMES)
