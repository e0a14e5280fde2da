"""Archives, FMUs and libraries that are damaged, foreign or hostile; and what the command makes of it."""

import errno
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus.toolchain.compiler import host
from orchestrator.files import archive
from orchestrator.files.archive import unpack
from orchestrator.files.scratch import Scratch
from orchestrator.system.check import load_system
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
        (b'<fmiModelDescription fmiVersion="2.0" guid="g"/>', "offers none of CoSimulation, ModelExchange"),
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
    from orchestrator.run.simulate import simulate

    library = f"binaries/{host().fmi2_folder}/speed{host().suffix}"
    broken = repacked(tmp_path, fmu("speed"), {library: b"no library"})
    system = load(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": broken})
    with pytest.raises(InputError, match=r"speed \(speed.* cannot be instantiated: file too short"):
        simulate(system, 1)

    with zipfile.ZipFile(fmu("speed")) as archive:
        xml = archive.read("modelDescription.xml").decode()
    guid = xml.split('guid="')[1].split('"')[0]
    wrong = repacked(tmp_path, fmu("speed"), {"modelDescription.xml": xml.replace(guid, "{other}").encode()})
    system = load(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": wrong})
    with pytest.raises(InputError, match=r"component speed .* cannot be instantiated: the GUID"):
        simulate(system, 1)


Entry = tuple[str | zipfile.ZipInfo, bytes]


def archived(folder: Path, *entries: Entry, name: str = "odd.ssp") -> Path:
    """A deflated archive of entries, written as they are."""
    path = folder / name
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        warnings.simplefilter("ignore")  # zipfile warns of second entries
        for entry, content in entries:
            archive.writestr(entry, content)
    return path


def unpacking(path: Path) -> str:
    """With what message an archive is refused; nothing is left of it."""
    target = path.parent / "unpacked" / "here"
    with pytest.raises(InputError) as caught:
        unpack(path, target, "archive x")
    assert not target.parent.exists() or not list(target.parent.iterdir())
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message


def special(name: str, mode: int) -> zipfile.ZipInfo:
    """An entry with a Unix mode."""
    entry = zipfile.ZipInfo(name)
    entry.external_attr = mode << 16
    return entry


@pytest.mark.parametrize("name", ["../evil", "/evil", "a/../../evil", "c:evil", "..\\evil"])
def test_archives_that_leave_their_folder(tmp_path: Path, name: str) -> None:
    path = archived(tmp_path, (name, b"x"))
    with pytest.raises(InputError, match="leaves the archive"):
        load_system(path)
    assert not (tmp_path.parent / "evil").exists()


LONG = "n" * 256


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([(special("SystemStructure.ssd", 0o120777), b"/etc/passwd")], "'SystemStructure.ssd' is a link"),
        ([(special("pipe", 0o010644), b"")], "entry 'pipe' is neither a file nor a folder"),
        ([(special("disk", 0o060644), b"")], "entry 'disk' is neither a file nor a folder"),
        ([("a", b"1"), ("a", b"2")], "entry 'a' is in the archive twice"),
        ([("a/b", b"1"), ("a//b", b"2")], "is in the archive twice"),
        ([("a/b", b"1"), ("./a/b", b"2")], "is in the archive twice"),
        ([("a", b"1"), ("a/b", b"2")], "entry 'a/b' is inside of what is a file elsewhere"),
        ([("a/b", b"1"), ("a", b"2")], "entry 'a' is both a file and a folder"),
        ([("a/", b""), ("a", b"2")], "entry 'a' is both a file and a folder"),
        ([(LONG, b"")], "has too long a name"),
        ([("/".join("abcd" * 300), b"")], "has too long a name"),
        ([("a\nb", b"")], "has a name with characters that no file name may have"),
        ([("a\\b", b"")], "has a name with characters that no file name may have"),
        ([("./", b"")], "has a name with characters"),
    ],
)
def test_entries_that_are_refused(tmp_path: Path, entries: list[Entry], words: str) -> None:
    message = unpacking(archived(tmp_path, *entries))
    assert words in message
    assert message.startswith("archive x: entry ")


SPELT_ALIKE = [
    ([("a", b"1"), ("A", b"2")], "entry 'A' differs from 'a' only in case"),
    ([("a/x", b"1"), ("A/y", b"2")], "entry 'A/y' differs from 'a' only in case"),
    ([("a\u0308", b"1"), ("ä", b"2")], "differs from"),
]


@pytest.mark.parametrize(("entries", "words"), SPELT_ALIKE)
def test_names_that_differ_in_spelling_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entries: list[Entry], words: str
) -> None:
    path = archived(tmp_path, *entries)
    monkeypatch.setattr(archive, "FOLDS_CASE", True)  # as on Windows and macOS
    assert words in unpacking(path)
    monkeypatch.setattr(archive, "FOLDS_CASE", False)
    unpack(path, tmp_path / "both", "archive x")
    assert sorted(p.read_bytes() for p in (tmp_path / "both").rglob("*") if p.is_file()) == [b"1", b"2"]


def test_what_other_tools_write(tmp_path: Path) -> None:
    """An entry twice with one content, a colon in a name, a name in code page 437."""
    path = archived(tmp_path, ("a", b"1"), ("a", b"1"), ("at 1:2", b"2"), ("name", b"3"))
    content = path.read_bytes().replace(b"name", b"n\x84me")
    path.write_bytes(content)
    unpack(path, tmp_path / "out", "archive x")
    found = {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    assert found == {"a": b"1", "at 1:2": b"2", "näme": b"3"}


def patched(path: Path, *changes: tuple[bytes, int, bytes]) -> Path:
    """Overwrite bytes in an archive, each at an offset from the last place of a signature."""
    content = bytearray(path.read_bytes())
    for signature, offset, new in changes:
        at = content.rindex(signature) + offset
        content[at : at + len(new)] = new
    path.write_bytes(content)
    return path


LOCAL, CENTRAL, END = b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([(CENTRAL, 8, b"\x01"), (LOCAL, 6, b"\x01")], "entry 'name' is encrypted"),
        ([(CENTRAL, 10, b"\x0c"), (LOCAL, 8, b"\x0c")], "is compressed by method 12; valid: stored"),
        ([(CENTRAL, 46, b"n\xe4me"), (CENTRAL, 9, b"\x08")], "has an entry whose name is not UTF-8"),
        ([(CENTRAL, 46, b"n\x00me")], "has a name with characters that no file name may have"),
        ([(CENTRAL, 46, b"came")], "is damaged: File name in directory"),
        ([(CENTRAL, 16, b"\x00\x00")], "is damaged: Bad CRC-32"),
        ([(CENTRAL, 24, b"\x02\x00\x00\x00")], "is damaged: Bad CRC-32"),  # longer than it says
        ([(CENTRAL, 24, b"\xff\xff\xff\x7f")], "bytes unpacks to 2147483647 bytes; accepted: 200 times"),
        ([(CENTRAL, 24, b"\xff\xff\xff\xff")], "unpacks to 4294967295 bytes"),  # zip64 without sizes
        ([(CENTRAL, 42, b"\xf0\xff\xff\x7f")], "is damaged"),
        ([(END, 12, b"\xff\xff\xff\x7f")], "is truncated or not a zip archive"),
        ([(END, 16, b"\xff\xff\xff\x7f")], "is damaged: entry 'name' begins before it"),
        ([(LOCAL, 30 + 4, b"\xff\xff")], "is damaged"),  # no deflate stream
    ],
)  # fmt: skip
def test_archives_that_lie(tmp_path: Path, changes: list[tuple[bytes, int, bytes]], words: str) -> None:
    path = patched(archived(tmp_path, ("name", b"content" * 5)), *changes)
    assert words in unpacking(path)


def test_entries_that_share_their_bytes(tmp_path: Path) -> None:
    path = archived(tmp_path, ("a", b"x" * 50), ("b", b"x" * 50))
    patched(path, (CENTRAL, 42, b"\x00\x00"))
    assert "entries 'a' and 'b' share their bytes" in unpacking(path)


def test_bombs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    many = archived(tmp_path, *((f"{i}", b"") for i in range(30)))
    monkeypatch.setattr(archive, "MAX_ENTRIES", 29)
    assert "has 30 entries of 0 bytes; accepted: 29 entries" in unpacking(many)
    monkeypatch.setattr(archive, "MAX_DIRECTORY", 100)
    assert "has a directory of" in unpacking(many)
    monkeypatch.undo()
    large = archived(tmp_path, ("zeros", bytes(2_000_000)))
    unpack(large, tmp_path / "fine", "archive x")
    monkeypatch.setattr(archive, "SMALL", 1_000_000)
    assert "unpacks to 2000000 bytes; accepted: 200 times as much" in unpacking(large)
    monkeypatch.setattr(archive, "MAX_BYTES", 3_000_000)
    monkeypatch.setattr(archive, "SMALL", 2_000_000)
    first = Scratch()
    unpack(large, first.path / "a", "archive x")
    with pytest.raises(InputError, match="2000000 bytes beside 2000000 bytes of the same package; accepted"):
        unpack(large, first.path / "b", "archive x")  # packages in a package share the limit
    unpack(large, Scratch().path / "b", "archive x")
    monkeypatch.setattr(archive, "MAX_BYTES", 1_999_999)
    assert "accepted: 20000 entries, 1999999 bytes" in unpacking(large)


def test_entities_in_xml(tmp_path: Path) -> None:
    lol = "".join(f'<!ENTITY l{i + 1} "{f"&l{i};" * 10}">' for i in range(9))
    head = f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY l0 "ha">{lol}]>'
    outside = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY l9 SYSTEM "file:///etc/passwd">]>'
    for text in (head, outside, '<!DOCTYPE x SYSTEM "http://localhost/x.dtd">'):
        xml = text + '<fmiModelDescription fmiVersion="2.0" modelName="&l9;"/>'
        broken = repacked(tmp_path, fmu("speed"), {"modelDescription.xml": xml.encode()})
        message = refused(tmp_path, OSCILLATOR, {"position": fmu("position"), "speed": broken})
        assert "component speed" in message
        assert "document type" in message or "is not valid XML" in message


def test_names_that_no_file_can_have(tmp_path: Path) -> None:
    text = OSCILLATOR.replace("resources/speed.fmu", f"resources/{LONG}.fmu")
    assert re.search(
        r"line 10: source 'resources/n+…' of component 'speed' has too long a name", refused(tmp_path, text)
    )
    with pytest.raises(InputError, match="cannot be read: File name too long"):
        load_system(tmp_path / f"{LONG}.ssp")


# ---- through the command ----


def test_the_command_says_it_in_one_line_with_exit_code_2(tmp_path: Path, slewright_here: Command) -> None:
    path = write_ssp(tmp_path, OSCILLATOR.replace('startElement="speed"', 'startElement="sped"', 1), NAMES)
    out = tmp_path / "r.parquet"
    done = slewright_here("simulate", path, "--out", out, "--stop", "1")
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

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(shutil, "copyfileobj", full)
    with pytest.raises(RunError, match=r"cannot be unpacked into .*: No space left on device"):
        load(tmp_path, OSCILLATOR, NAMES)
    monkeypatch.undo()
    path = write_ssp(tmp_path, OSCILLATOR, NAMES)
    monkeypatch.setattr(tempfile, "mkdtemp", full)
    with pytest.raises(RunError, match=r"no temporary folder can be made: No space left on device"):
        load_system(path)


def test_results_do_not_replace_what_is_read_nor_devices(tmp_path: Path, slewright_here: Command) -> None:
    path, out = write_ssp(tmp_path, OSCILLATOR, NAMES), tmp_path / "r.parquet"
    before = path.read_bytes()
    for options in (("--out", path), ("--out", out, "--json", path)):
        done = slewright_here("simulate", path, *options, "--stop", "0.1")
        assert (done.returncode, path.read_bytes()) == (2, before)
        assert "is to be read" in done.stderr
    os.mkfifo(tmp_path / "pipe")
    done = slewright_here("simulate", path, "--out", tmp_path / "pipe", "--stop", "0.1")
    assert done.returncode == 2
    assert "device or pipe" in done.stderr
    done = slewright_here("simulate", path, "--out", out)
    assert done.returncode == 2
    assert "states no stop time; give one with --stop" in done.stderr


@pytest.mark.long
def test_ctrl_c_is_heard_in_a_slow_paced_run(tmp_path: Path) -> None:
    path, out = write_ssp(tmp_path, OSCILLATOR, NAMES), tmp_path / "r.parquet"
    command = [sys.executable, "-m", "slewright", "simulate", str(path), "--out", str(out)]
    command += ["--stop", "1", "--realtime", "0.01"]  # a tick takes a second
    running = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60.0
    while not recording_path(out).exists():
        assert running.poll() is None, "it ended by itself"
        assert time.monotonic() < deadline, "nothing was recorded"
        time.sleep(0.05)
    time.sleep(0.5)
    running.send_signal(signal.SIGINT)
    try:
        assert running.wait(timeout=15) == 130
    finally:
        running.kill()
    assert read(out).reason == "interrupted"
