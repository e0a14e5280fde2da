"""The figures of a suite as tables in Markdown, for docs/results/reconcile-suite.md."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.suite.summary import MUSTS, RESULTS, met
from specs.version import VERSION

Figures = Mapping[str, Any]


def name(noise: str, visible: str) -> str:
    """Of the place in the page where the figures of such a suite belong."""
    return f"suite-{noise}-{visible}"


def page(figures: Figures, seed: int) -> str:
    """Demands, results by system and by effect, what was taken for what, plain ways on the same cases."""
    noise, visible = figures["noise"], figures["visible"]
    kind = "" if visible == "drawn" else f" --visible {visible}"
    options = f"--cases {figures['asked']} --noise {noise}{kind} --seed {seed}"
    asked = f"`python -m benchmarks reconcile-suite {options}`"
    done = figures["cases"]
    stopped = "" if done == figures["asked"] else f", stopped after {done} cases"
    by = ", ".join(code for code in figures["codes"] if code)
    answered = f", sources of reconcile {by}" if by else ""
    parts = [f"{asked}, version {VERSION}{answered}{stopped}; recordings are simulated.\n", _demands(figures)]
    parts.append(_grouped("system", figures["by_system"] | {"all": figures}))
    if 0 < figures["simplest"] < done:
        parts.append(_simplest(figures))
    if visible == "drawn":
        parts += [_grouped("visible effect", figures["by_effect"]), _confusion(figures["confusion"])]
        parts.append(_sizes(figures["equivalence_sizes"]))
        parts += [_reliability(of, rows) for of, rows in figures["reliability"].items()]
    plain = {k: b for k, b in figures["baselines"].items() if b["cases"]}
    if plain:
        parts.append(_grouped("plain way, same cases", plain))
    return "\n".join(parts)


def _demands(figures: Figures) -> str:
    rows = [
        (
            f"`{key}`",
            f"{how} {limit:g}".replace(">=", "≥").replace("<=", "≤"),
            _number(figures[key]),
            _met(figures[key], how, limit),
        )
        for key, how, limit in MUSTS[figures["noise"], figures["visible"]]
    ]
    return _table(("figure", "asked for", "reached", "met"), rows)


def _met(value: float | None, how: str, limit: float) -> str:
    """Whether a demand is met, in a word."""
    if value is None:
        return "not measured"
    return "yes" if met(value, how, limit) else "**no**"


def _simplest(figures: Figures) -> str:
    simplest, met = figures["simplest"], 100.0 * figures["share_met_of_simplest"]
    return (
        f"In {figures['cases'] - simplest} of the cases a set of fewer parameters explains the recordings as "
        "well as the truth: an answer that gives it, as it should, counts as abstained. "
        f"Of the other {simplest} cases {met:.0f} % are met.\n"
    )


def _grouped(what: str, groups: Mapping[str, Figures]) -> str:
    shown = [n for n in RESULTS if any(row[n] for row in groups.values())]
    timed = all("seconds_median" in row for row in groups.values())
    rows = [
        (
            key,
            row.get("cases", sum(row[n] for n in RESULTS)),
            *(row[n] for n in shown),
            *((_number(row["seconds_median"]),) if timed else ()),
        )
        for key, row in groups.items()
    ]
    return _table((what, "cases", *shown, *(("core seconds, median",) if timed else ())), rows)


def _confusion(confusion: Mapping[str, Mapping[str, int]]) -> str:
    rows = [
        (true, ", ".join(f"{named} {n}" for named, n in sorted(row.items(), key=lambda pair: -pair[1])))
        for true, row in confusion.items()
    ]
    return _table(("put in", "named as, times"), rows)


def _reliability(of: str, rows: Sequence[Mapping[str, Any]]) -> str:
    head = (f"probability of an {of}" if of == "effect" else f"probability of a {of}", "said", "mean", "true")
    own = [r for r in rows if r["claims"]]
    return _table(
        head,
        [(f"{r['from']:g} to {r['to']:g}", r["claims"], _number(r["mean"]), _number(r["true"])) for r in own],
    )


def _sizes(sizes: Mapping[str, int]) -> str:
    rows = [(size, n) for size, n in sorted(sizes.items(), key=lambda pair: int(pair[0]))]
    return _table(("sets that the recordings cannot tell from the truth, itself included", "cases"), rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    rows = [*rows]
    number = [bool(rows) and all(isinstance(r[i], int | float) for r in rows) for i in range(len(head))]
    lines = [head, ["--:" if n else "---" for n in number], *rows]
    return "".join(f"| {' | '.join(str(c) for c in line)} |\n" for line in lines)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
