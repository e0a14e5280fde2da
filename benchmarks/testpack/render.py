"""The parts of a system structure description as text, one element a line.

Texts are of SSP 1.0 and FMI 2; `for_version` makes them those of SSP 2.0 and FMI 3: types have other names.
"""

import re
from collections.abc import Iterable, Mapping
from xml.sax.saxutils import quoteattr

from benchmarks.testpack.models import ENUMERATIONS, UNITS

SSP = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = (
    f'xmlns:ssd="{SSP}Description" xmlns:ssc="{SSP}Common" xmlns:ssv="{SSP}ParameterValues"\n'
    f' xmlns:ssm="{SSP}ParameterMapping" xmlns:ssb="{SSP}SignalDictionary"'
)
VERSION = "@SSP@"  # stands for the version of SSP
PARAMETER_SET = "values"  # the name of all of them: some importers apply one by its name
XML = '<?xml version="1.0" encoding="UTF-8"?>'
TYPES = {"Real": "Float64", "Integer": "Int32"}
TYPE = re.compile(r"<(ssc|ssv):(Real|Integer)\b")


def for_version(text: str, fmi_version: int) -> str:
    """The text for FMI 2 and SSP 1.0, or for FMI 3 and SSP 2.0."""
    if fmi_version == 3:
        text = TYPE.sub(lambda found: f"<{found[1]}:{TYPES[found[2]]}", text)
    return text.replace(VERSION, "1.0" if fmi_version == 2 else "2.0")


def attributes(values: Mapping[str, object]) -> str:
    """` a="1" b="2"`, without those that are empty."""
    return "".join(f" {name}={quoteattr(str(value))}" for name, value in values.items() if value != "")


def lines(*parts: str) -> str:
    """One part a line, without empty ones."""
    return "\n".join(part for part in parts if part)


def holder(tag: str, parts: Iterable[str]) -> str:
    """`<ssd:tag>` around the parts, or nothing where there are none."""
    inner = lines(*parts)
    return f"<ssd:{tag}>\n{inner}\n</ssd:{tag}>" if inner else ""


# ---- connectors and elements ----


def connector(name: str, kind: str, type: str = "Real", inner: str = "", /, **more: str) -> str:
    """A connector; `more`: attributes of its type, `inner`: elements behind it; type "": none stated."""
    typed = f"<ssc:{type}{attributes(more)}/>" if type else ""
    return f"<ssd:Connector{attributes({'name': name, 'kind': kind})}>{typed}{inner}</ssd:Connector>"


def takes(name: str, type: str = "Real", inner: str = "", /, **more: str) -> str:
    """An input."""
    return connector(name, "input", type, inner, **more)


def gives(name: str, type: str = "Real", inner: str = "", /, **more: str) -> str:
    """An output."""
    return connector(name, "output", type, inner, **more)


def size(number: int | str) -> str:
    """A dimension of an array (SSP 2.0)."""
    return f'<ssc:Dimension size="{number}"/>'


def component(name: str, fmu: str, /, *connectors: str, bindings: str = "", **more: str) -> str:
    """A component; `fmu`: its file in resources/, or a whole path of another kind of source."""
    source = fmu if "/" in fmu or "." in fmu or "#" in fmu else f"resources/{fmu}.fmu"
    opening = f"<ssd:Component{attributes({'name': name, 'source': source, **more})}>"
    return lines(opening, holder("Connectors", connectors), bindings, "</ssd:Component>")


def system(
    name: str,
    elements: Iterable[str],
    connections: Iterable[str] = (),
    connectors: Iterable[str] = (),
    bindings: str = "",
    dictionaries: str = "",
) -> str:
    """A system, the outermost or an inner one."""
    return lines(
        f"<ssd:System name={quoteattr(name)}>",
        holder("Connectors", connectors),
        bindings,
        holder("Elements", elements),
        holder("Connections", connections),
        dictionaries,
        "</ssd:System>",
    )


# ---- connections ----


def connection(source: str, target: str, inner: str = "", /, **more: str) -> str:
    """From "component.connector" (or a system connector, without a dot) to another."""
    ends: dict[str, object] = {}
    for side, end in (("start", source), ("end", target)):
        element, _, name = end.rpartition(".")
        ends |= {f"{side}Element": element, f"{side}Connector": name}
    return f"<ssd:Connection{attributes({**ends, **more})}>{inner}</ssd:Connection>"


def linear(factor: float, offset: float = 0.0) -> str:
    """A linear transformation."""
    return f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>'


def mapping(kind: str, pairs: Mapping[object, object]) -> str:
    """A Boolean, Integer or Enumeration mapping."""
    entries = "".join(f'<ssc:MapEntry source="{a}" target="{b}"/>' for a, b in pairs.items())
    return f"<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>"


# ---- parameters ----


def value(name: str, type: str, value: object, inner: str = "", **more: str) -> str:
    """One parameter of a set."""
    return (
        f"<ssv:Parameter name={quoteattr(name)}><ssv:{type}{attributes({'value': value, **more})}/>{inner}"
        "</ssv:Parameter>"
    )


def parameter_set(*values: str, units: bool = False) -> str:
    """A parameter set, to stand inline or (behind XML) in a file."""
    return lines(
        f'<ssv:ParameterSet {NAMESPACES} version="{VERSION}" name="{PARAMETER_SET}">',
        "<ssv:Parameters>",
        *values,
        "</ssv:Parameters>",
        _units("ssv") if units else "",
        "</ssv:ParameterSet>",
    )


def binding(*values: str, source: str = "", mapping: str = "", **more: str) -> str:
    """A parameter binding with its values inline, or in the file `source`."""
    inner = "" if source else lines("<ssd:ParameterValues>", parameter_set(*values), "</ssd:ParameterValues>")
    opening = f"<ssd:ParameterBinding{attributes({'source': source, **more})}>"
    return lines(opening, inner, mapping, "</ssd:ParameterBinding>")


def bindings(*items: str) -> str:
    """Bindings of an element, in their order."""
    return holder("ParameterBindings", items)


def parameter_mapping(*entries: str) -> str:
    """A parameter mapping, to stand inline or (behind XML) in a file."""
    return lines(
        f'<ssm:ParameterMapping {NAMESPACES} version="{VERSION}">', *entries, "</ssm:ParameterMapping>"
    )


def entry(source: str, target: str, inner: str = "", **more: str) -> str:
    """One entry of a parameter mapping."""
    named = attributes({"source": source, "target": target, **more})
    return f"<ssm:MappingEntry{named}>{inner}</ssm:MappingEntry>"


# ---- the whole ----


def _units(prefix: str = "ssd") -> str:
    units = [
        f'<ssc:Unit name="{n}"><ssc:BaseUnit{attributes(base)}/></ssc:Unit>' for n, base in UNITS.items()
    ]
    return lines(f"<{prefix}:Units>", *units, f"</{prefix}:Units>")


def _enumerations() -> str:
    found = []
    for name, items in ENUMERATIONS.items():
        inner = "".join(f'<ssc:Item name="{n}" value="{v}"/>' for n, v in items.items())
        found.append(f'<ssc:Enumeration name="{name}">{inner}</ssc:Enumeration>')
    return lines("<ssd:Enumerations>", *found, "</ssd:Enumerations>")


def annotation(step: float | str, inner: str = "", **more: str) -> str:
    """What SSP leaves to importers: the step size, in this project's annotation. Others may ignore it."""
    named = attributes({"stepSize": step, **more})
    return lines(
        "<ssd:Annotations>",
        '<ssc:Annotation type="slewright.simulation">',
        f'<slw:Simulation xmlns:slw="urn:slewright:simulation"{named}>',
        inner,
        "</slw:Simulation>",
        "</ssc:Annotation>",
        "</ssd:Annotations>",
    )


def joined(start: str, end: str) -> str:
    """A connection of two terminals, "component.terminal", in this project's annotation."""
    (one, mine), (other, theirs) = (text.split(".") for text in (start, end))
    ends = {"startElement": one, "startTerminal": mine, "endElement": other, "endTerminal": theirs}
    return f"<slw:TerminalConnection{attributes(ends)}/>"


def ssd(
    system: str, step: float | str = 0.1, stop: float = 0.8, annotated: str = "", name: str = "case"
) -> str:
    """A whole description around its outermost system; `annotated` replaces the annotation."""
    return (
        lines(
            XML,
            f'<ssd:SystemStructureDescription {NAMESPACES} version="{VERSION}" name="{name}">',
            system,
            _enumerations(),
            _units(),
            f'<ssd:DefaultExperiment startTime="0" stopTime="{stop}"/>',
            annotated or annotation(step),
            "</ssd:SystemStructureDescription>",
        )
        + "\n"
    )
