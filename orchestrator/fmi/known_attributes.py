"""The attributes that FMI 2.0 and 3.0 know in modelDescription.xml: any other one is warned about.

Foreign attributes (in a namespace) and everything below Annotations are nobody's business here.
Source: fmi2ModelDescription.xsd and fmi3ModelDescription.xsd with what they include.
"""

from collections.abc import Iterator

from orchestrator.files.xml_file import Element, local, shortened

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


def warnings(root: Element, version: int) -> Iterator[str]:
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
        some = [f"{shortened(name)} (line {line})" for name, line in list(unknown.items())[:5]]
        more = f" … ({len(unknown)} in all)" if len(unknown) > 5 else ""
        yield f"attributes that FMI {version}.0 does not know are ignored: {', '.join(some)}{more}"
