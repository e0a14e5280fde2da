"""Terminals of an FMU: groups of variables that are connected together (`terminalsAndIcons.xml`).

FMI 2.0.4 takes the file as FMI 3.0 defines it.  An FMU whose file is wrong runs all the same: nothing but a
connection by terminal needs it.
Source: FMI 3.0.2, 2.4.9, Modelica Association.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element, local
from specs.errors import InputError, nearest

FOLDER = "terminalsAndIcons"
FILE = "terminalsAndIcons.xml"
ICONS = ("icon.png", "icon.svg")
MAX_DEPTH = 16  # of terminals in terminals


@dataclass(frozen=True)
class Member:
    """A variable of a terminal; `name` is what it is called there ("": nothing), `kind`: signal, inflow …"""

    name: str
    variable: str
    kind: str


@dataclass(frozen=True)
class Terminal:
    """A group of variables.

    rule     how members find each other: plug, bus, sequence, or one that a layered standard defines
    kind     of what domain it is; "": not stated
    streams  names of its stream members, which are read but not connected
    inner    terminals in it
    """

    name: str
    rule: str
    kind: str = ""
    description: str = ""
    members: tuple[Member, ...] = ()
    streams: tuple[str, ...] = ()
    inner: tuple["Terminal", ...] = ()


@dataclass(frozen=True)
class Terminals:
    """The terminals of an FMU by name; `icons`: files; `problem`: why they could not be read."""

    by_name: Mapping[str, Terminal] = field(default_factory=dict)
    icons: tuple[str, ...] = ()
    problem: str = ""


def read(folder: Path, variables: Collection[str], shown: str) -> Terminals:
    """The terminals of the FMU unpacked in `folder`; `shown` names it in messages."""
    icons = tuple(name for name in ICONS if (folder / FOLDER / name).is_file())
    path = folder / FOLDER / FILE
    if not path.is_file():
        return Terminals(icons=icons)
    where = f"{shown}, {FILE}"
    try:
        root = xml_file.read(path, where)
        if local(root) != "fmiTerminalsAndIcons":
            raise InputError(f"{where}: <{local(root)}> is not <fmiTerminalsAndIcons>")
        elements = [e for holder in root if local(holder) == "Terminals" for e in holder]
        found = _Reader(variables, where).terminals(elements, 1)
    except InputError as error:
        return Terminals(icons=icons, problem=str(error))
    return Terminals({t.name: t for t in found}, icons)


class _Reader:
    """One file of one FMU."""

    def __init__(self, variables: Collection[str], where: str) -> None:
        self.variables, self.where = variables, where

    def terminals(self, elements: list[Element], depth: int) -> tuple[Terminal, ...]:
        if depth > MAX_DEPTH:
            raise InputError(f"{self.where}: terminals are nested more than {MAX_DEPTH} deep")
        found = [self.terminal(e, depth) for e in elements if local(e) == "Terminal"]
        self.unique(found, "terminal", elements)
        return tuple(found)

    def terminal(self, element: Element, depth: int) -> Terminal:
        parts = list(element)
        members = [self.member(e) for e in parts if local(e) == "TerminalMemberVariable"]
        self.unique([m for m in members if m.name], "member", [element])
        return Terminal(
            xml_file.required(element, "name", self.where),
            xml_file.required(element, "matchingRule", self.where),
            element.get("terminalKind", ""),
            element.get("description", ""),
            tuple(members),
            tuple(self.stream(e) for e in parts if local(e) == "TerminalStreamMemberVariable"),
            self.terminals(parts, depth + 1),
        )

    def member(self, element: Element) -> Member:
        variable = xml_file.required(element, "variableName", self.where)
        self.known(element, variable)
        kind = xml_file.required(element, "variableKind", self.where)
        return Member(element.get("memberName", ""), variable, kind)

    def stream(self, element: Element) -> str:
        for way in ("in", "out"):
            self.known(element, xml_file.required(element, f"{way}StreamVariableName", self.where))
        return xml_file.required(element, "inStreamMemberName", self.where)

    def known(self, element: Element, variable: str) -> None:
        if variable not in self.variables:
            raise InputError(
                f"{self.where} line {element.sourceline}: the FMU has no variable '{variable}'; "
                f"{nearest(variable, self.variables)}"
            )

    def unique(self, found: list[Terminal] | list[Member], what: str, elements: list[Element]) -> None:
        for name, count in Counter(item.name for item in found).items():
            if count > 1:
                line = elements[0].sourceline
                raise InputError(f"{self.where} line {line}: two {what}s are called '{name}'")
