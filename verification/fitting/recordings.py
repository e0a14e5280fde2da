"""Recordings for a fit: what drives a system's inputs at each tick, and what its outputs should show."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.fmi.instance import LIMIT_S
from orchestrator.run.simulate import simulate
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.formats import read_measurement
from records.formats.assemble import OURS
from records.formats.tables import is_clock
from records.formats.units import converted, spelled
from records.measurement import Channel
from specs.errors import InputError, RunError, nearest

FEWEST = 10  # samples of an output


@dataclass(frozen=True)
class Recording:
    """One run: its inputs by tick, `seen` outputs as (time [n], values [n]), s from the run's start."""

    name: str
    ticks: int
    stimuli: Stimuli
    seen: Mapping[str, tuple[np.ndarray, np.ndarray]]

    def simulated(
        self, system: System, parameters: Mapping[str, float], limit_s: float = LIMIT_S
    ) -> dict[str, np.ndarray]:
        """Outputs at the recording's own times, linear between ticks; RunError where the run fails.

        `limit_s`: how long one call of an FMU may take.
        """
        record = simulate(
            system, self.ticks, self.stimuli, parameters, record=list(self.seen), seed=0, limit_s=limit_s
        )
        if not record.complete:
            raise RunError(record.reason)
        time = np.arange(self.ticks + 1) * system.step_s
        return {n: np.interp(t, time, record.column(n)) for n, (t, _) in self.seen.items()}


def check_names(system: System, names: Mapping[str, str], path: Path | None) -> None:
    """InputError for a name in the file of `--map` that is neither an input nor an output of the system."""
    for theirs, ours in names.items():
        match = OURS.match(ours.strip())
        if is_clock(ours) or match is None:  # the latter is said where the recording is read
            continue
        if match["name"] not in system.inputs and match["name"] not in system.outputs:
            valid = nearest(match["name"], [*system.inputs, *system.outputs])
            raise InputError(
                f"{path}: '{theirs}' = '{ours}': {system.name} has no such input or output; {valid}"
            )


def read(
    path: Path, system: System, names: Mapping[str, str] | None = None, skip_s: float = 0.0
) -> Recording:
    """A recording for a system; channels are found by name, in the system's units.

    `skip_s`: what is left out of the comparison at the beginning, where the system starts from its own state.
    InputError where no output was recorded, or an output keeps one value.
    """
    found = read_measurement(path, names=names).channels
    ports = {**system.outputs, **system.inputs}
    channels = {n: _in_unit(c, ports[n].unit_name, path) for n, c in found.items() if n in ports}
    driven = [n for n in system.inputs if n in channels]
    shown = [n for n in system.outputs if n in channels and n not in driven]
    if not shown:
        has, wanted = ", ".join(list(found)[:8]), ", ".join(list(system.outputs)[:8])
        raise InputError(
            f"{path}: no output of {system.name} in it (has {has}; outputs: {wanted}); see --map"
        )
    begin = max(channels[n].time[0] for n in (*driven, *shown))
    end = min(channels[n].time[-1] for n in (*driven, *shown))
    ticks = int(np.floor((end - begin) / system.step_s + 1e-9))
    seen = {n: _seen(channels[n], begin, begin + skip_s, begin + ticks * system.step_s) for n in shown}
    for name, (_, values) in seen.items():
        if len(values) < FEWEST:
            raise InputError(
                f"{path}: {len(values)} samples of {name} to compare, at least {FEWEST} are needed"
            )
    still = [n for n, (_, values) in seen.items() if not np.ptp(values)]
    if len(still) == len(seen):
        raise InputError(f"{path}: {', '.join(still)} keeps one value: there is nothing to fit to")
    columns = {n: _held(channels[n], begin + np.arange(ticks) * system.step_s) for n in driven}
    changes = {k: {n: float(c[k]) for n, c in columns.items()} for k in range(ticks)} if columns else {}
    return Recording(str(path), ticks, Stimuli(changes), {n: s for n, s in seen.items() if n not in still})


def _in_unit(channel: Channel, unit: str, path: Path) -> Channel:
    """The channel in a connector's unit; without one on either side it is as it is."""
    if not channel.unit or not unit or spelled(unit) == channel.unit:
        return channel
    values = converted(channel.values, channel.unit, spelled(unit), f"{path}: channel {channel.name}")
    return Channel(channel.name, unit, channel.time, values)


def _seen(channel: Channel, begin: float, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    kept = (channel.time >= first - 1e-9) & (channel.time <= last + 1e-9) & np.isfinite(channel.values)
    return channel.time[kept] - begin, channel.values[kept]


def _held(channel: Channel, time: np.ndarray) -> np.ndarray:
    """The last sample at or before each time; missing ones are passed over."""
    good = np.isfinite(channel.values)
    at = np.searchsorted(channel.time[good], time + 1e-9, side="right") - 1
    return channel.values[good][np.maximum(at, 0)]
