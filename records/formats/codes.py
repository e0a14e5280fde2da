"""Codes that stand for no value: in texts beside numbers, as DBC value tables and MDF
conversions have them.
"""

import re

NO_VALUE = re.compile(
    r"\b(sna|n/a|na|not?[ _-]?avail\w*|signal[ _-]?not[ _-]?avail\w*|unavail\w*|invalid\w*|not[ _-]?valid"
    r"|no[ _-]?(data|value|signal)|undefined|"
    r"nicht[ _-]?verf\w*|ung(ü|ue)ltig|kein[ _-]?wert|nv|nan)\b",
    re.IGNORECASE,
)
ERROR = re.compile(r"\b(error|err|fehler|fault\w*|defect|defekt)\b", re.IGNORECASE)


def means_no_value(text: str, at_the_top: bool = False) -> bool:
    """Whether a text says that there is no value; *error* does so where the code is at the top
    of its field.
    """
    words = text.replace("_", " ")
    return bool(NO_VALUE.search(words) or (at_the_top and ERROR.search(words)))
