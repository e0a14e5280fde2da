"""Which parameters of the machine the traces identify, and which are assumed."""

import hashlib
import json
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.models.slew import evidence, fit
from fmus.models.slew.evidence import Identifiability
from records.report.picture import Panel
from specs import parameters as parameter_specs
from specs.parameters import Parameter
from specs.progress import Report
from verification.dossier import svg
from verification.dossier.markdown import chapter, code, number, picture, significant, table
from verification.dossier.section import Section

FILES = ("geometry", "slew", "machine")
# Share of a value that comes from the traces, the rest being its start value.
IDENTIFIED, WEAK = 0.8, 0.5
STATUSES = ("datasheet", "measured", "identified", "assumed")
FITTED_COLUMNS = ("parameter", "value", "standard error", "start", "spread", "unit")
FITTED_COLUMNS += ("from traces", "verdict", "status")
CAPTION = (
    "Left: share of each fitted value that comes from the traces. Right: singular values of the errors' "
    "sensitivities, parameters in spreads; below the dashed line the start decides."
)
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
        "fingerprint": fingerprint(),
        "singular_values": found.singular_values.tolist(),
        "coupled": [{"one": a, "other": b, "correlation": c} for a, b, c in found.coupled],
        "status": {name: dict(Counter(p.status for p in group.values())) for name, group in known.items()},
        "called_identified_but_weak": _overstated(known["slew"], verdicts),
    }
    text = _text(known, figures, found)
    pictures = {"identifiability.svg": _bars(found, verdicts)}
    return Section("parameters", "Which parameters the traces identify", text, figures, pictures)


def fingerprint() -> str:
    """Short hash of the values of all parameters of the machine."""
    values = {n: p.value for n, p in parameter_specs.load(*FILES).items()}
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def verdict(resolution: float) -> str:
    """`identified`, `weak` or `not` from the share that comes from the traces."""
    return "identified" if resolution >= IDENTIFIED else "weak" if resolution >= WEAK else "not"


def _overstated(known: Mapping[str, Parameter], verdicts: Mapping[str, str]) -> list[str]:
    return [n for n, v in verdicts.items() if v == "not" and known[n].status == "identified"]


def _text(
    known: Mapping[str, Mapping[str, Parameter]], figures: Mapping[str, Any], found: Identifiability
) -> str:
    counts = Counter(row["verdict"] for row in figures["fitted"].values())
    values = found.singular_values
    coupled = [[code(one), code(other), number(c)] for one, other, c in found.coupled]
    fitted = [_fitted_row(n, r, known["slew"]) for n, r in figures["fitted"].items()]
    return chapter(
        "parameters",
        statuses=_status_table(figures["status"]),
        count=len(fitted),
        identified_from=f"{100 * IDENTIFIED:.0f} %",
        weak_from=f"{100 * WEAK:.0f} %",
        identified=counts["identified"],
        weak=counts["weak"],
        unidentified=counts["not"],
        fitted=table(FITTED_COLUMNS, fitted, right=(1, 2, 3, 4, 6)),
        overstated=_overstated_text(figures["called_identified_but_weak"]),
        bars=picture("identifiability.svg", CAPTION),
        singular_values=", ".join(significant(v, 3) for v in values),
        above=int((values > fit.PRIOR_WEIGHT).sum()),
        weight=f"{fit.PRIOR_WEIGHT:g}",
        coupled=table(("one", "other", "correlation"), coupled, right=(2,)) if coupled else "None.",
        fingerprint=code(figures["fingerprint"]),
        all_parameters=_all_tables(known),
    )


def _status_table(counts: Mapping[str, Mapping[str, int]]) -> str:
    total = sum((Counter(c) for c in counts.values()), Counter())
    rows = [[code(f"{n}.toml"), *(str(c.get(s, 0)) for s in STATUSES)] for n, c in counts.items()]
    rows.append(["all", *(str(total[s]) for s in STATUSES)])
    return table(("parameters of the machine, by status", *STATUSES), rows)


def _overstated_text(names: list[str]) -> str:
    if not names:
        return "No parameter that is called *identified* has the verdict *not*."
    return f"**Called *identified*, but the verdict is *not*:** {', '.join(map(code, names))}."


def _fitted_row(name: str, row: Mapping[str, Any], known: Mapping[str, Parameter]) -> list[str]:
    values = (
        significant(row[k], 4 if k == "shipped" else 2) for k in ("shipped", "deviation", "start", "spread")
    )
    return [
        code(name),
        *values,
        row["unit"],
        f"{100 * row['resolution']:.0f} %",
        row["verdict"],
        known[name].status,
    ]


def _all_tables(known: Mapping[str, Mapping[str, Parameter]]) -> str:
    parts = []
    for name, group in known.items():
        rows = [[code(p.name), significant(p.value), p.unit, p.status, p.source] for p in group.values()]
        body = table(("parameter", "value", "unit", "status", "source"), rows, right=(1,))
        head = f"specs/parameters/{name}.toml: {len(group)} parameters"
        parts.append(f"<details><summary>{head}</summary>\n\n{body}\n\n</details>")
    return "\n\n".join(parts)


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
    decades = {float(k): f"{10.0**k:g}" for k in range(int(low), int(high) + 1)}
    drawn = svg.axes(panel, "Singular values", "number", "", None, decades)
    weight = float(np.log10(fit.PRIOR_WEIGHT))
    drawn += svg.line(panel, panel.x, (weight, weight), svg.RED, 1.4, "5 4")
    return drawn + svg.dots(panel, range(1, len(values) + 1), exponents, svg.BLUE, 3.5)
