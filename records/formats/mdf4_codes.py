"""MDF conversions with texts: where a rule gives numbers for some raw values, its texts are
codes for no value.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from records.formats.codes import means_no_value, of_states
from records.formats.exact import scaled

LINEAR, V3_LINEAR = 1, 0
VALUE_TO_TEXT, RANGE_TO_TEXT = 7, 8  # MDF4
V3_VALUE_TO_TEXT, V3_RANGE_TO_TEXT = 11, 12


def exactly(rule: Any, raw: np.ndarray) -> np.ndarray | None:
    """Values of raw whole numbers that a linear rule keeps whole, exactly; None for others."""
    if rule is None or rule.conversion_type not in (LINEAR, V3_LINEAR) or not hasattr(rule, "b"):
        return None
    return scaled(raw, rule.a, rule.b)


def has_texts(rule: Any) -> bool:
    """Whether a conversion gives texts for some raw values."""
    kinds = (VALUE_TO_TEXT, RANGE_TO_TEXT, V3_VALUE_TO_TEXT, V3_RANGE_TO_TEXT)
    return rule is not None and bool(_refs(rule)) and rule.conversion_type in kinds


def _refs(rule: Any) -> dict[str, Any]:
    return dict(getattr(rule, "referenced_blocks", None) or {})


def applied(rule: Any, raw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values [n] of raw numbers [n], and which of them are codes.

    A rule with texts alone is an enumeration: its numbers stay, but for those whose text says that there is
    no value.  Beside a rule for numbers every text is a code.
    """
    entries = list(_entries(rule, raw))
    numeric = any(not _is_text(to) for _, to in entries)
    states = set() if numeric else of_states(_as_text(to) for _, to in entries)
    plain = np.float64 if raw.dtype.kind == "f" else np.uint64 if raw.dtype == np.uint64 else np.int64
    values = raw.astype(np.float64 if numeric else plain)
    coded = np.zeros(len(raw), dtype=bool)
    for mask, to in entries:
        if _is_text(to):
            text = _as_text(to)
            coded |= mask & (numeric or (text not in states and means_no_value(text, _at_the_top(raw, mask))))
        elif has_texts(to):
            inner, codes = applied(to, raw[mask])
            values[mask], coded[mask] = inner, codes
        else:
            values[mask] = np.asarray(to.convert(raw[mask]), dtype=np.float64)
    return values, coded


def named(rule: Any, raw: np.ndarray, coded: np.ndarray) -> dict[str, int]:
    """Texts of raw numbers [n] that are no codes, and how many samples have each; not that of all others."""
    *entries, _ = _entries(rule, raw)
    found = {_as_text(to): int((mask & ~coded).sum()) for mask, to in entries if _is_text(to)}
    return {text: count for text, count in found.items() if text and count}


def _at_the_top(raw: np.ndarray, mask: np.ndarray) -> bool:
    """Whether the raw numbers chosen are the last two that their type can hold."""
    return (
        raw.dtype.kind == "u" and bool(mask.any()) and bool((raw[mask] >= np.iinfo(raw.dtype).max - 1).all())
    )


def _is_text(to: Any) -> bool:
    return to is None or isinstance(to, bytes | str)


def _as_text(to: Any) -> str:
    return to.decode("utf-8", "replace") if isinstance(to, bytes) else str(to or "")


def _entries(rule: Any, raw: np.ndarray) -> Iterator[tuple[np.ndarray, Any]]:
    """(which raw numbers, text or rule) of each entry; what no entry has goes to the default."""
    refs, left = _refs(rule), np.ones(len(raw), dtype=bool)
    by_value = rule.conversion_type in (VALUE_TO_TEXT, V3_VALUE_TO_TEXT)
    for k in range(len(refs)):
        if f"text_{k}" not in refs:
            continue
        if by_value:
            value = getattr(rule, f"val_{k}", None)
            mask = raw == (getattr(rule, f"param_val_{k}", None) if value is None else value)
        else:
            low, high = getattr(rule, f"lower_{k}"), getattr(rule, f"upper_{k}")
            mask = (raw >= low) & ((raw < high) if raw.dtype.kind == "f" and low != high else (raw <= high))
        mask = np.asarray(mask) & left
        left &= ~mask
        yield mask, refs[f"text_{k}"]
    default = refs.get("default_addr")
    if _is_text(default) and not _as_text(default):
        default = None if any(not _is_text(to) for to in refs.values()) else b""
    yield left, default
