"""Logs of candump and traces of PEAK's PCAN-View, line by line."""

import re
from collections.abc import Iterator
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any

import can

from records.formats.can_frames import NO_ZONE, FrameLog
from records.formats.log_lines import LeftOut, LogLines
from records.formats.metadata import at_ns
from records.recording import first_line
from specs.errors import InputError

TIME = r"\((?P<time>\d+\.\d+|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d+)\)"
STORED = re.compile(
    rf"^\s*{TIME}"
    r"\s+(?P<bus>\S+)\s+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#[0-9A-Fa-f])?(?P<remote>R\d?)?"
    r"(?P<data>(?:[0-9A-Fa-f]{2}\.?)*)(?P<length>)(?:\s+[RT])?\s*$"
)
SHOWN = re.compile(
    rf"^\s*{TIME}"
    r"\s+(?P<bus>\S+)\s+(?:[RT]X\s+\S+\s+\S+\s+)?(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<length>\d+)\]"
    r"\s*(?P<remote>remote request)?(?P<data>(?:\s*[0-9A-Fa-f]{2})*)\s*(?:'.*)?$"
)
ERROR_FLAG = 0x2000_0000
VERSION, VERSIONS = ";$FILEVERSION", ("1.0", "1.1", "1.3", "2.0", "2.1")  # that python-can reads
SINCE_1970 = 10**8  # s: times from here on count from 1970


def read_candump(path: Path, log: FrameLog) -> Iterator[Any]:
    """Frames of `-l` (`(time) can0 100#0011`), `-t a` and `-t A` (`(time) can0 100 [2] 00 11`), from the
    first one's time.
    """
    lines, buses, frames = LogLines(path), dict[str, int](), 0
    unread, others, first_text, of_day = LeftOut(), LeftOut(), "", False
    first: Decimal | None = None
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        first_text = first_text or line
        match = STORED.match(line) or SHOWN.match(line)
        data = _data(match) if match else None
        if match is None or data is None:
            unread.add(number, line)
        elif match["remote"] or (len(match["id"]) == 8 and int(match["id"], 16) & ERROR_FLAG):
            others.add(number, line)
        else:
            time = _time(match["time"])
            first = time if first is None else first
            frames += 1
            of_day = of_day or "-" in match["time"]
            yield can.Message(
                timestamp=float(time - first),
                arbitration_id=int(match["id"], 16) & 0x1FFF_FFFF, is_extended_id=len(match["id"]) > 3,
                data=data, channel=buses.setdefault(match["bus"], len(buses)), is_fd=len(data) > 8,
            )  # fmt: skip
    if not frames:
        raise InputError(
            f"{path} is no log of candump: none of its lines is a frame; the first: {first_text[:50]!r}"
        )
    log.start = _start(first)
    if of_day:
        log.notes.append("the times state no time zone: taken as UTC")
    if lines.cut.strip():
        log.notes.append("the log was not closed: its last line is left out")
    log.notes += others.said("remote and error frames") + unread.said("lines that are not understood")


def _time(text: str) -> Decimal:
    """s since 1970, or whatever the log counts from."""
    if "-" not in text:
        return Decimal(text)
    day, _, rest = text.partition(".")
    return Decimal(int(datetime.fromisoformat(f"{day}+00:00").timestamp())) + Decimal(f"0.{rest}")


def _data(match: re.Match[str]) -> bytes | None:
    """The bytes of a frame; None where they are not as many as the line says."""
    data = bytes.fromhex(match["data"].replace(" ", "").replace("\t", "").replace(".", ""))
    wrong = match["length"] and not match["remote"] and int(match["length"]) != len(data)
    return None if wrong or len(data) > 64 else data


class _Counted:
    """Lines as a file gives them, those with frames counted."""

    def __init__(self, lines: LogLines) -> None:
        self.lines, self.rows = iter(lines), 0

    def __iter__(self) -> "_Counted":
        return self

    def __next__(self) -> str:
        line = next(self.lines)
        if line.startswith(VERSION) and (version := line.partition("=")[2].strip()) not in VERSIONS:
            raise InputError(f"a PCAN trace of version {version}; valid: {', '.join(VERSIONS)}")
        self.rows += bool(line.strip()) and not line.startswith(";")
        return line + "\n"

    read = close = lambda self, *_: None  # python-can takes what has both for a file


def read_trc(path: Path, log: FrameLog) -> Iterator[Any]:
    """Frames of a PCAN trace from the first one's time; its lines are counted beside its frames."""
    lines = LogLines(path)
    counted, frames, remote = _Counted(lines), 0, 0
    first: Decimal | None = None
    reader = can.TRCReader(counted)  # type: ignore[arg-type]
    messages = iter(reader)
    while True:
        try:
            message = next(messages)
        except StopIteration:
            break
        except InputError as error:
            raise InputError(f"{path} is {error}") from None
        except Exception as error:  # noqa: BLE001 - a damaged log makes python-can raise anything
            raise InputError(f"{path} is damaged or no PCAN trace: {first_line(error)}") from None
        time = round(Decimal(message.timestamp), 6)  # its resolution
        first = time if first is None else first
        frames += 1
        remote += message.is_remote_frame
        message.timestamp = float(time - first)
        yield message
    log.start = _start(first)
    if log.start:
        log.notes.append(NO_ZONE)
    if lines.cut.strip():
        log.notes.append("the log was not closed: its last line is left out")
    if remote:
        log.notes.append(f"frames without data: left out {remote} remote frames")
    if counted.rows != frames:
        log.notes.append(f"the trace has {counted.rows} lines, of which {frames} were read as frames")


def _start(first: Decimal | None) -> Any:
    return at_ns(int(first * 10**9)) if first is not None and first > SINCE_1970 else None
