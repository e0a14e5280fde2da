"""Units and numbers as people write them: N·m·s/rad, m/s², 0.0108."""

import math
import re
from collections import Counter
from collections.abc import Iterable

NO_AXIS = "no state of the model is known as a speed"
RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def written(unit: str) -> str:
    """A unit of the project in print: `kg.m2` is kg·m²; nothing for `1`."""
    if unit in ("", "1"):
        return ""
    powers = re.sub(r"(?<=[A-Za-z])(-?\d+)", lambda m: m[1].translate(RAISED), unit)
    return powers.replace(".", "·")


def with_unit(text: str, unit: str) -> str:
    """A number's text with its unit."""
    return f"{text} {written(unit)}".rstrip()


def number(value: float | None, digits: int = 4) -> str:
    """A number with some significant digits, powers of ten beyond 1e-4 and 1e6; a dash for none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value and not 1e-4 <= abs(value) < 1e6:
        head, _, power = f"{value:.{max(digits - 1, 0)}e}".partition("e")
        if "." in head:
            head = head.rstrip("0").rstrip(".")
        return f"{head}·10{str(int(power)).translate(RAISED)}".replace("-", "−")
    text = f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.{digits}g}"
    return text.replace("-", "−")


def number_with_error(value: float, interval: list[float]) -> str:
    """A number with no more digits than its interval [low, high] lets one know."""
    half = 0.5 * abs(interval[1] - interval[0])
    largest = max(abs(value), *map(abs, interval))
    if not half or not math.isfinite(half) or not 1e-3 <= largest < 1e6:
        return number(value)
    decimals = min(8, max(0, 1 - math.floor(math.log10(half))))
    return f"{value:.{decimals}f}".replace("-", "−")


def percent(share: float | None) -> str:
    """A share in %, without more digits than anybody reads."""
    if share is None or not math.isfinite(share):
        return "–"
    value = 100.0 * share
    if 99.5 <= value < 100.0:
        return f"{min(value, 99.9):.1f} %"
    return f"{value:.0f} %" if abs(value) >= 9.95 else f"{value:.1f} %"


def listed(names: list[str], last: str = "and") -> str:
    """a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}" if names else ""


def either(sets: Iterable[Iterable[tuple[str, str]]], what: str = "model") -> str:
    """A sentence on sets of effects (name, port) that explain as much: what is certain, and what is not."""
    rows, lacks = [sorted(one) for one in sets], f"The {what} lacks"
    common = set.intersection(*({name for name, _ in one} for one in rows))
    rest = [[pair for pair in one if pair[0] not in common] for one in rows]
    sure, doubtful = listed(sorted(common)), ", or ".join(_apart([one for one in rest if one]))
    which = "the recordings do not tell which"
    if not common:
        return f"{lacks} {doubtful}: {which}."
    if not doubtful:  # the same effects in other places
        return f"{lacks} {', or '.join(map(with_ports, rows))}: {which}."
    if not all(rest):
        return f"{lacks} {sure}, and perhaps {doubtful}."
    return f"{lacks} {sure}, and besides {doubtful}: {which}."


def _apart(sets: list[list[tuple[str, str]]]) -> list[str]:
    """Sets in words, those of the same names with their ports."""
    texts = [together(one) for one in sets]
    return [with_ports(s) if texts.count(t) > 1 else t for s, t in zip(sets, texts, strict=True)]


def with_ports(effects: Iterable[tuple[str, str]], last: str = "and") -> str:
    """Effects given as (name, port), each with its port."""
    return listed([f"{name} ({port})" for name, port in effects], last)


def together(effects: Iterable[tuple[str, str]]) -> str:
    """Effects given as (name, port): a, b and c; one that is there more than once with its ports."""
    rows = sorted(effects)
    often = Counter(name for name, _ in rows)
    return listed([f"{name} ({port})" if often[name] > 1 else name for name, port in rows])
