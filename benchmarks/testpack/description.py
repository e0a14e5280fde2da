"""modelDescription.xml of an FMU of the pack, FMI 2.0 and 3.0."""

from collections.abc import Iterator, Mapping
from xml.sax.saxutils import quoteattr

from benchmarks.testpack.models import ENUMERATIONS, NAMES, UNITS, Fmu, Start, Variable

TOOL = "Slewright test pack"
STATE = {
    2: {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"},
    3: {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true"},
}


def token_begin(fmu: Fmu, fmi_version: int) -> str:
    """What the tokens of all FMUs with the same library begin with."""
    return f"slewright-testpack-{fmu.model}-{fmi_version}-"


def token(fmu: Fmu, fmi_version: int) -> str:
    """GUID or instantiation token: some importers take two FMUs with the same one for one."""
    return f"{token_begin(fmu, fmi_version)}{fmu.name.encode().hex()}"


def description(fmu: Fmu, fmi_version: int) -> str:
    """The XML text."""
    parts = _fmi2(fmu) if fmi_version == 2 else _fmi3(fmu)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + "\n".join(parts) + "\n</fmiModelDescription>\n"


def terminals(fmu: Fmu) -> str:
    """The text of terminalsAndIcons.xml; FMI 2.0 takes that of FMI 3.0."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>'
        f"{fmu.terminals}</Terminals></fmiTerminalsAndIcons>\n"
    )


def _attributes(values: Mapping[str, object]) -> str:
    return "".join(f" {name}={quoteattr(str(value))}" for name, value in values.items() if value != "")


def _flags(fmu: Fmu, fmi_version: int) -> str:
    steps = {} if fmu.exchange else {"canHandleVariableCommunicationStepSize": "true"}
    known = {**steps, **STATE[fmi_version]}
    state = "state" if fmi_version == 2 else "State"
    changed = {k: v for k, v in fmu.flags.items() if not k.endswith(("state", "State")) or k.endswith(state)}
    return _attributes({"modelIdentifier": fmu.model, **known, **changed})


def _interface(fmu: Fmu) -> str:
    return "ModelExchange" if fmu.exchange else "CoSimulation"


def _number(fmu: Fmu, name: str) -> int:
    """The place of a variable, which is its value reference."""
    return next(i for i, v in enumerate(fmu.variables) if v.name == name)


def _units(fmu: Fmu) -> Iterator[str]:
    used = sorted({v.unit for v in fmu.variables if v.unit})
    if used:
        units = "".join(f'<Unit name="{u}"><BaseUnit{_attributes(UNITS[u])}/></Unit>' for u in used)
        yield f"<UnitDefinitions>{units}</UnitDefinitions>"


def _types(fmu: Fmu, fmi_version: int) -> Iterator[str]:
    used = sorted({v.enumeration for v in fmu.variables if v.type == "Enumeration"})
    if not used:
        return
    types = []
    for name in used:
        items = "".join(f'<Item name="{n}" value="{v}"/>' for n, v in ENUMERATIONS[name].items())
        if fmi_version == 2:
            types.append(f'<SimpleType name="{name}"><Enumeration>{items}</Enumeration></SimpleType>')
        else:
            types.append(f'<EnumerationType name="{name}">{items}</EnumerationType>')
    yield f"<TypeDefinitions>{''.join(types)}</TypeDefinitions>"


def _experiment(fmu: Fmu) -> Iterator[str]:
    if fmu.experiment:
        yield f"<DefaultExperiment {fmu.experiment}/>"


def written(start: Start) -> str:
    """A start value as XML has it."""
    if isinstance(start, bool):
        return str(start).lower()
    return " ".join(map(repr, start)) if isinstance(start, tuple) else str(start)


def _variability(v: Variable) -> str:
    if v.causality == "parameter":
        return "tunable"
    if v.causality == "structuralParameter":
        return "fixed"
    return "continuous" if v.continuous else "discrete"


def _common(fmu: Fmu, v: Variable, reference: int) -> dict[str, object]:
    initial = {"parameter": "exact", "structuralParameter": "exact", "output": "calculated"}
    return {
        "name": fmu.shown(v.name),
        "valueReference": reference,
        "causality": v.causality,
        "variability": _variability(v),
        "initial": initial.get(v.causality, "") if v.type != "Clock" else "",
    }


def _typed(v: Variable) -> dict[str, object]:
    """Attributes of the type."""
    values: dict[str, object] = {}
    if v.type == "Enumeration":
        values["declaredType"] = v.enumeration
    if v.unit:
        values["unit"] = v.unit
    if v.relative:
        values["relativeQuantity"] = "true"
    if v.min is not None:
        values |= {"min": v.min, "max": v.max}
    return values


# ---- FMI 2.0 ----


def _fmi2(fmu: Fmu) -> Iterator[str]:
    yield (
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(fmu.name)} guid="{token(fmu, 2)}" '
        f'generationTool="{TOOL}" numberOfEventIndicators="{int(fmu.exchange)}">'
    )
    yield f'<{_interface(fmu)}{_flags(fmu, 2)} canNotUseMemoryManagementFunctions="true"/>'
    yield from _units(fmu)
    yield from _types(fmu, 2)
    yield from _experiment(fmu)
    yield "<ModelVariables>"
    for reference, v in enumerate(fmu.variables):
        inner = _attributes(_typed(v))
        if v.rate_of:
            inner += f' derivative="{_number(fmu, v.rate_of) + 1}"'
        if v.start is not None:
            inner += f" start={quoteattr(written(v.start))}"
        outer = _attributes(_common(fmu, v, reference))
        yield f"<ScalarVariable{outer}><{v.type}{inner}/></ScalarVariable>"
    yield "</ModelVariables>"
    yield f"<ModelStructure>{_structure2(fmu)}</ModelStructure>"


def _structure2(fmu: Fmu) -> str:
    index = {v.name: i for i, v in enumerate(fmu.variables, 1)}
    outputs = [v for v in fmu.variables if v.causality == "output"]
    lines = "".join(
        f'<Unknown index="{index[v.name]}" dependencies="{" ".join(str(index[d]) for d in v.depends)}"/>'
        for v in outputs
    )
    rates = "".join(f'<Unknown index="{index[v.name]}"/>' for v in fmu.variables if v.rate_of)
    unknowns = "".join(f'<Unknown index="{index[v.name]}"/>' for v in outputs) + rates
    derivatives = f"<Derivatives>{rates}</Derivatives>" if rates else ""
    initial = f"<InitialUnknowns>{unknowns}</InitialUnknowns>"
    return f"<Outputs>{lines}</Outputs>{derivatives}{initial}" if outputs else ""


# ---- FMI 3.0 ----


def _fmi3(fmu: Fmu) -> Iterator[str]:
    yield (
        f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(fmu.name)} '
        f'instantiationToken="{token(fmu, 3)}" generationTool="{TOOL}">'
    )
    yield f"<{_interface(fmu)}{_flags(fmu, 3)}/>"
    yield from _units(fmu)
    yield from _types(fmu, 3)
    yield from _experiment(fmu)
    yield "<ModelVariables>"
    for reference, v in enumerate(fmu.variables):
        yield _variable3(fmu, v, reference)
    time = len(fmu.variables)
    yield f'<Float64 name="time" valueReference="{time}" causality="independent" variability="continuous"/>'
    yield "</ModelVariables>"
    yield f"<ModelStructure>{_structure3(fmu)}</ModelStructure>"


def _variable3(fmu: Fmu, v: Variable, reference: int) -> str:
    vr = {v.name: i for i, v in enumerate(fmu.variables)}
    kind = NAMES[3].get(v.type, v.type)
    values = _common(fmu, v, reference) | _typed(v)
    if v.rate_of:
        values["derivative"] = vr[v.rate_of]
    if v.clock:
        values["clocks"] = vr[v.clock]
    if v.type == "Clock":
        values["intervalVariability"] = v.ticks or ("constant" if v.interval else "triggered")
        values |= {"intervalDecimal": v.interval, "shiftDecimal": v.shift}
    inner = ""
    if isinstance(v.size, str):
        inner = f'<Dimension valueReference="{vr[v.size]}"/>'
    elif v.shape:
        inner = "".join(f'<Dimension start="{n}"/>' for n in v.shape)
    elif v.size is not None:
        inner = f'<Dimension start="{v.size}"/>'
    if kind in ("String", "Binary") and v.start is not None:
        inner += f"<Start value={quoteattr(written(v.start))}/>"
    elif v.start is not None:
        values["start"] = written(v.start)
    return f"<{kind}{_attributes(values)}>{inner}</{kind}>"


def _structure3(fmu: Fmu) -> str:
    vr = {v.name: i for i, v in enumerate(fmu.variables)}
    outputs = [v for v in fmu.variables if v.causality == "output"]
    lines = "".join(
        f'<Output valueReference="{vr[v.name]}" dependencies="{" ".join(str(vr[d]) for d in v.depends)}"/>'
        for v in outputs
    )
    rates = [vr[v.name] for v in fmu.variables if v.rate_of]
    lines += "".join(f'<ContinuousStateDerivative valueReference="{r}"/>' for r in rates)
    clocked = "".join(f'<InitialUnknown valueReference="{vr[v.name]}"/>' for v in outputs if not v.clock)
    clocked += "".join(f'<InitialUnknown valueReference="{r}"/>' for r in rates)
    return lines + clocked + (f'<EventIndicator valueReference="{vr["y"]}"/>' if fmu.exchange else "")
