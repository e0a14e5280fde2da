"""What a cell of a table says: a number, a date, a word for a missing value, a flag or text."""

import re

# Words for a value that is missing, in lower case; `--missing` adds others.
MISSING = frozenset(
    [
        "n/a",
        "na",
        "#n/a",
        "#na",
        "-",
        "--",
        "---",
        "null",
        "none",
        "nil",
        "?",
        "??",
        "*",
        "bad",
        "error",
        "invalid",
        "missing",
        "void",
        "no_data",
        "nodata",
        "#value!",
        "#ref!",
        "#num!",
        "#null!",
        "#name?",
        "#nv",
        "#wert!",
        "#bezug!",
        "#zahl!",
        "#valeur!",
        "#nom?",
        "nat",
        "<na>",
        "#div/0!",
        "n.a.",
        "k.a.",
        "undef",
        "undefined",
    ]
)
# Results of a calculation that failed: a sample, but no good one.
NOT_A_NUMBER = frozenset(
    [
        "nan",
        "+nan",
        "-nan",
        "inf",
        "+inf",
        "-inf",
        "infinity",
        "+infinity",
        "-infinity",
        "inf.",
        "-inf.",
        "nan(ind)",
        "-nan(ind)",
        "nan(snan)",
        "1.#inf",
        "-1.#inf",
        "1.#ind",
        "-1.#ind",
        "1.#qnan",
        "-1.#qnan",
        "1.#snan",
    ]
)
FLAGS = {
    "true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "yes": 1.0, "no": 0.0, "ja": 1.0, "nein": 0.0,
    "wahr": 1.0, "falsch": 0.0, "ein": 1.0, "aus": 0.0, "vrai": 1.0, "faux": 0.0, "oui": 1.0, "non": 0.0,
}  # fmt: skip
MONTHS = {
    "jan": 1, "feb": 2, "mar": 3, "mär": 3, "maer": 3, "mrz": 3, "mars": 3, "apr": 4, "avr": 4,
    "may": 5, "mai": 5, "jun": 6, "juin": 6, "jul": 7, "juil": 7, "aug": 8, "août": 8, "sep": 9, "sept": 9,
    "oct": 10, "okt": 10, "nov": 11, "dec": 12, "dez": 12, "déc": 12, "févr": 2, "janv": 1,
}  # fmt: skip
MINUS = "\u2212"
GROUPERS = "'\u2019 \u00a0\u202f\u2009"  # marks that only ever group digits
_MONTH = "(" + "|".join(sorted(MONTHS, key=len, reverse=True)) + r")\w*"
DATE = re.compile(
    r"^\d{4}-\d{1,2}-\d{1,2}|^\d{1,2}\.\d{1,2}\.\d{4}|^\d{4}[/.]\d{1,2}[/.]\d{1,2}|^\d{1,2}/\d{1,2}/\d{4}|^\d{1,3}:\d\d(:|\.|,|$|\s)"
    r"|^\d{8}[T ]\d{2}|^\d+ days?,? \d"
    rf"|^\d{{1,2}}[-. ]+{_MONTH}[-. ]+\d{{4}}|^([A-Z]\w{{2,8}}\.?,? )?{_MONTH}\.? +\d{{1,2}},? ",
    re.IGNORECASE,
)
NUMERIC = re.compile(rf"^[+-{MINUS}]?(\d[\d.,{GROUPERS}]*|[.,]\d+)([eEdD][+-]?\d+)?$".replace("+-", r"+\-"))


def is_number(cell: str) -> bool:
    """Whether a cell is written as a number, whatever its marks mean."""
    return bool(NUMERIC.match(cell)) or cell.lower() in NOT_A_NUMBER


def is_date(cell: str) -> bool:
    """Whether a cell is a date or a time of day."""
    return bool(DATE.match(cell))


def is_value(cell: str) -> bool:
    """Whether a cell is data and no name."""
    return is_number(cell) or is_date(cell)
