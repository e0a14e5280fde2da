"""CAN logs as other tools write them: codes, states, large numbers, short frames and other lines."""

import random
import struct
from datetime import datetime, timedelta
from pathlib import Path

from tests.records.variants_written import Written, first_of

DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 257 Wide: 8 A
 SG_ w : 0|64@1- (3,-5) [0|0] "" A
BO_ 256 Press: 8 A
 SG_ p : 0|16@1+ (0.1,0) [0|6553.5] "bar" A
 SG_ s : 16|16@1- (0.01,0) [-327|327] "deg" A
 SG_ n : 32|32@1+ (1,0) [0|0] "" A
VAL_ 256 p 65535 "SNA" 65534 "Error" ;
BO_ 258 State: 1 A
 SG_ ok : 0|1@1+ (1,0) [0|1] "" A
 SG_ st : 1|3@1+ (1,0) [0|7] "" A
VAL_ 258 ok 0 "invalid" 1 "valid" ;
VAL_ 258 st 0 "not available" 1 "available" 6 "No error" 7 "SNA" ;
"""
Rows = list[tuple[float, int, bytes]]


def press(r: random.Random, folder: Path) -> tuple[Rows, dict[str, tuple[list[float], list[float]]], Path]:
    """Frames of three messages, some short, some with codes, states or large numbers, and what they mean."""
    dbc = folder / "v.dbc"
    dbc.write_text(DBC)
    rows: Rows = []
    channels: dict[str, tuple[list[float], list[float]]] = {
        n: ([], []) for n in ("p", "s", "n", "w", "ok", "st")
    }
    for k in range(r.randint(2, 30)):
        time, length = round(0.02 * k, 6), r.choice([8, 8, 8, 8, 4, 2, 3])
        p = r.choice([r.randint(0, 65000), r.randint(0, 65000), 65535, 65534])
        s, n = r.randint(-32000, 32000), r.randint(0, 2**32 - 1)
        w, ok, st = r.randint(-(2**61), 2**61), r.randint(0, 1), r.choice([0, 1, 6, 7])
        rows.append((time, 256, struct.pack("<HhI", p, s, n)[:length]))
        if r.random() < 0.5:
            rows += [(time, 257, struct.pack("<q", w)), (time, 258, bytes([ok + 2 * st]))]
            for name, value in (("w", 3 * w - 5), ("ok", ok), ("st", st)):
                if (name, value) != ("st", 7):
                    channels[name][0].append(time)
                    channels[name][1].append(value)
        for name, value, needs, good in (
            ("p", p * 0.1, 2, p < 65534),
            ("s", s * 0.01, 4, True),
            ("n", n, 8, True),
        ):
            if length >= needs and good:
                channels[name][0].append(time)
                channels[name][1].append(value)
    return rows, channels, dbc


def asc(r: random.Random, folder: Path) -> Written:
    """An ASC log with other lines among its frames."""
    rows, channels, dbc = press(r, folder)
    base = r.choice(["hex", "dec"])
    lines = [
        r.choice(["date Thu Mar 26 10:00:00.000 am 2026", "date Do M\u00e4r 26 10:00:00.000 2026"]),
        f"base {base}  timestamps absolute",
    ]
    lines += r.choice([[], ["internal events logged"], ["no internal events logged"], ["// version 8.2.0"]])
    block = r.random() < 0.5
    lines += ["Begin Triggerblock Thu Mar 26 10:00:00.000 am 2026"] if block else []
    mark = r.choice("...,")
    for time, identifier, data in rows:
        shown = f"{time:11.6f}".replace(".", mark)
        number = f"{identifier:X}" if base == "hex" else str(identifier)
        name = r.choice([number, {256: "Press", 257: "Wide", 258: "State"}[identifier]])
        parts = " ".join(f"{b:02X}" if base == "hex" else str(b) for b in data)
        code = r.choice(["8", "8", "F"]) if len(data) == 8 else str(len(data))
        lines.append(f"{shown} 1  {name:<15} {r.choice(['Rx', 'Tx'])}   d {code} {parts}")
        if r.random() < 0.2:
            name = r.choice(["", "Name "])
            lines[-1] = f"{shown} CANFD   1 Rx {number} {name}1 0 {code} {len(data)} {parts} 102 130"
        if r.random() < 0.1:
            lines.append(
                f"{shown} "
                + r.choice(
                    [
                        "1  ErrorFrame",
                        "1  Statistic: D 3 R 0",
                        "1  100  Rx   r 8",
                        "CAN 1 Status:chip",
                        "junk",
                    ]
                )
            )
    lines += ["End TriggerBlock"] if block else []
    path = folder / "v.asc"
    path.write_bytes(
        r.choice(["\n", "\r\n"]).join([*lines, ""]).encode(r.choice(["utf-8", "cp1252", "utf-16"]))
    )
    return Written(path, channels, {"dbc": dbc}, (), first_of(channels), 1e-9, "\n".join(lines)[:600])


def candump(r: random.Random, folder: Path) -> Written:
    """A log of candump in its forms."""
    rows, channels, dbc = press(r, folder)
    form, zero = r.choice("labA"), r.choice([0, 1_774_000_000])
    lines = []
    for time, identifier, data in rows:
        stamp = f"({zero + int(time)}.{round(time % 1 * 1e6):06d})"
        now = datetime(2026, 3, 29, 23, 59, 59, 900_000) + timedelta(microseconds=round(time * 1e6))
        day = f"({now:%Y-%m-%d %H:%M:%S.%f})"
        stored = f"{stamp} can0 {identifier:03X}#{data.hex().upper()}"
        long = f"can0  {identifier:03X}   [{len(data)}]  {data.hex(' ').upper()}"
        shown = {"l": stored, "b": f"{stored} R", "a": f" {stamp}  {long}", "A": f" {day}  {long}"}[form]
        lines.append(shown)
        if r.random() < 0.05:
            lines.append(f"{stamp} can0 300#00")
    path = folder / r.choice(["v.log", "v.candump"])
    path.write_text("\n".join([*lines, ""]))
    return Written(path, channels, {"dbc": dbc}, (), first_of(channels), 1e-9, "\n".join(lines)[:600])


def blf(r: random.Random, folder: Path) -> Written:
    """A BLF log."""
    import can

    rows, channels, dbc = press(r, folder)
    path = folder / "v.blf"
    with can.BLFWriter(path, channel=1) as writer:
        writer.start_timestamp = 0.0
        for time, identifier, data in rows:
            writer.on_message_received(
                can.Message(timestamp=time, arbitration_id=identifier, is_extended_id=False, data=data)
            )
            if r.random() < 0.05:
                remote = can.Message(
                    timestamp=time, arbitration_id=256, is_extended_id=False, is_remote_frame=True, dlc=8
                )
                writer.on_message_received(remote)
    return Written(path, channels, {"dbc": dbc}, (), first_of(channels), 2e-8)
