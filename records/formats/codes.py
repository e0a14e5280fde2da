"""Codes that stand for no value: in texts beside numbers, as DBC value tables and MDF
conversions have them.
"""

import re
from collections.abc import Iterable

NO_VALUE = re.compile(
    r"\b(sna|snv|n/a|n\.a|na|not?[ _-]?avail\w*|signal[ _-]?not[ _-]?avail\w*|unavail\w*|invalid\w*"
    r"|not[ _-]?(valid|supported|installed|defined)|no[ _-]?(data|value|signal)|undefined|undefiniert"
    r"|non? disponible|indisponible|无效|nicht[ _-]?verf\w*|ung(ü|ue)ltig|kein[ _-]?wert|nv|nan)\b",
    re.IGNORECASE,
)
ERROR = re.compile(
    r"(?<!\bno )(?<!\bkein )\b(error|err|fehler|fault\w*|failure|defect|defekt|timeout|implausib\w*"
    r"|open[ -]?circuit|short[ -]?circuit|short to \w+|(out of|over|under)[ -]?range)\b(?!.?free)",
    re.IGNORECASE,
)
STATE = re.compile(r"\b(valid|g(ü|ue)ltig)\b|\b(available|verf(ü|ue)gbar)\b", re.IGNORECASE)


def of_states(texts: Iterable[str]) -> set[str]:
    """Texts that are states and no codes: *invalid* where another one is *valid*, and the like."""
    found = [(t, t.replace("_", " ")) for t in texts]
    positive = {bool(m[1]) for _, t in found if (m := STATE.search(t)) and not NO_VALUE.search(t)}
    about = {True: r"valid|g(ü|ue)ltig", False: r"avail|verf"}
    return {
        raw for raw, t in found for kind in positive
        if NO_VALUE.search(t) and re.search(about[kind], t, re.IGNORECASE)
    }  # fmt: skip


def means_no_value(text: str, at_the_top: bool = False) -> bool:
    """Whether a text says that there is no value; *error* does so where the code is at the top
    of its field.
    """
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text.replace("_", " "))
    return bool(NO_VALUE.search(words) or (at_the_top and ERROR.search(words)))
