"""Equations of the catalogue as HTML: symbols in italics with subscripts, functions upright."""

import re
from collections.abc import Iterable
from html import escape

GREEK = {"mu": "μ", "tau": "τ", "phi": "φ", "sigma": "σ", "alpha": "α", "zeta": "ζ"}
FUNCTIONS = {"sgn", "sin", "cos", "tan", "exp", "max", "min", "sqrt"}
UPRIGHT = FUNCTIONS | {"if", "else", "where", "for", "and", "of", "the"}
LETTER = "[A-Za-zΑ-Ωα-ω]"
TOKEN = re.compile(rf"{LETTER}[A-Za-z0-9_]*")


def equation(text: str, parameters: Iterable[str] = ()) -> str:
    """An equation as HTML; `parameters` are written as symbols wherever they stand."""
    known, made, end = set(parameters), [], 0
    for match in TOKEN.finditer(text):
        made += [escape(text[end : match.start()]), _token(match[0], known)]
        end = match.end()
    return f"<span class='equation'>{''.join([*made, escape(text[end:])])}</span>"


def symbol(name: str) -> str:
    """A parameter's name as a symbol: Fc_positive is F with the subscript c, positive."""
    head, *rest = name.split("_")
    split = re.fullmatch(r"([A-Za-z])([a-z]|\d)", head)
    if split and head not in GREEK:
        head, rest = split[1], [split[2], *rest]
    below = f"<sub>{escape(', '.join(rest))}</sub>" if rest else ""
    return f"<i>{escape(GREEK.get(head, head))}</i>{below}"


def spelt(name: str) -> str:
    """A parameter's symbol, and its name where the symbol does not spell it out."""
    written = symbol(name)
    whole = written == f"<i>{escape(name)}</i>"
    return written if whole else f"{written} <small>{escape(name)}</small>"


def _token(word: str, known: set[str]) -> str:
    if word not in known and re.fullmatch(r"d[a-z]", word):  # a differential
        return f"d<i>{word[1]}</i>"
    if word in known or (len(word) <= 2 and word not in UPRIGHT) or re.fullmatch(rf"{LETTER}_[a-z]+", word):
        return symbol(word)
    return escape(word)
