"""Which parameters of the machine the traces identify, and which are assumed."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.slew import evidence, fit
from fmus.slew.evidence import Identifiability
from orchestrator.dossier import svg
from orchestrator.dossier.section import Report, Section, number, picture, significant, table
from records.report.picture import Panel
from specs import parameters as parameter_specs
from specs.parameters import Parameter

FILES = ("geometry", "slew", "machine")
# Share of a value that comes from the traces, the rest being its start value.
IDENTIFIED, WEAK = 0.8, 0.5
COLOURS = {"identified": svg.BLUE, "weak": svg.ORANGE, "not": svg.GREY}


def section(report: Report) -> Section:
    """Tables of all parameters, and how much the traces say about the fitted ones."""
    report("identifiability of the slew parameters")
    result = evidence.shipped()
    found = evidence.identifiability(result)
    fitted = evidence.parameters(result)
    verdicts = {n: verdict(row["resolution"]) for n, row in fitted.items()}
    known = {name: parameter_specs.load(name) for name in FILES}
    figures = {
        "fitted": {n: {**row, "verdict": verdicts[n]} for n, row in fitted.items()},
        "singular_values": found.singular_values.tolist(),
        "coupled": [{"one": a, "other": b, "correlation": c} for a, b, c in found.coupled],
        "status": {name: dict(Counter(p.status for p in group.values())) for name, group in known.items()},
        "called_identified_but_weak": _overstated(known["slew"], verdicts),
    }
    text = _text(known, figures, found)
    pictures = {"identifiability.svg": _bars(found, verdicts)}
    return Section("parameters", "Which parameters the traces identify", text, figures, pictures)


def verdict(resolution: float) -> str:
    """`identified`, `weak` or `not` from the share that comes from the traces."""
    return "identified" if resolution >= IDENTIFIED else "weak" if resolution >= WEAK else "not"


def _overstated(known: Mapping[str, Parameter], verdicts: Mapping[str, str]) -> list[str]:
    return [n for n, v in verdicts.items() if v == "not" and known[n].status == "identified"]


def _text(
    known: Mapping[str, Mapping[str, Parameter]], figures: Mapping[str, Any], found: Identifiability
) -> str:
    counts = Counter(row["verdict"] for row in figures["fitted"].values())
    scaled = figures["singular_values"]
    above = sum(v > fit.PRIOR_WEIGHT for v in scaled)
    statuses = ("datasheet", "measured", "identified", "assumed")
    rows = [[f"`{n}.toml`", *(str(c.get(s, 0)) for s in statuses)] for n, c in figures["status"].items()]
    total = sum((Counter(c) for c in figures["status"].values()), Counter())
    rows.append(["all", *(str(total[s]) for s in statuses)])
    coupled = [[_code(c["one"]), _code(c["other"]), number(c["correlation"])] for c in figures["coupled"]]
    return f"""
{table(("parameters of the machine, by status", *statuses), rows)}
*datasheet*: published for this machine. *measured*: read off the traces directly. *identified*: fitted to the
traces. *assumed*: our estimate; no public source states it for this machine. Everything about arm cylinders, valves,
pump, tool body and sensor noise is assumed: the machine is a stand-in there, not a copy.

**The fitted parameters.** The fit starts each of {len(figures["fitted"])} parameters at a value with a spread
(`fmus/slew/start.toml`) and weighs the traces against it. Linearised at the shipped values, *from traces* is the
share of a value that the traces decide, the rest stays with its start; *standard error* allows for both. Verdict:
**identified** from {IDENTIFIED:.0%} on ({counts["identified"]} parameters), **weak** from {WEAK:.0%} on
({counts["weak"]}), **not** below ({counts["not"]}): such a value is its start, moved a little.

{
        table(
            (
                "parameter",
                "value",
                "standard error",
                "start",
                "spread",
                "unit",
                "from traces",
                "verdict",
                "status",
            ),
            [_fitted_row(n, r, known["slew"]) for n, r in figures["fitted"].items()],
            right=(1, 2, 3, 4, 6),
        )
    }
{_overstated_text(figures["called_identified_but_weak"])}
{
        picture(
            "identifiability.svg",
            "Left: share of each fitted value that comes from the traces. Right: singular values "
            "of the errors' sensitivities, parameters in spreads; below the dashed line the start decides.",
        )
    }
Singular values: {", ".join(significant(v, 3) for v in scaled)}. {above} of {
        len(scaled)
    } directions lie above the
weight of the start ({fit.PRIOR_WEIGHT:g}): the traces determine that many combinations, not {
        len(scaled)
    } parameters.
These pairs are known in combination only (|correlation| > 0.7):

{table(("one", "other", "correlation"), coupled, right=(2,)) if coupled else "None."}
The standard errors take residuals of neighbouring samples as independent, which they are not; the true ones are
larger. The spreads of the re-draws (chapter 7) are therefore wider than these errors.

{_all_tables(known)}"""


def _overstated_text(names: list[str]) -> str:
    if not names:
        return "No parameter that is called *identified* has the verdict *not*.\n"
    return f"**Called *identified*, but the verdict is *not*:** {', '.join(map(_code, names))}.\n"


def _fitted_row(name: str, row: Mapping[str, Any], known: Mapping[str, Parameter]) -> list[str]:
    values = (
        significant(row[k], 4 if k == "shipped" else 2) for k in ("shipped", "deviation", "start", "spread")
    )
    return [
        _code(name),
        *values,
        row["unit"],
        f"{100 * row['resolution']:.0f} %",
        row["verdict"],
        known[name].status,
    ]


def _all_tables(known: Mapping[str, Mapping[str, Parameter]]) -> str:
    parts = ["**All parameters**, file by file.\n"]
    for name, group in known.items():
        rows = [[_code(p.name), significant(p.value), p.unit, p.status, p.source] for p in group.values()]
        body = table(("parameter", "value", "unit", "status", "source"), rows, right=(1,))
        head = f"specs/parameters/{name}.toml: {len(group)} parameters"
        parts.append(f"<details><summary>{head}</summary>\n\n{body}\n</details>\n")
    return "\n".join(parts)


def _code(name: str) -> str:
    return f"`{name}`"


def _bars(found: Identifiability, verdicts: Mapping[str, str]) -> str:
    order = np.argsort(-found.resolution)
    n = len(order)
    panel = Panel(170, 54, 380, 18.0 * n, (0.0, 1.0), (0.0, float(n)))
    share = {k / 5: f"{20 * k} %" for k in range(6)}
    parts = [svg.axes(panel, "Share decided by the traces", "", "", share, {})]
    for row, i in enumerate(order):
        name, y = found.names[i], n - row - 0.5
        color = COLOURS[verdicts[name]]
        parts.append(svg.box(panel, (0.0, float(found.resolution[i])), (y - 0.34, y + 0.34), color))
        parts.append(svg.text(panel.left - 7, panel.at_y(y) + 4, name.removeprefix("slew_"), anchor="end"))
    parts.append(svg.legend(170, 24, [(c, v) for v, c in COLOURS.items()]))
    parts.append(_spectrum(found.singular_values, panel.height))
    return svg.document(960, panel.top + panel.height + 52, "Identifiability of the slew parameters", parts)


def _spectrum(values: np.ndarray, height: float) -> str:
    exponents = np.log10(values)
    low, high = float(np.floor(exponents.min())), float(np.ceil(exponents.max()))
    panel = Panel(640, 54, 290, height, (0.0, len(values) + 1.0), (low, high))
    decades = {k: f"{10.0**k:g}" for k in range(int(low), int(high) + 1)}
    drawn = svg.axes(panel, "Singular values", "number", "", None, decades)
    weight = float(np.log10(fit.PRIOR_WEIGHT))
    drawn += svg.line(panel, panel.x, (weight, weight), svg.RED, 1.4, "5 4")
    return drawn + svg.dots(panel, range(1, len(values) + 1), exponents, svg.BLUE, 3.5)
