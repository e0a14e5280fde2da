"""Reads a signal dictionary (SSB), inline or a file of its own (SSP 2.0, chapter 8)."""

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.ssp.ssc import Typed, read_definitions, read_type
from orchestrator.ssp.text import Text
from specs.errors import InputError


def read_dictionary(root: Element, shown: str, warnings: list[str]) -> dict[str, Typed]:
    """Signals by name; InputError, naming `shown` and line, for one without a type or named twice."""
    if xml_file.local(root) != "SignalDictionary":
        raise InputError(
            f"{shown} line {root.sourceline}: <{xml_file.local(root)}> is not a SignalDictionary"
        )
    text = Text(shown, root.get("version", "1.0"), warnings)
    groups = text.children(root, "ssb:SignalDictionary")
    definitions = read_definitions(text, groups)
    found: dict[str, Typed] = {}
    for entry in groups.get("DictionaryEntry", []):
        name = text.name(entry)
        if name in found:
            raise text.error(entry, f"second dictionary entry '{name}'")
        found[name] = read_type(
            text, text.children(entry, "ssb:DictionaryEntry"), definitions, f"entry '{name}'"
        )
        if not found[name].type:
            raise text.error(entry, f"dictionary entry '{name}' has no type")
        if any(isinstance(d, str) or d is None for d in found[name].dimensions):
            raise text.error(entry, f"dictionary entry '{name}' has a dimension without 'size'")
    return found
