"""Seeds with what the small systems of the tests lack: every form of SSP 2.0 and every type of FMI 3."""

from collections.abc import Callable, Iterator

from orchestrator.fmi.variable import FMI3_TYPES
from tests.orchestrator.fuzz.case import Case

SPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for short, name in {
        "ssd": "Description",
        "ssc": "Common",
        "ssv": "ParameterValues",
        "ssm": "ParameterMapping",
        "ssb": "SignalDictionary",
    }.items()
)
STARTS = {"Boolean": "true", "Enumeration": "1", "Float64": "0.5", "Float32": "2"}
STATED = '"constant" intervalDecimal="0.02" shiftDecimal="0.04"'  # of the clock
GEAR = (
    '<ssc:Enumerations><ssc:Enumeration name="Gear"><ssc:Item name="park" value="0"/>'
    '<ssc:Item name="drive" value="1"/></ssc:Enumeration></ssc:Enumerations>'
)
UNITS = (
    '<ssc:Units><ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>'
    '<ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit></ssc:Units>'
)


def cases(described: Callable[[str], dict[str, str]]) -> Iterator[Case]:
    """The seeds; `described` makes the parts of an FMU from its description."""
    fmu = described(_description())
    files = {"values.ssv": _values(), "names.ssm": _mapping(), "words.ssb": _dictionary()}
    for algorithm in ("jacobi", "gauss-seidel", "iterate", "adaptive"):
        ssd = _structure(algorithm)
        yield Case("ssp", {"SystemStructure.ssd": ssd, **files}, {"resources/all.fmu": fmu})
    # arrays whose size a parameter set decides, without bounds
    free = described(_description().replace(' min="0" max="5"', ""))
    row, end = "<ssc:Float64/>", "</ssd:Connector>"
    loose = _structure("jacobi").replace(f'{row}<ssc:Dimension size="2"/>{end}', row + end)
    yield Case("ssp", {"SystemStructure.ssd": loose, **files}, {"resources/all.fmu": free})
    yield Case("fmu", {}, {"all.fmu": fmu})
    for description in _clocked():
        yield Case("fmu", {}, {"all.fmu": described(description)})
    yield Case("ssp", {"SystemStructure.ssd": _parameters()}, {"all.fmu": fmu})
    part = _part("all.fmu")
    inner = Case("ssp", {"SystemStructure.ssd": part, "odd name.ssd": part}, {"all.fmu": fmu})
    packed = inner.archive(False).decode("latin-1")
    others = {"SystemStructure.ssd": _files(), "sub/other.ssd": _part("../all.fmu"), "pack.ssp": packed}
    yield Case("ssp", others, {"all.fmu": fmu})


def _system(inner: str, more: str = "") -> str:
    return (
        f'<?xml version="1.0"?><ssd:SystemStructureDescription {SPACES} version="2.0" name="part">'
        f'<ssd:System name="part">{inner}</ssd:System>{GEAR}{UNITS}{more}</ssd:SystemStructureDescription>'
    )


def _part(source: str) -> str:
    """A system with an input, an output and a parameter of its own."""
    kinds = {
        "float64_in": "input",
        "float64_out": "output",
        "float64": "parameter",
        "n": "structuralParameter",
    }
    types = {"n": "UInt64"}
    own = "".join(_connector(name, kind, types.get(name, "Float64")) for name, kind in kinds.items())
    links = "".join(
        f'<ssd:Connection startConnector="{name}" endElement="all" endConnector="{name}"/>'
        if kind != "output"
        else f'<ssd:Connection startElement="all" startConnector="{name}" endConnector="{name}"/>'
        for name, kind in kinds.items()
    )
    size = '<ssc:Dimension sizeConnector="n"/>'
    row = f'<ssd:Connector name="row_in" kind="input"><ssc:Float64/>{size}</ssd:Connector>'
    return _system(
        f"<ssd:Connectors>{own}</ssd:Connectors>{_inline('n', 'UInt64', '3')}<ssd:Elements>"
        f'<ssd:Component name="all" source="{source}"><ssd:Connectors>{own}{row}</ssd:Connectors>'
        "</ssd:Component>"
        f"</ssd:Elements><ssd:Connections>{links}</ssd:Connections>"
    )


def _inline(name: str, kind: str, value: str) -> str:
    """A binding with one value written in place."""
    return (
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"
        '<ssv:ParameterSet version="2.0" name="p">'
        f'<ssv:Parameters><ssv:Parameter name="{name}"><ssv:{kind} value="{value}"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>"
        "</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def _parameters() -> str:
    """Values that travel along connections, a component without a source, and a constant."""
    system = "".join(
        _connector(name, kind, "Float64") for name, kind in (("gain", "parameter"), ("shared", "input"))
    )
    own = "".join(
        _connector(name, kind, "Float64")
        for name, kind in (("float64", "parameter"), ("float64_in", "input"), ("float64_out", "output"))
    )
    halve = '<ssc:LinearTransformation factor="0.5"/>'
    return _system(
        f"<ssd:Connectors>{system}</ssd:Connectors>{_inline('gain', 'Float64', '3')}<ssd:Elements>"
        f'<ssd:Component name="a" source="all.fmu"><ssd:Connectors>{own}</ssd:Connectors></ssd:Component>'
        f'<ssd:Component name="b" source="all.fmu" implementation="CoSimulation"><ssd:Connectors>{own}'
        f"</ssd:Connectors></ssd:Component></ssd:Elements><ssd:Connections>"
        f'<ssd:Connection startConnector="gain" endElement="a" endConnector="float64">{halve}'
        "</ssd:Connection>"
        '<ssd:Connection startConnector="shared" endElement="a" endConnector="float64_in"/>'
        '<ssd:Connection startElement="a" startConnector="float64_out" endElement="b" '
        f'endConnector="float64_in">{halve}</ssd:Connection></ssd:Connections>',
        '<ssd:DefaultExperiment startTime="1" stopTime="2"/><ssd:SSDVariant baseSSD="x.ssd"/>',
    )


def _files() -> str:
    """Systems of other files: an SSD in a folder, a package, and one of this file by its id."""
    outer = _connector("float64_in", "input", "Float64") + _connector("float64_out", "output", "Float64")
    component = (
        '<ssd:Component name="{}" type="application/x-ssp-{}" source="{}">'
        "<ssd:Connectors>{}</ssd:Connectors></ssd:Component>"
    )
    named = _part("all.fmu")
    system = named[named.index("<ssd:System ") : named.index("</ssd:System>")] + "</ssd:System>"
    return _system(
        "<ssd:Elements>"
        + component.format("sub", "definition", "sub/other.ssd", outer)
        + component.format("pack", "package", "pack.ssp", outer)
        + component.format("odd", "package", "pack.ssp#odd%20name.ssd", outer)
        + component.format("again", "definition", "#mine", outer)
        + system.replace("<ssd:System ", '<ssd:System id="mine" ')
        + "</ssd:Elements><ssd:Connections>"
        '<ssd:Connection startElement="sub" startConnector="float64_out" endElement="pack" '
        'endConnector="float64_in"/></ssd:Connections>'
    )


def _description() -> str:
    """An FMU with an input, an output and a parameter of each type, arrays, clocks and aliases."""
    items = '<Item name="park" value="0"/><Item name="drive" value="1"/>'
    types = f'<TypeDefinitions><EnumerationType name="Gear">{items}</EnumerationType></TypeDefinitions>'
    unit = '<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit></UnitDefinitions>'
    variables = [
        '<Float64 name="time" valueReference="0" causality="independent"/>',
        '<UInt64 name="n" valueReference="1" causality="structuralParameter" start="2" min="0" max="5"/>',
        f'<Clock name="tick" valueReference="2" causality="input" intervalVariability={STATED}/>',
        '<Float64 name="row_in" valueReference="3" causality="input" start="1 2">'
        '<Dimension valueReference="1"/></Float64>',
        '<Float64 name="row_out" valueReference="4" causality="output"><Dimension valueReference="1"/>'
        '<Alias name="row_too"/></Float64>',
        '<Int32 name="sampled" valueReference="5" causality="input" start="0" clocks="2"/>',
        '<Float64 name="matrix" valueReference="6" causality="parameter" variability="tunable" start="0">'
        '<Dimension start="2"/><Dimension start="2"/></Float64>',
        *(_variable(name, 10 + 3 * i) for i, name in enumerate(FMI3_TYPES) if name != "Clock"),
    ]
    outputs = [4, *(11 + 3 * i for i, name in enumerate(FMI3_TYPES) if name != "Clock")]
    structure = "".join(f'<Output valueReference="{vr}" dependencies="{vr - 1}"/>' for vr in outputs)
    return (
        '<fmiModelDescription fmiVersion="3.0" modelName="all" instantiationToken="all">'
        '<CoSimulation modelIdentifier="all" hasEventMode="true" canGetAndSetFMUState="true" '
        f'canHandleVariableCommunicationStepSize="true"/>{unit}{types}'
        '<DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>'
        f"<ModelVariables>{''.join(variables)}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def _clocked() -> Iterator[str]:
    """The same with clocks of each kind, ticks inside steps, and scheduled execution."""
    text, fraction = _description(), 'supportsFraction="true"'
    kinds = [f'"{kind}"' for kind in ("fixed", "tunable", "changing", "countdown")]
    for told in (
        *kinds,
        f'"fixed" {fraction}',
        f'"countdown" {fraction}',
        '"constant" intervalDecimal="0.003"',
    ):
        yield text.replace(STATED, told)
    flags = text[text.index(' hasEventMode="true"') : text.index("/>", text.index(' hasEventMode="true"'))]
    partitions = text.replace(flags, "").replace("<CoSimulation", "<ScheduledExecution")
    for told in (STATED, '"countdown"'):
        yield partitions.replace(STATED, f'{told} priority="1"')


def _variable(name: str, vr: int) -> str:
    inner = {"String": '<Start value="a"/>', "Binary": '<Start value="00ff"/>'}.get(name, "")
    start = "" if inner else f'start="{STARTS.get(name, "1")}"'
    more = {"Enumeration": 'declaredType="Gear"', "Float64": 'unit="K"'}.get(name, "")
    lower = name.lower()
    return (
        f'<{name} name="{lower}_in" valueReference="{vr}" causality="input" {start} {more}>{inner}</{name}>'
        f'<{name} name="{lower}_out" valueReference="{vr + 1}" causality="output" {more}/>'
        f'<{name} name="{lower}" valueReference="{vr + 2}" causality="parameter" variability="tunable" '
        f"{start} {more}>{inner}</{name}>"
    )


def _connector(name: str, kind: str, type_: str) -> str:
    inner = {"Enumeration": ' name="Gear"', "Binary": ' mime-type="application/octet-stream"'}.get(type_, "")
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{type_}{inner}/></ssd:Connector>'


def _structure(algorithm: str) -> str:
    """Two of these FMUs, one in a system of its own; a dictionary between them."""
    types = [name for name in FMI3_TYPES if name != "Clock"]
    own = [_connector(f"{t.lower()}_{way}", f"{way}put", t) for t in types for way in ("in", "out")]
    row = (
        '<ssd:Connector name="row_{0}" kind="{0}put"><ssc:Float64/><ssc:Dimension size="2"/></ssd:Connector>'
    )
    two = '<ssc:Dimension size="2"/>'
    matrix = _connector("matrix", "parameter", "Float64").replace("</ssd:C", f"{two}{two}</ssd:C")
    rows = [row.format("in"), row.format("out"), matrix]
    bindings = (
        '<ssd:ParameterBindings><ssd:ParameterBinding prefix="" source="values.ssv">'
        '<ssd:ParameterMapping source="names.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>'
    )
    component = (
        '<ssd:Component name="{}" source="resources/all.fmu"><ssd:Connectors>{}</ssd:Connectors>{}'
        "</ssd:Component>"
    )
    first = component.format("first", "".join(own + rows), bindings)
    inner = component.format("deep", "".join(own + rows), "")
    through = "".join(
        f'<ssd:Connection startConnector="{t.lower()}_in" endElement="deep" endConnector="{t.lower()}_in"/>'
        f'<ssd:Connection startElement="deep" startConnector="{t.lower()}_out" '
        f'endConnector="{t.lower()}_out"/>'
        for t in types
    )
    nested = (
        f'<ssd:System name="inner"><ssd:Connectors>{"".join(own)}</ssd:Connectors>'
        f"<ssd:Elements>{inner}</ssd:Elements><ssd:Connections>{through}</ssd:Connections></ssd:System>"
    )
    links = "".join(_connection(t) for t in types)
    # the dictionary carries one signal from the first to the system's output
    reference = (
        '<ssd:SignalDictionaryReference name="words" dictionary="words"><ssd:Connectors>'
        + _connector("speed", "inout", "Float64") + "</ssd:Connectors></ssd:SignalDictionaryReference>"
    )  # fmt: skip
    words = (
        '<ssd:SignalDictionaries><ssd:SignalDictionary name="words" source="words.ssb"/>'
        "</ssd:SignalDictionaries>"
    )
    return (
        f'<?xml version="1.0"?><ssd:SystemStructureDescription {SPACES} version="2.0" name="rich">'
        f'<ssd:System name="rich"><ssd:Connectors>{_connector("drive", "input", "Float64")}'
        f"{_connector('shown', 'output', 'Float64')}</ssd:Connectors>"
        f"<ssd:Elements>{first}{nested}{reference}</ssd:Elements><ssd:Connections>{links}"
        '<ssd:Connection startElement="first" startConnector="row_out" endElement="first" '
        'endConnector="row_in"/>'
        '<ssd:Connection startElement="words" startConnector="speed" endConnector="shown"/>'
        '<ssd:Connection startElement="inner" startConnector="float64_out" endElement="words" '
        'endConnector="speed"/>'
        f"</ssd:Connections>{words}</ssd:System>{GEAR}{UNITS}"
        '<ssd:DefaultExperiment stopTime="1"/><ssd:Annotations><ssc:Annotation type="slewright.simulation">'
        '<slw:Simulation xmlns:slw="urn:slewright:simulation" stepSize="0.01" '
        f'algorithm="{algorithm}" tolerance="1e-3" maxIterations="7" maxHalvings="2">'
        '<slw:Component name="inner.deep" stepSize="0.02"/>'
        '<slw:Fault target="inner.deep.float64_in" kind="bias" start_s="0.01" value="1"/>'
        "</slw:Simulation></ssc:Annotation></ssd:Annotations></ssd:SystemStructureDescription>"
    )


def _connection(name: str) -> str:
    """From the first FMU into the nested system, with the transformation that fits the type."""
    entry = '<ssc:MapEntry source="{}" target="{}"/>'
    inner = {
        "Float64": '<ssc:LinearTransformation factor="2" offset="1"/>',
        "Int32": f"<ssc:IntegerMappingTransformation>{entry.format(1, 2)}</ssc:IntegerMappingTransformation>",
        "Boolean": "<ssc:BooleanMappingTransformation>" + entry.format("true", "false")
        + entry.format("false", "true") + "</ssc:BooleanMappingTransformation>",
        "Enumeration": "<ssc:EnumerationMappingTransformation>" + entry.format("park", "drive")
        + entry.format("drive", "park") + "</ssc:EnumerationMappingTransformation>",
    }.get(name, "")  # fmt: skip
    lower = name.lower()
    return (
        f'<ssd:Connection startElement="first" startConnector="{lower}_out" endElement="inner" '
        f'endConnector="{lower}_in">{inner}</ssd:Connection>'
    )


def _values() -> str:
    values = {
        "temperature": '<ssv:Float64 value="20" unit="degC"/>',
        "gear": '<ssv:Enumeration value="drive" name="Gear"/>',
        "square": '<ssv:Float64 value="1 2 3 4"/><ssc:Dimension size="2"/><ssc:Dimension size="2"/>',
        "label": '<ssv:String value="x"/>',
        "bytes": '<ssv:Binary value="00ff"/>',
        "on": '<ssv:Boolean value="true"/>',
        "n": '<ssv:UInt64 value="2"/>',
    }
    parameters = "".join(
        f'<ssv:Parameter name="{name}">{value}</ssv:Parameter>' for name, value in values.items()
    )
    return (
        f'<ssv:ParameterSet {SPACES} version="2.0" name="set"><ssv:Parameters>{parameters}</ssv:Parameters>'
        f"{GEAR.replace('ssc:Enumerations', 'ssv:Enumerations')}{UNITS.replace('ssc:Units', 'ssv:Units')}"
        "</ssv:ParameterSet>"
    )


def _mapping() -> str:
    names = {"temperature": "float64", "gear": "enumeration", "square": "matrix", "label": "string"} | {
        "bytes": "binary",
        "on": "boolean",
        "n": "n",
    }
    entries = "".join(f'<ssm:MappingEntry source="{s}" target="{t}"/>' for s, t in names.items())
    return f'<ssm:ParameterMapping {SPACES} version="2.0">{entries}</ssm:ParameterMapping>'


def _dictionary() -> str:
    return (
        f'<ssb:SignalDictionary {SPACES} version="2.0"><ssb:DictionaryEntry name="speed">'
        f"<ssc:Float64 unit='K'/></ssb:DictionaryEntry>"
        f"{UNITS.replace('ssc:Units', 'ssb:Units')}</ssb:SignalDictionary>"
    )
