"""Recordings as other tools write them, made at random, read, and compared with what was written.

    python -m tests.records.variants --count 10000 --seed 1 [--json FILE] [--kind text]

Each variant is read right or refused; one that is read with other values, times, units or start, or without a
channel that no note mentions, is a silent error.  Exit 1 where there is one.
"""

import argparse
import collections
import json
import random
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from records.formats import read_measurement
from records.measurement import Measurement
from specs.errors import InputError
from tests.records import variants_binary, variants_can, variants_lvm, variants_text
from tests.records.variants_written import Written

KINDS: dict[str, tuple[int, Callable[[random.Random, Path], Written]]] = {
    "text": (12, variants_text.text),
    "asc": (2, variants_can.asc),
    "candump": (2, variants_can.candump),
    "blf": (1, variants_can.blf),
    "mcap": (2, variants_binary.mcap),
    "ros2": (1, variants_binary.ros2),
    "parquet": (2, variants_binary.parquet),
    "mf4": (1, variants_binary.mf4),
    "lvm": (1, variants_lvm.lvm),
}


START_S = 2e-3  # of a start: what the coarsest of the forms tells


def judged(written: Written) -> tuple[str, str]:
    """`right`, `refused` or `silent`, and why."""
    try:
        found = read_measurement(written.path, **written.options)
    except InputError as error:
        return "refused", str(error)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is no message
        return "silent", f"{type(error).__name__}: {error}"
    wrong = next((why for name in written.channels if (why := wrong_in(found, written, name))), "")
    begun = found.start and found.start.timestamp()
    if begun is not None and written.start is not None and abs(begun - written.start) > START_S:
        wrong = wrong or f"it starts at {found.start} instead of {written.start:.3f} s since 1970"
    extra = set(found.channels) - set(written.channels) - set(written.may)
    wrong = wrong or (f"{sorted(extra)} was not written" if extra else "")
    return ("silent", wrong) if wrong else ("right", "")


def wrong_in(found: Measurement, written: Written, name: str) -> str:
    """What is wrong in a channel; "" for nothing."""
    notes, (time, values) = " ".join(found.repairs), written.channels[name]
    if not len(values) or (name not in found.channels and name in notes and "left out" in notes):
        return ""
    if name not in found.channels:
        return f"{name} is not there: {sorted(found.channels)}"
    channel, zero = found[name], written.first
    if zero is None:
        zero = min(t[0] for t, v in written.channels.values() if len(v))
    if len(channel.values) != len(values):
        return f"{name}: {len(channel.values)} samples instead of {len(values)}"
    if not np.allclose(channel.time, np.asarray(time) - zero, rtol=1e-9, atol=written.resolution):
        return f"{name}: times {channel.time[:3]} instead of {np.asarray(time)[:3] - zero}"
    if channel.unit != written.units.get(name, channel.unit):
        return f"{name}: in '{channel.unit}' instead of '{written.units[name]}'"
    exact = all(isinstance(v, int) for v in values) and "rounded to floats" not in notes
    held = channel.values.tolist()
    same = (
        held == values if exact else np.allclose(channel.values.astype(float), values, rtol=1e-9, atol=1e-12)
    )
    return "" if same else f"{name}: {held[:4]} instead of {values[:4]}"


def run(count: int, seed: int, kind: str | None = None) -> dict[str, Any]:
    """Write and read so many variants; figures by kind, and the first silent errors."""
    names = [kind] if kind else [k for k, (weight, _) in KINDS.items() for _ in range(weight)]
    figures: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    silent: list[dict[str, Any]] = []
    reasons: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            chosen = names[number % len(names)]
            written = KINDS[chosen][1](random.Random(f"{seed} {number}"), Path(folder))
            verdict, why = judged(written)
            figures[chosen][verdict] += 1
            if verdict == "refused":
                reasons[f"{chosen}: {re.sub(r'[0-9]+|.[^ ]*v[.][a-z]*|/[^ ]*', '', why)[:70]}"] += 1
            if verdict == "silent":
                silent.append({"number": number, "kind": chosen, "why": why, "how": written.how})
    return {
        "count": count,
        "seed": seed,
        "kinds": {k: dict(v) for k, v in figures.items()},
        "refusals": dict(reasons.most_common(30)),
        "silent": silent,
    }


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=list(KINDS))
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    figures = run(given.count, given.seed, given.kind)
    for kind, of in figures["kinds"].items():
        print(f"{kind:8} " + ", ".join(f"{v} {k}" for k, v in sorted(of.items())))
    for one in figures["silent"][:10]:
        print("silent:", one)
    print(f"{given.count} variants, seed {given.seed}: {len(figures['silent'])} silent errors")
    if given.json:
        given.json.write_text(json.dumps(figures, indent=1))
    return 1 if figures["silent"] else 0


if __name__ == "__main__":
    sys.exit(main())
