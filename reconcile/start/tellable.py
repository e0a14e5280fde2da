"""`slewright reconcile … --check-only`: what recordings can tell of a model, before anything is searched."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reconcile.equations.model import Attached
from reconcile.judging import inputs, mistaken, unidentifiable
from reconcile.recordings import checks
from reconcile.recordings.data import Run, read_run, split
from reconcile.reporting.terminal import without_axis
from reconcile.search.core import Core
from reconcile.search.screen import Screen
from reconcile.search.shapes import Shapes
from reconcile.start import units
from reconcile.tolerances import KNOWN
from specs.errors import InputError
from specs.version import VERSION

SPARSE, DENSE = 5.0, 400.0  # samples in the time in which the outputs forget: fewer or more are said
SLIGHT = 0.1  # of the forces at a port: an effect that is told from here on is told well


def examine(paths: Sequence[Path], model: str, names: Path | None = None) -> dict[str, Any]:
    """Figures: sampling, noise by output, parameters and effects with what the recordings tell of them.

    And what would be asked about units, signs and names of channels.

    Raises InputError for recordings or a model that cannot be used, an FMU or a system among them.
    """
    if Path(model).suffix.lower() == ".fmu":
        raise InputError(f"{model} is closed; --check-only needs a model folder")
    folder = checks.open_folder(model)
    variables = [v.name for v in (*folder.model.inputs, *folder.model.outputs)]
    renamed = checks.read_names(names, variables)
    runs = [run for path in paths for run in read_run(path, folder, renamed)]
    if asked := units.question(folder.model, runs, renamed):
        raise InputError(asked)
    runs = list(inputs.without_noise(folder, (runs, (), ()))[0])
    core = Core(folder, split(runs, (), ()))
    return told(core, runs) | {"question": mistaken.evident(core, renamed)}


def told(core: Core, runs: Sequence[Run]) -> dict[str, Any]:
    """The figures of a folder that is filtered."""
    screen = Screen(core, core.base, Shapes(core))
    per = core.memory_s / core.period
    known = core.known(core.base)
    return {
        "samples": sum(len(r.time) for r in core.records),
        "period_s": core.period,
        "memory_s": core.memory_s,
        "sampling": _sampling(per),
        "noise": {n: {"level": f.level, "source": f.source} for n, f in core.floors.items()},
        "parameters": {n: {"known_to": share, "told": share < KNOWN} for n, share in known.items()},
        "unseen": unidentifiable.parameters(core, core.base),
        "effects": {a.key: _effect(screen, a) for a in core.candidates if a.effect.amplitudes},
        "not_foretold": [a.key for a in core.candidates if not a.effect.amplitudes],
        "untold": unidentifiable.effects(core.folder, runs),
        "notes": [*(f"{r.name}: {n}" for r in runs for n in r.notes), *units.notes(runs)],
        "seed": 0,
        "versions": {"slewright": VERSION},
    }


def _sampling(per: float) -> str:
    text = f"{per:.3g} samples in the time in which the outputs forget where they were"
    if per < SPARSE:
        return f"{text}: fast effects do not show"
    return f"{text}: more than is needed" if per > DENSE else text


def _effect(screen: Screen, a: Attached) -> dict[str, Any]:
    """The least amplitude that shows at two deviations, as a share of the forces (or signals) there."""
    least = screen.least(a)
    told_as = "not separable" if least is None else "well" if least < SLIGHT else "weakly"
    return {"least": None if least is None or not np.isfinite(least) else least, "told": told_as}


def lines(figures: dict[str, Any]) -> list[str]:
    """What is printed."""
    by: dict[str, list[str]] = {"well": [], "weakly": [], "not separable": []}
    for n, e in figures["effects"].items():
        by[e["told"]].append(n)
    unknown = [n for n, p in figures["parameters"].items() if not p["told"]]
    known = [n for n in figures["parameters"] if n not in unknown]
    found = [f"sampling: {figures['sampling']}"]
    found += [f"noise of {n}: {f['level']:.3g} ({f['source']})" for n, f in figures["noise"].items()]
    found += [*figures["notes"], f"parameters that they tell: {', '.join(known) or 'none'}"]
    rows = {
        "parameters that they do not tell": unknown,
        "effects that they tell well": by["well"],
        "effects that they tell weakly": by["weakly"],
        "effects that look like something else": by["not separable"],
        "effects that are looked for, but nothing says before how well they show": figures["not_foretold"],
    }
    found += [f"{what}: {', '.join(names)}" for what, names in rows.items() if names]
    asked = [f"question: {figures['question']}"] if figures.get("question") else []
    return found + without_axis(figures) + asked
