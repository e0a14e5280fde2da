"""`slewright fmu`: a Python class with `step` as an FMI 3.0 FMU of co-simulation.

The class says its variables in dictionaries `inputs`, `outputs` and `parameters`: name → start value, or a
dictionary with `start`, `unit`, `min`, `max`, `description`. Numbers are Float64, whole numbers Int32,
Booleans Boolean; a list or numpy array of numbers is an array.
"""

import hashlib
import importlib.util
import json
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from fmus.paths import SHIM
from fmus.toolchain import compiler
from fmus.toolchain.build import pack
from specs.errors import InputError, nearest
from specs.units import UNITS

HERE = Path(__file__).parent
GROUPS = {"inputs": "input", "outputs": "output", "parameters": "parameter"}
ATTRIBUTES = ("start", "unit", "min", "max", "description")
NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
TYPES = {"d": "Float64", "i": "Int32", "b": "Boolean"}
TOP = 2**31 - 1  # of Int32


@dataclass(frozen=True)
class Variable:
    """A declared variable; `array`: "", "list" or "numpy"."""

    name: str
    causality: str
    kind: str
    start: tuple[float, ...]
    array: str
    more: Mapping[str, Any]


def build_python_fmu(source: Path, class_name: str | None = None, python: str = sys.executable) -> bytes:
    """The FMU of a class in the file `source`, for this platform; it runs with the interpreter `python`.

    Raises InputError, naming file and class, for what cannot be an FMU.
    """
    if compiler.host().name.endswith("windows"):
        raise InputError("an FMU from Python needs Linux or macOS: it starts a process of its own")
    made = _class_of(source, class_name)
    variables = tuple(_variables(made, f"{source}, class {made.__name__}"))
    table = _table(made, source, variables)
    token = hashlib.sha256(source.read_bytes() + json.dumps(table).encode()).hexdigest()[:32]
    host = compiler.host()
    return pack(
        {
            "modelDescription.xml": _description(made, variables, token).encode(),
            f"binaries/{host.name}/{made.__name__}{host.suffix}": _library(variables, token),
            "resources/python.txt": f"{python}\n".encode(),
            "resources/server.py": (HERE / "server.py").read_bytes(),
            "resources/table.json": json.dumps(table).encode(),
            f"resources/model/{source.name}": source.read_bytes(),
        }
    )


def _class_of(source: Path, class_name: str | None) -> type:
    if not source.is_file():
        raise InputError(f"{source}: there is no such file")
    spec = importlib.util.spec_from_file_location("model", source)
    if spec is None or spec.loader is None:
        raise InputError(f"{source} is no Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # noqa: BLE001  # whatever the user's file raises
        raise InputError(f"{source} cannot be imported: {type(error).__name__}: {error}") from None
    classes = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == "model" and callable(getattr(value, "step", None))
    }
    if class_name is not None and class_name not in classes:
        raise InputError(f"{source} has no class '{class_name}' with step; {nearest(class_name, classes)}")
    if class_name is None and len(classes) != 1:
        found = ", ".join(classes) or "none"
        raise InputError(
            f"{source} must have one class with step, or --class NAME say which; it has: {found}"
        )
    return classes[class_name or next(iter(classes))]


def _variables(made: type, where: str) -> Iterator[Variable]:
    seen: set[str] = {"time", "step", "start"}
    for group, causality in GROUPS.items():
        declared = getattr(made, group, {})
        if not isinstance(declared, dict):
            raise InputError(f"{where}: {group} must be a dictionary of names, not {declared!r}")
        for name, said in declared.items():
            if not isinstance(name, str) or not NAME.fullmatch(name) or name in seen:
                raise InputError(f"{where}: {group} has {name!r}, which is no name, or taken")
            seen.add(name)
            yield _variable(name, causality, said, f"{where}: {name}")
    if not any(getattr(made, group, {}) for group in ("inputs", "outputs")):
        raise InputError(f"{where} declares neither inputs nor outputs")


def _variable(name: str, causality: str, said: Any, where: str) -> Variable:
    said = said if isinstance(said, dict) else {"start": said}
    if unknown := [key for key in said if key not in ATTRIBUTES]:
        raise InputError(f"{where}: unknown attribute '{unknown[0]}'; valid: {', '.join(ATTRIBUTES)}")
    if (unit := said.get("unit", "")) not in ("", *UNITS):
        raise InputError(f"{where}: unknown unit '{unit}'; {nearest(unit, UNITS)}")
    start = said.get("start", 0.0)
    listed = start.tolist() if hasattr(start, "tolist") else start
    values = listed if isinstance(listed, list | tuple) else [listed]
    array = "" if values is not listed else "list" if start is listed else "numpy"
    kinds = {bool: "b", int: "i", float: "d"}
    if not values or any(type(v) not in kinds for v in values):
        raise InputError(f"{where}: start {start!r} is no number, Boolean or list of numbers")
    if array and any(isinstance(v, bool) for v in values):
        raise InputError(f"{where}: an array holds numbers")
    kind = "d" if array else kinds[type(values[0])]
    low, high = said.get("min", -float("inf")), said.get("max", float("inf"))
    if kind == "i":
        low, high = max(low, -TOP - 1), min(high, TOP)
    if any(not low <= v <= high for v in values):
        raise InputError(f"{where}: start {start!r} is out of its bounds {low:g} … {high:g}")
    return Variable(name, causality, kind, tuple(map(float, values)), array, said)


def _table(made: type, source: Path, variables: tuple[Variable, ...]) -> dict[str, Any]:
    rows, first = [], 1  # cell 0 is the time
    for v in variables:
        row = {"name": v.name, "causality": v.causality, "kind": v.kind, "array": v.array}
        rows.append({**row, "first": first, "size": len(v.start)})
        first += len(v.start)
    return {"file": source.name, "class": made.__name__, "variables": rows}


def _library(variables: tuple[Variable, ...], token: str) -> bytes:
    rows, starts = ["{0, 1, 'd'}"], [0.0]
    for v in variables:
        rows.append(f"{{{len(starts)}, {len(v.start)}, '{v.kind}'}}")
        starts += v.start
    header = (
        f'#define TOKEN "{token}"\n#define N_CELLS {len(starts)}\n#define N_VARIABLES {len(rows)}\n'
        "static const struct { unsigned first, size; char kind; } variables[] = "
        f"{{{', '.join(rows)}}};\nstatic const double starts[N_CELLS] = {{{', '.join(map(repr, starts))}}};\n"
    )
    host = compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "table.h").write_text(header)
        (folder / "rest.c").write_text(_rest((HERE / "shim.c").read_text()))
        flags = (f"-I{SHIM}", f"-I{folder}", "-D_GNU_SOURCE", "-fvisibility=default")
        objects = [
            compiler.compile_object(HERE / "shim.c", folder / "shim.o", host.name, flags),
            compiler.compile_object(folder / "rest.c", folder / "rest.o", host.name, flags, generated=True),
        ]
        return compiler.link_shared(objects, folder / f"model{host.suffix}", host.name).read_bytes()


def _rest(source: str) -> str:
    """Functions that the standard demands and nobody calls here: they return an error."""
    header = (SHIM / "fmi" / "fmi3Functions.h").read_text()
    names = set(re.findall(r"\s(fmi3\w+);", header)) - set(re.findall(r"\b(fmi3\w+)\(", source))
    names -= {f"fmi3{verb}{kind}" for verb in ("Get", "Set") for kind in TYPES.values()}
    null = ("fmi3InstantiateModelExchange", "fmi3InstantiateScheduledExecution")
    return "".join(
        f"void *{n}(void) {{ return 0; }}\n" if n in null else f"int {n}(void) {{ return 3; }}\n"
        for n in sorted(names)
    )


def _description(made: type, variables: tuple[Variable, ...], token: str) -> str:
    lines = [_xml(number, v) for number, v in enumerate(variables, 1)]
    units = sorted({v.more["unit"] for v in variables if v.more.get("unit")})
    defined = "".join(f'<Unit name="{u}">{_base(u)}</Unit>' for u in units)
    outputs = "".join(
        f'<Output valueReference="{n}"/>' for n, v in enumerate(variables, 1) if v.causality == "output"
    )
    unit_part = f"<UnitDefinitions>{defined}</UnitDefinitions>\n" if units else ""
    text = " ".join((made.__doc__ or "").split())
    step = getattr(made, "step_s", None)
    experiment = f'<DefaultExperiment stepSize="{float(step)!r}"/>\n' if step else ""
    name = made.__name__
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{token}" '
        f'description="{escape(text)}" generationTool="slewright fmu">\n'
        f'<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" '
        'canGetAndSetFMUState="true" canSerializeFMUState="true"/>\n'
        f"{unit_part}{experiment}<ModelVariables>\n"
        '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>\n'
        f"{''.join(lines)}</ModelVariables>\n<ModelStructure>{outputs}</ModelStructure>\n"
        "</fmiModelDescription>\n"
    )


def _xml(number: int, v: Variable) -> str:
    variability = "fixed" if v.causality == "parameter" else "discrete"
    values = [
        str(bool(x)).lower() if v.kind == "b" else repr(int(x) if v.kind == "i" else x) for x in v.start
    ]
    more = {key: v.more[key] for key in ("unit", "min", "max") if key in v.more and v.kind != "b"}
    if v.kind == "i":
        more.pop("unit", None)
    attributes = "".join(f' {key}="{escape(str(value))}"' for key, value in more.items())
    text = f' description="{escape(v.more["description"])}"' if v.more.get("description") else ""
    exact = ' initial="exact"' if v.causality == "output" else ""
    inner = f'<Dimension start="{len(values)}"/>' if v.array else ""
    return (
        f'<{TYPES[v.kind]} name="{v.name}" valueReference="{number}" causality="{v.causality}" '
        f'variability="{variability}"{exact}{text}{attributes} start="{" ".join(values)}">'
        f"{inner}</{TYPES[v.kind]}>\n"
    )


def _base(name: str) -> str:
    unit = UNITS[name]
    parts = {**unit.exponents}
    if unit.factor != 1.0:
        parts["factor"] = unit.factor  # type: ignore[assignment]
    if unit.offset:
        parts["offset"] = unit.offset  # type: ignore[assignment]
    return f"<BaseUnit{''.join(f' {k}={chr(34)}{v}{chr(34)}' for k, v in parts.items())}/>"
