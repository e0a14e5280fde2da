"""One SSP file while it is read: its name for messages, its version, its elements held to their forms.

Files that it names by relative URI (SSP 2.0, 2.3) are found inside of the package, or refused.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from lxml import etree

from orchestrator.files import xml_file
from orchestrator.files.archive import MAX_NAME
from orchestrator.files.xml_file import Element, shortened
from orchestrator.ssp.element_forms import FORMS, NAMESPACES, SCHEMA_INSTANCE, Form
from specs.errors import InputError, nearest

VERSIONS = ("1.0", "2.0")


@dataclass(frozen=True, order=True)
class Place:
    """A line of a file, as messages name it."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file} line {self.line}"


class Text:
    """`shown` names the file; `warnings` takes sentences on what is read, but may not be meant."""

    def __init__(self, shown: str, version: str, warnings: list[str]) -> None:
        self.shown, self.version, self.warnings = shown, version, warnings
        self._told: set[str] = set()
        if version.split(".")[0] not in ("1", "2"):
            raise InputError(f"{shown}: SSP version '{version}' is not supported; valid: 1.0, 2.0")
        if version not in VERSIONS:
            warnings.append(f"{shown}: SSP version '{version}' is read as {version[0]}.0")

    def children(self, element: Element, form_name: str) -> dict[str, list[Element]]:
        """Children that are read, by name, after a check of all attributes and children against the form."""
        form = FORMS[form_name]
        self._check_attributes(element, form)
        valid, ignored = form.children.split(), form.ignored.split()
        groups: dict[str, list[Element]] = {}
        for child in element:
            name = _name(child)
            if name in form.refused:
                raise self.error(child, f"<{name}> is not supported: {form.refused[name]}")
            if name not in valid and name not in ignored:
                raise self.error(
                    child,
                    f"<{name}> inside <{xml_file.local(element)}> is not supported; {nearest(name, valid)}",
                )
            if name in form.new.split():
                self.new_in_2(child, f"<{name}>")
            if name in valid:
                groups.setdefault(name, []).append(child)
        return groups

    def items(self, holders: Iterable[Element], form_name: str, name: str) -> Iterator[Element]:
        """The `name` children of all holders."""
        for holder in holders:
            yield from self.children(holder, form_name).get(name, [])

    def single(self, groups: dict[str, list[Element]], name: str) -> Element | None:
        """The one child `name`, if there is one; InputError for a second."""
        found = groups.get(name, [])
        if len(found) > 1:
            raise self.error(found[1], f"second <{name}>")
        return found[0] if found else None

    def name(self, element: Element, key: str = "name") -> str:
        """A required attribute."""
        return xml_file.required(element, key, self.shown)

    def flag(self, element: Element, key: str) -> bool:
        """A Boolean attribute that is false by default."""
        return xml_file.boolean(element, key, False, self.shown)

    def place(self, element: Element) -> Place:
        """Where an element stands."""
        return Place(self.shown, element.sourceline or 0)

    def error(self, element: Element, text: str) -> InputError:
        """An error at an element's line."""
        return InputError(f"{self.place(element)}: {text}")

    def warn(self, element: Element, text: str) -> None:
        """A warning at an element's line."""
        self.warnings.append(f"{self.place(element)}: {text}")

    def _check_attributes(self, element: Element, form: Form) -> None:
        tag = xml_file.local(element)
        known = [name.rstrip("!") for name in form.read.split()]
        for name in (n for n in form.read.split() if n.endswith("!")):
            if element.get(name[:-1]) is None:
                raise self.error(element, f"<{tag}> has no '{name[:-1]}'")
        for key in element.attrib:
            qualified = etree.QName(key)
            name = qualified.localname
            if qualified.namespace == SCHEMA_INSTANCE:
                continue
            if qualified.namespace is not None:
                self.warn(element, f"attribute '{name}' of <{tag}> is of a foreign namespace and ignored")
            elif name in form.refused:
                raise self.error(element, f"attribute '{name}': {form.refused[name]}")
            elif name not in known and name not in form.idle.split():
                choices = f"; {nearest(name, known)}" if known else ""
                raise self.error(element, f"attribute '{name}' of <{tag}> is not supported{choices}")

    def new_in_2(self, element: Element, what: str) -> None:
        """Warn, once a file, of what SSP 2.0 added in a file that declares 1.0; it is honoured too."""
        if self.version.startswith("1") and what not in self._told:
            self._told.add(what)
            self.warn(element, f"{what} is of SSP 2.0, but the file declares version {self.version}")


def _name(element: Element) -> str:
    """Local name of an element of SSP; with its namespace if that is a foreign one."""
    qualified = etree.QName(element)
    own = (qualified.namespace or "") in NAMESPACES
    return qualified.localname if own else f"{{{qualified.namespace}}}{qualified.localname}"


def path_in_package(place: Place, root: Path, folder: Path, source: str, of: str = "") -> Path:
    """The file `source` (`of` what) seen from `folder`; InputError, naming the place, if not below `root`."""
    name = unquote(source)
    path = Path(os.path.normpath(folder / name))
    foreign = ":" in source or "\\" in name or "\0" in name or name.startswith("/")
    if any(len(os.fsencode(part)) > MAX_NAME for part in path.parts):
        raise InputError(f"{place}: source '{shortened(source)}'{of} has too long a name")
    if not name or foreign or not path.is_relative_to(root):
        raise InputError(f"{place}: source '{source}'{of} is not inside the package")
    return path
