"""What commissioning measured of a machine, for its bundle: sensor zeros, the arm's tables, the tare."""

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


@dataclasses.dataclass(frozen=True)
class Commissioned:
    """Zeros [SI] by sensor, parameters of the arm loops, the load calibration's file, all files read."""

    zeros: Mapping[str, float]
    arm: Mapping[str, float]
    load_calibration: Path | None
    files: Mapping[str, bytes]


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
    return Commissioned(_zeros(path, data.get("zeros")), arm, places.get("load_calibration"), content)


def with_tables(model: Model, values: Mapping[str, float]) -> Model:
    """The arm loops with these values of their parameters."""
    changed = tuple(dataclasses.replace(v, start=values.get(v.name, v.start)) for v in model.parameters)
    return dataclasses.replace(model, parameters=changed)


def _zeros(path: Path, found: Any) -> dict[str, float]:
    """Zeros of sensors, none larger than commissioning lets pass."""
    if not isinstance(found, dict) or not found:
        raise InputError(f"{path}: no zeros: step 'rest' of the commissioning has not passed")
    sensors = {s.name: s for s in INPUT.signals if group(s) is Group.SENSOR}
    most = {
        "rad": parameters.parameter("commissioning_level").value,
        "rad/s": parameters.parameter("commissioning_zero_rate").value,
    }
    for name, value in found.items():
        if name not in sensors or sensors[name].unit not in most:
            raise InputError(f"{path}: zeros: {name} is no sensor that has one")
        limit = most[sensors[name].unit]
        if not isinstance(value, int | float) or not math.isfinite(value) or abs(value) > limit:
            raise InputError(f"{path}: zeros: {name} = {value}: at most {limit:g} {sensors[name].unit}")
    return {name: float(value) for name, value in found.items()}
