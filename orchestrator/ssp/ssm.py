"""Reads a parameter mapping (SSM): what the parameters of a set are called where they go (SSP 2.0, 7)."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.ssp.conversion import Transformation
from orchestrator.ssp.ssc import read_transformation
from orchestrator.ssp.ssv import ParameterValue
from orchestrator.ssp.text import Place, Text
from specs.errors import InputError


@dataclass(frozen=True)
class Entry:
    """The parameter `source` of a set goes to `target`, transformed."""

    source: str
    target: str
    transformation: Transformation | None
    suppress: bool
    place: Place


def read_mapping(root: Element, shown: str, warnings: list[str]) -> list[Entry]:
    """All entries of a <ParameterMapping>; InputError, naming `shown` and line, for two to one target."""
    if xml_file.local(root) != "ParameterMapping":
        raise InputError(
            f"{shown} line {root.sourceline}: <{xml_file.local(root)}> is not a ParameterMapping"
        )
    text = Text(shown, root.get("version", "1.0"), warnings)
    found: dict[str, Entry] = {}
    for element in text.children(root, "ssm:ParameterMapping").get("MappingEntry", []):
        groups = text.children(element, "ssm:MappingEntry")
        target = text.name(element, "target")
        if target in found:
            raise text.error(element, f"'{target}' is the target of a second mapping entry")
        found[target] = Entry(
            text.name(element, "source"),
            target,
            read_transformation(text, groups),
            text.flag(element, "suppressUnitConversion"),
            text.place(element),
        )
    return list(found.values())


def apply(
    entries: Iterable[Entry], values: Iterable[ParameterValue], warnings: list[str]
) -> list[ParameterValue]:
    """Mapped values under their new names; what no entry maps is left out, and said (SSP 2.0, 5.2.4)."""
    given = {value.name: value for value in values}
    entries, mapped = list(entries), []
    named = {entry.source for entry in entries}
    for value in given.values():
        if value.name not in named:
            warnings.append(f"{value.place}: ignored: no mapping entry names the parameter '{value.name}'")
    for entry in entries:
        if entry.source not in given:
            warnings.append(f"{entry.place}: the parameter set has no parameter '{entry.source}' to map")
            continue
        mapped.append(
            replace(
                given[entry.source],
                name=entry.target,
                transformation=entry.transformation,
                suppress=entry.suppress,
                shared=False,  # a mapping is written for one element: its targets must be there
            )
        )
    return mapped
