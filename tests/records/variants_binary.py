"""CAN logs, MCAP, Parquet and MDF4 as other tools write them."""

import json
import random
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tests.records.variants_written import Written

DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 256 Press: 8 A
 SG_ p : 0|16@1+ (0.1,0) [0|6553.5] "bar" A
 SG_ s : 16|16@1- (0.01,0) [-327|327] "deg" A
 SG_ n : 32|32@1+ (1,0) [0|0] "" A
VAL_ 256 p 65535 "SNA" 65534 "Error" ;
"""
Rows = list[tuple[float, bytes]]


def press(r: random.Random, folder: Path) -> tuple[Rows, dict[str, tuple[list[float], list[float]]], Path]:
    """Frames of a message, some short, some with codes, and what they mean."""
    dbc = folder / "v.dbc"
    dbc.write_text(DBC)
    rows: Rows = []
    channels: dict[str, tuple[list[float], list[float]]] = {"p": ([], []), "s": ([], []), "n": ([], [])}
    for k in range(r.randint(2, 30)):
        time, length = round(0.02 * k, 6), r.choice([8, 8, 8, 8, 4, 2, 3])
        p = r.choice([r.randint(0, 65000), r.randint(0, 65000), 65535, 65534])
        s, n = r.randint(-32000, 32000), r.randint(0, 2**32 - 1)
        rows.append((time, struct.pack("<HhI", p, s, n)[:length]))
        for name, value, needs, good in (
            ("p", p * 0.1, 2, p < 65534),
            ("s", s * 0.01, 4, True),
            ("n", n, 8, True),
        ):
            if length >= needs and good:
                channels[name][0].append(time)
                channels[name][1].append(value)
    return rows, channels, dbc


def _first(channels: dict[str, tuple[list[float], list[float]]]) -> float:
    return min((t[0] for t, _ in channels.values() if t), default=0.0)


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
    for time, data in rows:
        shown = f"{time:11.6f}".replace(".", mark)
        name = r.choice(["100" if base == "hex" else "256", "Press"])
        parts = " ".join(f"{b:02X}" if base == "hex" else str(b) for b in data)
        lines.append(f"{shown} 1  {name:<15} {r.choice(['Rx', 'Tx'])}   d {len(data)} {parts}")
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
    return Written(path, channels, {"dbc": dbc}, (), _first(channels), 1e-9, "\n".join(lines)[:600])


def candump(r: random.Random, folder: Path) -> Written:
    """A log of candump in its forms."""
    rows, channels, dbc = press(r, folder)
    form, zero = r.choice(["l", "a", "b"]), r.choice([0, 1_774_000_000])
    lines = []
    for time, data in rows:
        stamp = f"({zero + int(time)}.{round(time % 1 * 1e6):06d})"
        shown = {"l": f"{stamp} can0 100#{data.hex().upper()}", "a": f" {stamp}  can0  100   "
            f"[{len(data)}]  {data.hex(' ').upper()}",
                 "b": f"{stamp} can0 100#{data.hex().upper()} R"}[form]  # fmt: skip
        lines.append(shown)
        if r.random() < 0.05:
            lines.append(f"{stamp} can0 300#00")
    path = folder / r.choice(["v.log", "v.candump"])
    path.write_text("\n".join([*lines, ""]))
    return Written(path, channels, {"dbc": dbc}, (), _first(channels), 1e-9, "\n".join(lines)[:600])


def blf(r: random.Random, folder: Path) -> Written:
    """A BLF log."""
    import can

    rows, channels, dbc = press(r, folder)
    path = folder / "v.blf"
    with can.BLFWriter(path, channel=1) as writer:
        writer.start_timestamp = 0.0
        for time, data in rows:
            writer.on_message_received(
                can.Message(timestamp=time, arbitration_id=256, is_extended_id=False, data=data)
            )
            if r.random() < 0.05:
                remote = can.Message(
                    timestamp=time, arbitration_id=256, is_extended_id=False, is_remote_frame=True, dlc=8
                )
                writer.on_message_received(remote)
    return Written(path, channels, {"dbc": dbc}, (), _first(channels), 2e-8)


def mcap(r: random.Random, folder: Path) -> Written:
    """JSON messages with absent fields, large whole numbers and one or two publishers of a topic."""
    from mcap.writer import Writer

    path, zero = folder / "v.mcap", r.choice([0, 1_774_000_000_000_000_000])
    publishers = r.choice([1, 1, 2])
    written: dict[str, tuple[list[float], list[float]]] = {}
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=r.choice([100, 1 << 20]))
        writer.start(profile="", library="other")
        schema = writer.register_schema(name="s", encoding="jsonschema", data=b'{"type":"object"}')
        for k in range(publishers):
            topic = writer.register_channel(topic="/a", message_encoding="json", schema_id=schema)
            for i in range(r.randint(1, 20)):
                stamp = i * 20_000_000
                message: dict[str, Any] = {"x": i + 100 * k}
                if r.random() < 0.8:
                    message["y"] = r.choice([r.randint(-(2**53), 2**53), 1.5 * i])
                if r.random() < 0.2:
                    message["t"] = r.choice(["text", None, [1, 2]])
                writer.add_message(topic, zero + stamp, json.dumps(message).encode(), zero + stamp)
                for key in ("x", "y"):
                    if key in message:
                        name = f"a.{k + 1}.a.{key}" if publishers > 1 else f"a.{key}"
                        times, values = written.setdefault(name, ([], []))
                        times.append(stamp / 1e9)
                        values.append(message[key])
        writer.finish()
    if not any(n.endswith(".y") for n in written) and publishers == 1:
        written = {"a": written["a.x"]}
    may = ("a.x", "a.y", "a.1.a.x", "a", "a.1.a.y", "a.2.a.y", "a.1", "a.2")
    return Written(
        path, written if publishers == 1 else _same(written), {}, may, 0.0, 1e-9, str(written)[:400]
    )


def _same(written: dict[str, tuple[list[float], list[float]]]) -> dict[str, tuple[list[float], list[float]]]:
    """Names that two publishers get: with their number where both have the field, and it is not
    a name alone.
    """
    fields = [{n.split(".")[-1] for n in written if n.startswith(f"a.{k}.")} for k in (1, 2)]
    if fields[0] == fields[1] and len(fields[0]) == 2:
        return written
    return {}


def parquet(r: random.Random, folder: Path) -> Written:
    """A table of another tool."""
    rows, step = r.randint(2, 40), r.choice([20, 100, 1000])
    ms = np.arange(rows, dtype=np.int64) * step + r.choice([0, 500])
    stamp = ms + 1_774_000_000_000
    iso = [f"2026-03-29T00:00:{m // 1000:02d}.{m % 1000:03d}Z" if m < 60_000 else None for m in ms.tolist()]
    clocks = {
        "s": ("time", pa.array(ms / 1000)), "ms": ("time [ms]", pa.array(ms)),
        "name": ("time_ms", pa.array(ms)),
        "epoch": ("timestamp", pa.array(stamp)), "ns": ("timestamp", pa.array(stamp * 1_000_000)),
        "stamp": ("t", pa.array(stamp, pa.timestamp("ms"))),
        "zone": ("time", pa.array(stamp, pa.timestamp("ms", "UTC"))),
        "duration": ("time", pa.array(ms, pa.duration("ms"))), "text": ("time", pa.array(iso)),
    }  # fmt: skip
    name, clock = clocks[r.choice(list(clocks))]
    keep = [i for i, c in enumerate(clock.to_pylist()) if c is not None]
    table, channels = {name: clock}, {}
    for k in range(r.randint(1, 3)):
        kind = r.choice(
            [pa.float64(), pa.float32(), pa.int32(), pa.int64(), pa.uint64(), pa.uint8(), pa.bool_()]
        )
        whole = [r.randint(0, 1) if kind == pa.bool_() else r.randint(0, 200) for _ in range(rows)]
        held = [None if r.random() < 0.1 else bool(v) if kind == pa.bool_() else v for v in whole]
        label = r.choice(["p", "x(t)", "arr[1]", "q (L)"]) + str(k)
        table[label] = pa.array(held, kind)
        there = [i for i in keep if held[i] is not None]
        channels[label] = (
            [float(ms[i] - ms[keep[0]]) / 1000 for i in there],
            [float(held[i] or 0) for i in there],
        )
    path = folder / "v.parquet"
    pq.write_table(pa.table(table), path)
    return Written(
        path, channels, {}, (), _first(channels), 1e-9, str({k: str(v.type) for k, v in table.items()})
    )


def mf4(r: random.Random, folder: Path) -> Written:
    """Channels with linear rules and codes beside them, invalid samples and a clock in other units."""
    from asammdf import MDF, Signal

    rows, unit = r.randint(2, 30), r.choice(["s", "s", "ms"])
    time = np.arange(rows) * 0.02
    channels, signals = {}, []
    for k in range(r.randint(1, 3)):
        raw = np.array([r.choice([r.randint(0, 250), 255]) for _ in range(rows)], dtype=np.uint8)
        a, b = r.choice([0.1, 1.0, 2.5]), r.choice([0.0, 10.0])
        rule: Any = r.choice(
            [None, {"a": a, "b": b}, {"val_0": 255, "text_0": "SNA", "default_addr": {"a": a, "b": b}}]
        )
        good = raw < 255 if rule and "val_0" in rule else np.ones(rows, dtype=bool)
        scaled = raw * a + b if rule else raw.astype(float)
        signals.append(Signal(raw, time * (1000 if unit == "ms" else 1), name=f"p{k}", conversion=rule))
        channels[f"p{k}"] = (time[good].tolist(), scaled[good].tolist())
    path = folder / "v.mf4"
    with MDF(version="4.10") as file:
        file.append(signals, common_timebase=True)
        file.groups[0].channels[0].unit = unit
        file.save(path, overwrite=True)
    return Written(
        path, channels, {}, (), _first(channels), 1e-9, f"{unit} {[s.conversion for s in signals]}"
    )
