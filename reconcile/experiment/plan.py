"""The proposed experiment as files: a plan for `slewright collect`, and a table of the inputs over time."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from learning.collection.plan import PLAN_COMMANDS, load_plan
from reconcile.equations.model import Folder
from records.formats import csv_write, read_measurement
from records.measurement import Channel, Measurement
from specs.signals import signals

PLAN, TABLE = "experiment.toml", "experiment.csv"
POSE = {"boom_rad": ("q_boom", 1.1), "stick_rad": ("q_stick", -1.2)}  # where nothing is recorded
LIKE = "paper"  # the collection whose limits are kept
MARGIN_RAD = 0.02
WIDTH = 12  # numbers a line


def drivable(folder: Folder) -> bool:
    """Whether the model's inputs are commands of the reference machine: `slewright collect` drives it."""
    controls = folder.ports.controls
    return bool(controls) and set(controls) <= set(PLAN_COMMANDS)


def kept() -> dict[str, tuple[float, float]]:
    """What the supervisor keeps of the machine's outputs."""
    limits = load_plan(Path(LIKE)).limits
    speed, swing = limits.slew_speed_rad_s, limits.tool_swing_rad
    arm = {"q_boom": limits.boom_rad, "q_stick": limits.stick_rad}
    return arm | {"qd_slew": (-speed, speed), "q_tool_x": (-swing, swing), "q_tool_y": (-swing, swing)}


def units_of(folder: Folder) -> dict[str, str]:
    """Units by name of what may be driven: a model's inputs, or the machine's commands that move it."""
    commands = {n: signals()[n].unit for n in PLAN_COMMANDS}
    return commands | {v.name: v.unit for v in folder.model.inputs}


def pose(paths: Sequence[Path]) -> dict[str, float]:
    """Where the arm stood in the recordings, on average, and the load told: {"q_boom", "q_stick", "load_kg"}.

    Empty where that was not recorded.
    """
    found: dict[str, list[float]] = {}
    for path in paths:
        measured = read_measurement(path)
        for ours, theirs in (("q_boom", "q_boom"), ("q_stick", "q_stick"), ("load_kg", "load_told")):
            if theirs in measured and len(measured[theirs].values):
                found.setdefault(ours, []).append(float(np.median(measured[theirs].values)))
    return {name: float(np.median(values)) for name, values in found.items()}


def write_for(out: Path, proposal: Any, folder: Folder, paths: Sequence[Path]) -> None:
    """Write the files of a proposal for a model, whose recordings lie in `paths`."""
    stands = pose(paths) if set(proposal.commands) <= set(PLAN_COMMANDS) else {}
    write(out, proposal.figures, proposal.commands, units_of(folder), stands)


def write(
    out: Path,
    figures: Mapping[str, Any],
    commands: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    stands: Mapping[str, float],
) -> None:
    """Write OUT/experiment.toml, and OUT/experiment.csv with the inputs over time (`units` by input)."""
    said = json.dumps(figures["sentence"], ensure_ascii=False)
    head = f'name = "experiment"\ndescription = {said}\nseed = 1\n'
    driven = {n: commands[n] for n in figures["ranges"]}
    machine = set(driven) <= set(PLAN_COMMANDS)
    body = _limits() + _part(figures, stands) + _commands(driven) if machine else _own(figures)
    (out / PLAN).write_text(head + body, encoding="utf-8")
    time = figures["tick_s"] * np.arange(len(next(iter(commands.values()))))
    channels = {n: Channel(n, units[n], time, u) for n, u in commands.items()}
    csv_write.write(Measurement(channels), out / TABLE)


def _limits() -> str:
    """The limits that the project's own collection keeps."""
    listed = asdict(load_plan(Path(LIKE)).limits)
    return "\n[limits]\n" + "".join(f"{n} = {_value(v)}\n" for n, v in listed.items())


def _part(figures: Mapping[str, Any], stands: Mapping[str, float]) -> str:
    allowed = asdict(load_plan(Path(LIKE)).limits)
    lines = ["", "[parts.experiment]", 'kind = "replay"', f"recording_s = {figures['duration_s']:g}"]
    lines.append("recordings = { train = 1 }")
    for key, (name, usual) in POSE.items():
        low, high = allowed[key]
        at = float(np.clip(stands.get(name, usual), low + MARGIN_RAD, high - MARGIN_RAD))
        lines.append(f"{key} = [{at - MARGIN_RAD:.4f}, {at + MARGIN_RAD:.4f}]")
    lines.append(f"loads_kg = [{max(0.0, stands.get('load_kg', 0.0)):.1f}]")
    return "\n".join(lines) + "\n"


def _commands(commands: Mapping[str, np.ndarray]) -> str:
    text = "\n[parts.experiment.commands]\n"
    for name, values in commands.items():
        numbers = [
            f"{v:.4f}".rstrip("0").rstrip(".") + (".0" if float(f"{v:.4f}").is_integer() else "")
            for v in values
        ]
        rows = [", ".join(numbers[k : k + WIDTH]) for k in range(0, len(numbers), WIDTH)]
        text += f"{name} = [\n" + "".join(f"    {row},\n" for row in rows) + "]\n"
    return text


def _own(figures: Mapping[str, Any]) -> str:
    """For a rig that is not the project's machine: the same part, its inputs in the table beside it."""
    e = figures["excitation"]
    lines = ["", "[parts.experiment]", 'kind = "replay"', f"recording_s = {figures['duration_s']:g}"]
    lines += ["recordings = { train = 1 }", f'table = "{TABLE}"', f"period_s = {figures['tick_s']:g}"]
    lines += ["", "[parts.experiment.start]", *(f"{json.dumps(n)} = {v:.6g}" for n, v in e["start"].items())]
    lines += ["", "[parts.experiment.limits]"]
    lines += [f"{json.dumps(n)} = [{low:.6g}, {high:.6g}]" for n, (low, high) in figures["ranges"].items()]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    return f"[{', '.join(f'{v!r}' for v in value)}]" if isinstance(value, list | tuple) else repr(value)
