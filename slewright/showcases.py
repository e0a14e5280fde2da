"""Showcases: a plain model, recordings of the simulated reference machine, what reconcile adds to it.

Each collects its recordings, reconciles the plain model with them, and lets the scenarios of an empty grab
run on the nominal system with the plain and with the extended model, and on the reference machine.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PLAN = "showcases"
SCENARIOS = ("four_targets_empty", "five_targets_empty")
METRICS = {"speed": "°/s", "overshoot": "°", "error": "m", "tool": "°/s"}
SYSTEMS = ("plain", "extended", "machine")
Report = Callable[..., None]


@dataclass(frozen=True)
class Showcase:
    """`model`: the plain one, a folder or a model's name; `part`: of the plan; `lacks`: what must be named.

    One of `lacks` is enough.  `moves`: the metrics that the model has a say in.
    """

    name: str
    model: str
    part: str
    lacks: tuple[str, ...]
    moves: tuple[str, ...]


COUPLINGS = ("coriolis_coupling", "centrifugal_coupling", "euler_coupling")
SHOWCASES = {
    "tool": Showcase("tool", "tool", "slewing", COUPLINGS, ("error", "tool")),
    "slew": Showcase(
        "slew", "docs/showcases/slew_one_pose", "reaching", ("pose_dependent_inertia",), tuple(METRICS)
    ),
}


def measure(chosen: Showcase, out: Path, seed: int = 1, report: Report | None = None) -> dict[str, Any]:
    """Figures of a showcase; recordings, report and verification lie in `out`.

    `seed`: of the scenarios' sensor noise.  Raises InputError for a folder with something else in it;
    RunError when a run fails.
    """
    from reconcile.workflow import reconcile
    from specs.version import VERSION

    said = report or (lambda *_: None)
    sets = record(chosen, out / "recordings", said)
    folder = out / chosen.name
    answer = reconcile(sets["train"], chosen.model, folder, sets["validation"], sets["test"], report=said)
    extended = folder / "model" if "model" in answer else None
    metrics = verified(chosen, extended, out / "verify", seed, said)
    kept = ("verdict", "sentence", "residual_status", "alternatives", "effects", "reestimated", "gap")
    found = {k: answer[k] for k in kept} | {"metrics": metrics, "closer": closer(metrics)}
    recordings = {which: [p.name for p in paths] for which, paths in sets.items()}
    return found | {"recordings": recordings, "seed": seed, "versions": {"slewright": VERSION}}


def record(chosen: Showcase, out: Path, report: Report | None = None) -> dict[str, list[Path]]:
    """The showcase's recordings by split, made where they are not there yet."""
    from learning.collection.collect import collect
    from learning.collection.plan import load_plan

    manifest = collect(load_plan(Path(PLAN)), out, parts=[chosen.part], report=report)
    found: dict[str, list[Path]] = {"train": [], "validation": [], "test": []}
    for row in manifest["recordings"]:
        if row["part"] == chosen.part:
            found[row["split"]].append(out / row["file"])
    return found


def verified(
    chosen: Showcase, extended: Path | None, out: Path, seed: int, report: Report | None = None
) -> dict[str, dict[str, float]]:
    """Metrics of `SYSTEMS`, each the mean over the scenarios; without an extended model, of the others."""
    from orchestrator.verify import verify

    plain = Path(chosen.model) if Path(chosen.model).is_dir() else None
    wanted = {"plain": ("nominal", plain), "extended": ("nominal", extended), "machine": ("reference", None)}
    found = {}
    for name, (system, model) in wanted.items():
        if name == "extended" and extended is None:
            continue
        folder = out / chosen.name / name
        verify(SCENARIOS, (system,), seed, folder, model, jobs=1, progress=report)
        scenarios = json.loads((folder / "metrics.json").read_text())["scenarios"]
        rows = [scenarios[s][system] for s in SCENARIOS]
        found[name] = {m: sum(r[m] for r in rows) / len(rows) for m in METRICS}
    return found


def closer(metrics: Mapping[str, Mapping[str, float]]) -> dict[str, float | None]:
    """By metric, the share of the distance to the machine that the extended model took away (< 0: added).

    None where plain model and machine do not differ, or nothing was extended.
    """
    shares: dict[str, float | None] = {}
    for m in METRICS:
        distance = {s: abs(metrics[s][m] - metrics["machine"][m]) for s in metrics}
        known = "extended" in distance and distance["plain"] > 0.0
        shares[m] = 1.0 - distance["extended"] / distance["plain"] if known else None
    return shares


def missed(chosen: Showcase, figures: Mapping[str, Any]) -> list[str]:
    """What is wanted of a showcase and was missed."""
    named = {e["name"] for e in figures["effects"]}
    found = []
    if not named & set(chosen.lacks):
        found.append(f"{chosen.name}: none of {', '.join(chosen.lacks)} is named: {figures['sentence']}")
    for name, gap in figures["gap"].items():
        if named and not _less(gap["after"], gap["nominal"]):
            found.append(f"{chosen.name}: the gap of {name} did not shrink")
    for m in chosen.moves:
        share = figures["closer"][m]
        if share is not None and share <= 0.0:
            found.append(f"{chosen.name}: {m} did not move towards the machine")
    return found


def _less(after: float | None, before: float | None) -> bool:
    return after is not None and (before is None or after < before)


def page(chosen: Showcase, figures: Mapping[str, Any]) -> str:
    """The figures in Markdown."""
    command = (
        f"slewright bench showcases --only {chosen.name} --seed {figures['seed']} --markdown docs/showcases"
    )
    lines = [f"`{command}` makes this part; version {figures['versions']['slewright']}.", ""]
    for which, use in (("train", "fitted"), ("validation", "confirm"), ("test", "held out")):
        lines.append(f"- {use}: " + ", ".join(f"`{n}`" for n in figures["recordings"][which]))
    lines += ["", f"**{figures['verdict']}**: {figures['sentence']}", ""]
    return "\n".join([*lines, *_effects(figures), "", *_gap(figures), "", *_metrics(figures)]) + "\n"


def _effects(figures: Mapping[str, Any]) -> list[str]:
    rows = ["| effect | equation | parameter | value | 95 % |", "|---|---|---|--:|---|"]
    for e in figures["effects"]:
        for name, q in e["parameters"].items():
            low, high = q["ci95"]
            equation = e["equation"].replace("|", "\\|")
            value = f"{q['value']:.4g} {q['unit']}"
            rows.append(f"| `{e['name']}` | {equation} | {name} | {value} | {low:.4g} … {high:.4g} |")
    return rows


def _gap(figures: Mapping[str, Any]) -> list[str]:
    rows = [
        "Gap above the floor, on what is held out:",
        "",
        "| signal | floor | plain | re-estimated | extended |",
        "|---|--:|--:|--:|--:|",
    ]
    for name, g in figures["gap"].items():
        values = " | ".join(_number(g[k]) for k in ("floor", "nominal", "reestimated", "after"))
        rows.append(f"| `{name}` [{g['unit']}] | {values} |")
    return rows


def _metrics(figures: Mapping[str, Any]) -> list[str]:
    names = {
        "plain": "nominal system, plain model",
        "extended": "nominal system, extended model",
        "machine": "simulated reference machine",
    }
    rows = [
        f"`slewright verify` on {' and '.join(f'`{s}`' for s in SCENARIOS)}, mean of the two:",
        "",
        "| system | " + " | ".join(f"{m} [{unit}]" for m, unit in METRICS.items()) + " |",
        "|---|" + "--:|" * len(METRICS),
    ]
    for s, found in figures["metrics"].items():
        rows.append(f"| {names[s]} | " + " | ".join(f"{found[m]:.2f}" for m in METRICS) + " |")
    shares = [figures["closer"][m] for m in METRICS]
    told = [
        "as far" if x is None else f"{100 * x:.0f} % closer" if x >= 0 else f"{-100 * x:.0f} % farther"
        for x in shares
    ]
    return [*rows, "| extended against plain | " + " | ".join(told) + " |"]


def _number(value: float | None) -> str:
    return "runs away" if value is None else f"{value:.3g}"


def pages(folder: Path, chosen: Sequence[Showcase], figures: Mapping[str, Any]) -> None:
    """Fill the part between the markers of every showcase's page in a folder."""
    from slewright import markers

    for showcase in chosen:
        markers.fill(folder / f"{showcase.name}.md", "showcase", page(showcase, figures[showcase.name]))
