"""What commissioning measured of a machine, for its bundle: sensor zeros, the arm's tables, the tare.

The zero of a joint's encoder is its offset by the known points that were touched, where these tell it to the
error that the guard counts on; else the zero at rest, by inclinometer and mark.
"""

import dataclasses
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from baselines.arm_velocity import table_file
from baselines.arm_velocity.tracking import parameters_of
from fmus.definition import Model
from runtime.image import INPUT, Group, group
from specs import parameters
from specs.errors import InputError

FORMAT = 1
NAME = "commissioning.json"  # in the bundle
JOINTS = ("q_slew", "q_boom", "q_stick")


@dataclasses.dataclass(frozen=True)
class Commissioned:
    """Zeros [SI] by sensor, parameters of the arm loops, the load calibration's file, all files read.

    `touched`: a sentence for each encoder whose offset was found by touching known points.
    """

    zeros: Mapping[str, float]
    arm: Mapping[str, float]
    load_calibration: Path | None
    files: Mapping[str, bytes]
    touched: tuple[str, ...] = ()


def read(path: Path) -> Commissioned:
    """Read `calibration.json` of `slewright commission` and what it names; InputError for what is wrong."""
    try:
        text = path.read_text(encoding="utf-8")
        data = json.loads(text)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if not isinstance(data, dict) or data.get("commissioning") != FORMAT:
        raise InputError(f"{path}: no calibration.json of slewright commission (format {FORMAT})")
    files = data.get("files") if isinstance(data.get("files"), dict) else {}
    places = {kind: path.parent / str(name) for kind, name in (files or {}).items()}
    content = {NAME: text.encode()}
    arm: dict[str, float] = {}
    if "arm_tables" in places:
        arm = parameters_of({j: v.tolist() for j, v in table_file.read(places["arm_tables"]).items()})
        content["arm-tables.toml"] = places["arm_tables"].read_bytes()
    at_rest = _zeros(path, data.get("zeros"))
    zeros, said = _touched(path, data.get("geometry") or {}, at_rest)
    return Commissioned(zeros, arm, places.get("load_calibration"), content, said)


def with_tables(model: Model, values: Mapping[str, float]) -> Model:
    """The arm loops with these values of their parameters."""
    changed = tuple(dataclasses.replace(v, start=values.get(v.name, v.start)) for v in model.parameters)
    return dataclasses.replace(model, parameters=changed)


def _touched(
    path: Path, found: Any, at_rest: Mapping[str, float]
) -> tuple[dict[str, float], tuple[str, ...]]:
    """The zeros with the offsets by touched points that are known well enough, and what became of each."""
    offsets, said, need = dict[str, float](), list[str](), parameters.parameter("guard_angle_error").value
    for joint in JOINTS if isinstance(found, dict) else ():
        if f"offset {joint}" not in found:
            continue
        offset, half = _offset(path, found, joint)
        rest = f"at rest {at_rest.get(joint, 0.0):.4f} rad"
        if half <= need:
            offsets[joint] = offset
            said.append(f"{joint}: zero {offset:.4f} ± {half:.4f} rad by the points touched ({rest})")
        else:
            said.append(f"{joint}: zero {rest}: the points tell it to {half:.4f} rad, needed are {need:g}")
    return {**at_rest, **_within(path, "geometry: offset of ", offsets)}, tuple(said)


def _offset(path: Path, found: Mapping[str, Any], joint: str) -> tuple[float, float]:
    """A joint's offset by the touched points, and half of its 95 % interval, rad."""
    try:
        low, high = (float(end) for end in found[f"interval {joint}"])
        half = (high - low) / 2
        if not half >= 0.0:
            raise ValueError(f"from {low} to {high}")
        return float(found[f"offset {joint}"]), half
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: geometry: {joint}: no offset with its interval ({error})") from None


def _zeros(path: Path, found: Any) -> dict[str, float]:
    """Zeros of sensors, none larger than commissioning lets pass."""
    if not isinstance(found, dict) or not found:
        raise InputError(f"{path}: no zeros: step 'rest' of the commissioning has not passed")
    return _within(path, "zeros: ", found)


def _within(path: Path, what: str, found: Mapping[str, Any]) -> dict[str, float]:
    """The same as numbers; InputError for one that is none of a sensor, or too large."""
    sensors = {s.name: s for s in INPUT.signals if group(s) is Group.SENSOR}
    most = {
        "rad": parameters.parameter("commissioning_level").value,
        "rad/s": parameters.parameter("commissioning_zero_rate").value,
    }
    for name, value in found.items():
        if name not in sensors or sensors[name].unit not in most:
            raise InputError(f"{path}: {what}{name} is no sensor that has one")
        limit = most[sensors[name].unit]
        if not isinstance(value, int | float) or not math.isfinite(value) or abs(value) > limit:
            raise InputError(f"{path}: {what}{name} = {value}: at most {limit:g} {sensors[name].unit}")
    return {name: float(value) for name, value in found.items()}
