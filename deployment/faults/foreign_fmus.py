"""The faults of fmu_table.py: an FMU of this project, damaged at random, and the answer to it judged."""

import os
import signal
import struct
import tempfile
import threading
import time
import zipfile
import zlib
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np

from deployment.faults.fmu_table import LIMIT_S
from deployment.faults.table import Fault, Outcome
from fmus.toolchain.build import build_fmu
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.overview import figures
from records.record import read
from specs.errors import InputError, RunError
from specs.progress import Report

MODEL = "slew"
VERSIONS = (2, 3)
DESCRIPTION = "modelDescription.xml"
NEEDED = ("EnterInitializationMode", "ExitInitializationMode", "DoStep", "FreeInstance")
LIBRARIES = (".so", ".dylib", ".dll")
PROCESSOR = 18  # place in the header of an ELF file
LONG_TICKS = 100_000_000  # more than anybody waits for
MOMENTS_S = (0.02, 0.3)  # of a run, in which its FMU fails

Files = dict[str, bytes]
Damage = Callable[[Files, np.random.Generator], None]


def run_fmus(wanted: Sequence[Fault], count: int, seed: int, report: Report) -> list[Outcome]:
    """Inject each of the `wanted` faults `count` times."""
    outcomes = []
    for number, fault in enumerate(wanted):
        report(fault.name, number, len(wanted))
        random, outcome = np.random.default_rng([seed, zlib.crc32(fault.name.encode())]), Outcome(fault)
        for k in range(count):
            with tempfile.TemporaryDirectory() as folder:
                _inject(fault, Path(folder), random, outcome, k)
        outcomes.append(outcome)
    return outcomes


def _inject(fault: Fault, folder: Path, random: np.random.Generator, outcome: Outcome, number: int) -> None:
    version = int(random.choice(VERSIONS))
    content = build_fmu(MODEL, version).read_bytes()
    path = folder / f"{MODEL}.fmu"
    if fault.name in SIGNALS:
        path.write_bytes(_packed(_unpacked(content)))  # other bytes: it runs in a process of its own
        outcome.add(number, *_failing(path, SIGNALS[fault.name], random))
        return
    if fault.name == "fmu_archive_cut":
        path.write_bytes(content[: int(random.integers(len(content) - 1))])
    else:
        files = _unpacked(content)
        DAMAGES[fault.name](files, random)
        path.write_bytes(_packed(files))
    outcome.add(number, *_refused(path))


def _refused(path: Path) -> tuple[float | None, str]:
    """(ms until the answer, what is wrong with it)"""
    begin = time.monotonic()
    try:
        figures(load_system(path))
    except InputError as error:
        named = MODEL in str(error)
        return 1000.0 * (time.monotonic() - begin), "" if named else f"it is not named: {error}"
    return None, "it is accepted"


# ---- damages ----


def _library(files: Files) -> str:
    return next(name for name in files if name.startswith("binaries/") and name.endswith(LIBRARIES))


def _cut(content: bytes, random: np.random.Generator) -> bytes:
    return content[: int(random.integers(1, max(2, int(0.9 * len(content)))))]


def _description_cut(files: Files, random: np.random.Generator) -> None:
    files[DESCRIPTION] = _cut(files[DESCRIPTION], random)


def _description_missing(files: Files, random: np.random.Generator) -> None:
    del files[DESCRIPTION]


def _library_missing(files: Files, random: np.random.Generator) -> None:
    del files[_library(files)]


def _library_cut(files: Files, random: np.random.Generator) -> None:
    files[_library(files)] = _cut(files[_library(files)], random)


def _library_pointer(files: Files, random: np.random.Generator) -> None:
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"
    files[_library(files)] = (pointer, b"see the other folder\n")[int(random.integers(2))]


def _other_system(files: Files, random: np.random.Generator) -> None:
    name = _library(files)
    begin = (b"MZ\x90\x00", struct.pack("<I", 0xFEEDFACF), struct.pack(">I", 0xCAFEBABE))
    files[name] = begin[int(random.integers(len(begin)))] + files[name][4:]


def _other_processor(files: Files, random: np.random.Generator) -> None:
    name = _library(files)
    content = bytearray(files[name])
    own = struct.unpack_from("<H", content, PROCESSOR)[0]
    other = [p for p in (3, 21, 40, 62, 183, 243) if p != own]
    struct.pack_into("<H", content, PROCESSOR, int(random.choice(other)))
    files[name] = bytes(content)


def _function_missing(files: Files, random: np.random.Generator) -> None:
    name, function = _library(files), str(random.choice(NEEDED)).encode()
    for version in (b"2", b"3"):
        old = b"fmi" + version + function + b"\0"
        files[name] = files[name].replace(old, old.replace(b"fmi", b"fmX"))


def _other_version(files: Files, random: np.random.Generator) -> None:
    other = (b"1.0", b"4.0", b"x")[int(random.integers(3))]
    for version in (b"2.0", b"3.0"):
        old, new = (b'fmiVersion="' + text for text in (version, other))
        files[DESCRIPTION] = files[DESCRIPTION].replace(old, new)


DAMAGES: dict[str, Damage] = {
    "fmu_description_cut": _description_cut,
    "fmu_description_missing": _description_missing,
    "fmu_library_missing": _library_missing,
    "fmu_library_empty": lambda files, random: files.update({_library(files): b""}),
    "fmu_library_cut": _library_cut,
    "fmu_library_pointer": _library_pointer,
    "fmu_library_other_system": _other_system,
    "fmu_library_other_processor": _other_processor,
    "fmu_function_missing": _function_missing,
    "fmu_version_other": _other_version,
}


def _unpacked(content: bytes) -> Files:
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}


def _packed(files: Files) -> bytes:
    file = BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return file.getvalue()


# ---- FMUs that fail in a run ----

SIGNALS = {"fmu_killed": signal.SIGKILL, "fmu_silent": signal.SIGSTOP}


def _failing(path: Path, how: signal.Signals, random: np.random.Generator) -> tuple[float | None, str]:
    """A run whose FMU's process gets a signal at a random moment."""
    at: list[float] = []

    def fail() -> None:
        at.append(time.monotonic())
        for pid in _hosts():
            os.kill(pid, how)

    def begin(tick: int) -> None:
        if tick > 0 and not timer.is_alive() and not at:
            timer.start()

    record, said = path.with_suffix(".parquet"), ""
    timer = threading.Timer(float(random.uniform(*MOMENTS_S)), fail)
    try:
        simulate(
            load_system(path), LONG_TICKS, record_path=record, limit_s=LIMIT_S, realtime=1.0, progress=begin
        )
    except RunError as error:
        said = str(error)
    finally:
        timer.cancel()
    if not at or not said:
        return None, said or "the run did not end"
    ms = 1000.0 * (time.monotonic() - at[0])
    if f"component {MODEL}" not in said:
        return ms, f"it is not named: {said}"
    kept = read(record)
    return ms, "" if len(kept.time) and not kept.complete else "what was recorded is lost"


def _hosts() -> list[int]:
    """The processes of this one's FMUs."""
    found = []
    for task in Path("/proc/self/task").iterdir():
        for text in (task / "children").read_text().split():
            if b"slewright-fmu-host" in Path(f"/proc/{text}/cmdline").read_bytes():
                found.append(int(text))
    return found
