"""What the standard demands of a modelDescription.xml: a breach that a run would feel is refused.

Attributes that FMI does not know are warned about; those in a namespace, and all below Annotations, are not.
Source: FMI 2.0.4, tables in 2.2.7; FMI 3.0.2, 2.4.7.4 (allowed combinations) and 2.4.7.5 (start values);
fmi2ModelDescription.xsd and fmi3ModelDescription.xsd with what they include.
"""

import math
from collections.abc import Callable, Iterable, Iterator

from orchestrator.files.xml_file import Element, local, shortened
from orchestrator.fmi.variable import REALS, Scalar, Variable
from specs.errors import InputError, listed

# Which variability fits which causality, FMI 3; FMI 2 has the same without structural parameters.
COMBINATIONS = {
    "structuralParameter": ("fixed", "tunable"),
    "parameter": ("fixed", "tunable"),
    "calculatedParameter": ("fixed", "tunable"),
    "input": ("discrete", "continuous"),
    "output": ("constant", "discrete", "continuous"),
    "local": ("constant", "fixed", "tunable", "discrete", "continuous"),
    "independent": ("continuous",),
}
# What `initial` may be where it is not the default alone.
INITIAL = {
    "structuralParameter": ("exact",),
    "parameter": ("exact",),
    "calculatedParameter": ("calculated", "approx"),
}
SETTABLE = ("input", "parameter", "structuralParameter")
FLOAT32_MAX = 3.4028234663852886e38


def check(variables: Iterable[Variable], version: int, where: str) -> dict[str, Variable]:
    """The variables by name; InputError naming `where` and the line of the first one that is not allowed."""
    found: dict[str, Variable] = {}
    for variable in variables:
        other = found.get(variable.name)
        if other is not None:
            raise _error(where, variable, f"has the name of the variable in line {other.line}")
        for rule in RULES:
            if message := rule(variable):
                raise _error(where, variable, message)
        found[variable.name] = variable
    _check_independent(found.values(), where)
    if version == 2:
        _check_aliases(found.values(), where)
    return found


def warnings(variables: Iterable[Variable], undefined_units: Iterable[str]) -> Iterator[str]:
    """Sentences on what is not as the standard wants it, but does not change a run."""
    needless, lacking, outside = [], [], []
    for v in variables:
        if v.start is not None and v.initial in ("calculated", ""):
            needless.append(v.name)
        elif v.start is None and v.initial in ("exact", "approx") and v.type != "Clock":
            lacking.append(v.name)
        elif _outside(v) is not None:
            outside.append(v.name)
    if needless:
        yield f"start values of variables that are calculated are not used: {listed(needless)}"
    if lacking:
        yield f"variables should have a start value and have none: {listed(lacking)}"
    if outside:
        yield f"start values are out of their bounds: {listed(outside)}"
    if units := sorted(undefined_units):
        yield f"units are not defined and cannot be converted: {listed(units)}"


# ---- rules for one variable: a message, or "" ----


def _combination(v: Variable) -> str:
    valid = COMBINATIONS[v.causality]
    if v.type == "Clock":
        valid = ("discrete", "tunable")
        if v.causality not in ("input", "output", "local"):
            return f"is a clock of causality {v.causality}; valid: input, output, local"
    if v.variability not in valid:
        return f"is {v.causality} and {v.variability}; valid variability: {', '.join(valid)}"
    if v.variability == "continuous" and v.type not in REALS:
        return f"is continuous, but of type {v.type}"
    return ""


def _initial(v: Variable) -> str:
    valid = INITIAL.get(v.causality, ())
    if valid and v.initial not in valid:
        return f"is {v.causality} with initial='{v.initial}'; valid: {', '.join(valid)}"
    return ""


def _bounds(v: Variable) -> str:
    if v.min is not None and v.max is not None and v.min > v.max:
        return f"has min {v.min} above max {v.max}"
    return ""


def _start(v: Variable) -> str:
    if v.causality not in SETTABLE or v.type == "Clock":
        return ""
    if v.start is None:
        return f"is {v.causality} and has no start value"
    if any(isinstance(value, float) and not math.isfinite(value) for value in _flat(v)):
        return f"starts at {v.start}, which is not finite"
    value = _outside(v)
    return "" if value is None else f"starts at {value}, out of its bounds {v.min} … {v.max}"


def _float32(v: Variable) -> str:
    values = [*_flat(v), *(b for b in (v.min, v.max) if b is not None)] if v.type == "Float32" else []
    large = [x for x in values if isinstance(x, float) and math.isfinite(x) and abs(x) > FLOAT32_MAX]
    return f"has the value {large[0]}, beyond Float32" if large else ""


def _enumeration(v: Variable) -> str:
    if v.type != "Enumeration":
        return ""
    if not v.items:
        return "is an enumeration without a declaredType that names its items"
    if len(set(v.items.values())) != len(v.items):
        return "is an enumeration that gives two items one number"
    bad = [value for value in _flat(v) if value not in v.items.values()]
    return f"starts at {bad[0]}, which is no item of its enumeration" if bad else ""


def _clocked(v: Variable) -> str:
    if v.clocks and v.variability not in ("discrete", "tunable"):
        return f"belongs to a clock, but is {v.variability}; valid: discrete, tunable"
    return "belongs to itself as a clock" if v.name in v.clocks else ""


def _structural(v: Variable) -> str:
    if v.causality == "structuralParameter" and v.dimensions:
        return "is a structural parameter with dimensions"
    return "is a clock with dimensions" if v.type == "Clock" and v.dimensions else ""


def _max_size(v: Variable) -> str:
    sizes = [len(value) for value in _flat(v) if isinstance(value, bytes)]
    if v.max_size is not None and max(sizes, default=0) > v.max_size:
        return f"starts with {max(sizes)} bytes; its maxSize is {v.max_size}"
    return ""


RULES: tuple[Callable[[Variable], str], ...] = (
    _combination,
    _initial,
    _structural,
    _bounds,
    _start,
    _float32,
    _enumeration,
    _clocked,
    _max_size,
)


# ---- rules for all together ----


def _check_independent(variables: Iterable[Variable], where: str) -> None:
    found = [v for v in variables if v.causality == "independent"]
    for v in found:
        if v.type not in REALS or v.array:
            raise _error(where, v, f"is the independent variable, but {v.type}{' array' * v.array}")
    if len({v.vr for v in found}) > 1:
        raise _error(where, found[1], f"is a second independent variable beside '{found[0].name}'")


def _check_aliases(variables: Iterable[Variable], where: str) -> None:
    """FMI 2: variables of one base type and one value reference are one; only one of them may be set."""
    settable: dict[tuple[str, int], Variable] = {}
    for v in variables:
        if v.causality in SETTABLE:
            key = ("Integer" if v.type == "Enumeration" else v.type, v.vr)
            other = settable.setdefault(key, v)
            if other is not v:
                raise _error(where, v, f"is {v.causality} with the value reference {v.vr} of '{other.name}'")


def _flat(v: Variable) -> tuple[Scalar, ...]:
    if v.start is None:
        return ()
    return v.start if isinstance(v.start, tuple) else (v.start,)


def _outside(v: Variable) -> Scalar | None:
    """The first start value that is out of the bounds."""
    low = -math.inf if v.min is None else v.min
    high = math.inf if v.max is None else v.max
    if v.min is None and v.max is None:
        return None
    numbers = (value for value in _flat(v) if not isinstance(value, str | bytes))
    return next((value for value in numbers if not low <= value <= high), None)


def _error(where: str, variable: Variable, message: str) -> InputError:
    return InputError(f"{where} line {variable.line}: variable '{variable.name}' {message}")


VARIABLE = {"name", "valueReference", "description", "causality", "variability"} | {
    "canHandleMultipleSetPerTimeInstant"
}
REAL = {"quantity", "unit", "displayUnit", "relativeQuantity", "unbounded", "min", "max", "nominal"} | {
    "start",
    "derivative",
    "reinit",
}
WHOLE = {"quantity", "min", "max", "start"}
TYPED3 = VARIABLE | {"clocks", "intermediateUpdate", "previous", "declaredType", "initial"}
CLOCK = VARIABLE | {"clocks", "declaredType", "canBeDeactivated", "priority", "intervalVariability"}
TIMES = {
    "intervalDecimal",
    "shiftDecimal",
    "supportsFraction",
    "resolution",
    "intervalCounter",
    "shiftCounter",
}
BOTH = {"modelIdentifier", "needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess"} | {
    "canHandleVariableCommunicationStepSize",
    "maxOutputDerivativeOrder",
}
ROOT = {"fmiVersion", "modelName", "description", "author", "version", "copyright", "license"} | {
    "generationTool",
    "generationDateAndTime",
    "variableNamingConvention",
}

KNOWN = {
    2: {
        "fmiModelDescription": ROOT | {"guid", "numberOfEventIndicators"},
        "CoSimulation": BOTH
        | {"canInterpolateInputs", "canRunAsynchronuously", "canNotUseMemoryManagementFunctions"}
        | {"canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"},
        "DefaultExperiment": {"startTime", "stopTime", "tolerance", "stepSize"},
        "ScalarVariable": VARIABLE | {"initial"},
        "Real": REAL | {"declaredType"},
        "Integer": WHOLE | {"declaredType"},
        "Enumeration": WHOLE | {"declaredType"},
        "Boolean": {"declaredType", "start"},
        "String": {"declaredType", "start"},
    },
    3: {
        "fmiModelDescription": ROOT | {"instantiationToken"},
        "CoSimulation": BOTH
        | {"canGetAndSetFMUState", "canSerializeFMUState", "providesDirectionalDerivatives"}
        | {"providesAdjointDerivatives", "providesPerElementDependencies", "providesEvaluateDiscreteStates"}
        | {"fixedInternalStepSize", "recommendedIntermediateInputSmoothness", "providesIntermediateUpdate"}
        | {"mightReturnEarlyFromDoStep", "canReturnEarlyAfterIntermediateUpdate", "hasEventMode"},
        "DefaultExperiment": {"startTime", "stopTime", "tolerance", "stepSize"},
        **{f"Float{bits}": TYPED3 | REAL for bits in (32, 64)},
        **{f"{sign}Int{bits}": TYPED3 | WHOLE for sign in ("", "U") for bits in (8, 16, 32, 64)},
        "Enumeration": TYPED3 | WHOLE,
        "Boolean": TYPED3 | {"start"},
        "String": TYPED3,
        "Binary": TYPED3 | {"mimeType", "maxSize"},
        "Clock": CLOCK | TIMES,
        "Dimension": {"start", "valueReference"},
        "Start": {"value"},
        "Alias": {"name", "description", "displayUnit"},
    },
}


def unknown_attributes(root: Element, version: int) -> Iterator[str]:
    """A sentence on the attributes that are ignored because the standard does not know them."""
    unknown: dict[str, int] = {}
    variables = root.find("ModelVariables")
    elements = [root, *root.iterfind("CoSimulation"), *root.iterfind("DefaultExperiment")]
    for holder in () if variables is None else variables:
        elements += [holder, *(child for child in holder if child.tag != "Annotations")]
    for element in elements:
        known = KNOWN[version].get(local(element))
        for name in element.attrib if known is not None else ():
            if str(name) not in (known or ()) and not str(name).startswith("{"):
                unknown.setdefault(f"{local(element)}.{name}", element.sourceline or 0)
    if unknown:
        shown = listed([f"{shortened(name)} (line {line})" for name, line in unknown.items()])
        yield f"attributes that FMI {version}.0 does not know are ignored: {shown}"
