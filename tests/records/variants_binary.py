"""MCAP, bags of ROS 2, Parquet and MDF4 as other tools write them."""

import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tests.records.variants_written import Written, first_of


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


def ros2(r: random.Random, folder: Path) -> Written:
    """Joint states of publishers that name their joints in any order."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, kind, places = get_typestore(Stores.ROS2_HUMBLE), "sensor_msgs/msg/JointState", dict[str, int]()
    path, channels = folder / f"b{r.getrandbits(40)}", dict[str, tuple[list[float], list[float]]]()
    header = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), "base")
    with Writer(path, version=9, storage_plugin=r.choice(list(StoragePlugin))) as bag:
        topic = bag.add_connection("/j", kind, typestore=store)
        for k in range(r.randint(2, 12)):
            names = r.sample("abc", r.randint(1, 3))
            held = [r.uniform(-1, 1) for _ in names]
            one = store.types[kind](header, names, np.array(held), np.zeros(0), np.zeros(0))
            bag.write(topic, 10**18 + 20_000_000 * k, store.serialize_cdr(one, kind))
            for name, value in zip(names, held, strict=True):
                times, values = channels.setdefault(
                    f"j.position[{places.setdefault(name, len(places))}]", ([], [])
                )
                times.append(0.02 * k)
                values.append(value)
    return Written(path, channels if len(channels) > 1 else {}, {}, ("j",), 0.0, 1e-9, start=1e9)


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
        top = r.choice([200, 200, {pa.int64(): 2**63 - 1, pa.uint64(): 2**64 - 1}.get(kind, 200)])
        whole = [r.randint(0, 1) if kind == pa.bool_() else r.randint(0, top) for _ in range(rows)]
        held = [None if r.random() < 0.1 else bool(v) if kind == pa.bool_() else v for v in whole]
        label = r.choice(["p", "x(t)", "arr[1]", "q (L)"]) + str(k)
        table[label] = pa.array(held, kind)
        there = [i for i in keep if held[i] is not None]
        channels[label] = (
            [float(ms[i] - ms[keep[0]]) / 1000 for i in there],
            [int(held[i] or 0) if top > 200 else float(held[i] or 0) for i in there],
        )
    path = folder / "v.parquet"
    pq.write_table(pa.table(table), path)
    return Written(
        path, channels, {}, (), first_of(channels), 1e-9, str({k: str(v.type) for k, v in table.items()})
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
        wide = r.choice([False, False, True])
        if wide:
            raw, a, b = (
                raw.astype(np.uint64) * np.uint64(2**52 + 1),
                r.choice([1.0, 3.0]),
                r.choice([0.0, 10.0]),
            )
        rule: Any = (
            r.choice([None, {"a": a, "b": b}])
            if wide
            else r.choice(
                [None, {"a": a, "b": b}, {"val_0": 255, "text_0": "SNA", "default_addr": {"a": a, "b": b}}]
            )
        )
        good = raw < 255 if rule and "val_0" in rule else np.ones(rows, dtype=bool)
        scaled = raw * a + b if rule else raw.astype(float)
        signals.append(Signal(raw, time * (1000 if unit == "ms" else 1), name=f"p{k}", conversion=rule))
        channels[f"p{k}"] = (time[good].tolist(), scaled[good].tolist())
        if wide:
            exact = [int(v) * int(a if rule else 1) + int(b if rule else 0) for v in raw]
            channels[f"p{k}"] = (time.tolist(), exact)
    path = folder / "v.mf4"
    with MDF(version="4.10") as file:
        file.append(signals, common_timebase=True)
        file.groups[0].channels[0].unit = unit
        file.save(path, overwrite=True)
    return Written(
        path, channels, {}, (), first_of(channels), 1e-9, f"{unit} {[s.conversion for s in signals]}"
    )
