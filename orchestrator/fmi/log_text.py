"""What an FMU logs: on one line, with the names of its variables."""

import re

from orchestrator.fmi.model_description import ModelDescription

KINDS = {"r": ("Real",), "i": ("Integer", "Enumeration"), "b": ("Boolean",), "s": ("String",)}
REFERENCE = re.compile(r"##|#([ribs])(\d+)#")


def one_line(message: bytes) -> str:
    """A foreign message without what would break lines or move the cursor of a terminal."""
    text = " ".join(message.decode("utf-8", "replace").split())
    return "".join(c if c.isprintable() else " " for c in text)


def named(text: str, model: ModelDescription) -> str:
    """With the names of variables that it refers to: in FMI 2 #r12# is the real variable 12, and ## is #."""
    if model.fmi_version != 2 or "#" not in text:
        return text

    def name(found: re.Match[str]) -> str:
        kind, number = found.groups()
        known = (
            v.name for v in model.variables.values() if kind and v.type in KINDS[kind] and v.vr == int(number)
        )
        return next(known, found.group()) if kind else "#"

    return REFERENCE.sub(name, text)
