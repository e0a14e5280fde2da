"""modelDescription.xml of FMI 2.0 and FMI 3.0 from one model definition."""

from collections.abc import Iterable

from lxml import etree

from fmus.definition import Model
from fmus.toolchain.variables import TIME_VR, Exposed, exposed
from specs.units import known
from specs.version import VERSION

SOURCES = ("core.c", "integrator.c", "model.c")  # and the file of the FMI version
TOOL = "Slewright " + VERSION


def description(model: Model, fmi_version: int, token: str) -> bytes:
    """The XML file for FMI `fmi_version` (2 or 3)."""
    root = etree.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{fmi_version}.0",
            "modelName": model.name,
            "guid" if fmi_version == 2 else "instantiationToken": token,
            "description": model.description,
            "license": "Apache-2.0",
            "version": VERSION,
            "generationTool": TOOL,
            "variableNamingConvention": "structured",
        },
    )
    (_fmi2_interface if fmi_version == 2 else _fmi3_interface)(root, model)
    _units(root, model)
    box = etree.SubElement(root, "LogCategories")
    etree.SubElement(box, "Category", name="logStatusError", description="Failures, with their reason")
    step = max(model.step, model.sample_time)
    etree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize=repr(step))
    (_fmi2_variables if fmi_version == 2 else _fmi3_variables)(root, model)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def build_description(model: Model) -> bytes:
    """sources/buildDescription.xml of FMI 3."""
    root = etree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = etree.SubElement(root, "BuildConfiguration", modelIdentifier=model.name)
    # Optimised and without errno, sqrt is an instruction: the library needs no libm.
    options = "-O2 -fno-math-errno -ffp-contract=off"
    files = etree.SubElement(build, "SourceFileSet", language="C99", compilerOptions=options)
    for name in (*SOURCES, "fmi3.c"):
        etree.SubElement(files, "SourceFile", name=name)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


# ---- FMI 2.0 ----


def _fmi2_interface(root: etree._Element, model: Model) -> None:
    root.set("numberOfEventIndicators", "0")
    cosim = etree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.name,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
        providesDirectionalDerivative="true",
    )
    files = etree.SubElement(cosim, "SourceFiles")
    for name in (*SOURCES, "fmi2.c"):
        etree.SubElement(files, "File", name=name)


def _fmi2_variables(root: etree._Element, model: Model) -> None:
    variables = exposed(model)
    position = {e.vr: i for i, e in enumerate(variables, start=1)}
    box = etree.SubElement(root, "ModelVariables")
    for e in variables:
        scalar = etree.SubElement(box, "ScalarVariable", name=e.name, valueReference=str(e.vr))
        _set(scalar, description=e.variable.description, **_role(model, e))
        kind = etree.SubElement(scalar, "Integer" if e.group == "SEED" else "Real")
        _set(kind, **_numbers(e), derivative=None if e.of_state is None else str(position[e.of_state]))
    structure = etree.SubElement(root, "ModelStructure")
    _fmi2_unknowns(structure, "Outputs", (e for e in variables if e.group == "OUTPUT"), position, "")
    if model.kind == "continuous":
        rates = [e for e in variables if e.group == "DERIVATIVE"]
        _fmi2_unknowns(structure, "Derivatives", rates, position, None)
    _fmi2_unknowns(
        structure, "InitialUnknowns", (e for e in variables if _is_unknown(model, e)), position, None
    )


def _fmi2_unknowns(
    box: etree._Element,
    tag: str,
    unknowns: Iterable[Exposed],
    position: dict[int, int],
    dependencies: str | None,
) -> None:
    element = etree.SubElement(box, tag)
    for e in unknowns:
        _set(etree.SubElement(element, "Unknown", index=str(position[e.vr])), dependencies=dependencies)


# ---- FMI 3.0 ----


def _fmi3_interface(root: etree._Element, model: Model) -> None:
    etree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model.name,
        canHandleVariableCommunicationStepSize="true",
        fixedInternalStepSize=repr(model.step),
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        providesDirectionalDerivatives="true",
    )


def _fmi3_variables(root: etree._Element, model: Model) -> None:
    box = etree.SubElement(root, "ModelVariables")
    etree.SubElement(
        box,
        "Float64",
        name="time",
        valueReference=str(TIME_VR),
        causality="independent",
        variability="continuous",
        description="Simulation time",
        unit="s",
    )
    variables = exposed(model)
    for e in variables:
        kind = etree.SubElement(box, "Int32" if e.group == "SEED" else "Float64", name=e.name)
        _set(
            kind,
            valueReference=str(e.vr),
            description=e.variable.description,
            **_role(model, e),
            **_numbers(e),
        )
        _set(kind, derivative=None if e.of_state is None else str(e.of_state))
    structure = etree.SubElement(root, "ModelStructure")
    for e in variables:
        if e.group == "OUTPUT":
            etree.SubElement(structure, "Output", valueReference=str(e.vr), dependencies="")
    for e in variables:
        if e.group == "DERIVATIVE":
            etree.SubElement(structure, "ContinuousStateDerivative", valueReference=str(e.vr))
    for e in variables:
        if _is_unknown(model, e):
            etree.SubElement(structure, "InitialUnknown", valueReference=str(e.vr))


# ---- common to both ----


def _is_calculated(e: Exposed) -> bool:
    return e.group in ("OUTPUT", "STATE", "DERIVATIVE")


def _is_unknown(model: Model, e: Exposed) -> bool:
    """Listed as an initial unknown: outputs, and the states and rates of a continuous model."""
    return e.group == "OUTPUT" or (_is_calculated(e) and model.kind == "continuous")


def _role(model: Model, e: Exposed) -> dict[str, str]:
    moving = "continuous" if model.kind == "continuous" else "discrete"
    if e.group == "INPUT":
        return {"causality": "input", "variability": moving}
    if e.group == "OUTPUT":
        held = e.name in model.sensors
        return {
            "causality": "output",
            "variability": "discrete" if held else moving,
            "initial": "calculated",
        }
    if e.group in ("PARAMETER", "SEED"):
        fixed = e.group == "SEED" or e.variable.fixed
        return {"causality": "parameter", "variability": "fixed" if fixed else "tunable", "initial": "exact"}
    return {"causality": "local", "variability": moving, "initial": "calculated"}


def _numbers(e: Exposed) -> dict[str, str | None]:
    """Unit, range and start value as attributes."""
    v = e.variable
    if e.group == "SEED":
        return {"start": str(int(v.start))}
    start = None if _is_calculated(e) else repr(float(v.start))
    # A parameter without a nominal value gets the size of its value, else of its range.
    size = abs(v.start) or max(abs(v.min or 0.0), abs(v.max or 0.0)) if e.group == "PARAMETER" else 0.0
    return {
        "unit": v.unit if known(v.unit) else None,
        "min": _real(v.min),
        "max": _real(v.max),
        "nominal": _real(v.nominal or size or None),
        "start": start,
    }


def _real(value: float | None) -> str | None:
    return None if value is None else repr(float(value))


def _units(root: etree._Element, model: Model) -> None:
    box = etree.SubElement(root, "UnitDefinitions")
    for name in sorted({e.variable.unit for e in exposed(model)} | {"s"}):
        unit = known(name)
        if unit is None:
            continue
        element = etree.SubElement(box, "Unit", name=name)
        base = etree.SubElement(element, "BaseUnit")
        _set(base, **{k: str(n) for k, n in unit.exponents.items() if n})
        if unit.factor != 1.0:
            base.set("factor", repr(unit.factor))
        if unit.offset != 0.0:
            base.set("offset", repr(unit.offset))


def _set(element: etree._Element, **attributes: str | None) -> None:
    for name, value in attributes.items():
        if value:
            element.set(name, value)
        elif value == "" and name == "dependencies":
            element.set(name, "")
