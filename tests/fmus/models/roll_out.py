"""Reference roll-outs of discrete models: columns time, inputs held from then on, outputs at that time.

`SLEWRIGHT_UPDATE_REFS=1 pytest ...` rewrites a model's reference.csv; the difference is then in the commit.
"""

import csv
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import casadi as ca
import numpy as np

from fmus.definition import Model
from fmus.toolchain.discrete import DiscreteStepper

ROOT = Path(__file__).resolve().parents[3]
Stimuli = Callable[[int], Mapping[str, float]]


def check_reference(model: Model, folder: str, stimuli: Stimuli, ticks: int) -> None:
    """The roll-out with `stimuli` of the tick equals the model's reference.csv."""
    header, rows = roll_out(model, stimuli, ticks)
    path = ROOT / folder / "reference.csv"
    if os.environ.get("SLEWRIGHT_UPDATE_REFS"):
        lines = [",".join(header), *(",".join(f"{value:.12g}" for value in row) for row in rows)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with path.open(encoding="utf-8", newline="") as file:
        read_header, *read = list(csv.reader(file))
    assert read_header == header
    np.testing.assert_allclose(np.array(rows), np.array(read, dtype=float), rtol=1e-8, atol=1e-8)


def roll_out(model: Model, stimuli: Stimuli, ticks: int) -> tuple[list[str], list[list[float]]]:
    """Header and rows of a roll-out of `ticks` steps, every fifth one kept."""
    run, rows = DiscreteStepper(model), []
    for tick in range(ticks + 1):
        run.set(**stimuli(tick))
        if tick % 5 == 0:
            rows.append([tick * model.step, *run.u, *run.outputs().values()])
        run.advance()
    return ["time", *(v.name for v in (*model.inputs, *model.outputs))], rows


def feeds_through(model: Model) -> list[str]:
    """Inputs that an output depends on directly: none, for a discrete model."""
    return _dependencies(model, 1, (model.h,))


def unused_parameters(model: Model) -> list[str]:
    """Parameters that neither equations, outputs nor start depend on, nor a delay names."""
    used = set(_dependencies(model, 3, (model.f, model.h))) | set(model.delays.values())
    p = model.symbols[3]
    used |= {
        v.name
        for v, hit in zip(model.parameters, ca.which_depends(model.x0(p), p, 1, False), strict=True)
        if hit
    }
    return [v.name for v in model.parameters if v.name not in used]


def _dependencies(model: Model, group: int, functions: tuple[ca.Function, ...]) -> list[str]:
    names = [v.name for v in (model.states, model.inputs, model.modes, model.parameters)[group]]
    symbol = model.symbols[group]
    hits = [ca.which_depends(f(*model.symbols), symbol, 1, False) for f in functions]
    return [name for name, *hit in zip(names, *hits, strict=True) if any(hit)]
