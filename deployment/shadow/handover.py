"""The recording as `slewright reconcile` reads it: operator's commands as inputs, machine's sensors."""

from pathlib import Path
from typing import Any

import numpy as np

from deployment.shadow.recorded import Shadowed
from records.formats import write_measurement
from records.formats.metadata import at_ns
from records.measurement import Channel, Measurement
from runtime.control import AXES
from runtime.image import INPUT, Group, group
from specs.signals import signal

FILE = "operator.parquet"
MODELS = ("slew", "tool")  # of the nominal system, which an operator's recording drives
KEPT = ("mode", "controller", "bundle", "platform", "label", "machine")  # of the recording's metadata


def measurement(found: Shadowed, source: Path, load: float) -> Measurement:
    """Channels in SI with their own samples; `load` [kg] stands as load_told, as reconcile has it."""
    columns = {n: found.operator[:, i] for i, n in enumerate(AXES)}
    columns |= {s.name: found.input(s.name) for s in INPUT.signals if group(s) is Group.SENSOR}
    columns["load_told"] = np.full(len(found), load)
    time = found.time
    channels = {}
    for name, values in columns.items():
        good = np.isfinite(values)
        if good.any():
            s = signal(name)
            channels[name] = Channel(name, s.unit, time[good], values[good], s.description)
    meta: dict[str, Any] = {k: found.metadata[k] for k in KEPT if k in found.metadata}
    meta["commands"] = f"the operator's, {found.source}"
    return Measurement(channels, at_ns(int(found.day_ns[0])), meta, str(source))


def write(found: Shadowed, source: Path, load: float, out: Path) -> Path:
    """Write it into the folder `out`; the file."""
    path = out / FILE
    write_measurement(measurement(found, source, load), path)
    return path


def next_commands(recording: Path, out: Path, figures: Path) -> list[str]:
    """What to type next, in this order."""
    found = [
        f"slewright reconcile {recording} --model {model} --out {out / f'reconcile-{model}'}"
        for model in MODELS
    ]
    return [*found, f"python -m benchmarks dossier --out {out / 'dossier.md'} --recorded {figures}"]
