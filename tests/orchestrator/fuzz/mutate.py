"""Structure-aware mutations: of XML trees, of the text, of which files there are, and of the archives."""

import ast
import random
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

from lxml import etree

import orchestrator
from tests.edges import folder_of
from tests.orchestrator.fuzz.case import BINARIES, LIBRARY, Case
from tests.orchestrator.fuzz.kinds import with_bent_binary

ODD = (
    "", " ", "0", "1", "-1", "2", "1.5", "-0", "00", "0x1", "1_0", "١", "127", "128", "255", "256", "65536",
    "2147483647", "2147483648", "4294967295", "4294967296", "9223372036854775807", "9223372036854775808",
    "18446744073709551616", "1" * 50, "1e308", "1e309", "1e-320", "INF", "-INF", "NaN", "inf",
    "nan", "1e999999999", "true", "false", "True", "1 2", "1 2 3 4 5 6", "0 1", ".", "..", "/", "a/b",
    "../x", "file:///etc/passwd",
    "http://x", "resources/position.fmu", "a.b", ".b", "b.", "é", "\u202e", "a" * 300, "00ff", "xyz", "m",
    "m/s", "deg", "position", "speed", "input", "output", "parameter", "constant", "fixed", "exact",
    "calculated",
)  # fmt: skip
ENTRIES = ("../evil", "/evil", "a\\b", "resources/", "modelDescription.xml", "SystemStructure.ssd", "x" * 300,
           "resources", "MODELDESCRIPTION.XML", "binaries", "ä", "c:x", "SystemStructure.ssd/x")  # fmt: skip


def words() -> tuple[str, ...]:
    """Every string that the code under test compares with or looks up."""
    found: set[str] = set()
    for path in sorted(Path(folder_of(orchestrator)).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and 0 < len(node.value) < 48:
                found.add(node.value)
    return tuple(sorted(w for w in found if not any(c.isspace() for c in w)))


class Mutator:
    """Mutates cases; `others` are taken parts from.  The same seed makes the same mutations."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.words = words()
        self.names = tuple(w for w in self.words if w.isidentifier())

    def mutate(self, case: Case, others: list[Case]) -> Case:
        """A changed copy: one to five mutations, mostly one, mostly of the XML trees."""
        for _ in range(1 + int(self.random.expovariate(1.2)) % 5):
            kind = self.random.random()
            if case.foreign and self.random.random() < 0.5:
                case = with_bent_binary(case, self.random)
            elif kind < 0.84:
                case = self._document(case, others)
            elif kind < 0.92:
                case = self._files(case, others)
            else:
                case = self._archive(case)
        return case

    # ---- one document ----

    def _document(self, case: Case, others: list[Case]) -> Case:
        places = [("", name) for name in case.files] + [
            (path, name)
            for path, parts in case.fmus.items()
            for name in parts
            if name != LIBRARY and not name.startswith(BINARIES)
        ]
        if not places:
            return case
        path, name = self.random.choice(places)
        text = case.fmus[path][name] if path else case.files[name]
        text = self._text(text) if self.random.random() < 0.08 else self._tree(text, others)
        if path:
            return replace(case, fmus={**case.fmus, path: {**case.fmus[path], name: text}})
        return replace(case, files={**case.files, name: text})

    def _tree(self, text: str, others: list[Case]) -> str:
        try:
            root = etree.fromstring(
                text.encode("latin-1", "replace"), etree.XMLParser(resolve_entities=False)
            )
        except (etree.XMLSyntaxError, ValueError):
            return self._text(text)
        elements = [e for e in root.iter() if isinstance(e.tag, str)]
        element = self.random.choice(elements)
        mutation: Callable = self.random.choice(
            (self._set, self._set, self._set, self._unset, self._add, self._drop, self._twice, self._move,
             self._insert, self._graft, self._rename, self._agree, self._many)
        )  # fmt: skip
        try:
            mutation(element, elements, others)
        except (ValueError, TypeError):  # characters that XML has not, an ancestor into itself
            return text
        return etree.tostring(root).decode("latin-1")

    def _value(self, old: str, elements: list, name: str = "") -> str:
        """An odd value, one that the attribute has elsewhere, a word of the code, or the old one bent."""
        kind = self.random.random()
        if kind < 0.3:
            return self.random.choice(ODD)
        if kind < 0.6:
            same = [e.get(name) for e in elements if e.get(name) is not None]
            return self.random.choice(same or [old])
        if kind < 0.8:
            return self.random.choice(self.words)
        at = self.random.randrange(len(old) + 1)
        return old[:at] + self.random.choice(ODD) + old[at + self.random.randrange(2) :]

    def _set(self, element, elements: list, others: list[Case]) -> None:
        holders = [e for e in elements if e.attrib] if not element.attrib else [element]
        if holders:
            holder = self.random.choice(holders)
            name = self.random.choice(list(holder.attrib))
            holder.set(name, self._value(holder.get(name), elements, name))

    def _unset(self, element, elements: list, others: list[Case]) -> None:
        if element.attrib:
            del element.attrib[self.random.choice(list(element.attrib))]

    def _add(self, element, elements: list, others: list[Case]) -> None:
        same = [n for e in elements for n in e.attrib]
        name = (
            self.random.choice(same)
            if same and self.random.random() < 0.4
            else self.random.choice(self.names)
        )
        element.set(name, self._value("", elements, name))

    def _drop(self, element, elements: list, others: list[Case]) -> None:
        if element.getparent() is not None:
            element.getparent().remove(element)

    def _twice(self, element, elements: list, others: list[Case]) -> None:
        if element.getparent() is not None:
            element.addnext(deepcopy(element))

    def _move(self, element, elements: list, others: list[Case]) -> None:
        parent = self.random.choice(elements)
        if element.getparent() is not None and element not in (parent, *parent.iterancestors()):
            parent.insert(self.random.randrange(len(parent) + 1), element)

    def _insert(self, element, elements: list, others: list[Case]) -> None:
        space = etree.QName(self.random.choice(elements)).namespace
        name = self.random.choice(self.names)
        etree.SubElement(element, f"{{{space}}}{name}" if space else name)

    def _graft(self, element, elements: list, others: list[Case]) -> None:
        """A subtree of another case, put where it may or may not belong."""
        other = self.random.choice(others)
        texts = [
            *other.files.values(),
            *(parts.get("modelDescription.xml", "") for parts in other.fmus.values()),
        ]
        try:
            root = etree.fromstring(self.random.choice(texts or [""]).encode("latin-1", "replace"))
        except (etree.XMLSyntaxError, ValueError):
            return
        donors = [e for e in root.iter() if isinstance(e.tag, str)]
        donor = self.random.choice(donors)
        alike = [e for e in elements if e.tag == donor.tag and e.getparent() is not None]
        if alike and self.random.random() < 0.7:
            self.random.choice(alike).addnext(deepcopy(donor))
        else:
            element.append(deepcopy(donor))

    def _rename(self, element, elements: list, others: list[Case]) -> None:
        space = etree.QName(element).namespace
        name = self.random.choice([etree.QName(e).localname for e in elements] + list(self.names[:20]))
        element.tag = f"{{{space}}}{name}" if space and self.random.random() < 0.9 else name

    def _agree(self, element, elements: list, others: list[Case]) -> None:
        """One value changed everywhere it stands: names stay consistent."""
        values = [v for e in elements for v in e.attrib.values()]
        if values:
            old = self.random.choice(values)
            new = self._value(old, elements)
            for e in elements:
                for name, value in e.attrib.items():
                    if value == old:
                        e.set(name, new)

    def _many(self, element, elements: list, others: list[Case]) -> None:
        """Deep or wide."""
        copy = deepcopy(element)
        if self.random.random() < 0.3 and len(element) < 3:
            for _ in range(self.random.choice((3, 40, 200))):
                inner = etree.SubElement(element, element.tag, element.attrib)  # type: ignore[arg-type]
                element = inner
        elif element.getparent() is not None and len(list(copy.iter())) < 20:
            for i in range(self.random.choice((5, 50))):
                another = deepcopy(copy)
                for key in ("name", "valueReference"):
                    if another.get(key) is not None:
                        another.set(key, f"{another.get(key)}{i}")
                element.addnext(another)

    def _text(self, text: str) -> str:
        at, to = sorted(self.random.randrange(len(text) + 1) for _ in range(2))
        doctype = '<!DOCTYPE x [<!ENTITY a "b"><!ENTITY c SYSTEM "file:///etc/passwd">]>'
        return self.random.choice((
            text[:at],
            text[:at] + text[to:],
            text[:at] + self.random.choice(ODD) + text[at:],
            text[:at] + chr(self.random.randrange(256)) + text[at + 1 :],
            text.replace("UTF-8", self.random.choice(("UTF-16", "latin-1", "EBCDIC", "x")), 1),
            doctype + text.partition("?>")[2],
            text.replace('="', '="&c;', 1),
            "\xef\xbb\xbf" + text,
            text.replace("1.0", self.random.choice(("2.0", "1.1", "3.0", "2.0.1")), 2),
        ))  # fmt: skip

    # ---- files and archives ----

    def _files(self, case: Case, others: list[Case]) -> Case:
        kind = self.random.random()
        if kind < 0.2:
            return replace(case, kind=self.random.choice(("ssp", "ssp", "ssd", "fmu")))
        if kind < 0.4 and case.files:
            gone = self.random.choice(list(case.files))
            return replace(case, files={n: t for n, t in case.files.items() if n != gone})
        if kind < 0.5 and case.fmus:
            gone = self.random.choice(list(case.fmus))
            return replace(case, fmus={n: t for n, t in case.fmus.items() if n != gone})
        other = self.random.choice(others)
        if kind < 0.7 and other.files and case.files:
            name, taken = self.random.choice(list(case.files)), self.random.choice(list(other.files))
            return replace(case, files={**case.files, name if kind < 0.6 else taken: other.files[taken]})
        if other.fmus and case.fmus:
            name = self.random.choice(list(case.fmus))
            return replace(case, fmus={**case.fmus, name: self.random.choice(list(other.fmus.values()))})
        return case

    def _archive(self, case: Case) -> Case:
        archive = self.random.choice(["", *case.fmus])
        kind = self.random.random()
        if kind < 0.45:
            name = self.random.choice((*ENTRIES, *case.files))
            return replace(case, entries=(*case.entries, (archive, name, self.random.choice(("", "x")))))
        if kind < 0.9:
            # the directory is at the end; most of what can be wrong is there
            place = (
                1.0 - self.random.random() ** 3 * 0.999
                if self.random.random() < 0.8
                else self.random.random()
            )
            new = "".join(chr(self.random.choice((0, 1, 255, self.random.randrange(256))))
                          for _ in range(self.random.choice((1, 1, 2, 4))))  # fmt: skip
            return replace(case, patches=(*case.patches, (archive, min(place, 0.99999), new)))
        return replace(case, cuts=(*case.cuts, (archive, self.random.random())))
