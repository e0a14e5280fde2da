"""Tables in long form: one column names the channel, another one holds the value, row by row."""

import re
from collections.abc import Iterable, Sequence

from specs.errors import InputError, listed

# What such columns are called, in small letters and without marks.
NAMES = frozenset(
    [
        "signal", "signalname", "channel", "channelname", "name", "variable", "variablename", "varname",
        "var", "tag", "tagname", "parameter", "topic", "field", "key", "item", "sensor", "sensorname",
        "metric", "point", "pointname", "kanal", "kanalname", "messstelle",
    ]
)  # fmt: skip
VALUES = frozenset(
    ["value", "val", "varvalue", "wert", "messwert", "valeur", "valor", "reading", "realvalue", "floatvalue"]
)


def check_long_form(texts: Iterable[tuple[str, Sequence[str]]], numbers: Iterable[str], source: str) -> None:
    """Raise InputError where a column of texts, given with some of them, names what the values of another one
    are: read as one channel they would be a mixture.
    """
    value = next((n for n in numbers if _bare(n) in VALUES), None)
    for name, some in texts:
        different = sorted({t for t in some if not t.startswith("$")})  # such as WinCC's $RT_COUNT$
        if value is not None and _bare(name) in NAMES and len(different) > 1:
            raise InputError(
                f"{source}: column {name} names what the numbers in {value} are, row by row "
                f"({listed(different, 4)}): write one column for each"
            )


def _bare(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())
