"""Vector's ASC logs, line by line: each line is a frame that is read, an event that holds none,
or counted as not read.
"""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from can import Message

from records.formats.can_frames import FrameLog
from records.formats.log_lines import LeftOut, LogLines
from records.formats.text.words import MONTHS
from specs.errors import InputError

NEAR = 60.0  # s between a log's start and its first frame
DATE = re.compile(
    r"^(?:date|begin\s+triggerblock)\s+\S+\s+(?P<month>[^\W\d]+)\.?\s+(?P<day>\d+)\s+(?P<h>\d+):(?P<m>\d+):(?P<s>\d+)"
    r"(?:[.,](?P<f>\d+))?\s*(?P<half>[ap]m)?\s+(?P<year>\d{4})\s*$",
    re.IGNORECASE,
)
TIMED = re.compile(r"^\s*(?P<time>\d+[.,]\d+)\s+(?P<rest>\S.*)$")
CLASSIC = re.compile(
    r"^(?P<bus>\d+)\s+(?P<id>\S+)\s+(?P<dir>Rx|Tx|TxRq)\s+d\s+(?P<length>[0-9a-fA-F]+)(?P<data>(?:\s+[0-9a-fA-F]{1,3})*)(?P<more>\s+.*)?$"
)
REMOTE = re.compile(r"^\d+\s+\S+\s+(Rx|Tx|TxRq)\s+r\b")
ERROR = re.compile(r"^(CANFD\s+)?\d+\s+(Rx\s+|Tx\s+)?ErrorFrame", re.IGNORECASE)
FD = re.compile(
    r"^CANFD\s+(?P<bus>\d+)\s+(?P<dir>Rx|Tx|TxRq)\s+(?P<id>[0-9a-fA-F]+x?)\s+(?:(?P<name>[A-Za-z_]\S*)\s+)?(?P<brs>[01])\s+(?P<esi>[01])\s+"
    r"(?P<dlc>[0-9a-fA-F])\s+(?P<length>\d+)(?P<data>(?:\s+[0-9a-fA-F]{1,3}(?!\S))*)"
)
EVENT = re.compile(
    r"^(Start of measurement|\d+\s+Statistic:|CAN\s+\d+\s+Status:|log trigger|SV:|J1939TP"
    r"|\d+\s+Statistic\b|TriggerEvent|Log\b|GPS|TFS:|//)",
    re.IGNORECASE,
)


@dataclass
class AscLog(FrameLog):
    """What a log's lines say besides its frames."""

    skipped: Counter[str] = field(default_factory=Counter)
    unread: LeftOut = field(default_factory=LeftOut)
    base: int = 16  # of the numbers of frames
    dated: bool = False  # a line of the head came
    open_block: bool = False  # a trigger block began and did not end


def read_asc(path: Path, named: dict[str, tuple[int, bool]], log: AscLog) -> Iterator[Message]:
    """The data frames; `named` gives identifiers of messages by name, for logs with names for numbers."""
    lines, first = LogLines(path), None
    for number, line in enumerate(lines, 1):
        match = TIMED.match(line.rstrip())
        if match is None:
            _head_line(path, number, line.strip(), log, first is not None)
            continue
        if not log.dated:
            raise InputError(f"{path} is not ASC: no line with its date or base before line {number}")
        message = _frame(match, log.base, named, log, number)
        if message is not None:
            first = message.timestamp if first is None else first
            yield message
    if not log.dated:
        raise InputError(f"{path} is not ASC: no line with its date")
    if lines.cut.strip():
        log.notes.append(
            "the log was not closed: read as far as it was written, but for its last line, which is cut"
        )
    _time_of_day(log, first)
    _conclude(log)


def _head_line(path: Path, number: int, bare: str, log: AscLog, begun: bool) -> None:
    """A line without a time: what it says of the log."""
    low = bare.lower()
    if low.startswith(("date ", "begin triggerblock")):
        _dated(path, number, bare, log, begun)
    elif low.startswith("end triggerblock"):
        log.open_block = False
    elif low.startswith("base "):
        log.dated, log.base = True, 10 if low.split()[1] == "dec" else 16
        if "relative" in low:
            raise InputError(f"{path}: times since the event before are not read; export with absolute ones")
    elif bare and not low.startswith(("//", "internal events", "no internal events")):
        log.unread.add(number, bare)


def _dated(path: Path, number: int, bare: str, log: AscLog, begun: bool) -> None:
    start = _date(bare)
    log.dated, log.start = True, start or log.start
    if bare.lower().startswith("begin"):
        log.open_block = True
        if begun:
            raise InputError(
                f"{path}: line {number}: another trigger block begins, with its own times; cut the log there"
            )
    elif start is None:
        log.notes.append(
            f"the date in line {number} is not understood ('{bare[5:45]}'): the start is not known"
        )


def _conclude(log: AscLog) -> None:
    """Say what was not read."""
    if log.open_block and not any("not closed" in n for n in log.notes):
        log.notes.append("the log was not closed: read as far as it was written")
    if log.skipped:
        shown = ", ".join(f"{n} {what}" for what, n in sorted(log.skipped.items()))
        log.notes.append(f"lines that are no data frames: {shown}")
    log.notes += log.unread.said("lines that are not understood")


def _time_of_day(log: AscLog, first: float | None) -> None:
    """Times that are the time of day at the start count from midnight."""
    if log.start is None or first is None:
        return
    midnight = log.start.replace(hour=0, minute=0, second=0, microsecond=0)
    if first > NEAR and abs((log.start - midnight).total_seconds() - first) < NEAR:
        log.start = midnight
        log.notes.append("times are times of day: they count from midnight")


def _frame(
    match: re.Match[str], base: int, named: dict[str, tuple[int, bool]], log: AscLog, number: int
) -> Message | None:
    """The data frame of a line; None for what holds none, which is counted."""
    rest = match["rest"]
    if ERROR.match(rest):
        log.skipped["error frames"] += 1
    elif REMOTE.match(rest):
        log.skipped["remote frames"] += 1
    elif EVENT.match(rest):
        if not rest.lower().startswith("start of"):
            log.skipped["events"] += 1
    else:
        frame = FD.match(rest) or CLASSIC.match(rest)
        made = _message(match, frame, base, named) if frame else None
        if made is not None:
            return made
        log.unread.add(number, match.string)
    return None


def _message(
    line: re.Match[str], frame: re.Match[str], base: int, named: dict[str, tuple[int, bool]]
) -> Message | None:
    fd = frame.re is FD
    try:
        length = int(frame["length"]) if fd else min(int(frame["length"], 16), 8)  # 9 to 15 are 8 bytes, too
        data = bytes(int(b, base) for b in frame["data"].split()[:length])
        identifier, extended = named[frame["id"]] if frame["id"] in named else _identifier(frame["id"], base)
    except ValueError:
        return None
    if len(data) != length or length > 64:
        return None
    return Message(
        timestamp=float(line["time"].replace(",", ".")), arbitration_id=identifier, is_extended_id=extended,
        data=data, channel=int(frame["bus"]) - 1, is_fd=fd, is_rx=frame["dir"] == "Rx",
    )  # fmt: skip


def _identifier(text: str, base: int) -> tuple[int, bool]:
    extended = text[-1:] in "xX"
    number = int(text.rstrip("xX"), base)
    if number >= (1 << 29 if extended else 1 << 11):
        raise ValueError(text)
    return number, extended


def _date(line: str) -> datetime | None:
    """The date of a line, in UTC; None where it cannot be read."""
    match = DATE.match(line)
    month = match and MONTHS.get(match["month"].lower())
    if not match or not month:
        return None
    hour = int(match["h"])
    if match["half"] and hour <= 12:
        hour = hour % 12 + (12 if match["half"].lower() == "pm" else 0)
    micro = int((match["f"] or "0").ljust(6, "0")[:6])
    try:
        return datetime(
            int(match["year"]), month, int(match["day"]), hour, int(match["m"]), int(match["s"]), micro, UTC
        )
    except ValueError:
        return None
