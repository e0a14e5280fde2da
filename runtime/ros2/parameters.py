"""The node's parameters, read-only: what the bundle was compiled with, and what the run is."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.bundle import PARAMETERS
from runtime.ros2.wire import message
from specs.errors import InputError

BOOL, INTEGER, DOUBLE, STRING = 1, 2, 3, 4  # rcl_interfaces/ParameterType
NOT_SET, MOST = 0, 1000  # names that one request may ask for
READ_ONLY = "read-only: bundle and configuration set it, before the start"
Value = bool | int | float | str
FIELDS: dict[type, tuple[int, str]] = {
    bool: (BOOL, "bool_value"), int: (INTEGER, "integer_value"), float: (DOUBLE, "double_value"),
    str: (STRING, "string_value"),
}  # fmt: skip


@dataclass(frozen=True)
class Parameter:
    """A value, and what it is."""

    value: Value
    description: str
    unit: str = ""


def read(bundle: Path) -> dict[str, Parameter]:
    """Those of a bundle's `parameters.json`; InputError if it cannot be read."""
    try:
        found = json.loads((bundle / PARAMETERS).read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"ros2: {bundle / PARAMETERS} cannot be read: {error}") from None
    return {
        name: Parameter(float(entry["value"]), entry.get("source", ""), entry.get("unit", ""))
        for name, entry in sorted(found.items())
    }


class Parameters:
    """Answers the services of `rcl_interfaces`; of a name that is not there it says nothing, as in ROS 2."""

    def __init__(self, known: Mapping[str, Parameter]) -> None:
        self.known = known
        self.services = {
            name: (f"rcl_interfaces/srv/{kind}", answer)
            for name, kind, answer in (
                ("list_parameters", "ListParameters", self._list),
                ("get_parameters", "GetParameters", self._get),
                ("get_parameter_types", "GetParameterTypes", self._types),
                ("describe_parameters", "DescribeParameters", self._describe),
                ("set_parameters", "SetParameters", self._set),
                ("set_parameters_atomically", "SetParametersAtomically", self._set_together),
            )
        }

    def _list(self, request: Any) -> dict[str, Any]:
        """Names at or below the prefixes, at most `depth` levels down; 0: any."""
        prefixes, depth = request.prefixes[:MOST] or [""], int(request.depth)
        names = [n for n in self.known if any(_below(n, prefix, depth) for prefix in prefixes)]
        found = sorted({n.rpartition(".")[0] for n in names if "." in n})
        return {"result": message("rcl_interfaces/msg/ListParametersResult")(names, found)}

    def _get(self, request: Any) -> dict[str, Any]:
        return {"values": [_plain(p.value) for p in self._asked(request.names)]}

    def _types(self, request: Any) -> dict[str, Any]:
        return {"types": [FIELDS[type(p.value)][0] for p in self._asked(request.names)]}

    def _describe(self, request: Any) -> dict[str, Any]:
        made = message("rcl_interfaces/msg/ParameterDescriptor")
        found = zip(request.names, self._asked(request.names), strict=False)
        return {
            "descriptors": [
                made(
                    n,
                    FIELDS[type(p.value)][0],
                    p.description,
                    f"[{p.unit}]" * bool(p.unit),
                    True,
                    False,
                    [],
                    [],
                )
                for n, p in found
            ]
        }

    def _set(self, request: Any) -> dict[str, Any]:
        made = message("rcl_interfaces/msg/SetParametersResult")
        return {"results": [made(False, self._refused(p.name)) for p in request.parameters[:MOST]]}

    def _set_together(self, request: Any) -> dict[str, Any]:
        names = [p.name for p in request.parameters[:1]]
        reason = self._refused(names[0]) if names else READ_ONLY
        return {"result": message("rcl_interfaces/msg/SetParametersResult")(False, reason)}

    def _refused(self, name: str) -> str:
        return READ_ONLY if name in self.known else f"there is no parameter {name[:80]!r}"

    def _asked(self, names: Sequence[str]) -> list[Parameter]:
        there = len(names) <= MOST and all(n in self.known for n in names)
        return [self.known[n] for n in names] if there else []


def _below(name: str, prefix: str, depth: int) -> bool:
    if prefix and name != prefix and not name.startswith(f"{prefix}."):
        return False
    rest = name[len(prefix) :].lstrip(".")
    return not depth or rest.count(".") < depth


def _plain(value: Value) -> Any:
    number, field = FIELDS[type(value)]
    empty: dict[str, Any] = {
        "bool_value": False, "integer_value": 0, "double_value": 0.0, "string_value": "",
        "byte_array_value": [], "bool_array_value": [], "integer_array_value": [], "double_array_value": [],
        "string_array_value": [],
    }  # fmt: skip
    return message("rcl_interfaces/msg/ParameterValue")(type=number, **{**empty, field: value})
