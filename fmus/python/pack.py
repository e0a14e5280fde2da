"""`slewright fmu`: a Python class with `step` as an FMI 3.0 FMU of co-simulation.

`declared.py` says how a class declares its variables.
"""

import hashlib
import importlib.util
import json
import re
import sys
import tempfile
from html import escape
from pathlib import Path
from typing import Any

from fmus.paths import SHIM
from fmus.python.declared import TYPES, Variable, step_of, variables_of
from fmus.toolchain import compiler
from fmus.toolchain.build import pack
from specs.errors import InputError, nearest
from specs.units import UNITS

HERE = Path(__file__).parent


def build_python_fmu(source: Path, class_name: str | None = None, python: str = sys.executable) -> bytes:
    """The FMU of a class in the file `source`, for this platform; it runs with the interpreter `python`.

    Raises InputError, naming file and class, for what cannot be an FMU.
    """
    if compiler.host().name.endswith("windows"):
        raise InputError("an FMU from Python needs Linux or macOS: it starts a process of its own")
    made = _class_of(source, class_name)
    where = f"{source}, class {made.__name__}"
    variables, step = variables_of(made, where), step_of(made, where)
    table = _table(made, source, variables)
    token = hashlib.sha256(source.read_bytes() + json.dumps(table).encode()).hexdigest()[:32]
    host = compiler.host()
    return pack(
        {
            "modelDescription.xml": _description(made, variables, step, token).encode(),
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
    sys.modules["model"] = module  # dataclasses look for their module there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # noqa: BLE001  # whatever the user's file raises
        raise InputError(f"{source} cannot be imported: {type(error).__name__}: {error}") from None
    finally:
        del sys.modules["model"]
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


def _description(made: type, variables: tuple[Variable, ...], step: float | None, token: str) -> str:
    lines = [_xml(number, v) for number, v in enumerate(variables, 1)]
    units = sorted({v.more["unit"] for v in variables if v.more.get("unit")})
    defined = "".join(f'<Unit name="{u}">{_base(u)}</Unit>' for u in units)
    outputs = "".join(
        f'<Output valueReference="{n}"/>' for n, v in enumerate(variables, 1) if v.causality == "output"
    )
    unit_part = f"<UnitDefinitions>{defined}</UnitDefinitions>\n" if units else ""
    text = " ".join((made.__doc__ or "").split())
    experiment = f'<DefaultExperiment stepSize="{step!r}"/>\n' if step else ""
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
    more = {key: v.more[key] for key in ("unit", "min", "max") if key in v.more}
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
