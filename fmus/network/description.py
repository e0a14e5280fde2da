"""What an importer reads of an FMU on networks: model description, terminals, FMI-LS-BUS's manifest."""

from lxml import etree

from fmus.network.definition import PORT_MEMBERS, PORT_VR, TIME_VR, NetworkFmu, Number
from fmus.toolchain.description import TOOL
from specs.units import known
from specs.version import VERSION

ROOM = 4096  # bytes of a binary: NW_ROOM in operations.h
MIME = 'application/org.fmi-standard.fmi-ls-bus.can; version="1.0.0"'
KIND, RULE = "org.fmi-ls-bus.network-terminal", "org.fmi-ls-bus.transceiver"
MANIFEST = "extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml"
LS = "http://fmi-standard.org/fmi-ls-manifest"
NAME, STANDARD = "org.fmi-standard.fmi-ls-bus", "1.0.0"


def files(fmu: NetworkFmu, token: str) -> dict[str, bytes]:
    """The files by their place in the archive."""
    return {
        "modelDescription.xml": _text(_description(fmu, token)),
        "terminalsAndIcons/terminalsAndIcons.xml": _text(_terminals(fmu)),
        MANIFEST: _text(_manifest(fmu)),
    }


def _description(fmu: NetworkFmu, token: str) -> etree._Element:
    about = {"fmiVersion": "3.0", "modelName": fmu.name, "instantiationToken": token}
    about |= {"description": fmu.description, "license": "Apache-2.0", "version": VERSION}
    root = etree.Element("fmiModelDescription", about, generationTool=TOOL)
    root.set("variableNamingConvention", "structured")
    abilities = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUState", "canSerializeFMUState")
    flags = dict.fromkeys((*abilities, "hasEventMode"), "true")
    etree.SubElement(root, "CoSimulation", {"modelIdentifier": fmu.name, **flags})
    _units(root, fmu)
    box = etree.SubElement(root, "LogCategories")
    etree.SubElement(box, "Category", name="logStatusError", description="Failures, with their reason")
    etree.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize=repr(fmu.step_s))
    _variables(etree.SubElement(root, "ModelVariables"), fmu)
    _structure(etree.SubElement(root, "ModelStructure"), fmu)
    return root


def _units(root: etree._Element, fmu: NetworkFmu) -> None:
    box = etree.SubElement(root, "UnitDefinitions")
    for name in sorted({n.known_unit for n in fmu.numbers} - {""} | {"s"}):
        unit = known(name)
        base = {k: str(n) for k, n in unit.exponents.items() if n} if unit else {}
        base |= {"factor": repr(unit.factor)} if unit and unit.factor != 1.0 else {}
        etree.SubElement(etree.SubElement(box, "Unit", name=name), "BaseUnit", base)


def _variables(box: etree._Element, fmu: NetworkFmu) -> None:
    time = {"name": "time", "valueReference": str(TIME_VR), "causality": "independent", "unit": "s"}
    etree.SubElement(box, "Float64", {**time, "variability": "continuous"})
    for port, name in enumerate(fmu.ports):
        rx_data, tx_data, rx_clock, tx_clock = (PORT_VR + 4 * port + i for i in range(4))
        _binary(box, f"{name}.Rx_Data", rx_data, "input", rx_clock)
        _binary(box, f"{name}.Tx_Data", tx_data, "output", tx_clock)
        _clock(box, f"{name}.Rx_Clock", rx_clock, "input")
        _clock(box, f"{name}.Tx_Clock", tx_clock, "output")
    for number in fmu.numbers:
        etree.SubElement(box, number.type, _attributes(number))


def _binary(box: etree._Element, name: str, vr: int, causality: str, clock: int) -> None:
    initial = "exact" if causality == "input" else "calculated"
    about = {"name": name, "valueReference": str(vr), "causality": causality, "variability": "discrete"}
    about |= {"clocks": str(clock), "maxSize": str(ROOM), "mimeType": MIME}
    if causality == "output":
        about["initial"] = initial
    element = etree.SubElement(box, "Binary", about)
    if causality == "input":
        etree.SubElement(element, "Start", value="")


def _clock(box: etree._Element, name: str, vr: int, causality: str) -> None:
    about = {"name": name, "valueReference": str(vr), "causality": causality, "variability": "discrete"}
    etree.SubElement(box, "Clock", {**about, "intervalVariability": "triggered"})


def _attributes(n: Number) -> dict[str, str]:
    found = {"name": n.name, "valueReference": str(n.vr), "causality": n.causality}
    found |= {"description": n.description} if n.description else {}
    settable = n.causality in ("parameter", "structuralParameter")
    found["variability"] = ("tunable" if n.tunable else "fixed") if settable else "discrete"
    if n.causality == "output":
        found["initial"] = "calculated"
    else:
        found["start"] = _value(n, n.start)
    if n.type != "Boolean":
        limits = (("min", n.min), ("max", n.max))
        found |= {key: _value(n, x) for key, x in limits if x is not None}
    if n.type == "Float64" and n.known_unit:
        found["unit"] = n.known_unit
    return found


def _value(n: Number, x: float) -> str:
    if n.type == "Boolean":
        return "true" if x else "false"
    return repr(float(x)) if n.type == "Float64" else str(int(x))


def _structure(box: etree._Element, fmu: NetworkFmu) -> None:
    """No output depends on an input at once: what is sent leaves at the end of a step."""
    outputs = [n.vr for n in fmu.numbers if n.causality == "output"]
    sent = [PORT_VR + 4 * port + i for port in range(len(fmu.ports)) for i in (1, 3)]
    for vr in (*sent, *outputs):
        etree.SubElement(box, "Output", valueReference=str(vr), dependencies="")
    for vr in (*sent[1::2], *outputs):  # not what is clocked
        etree.SubElement(box, "InitialUnknown", valueReference=str(vr), dependencies="")


def _terminals(fmu: NetworkFmu) -> etree._Element:
    root = etree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    holder = etree.SubElement(root, "Terminals")
    for name in fmu.ports:
        terminal = etree.SubElement(holder, "Terminal", name=name, matchingRule=RULE, terminalKind=KIND)
        for member in PORT_MEMBERS:
            _member(terminal, f"{name}.{member}", member)
        if fmu.configuration:
            about = {"name": "Configuration", "matchingRule": "bus", "terminalKind": f"{KIND}.configuration"}
            inner = etree.SubElement(terminal, "Terminal", about)
            for member, variable in fmu.configuration.items():
                _member(inner, variable, member)
    return root


def _member(terminal: etree._Element, variable: str, member: str) -> None:
    about = {"variableName": variable, "memberName": member, "variableKind": "signal"}
    etree.SubElement(terminal, "TerminalMemberVariable", about)


def _manifest(fmu: NetworkFmu) -> etree._Element:
    about = {f"{{{LS}}}fmi-ls-name": NAME, f"{{{LS}}}fmi-ls-version": STANDARD}
    about[f"{{{LS}}}fmi-ls-description"] = "Network communication of CAN as operations (low cut)"
    root = etree.Element("fmiLayeredStandardManifest", about, nsmap={"fmi-ls": LS})
    root.set("isBusSimulationFMU", "true" if fmu.is_bus else "false")
    return root


def _text(root: etree._Element) -> bytes:
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
