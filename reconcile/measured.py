"""The recordings of a real pendulum, reconciled, and predicted a second ahead before and after."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from reconcile import holdout
from reconcile.data import Block, Parts, Run, Signal, read_run
from reconcile.fit.solve import Fitted
from reconcile.fit.windows import cut
from reconcile.model import Folder, read_folder
from reconcile.study import Study
from reconcile.workflow import SEED, Report, examine
from records import scores
from specs.errors import InputError

DOWN = 0.9  # wanted of the error on held-out runs, as a share
AHEAD_S = 1.0  # of a prediction, after the stretch from which its initial state is estimated
RATE_HZ = 50.0  # of angle and speed as used, of 50 to 500 recorded: it swings at 0.7 Hz; torque is used whole
FIT = ("free/energy_shaping.csv", "free/ilqr.csv")
HELD_OUT = ("control_method_ddp_data_measured.csv", "control_method_direct_collocation_data_measured.csv")
OTHERS = (
    *FIT,
    "sysid_data_measured.csv",  # its torque jumps by 15 N m from sample to sample: nothing to judge by
    "control_method_energy_shaping_data_measured.csv",
    "control_method_ilqr_data_measured.csv",
)


def measure(data: Path, report: Report | None = None) -> dict[str, Any]:
    """Reconcile the pendulum's recordings in a folder; figures of the answer, and by run.

    Raises InputError where the folder does not hold them.
    """
    for name in ("model/model.py", *FIT, *HELD_OUT, *OTHERS):
        if not (data / name).is_file():
            raise InputError(f"{data} has no {name}; name the folder of the pendulum's recordings")
    folder = read_folder(data / "model")
    runs, held_out = (_runs(data, names, folder) for names in (FIT, HELD_OUT))
    figures, study, answer = examine(folder, runs, (), held_out, report=report)
    rows = {}
    for name in (*HELD_OUT, *OTHERS):
        held_out = name in HELD_OUT
        runs = _runs(data, (name,), folder)
        rows[name] = {"held_out": held_out, **_compared(study, answer.base, answer.fitted, runs)}
    alone = {
        name: _alone(folder, _runs(data, (name,), folder), study, answer.fitted) for name in (*FIT, *HELD_OUT)
    }
    figures["seed"] = SEED
    kept = ("verdict", "sentence", "effects", "residual_status", "alternatives", "reestimated", "gap", "seed")
    return {k: figures[k] for k in kept if k in figures} | {"ahead_s": AHEAD_S, "runs": rows, "alone": alone}


def _runs(data: Path, names: Sequence[str], folder: Folder) -> list[Run]:
    return [_thinned(run) for name in names for run in read_run(data / name, folder)]


def _thinned(run: Run) -> Run:
    """The run with its outputs at about RATE_HZ, samples left out and none averaged."""
    every = max(1, round(1.0 / (RATE_HZ * run.period_s)))
    outputs = {n: Signal(s.time[::every], s.values[::every]) for n, s in run.outputs.items()}
    return replace(run, outputs=outputs)


def _compared(study: Study, base: Fitted, after: Fitted, runs: Sequence[Run]) -> dict[str, Any]:
    """Root mean square error of each output AHEAD_S ahead, and the share by which it went down."""
    blocks = [Block(r, r.start_s, r.end_s) for r in runs]
    windows = cut(blocks, AHEAD_S / (1.0 - holdout.PREFIX), study.step_s)
    before, now = (holdout.predict(study, f, windows) for f in (base, after))
    return {
        name: {
            "before": (was := scores.rms(holdout.pairs(before, name))),
            "after": (left := scores.rms(holdout.pairs(now, name))),
            "down": 1.0 - left / was if was > 0.0 else 0.0,
        }
        for name in study.floors
    }


def _alone(folder: Folder, runs: Sequence[Run], study: Study, fitted: Fitted) -> dict[str, float]:
    """Parameters of the answer's effects fitted to one recording alone, started from the answer."""
    blocks = tuple(Block(r, r.start_s, r.end_s) for r in runs)
    present = fitted.point.present
    effects = list(dict.fromkeys(a.effect for a in present))  # one may be at two ports
    own = Study(folder, Parts(blocks, blocks, blocks), effects)
    chosen = [a for a in own.candidates if a.key in {x.key for x in present}]
    known = study.named(fitted.point.p)
    start = own.fit_problem.start(own.values | {n: v for n, v in known.items() if n in own.values})
    found = own.fit_set(replace(start, present=()), chosen, {n: known[n] for a in chosen for n in a.free})
    if found is None:
        return {}
    return {f.name: float(found.point.p[own.extended.index[f.name]]) for f in found.free}


def limits(figures: dict[str, Any]) -> list[str]:
    """What is wanted of the answer and was missed."""
    missed = []
    if "gravity_load" not in {e["name"] for e in figures["effects"]}:
        missed.append(f"gravity_load is not named: {figures['sentence']}")
    for run, row in figures["runs"].items():
        if row["held_out"] and not row["position"]["down"] >= DOWN:
            missed.append(f"{run}: error down {100 * row['position']['down']:.1f} %, wanted {100 * DOWN:g} %")
    return missed


def page(figures: dict[str, Any], version: str) -> str:
    """The figures in Markdown."""
    lines = [
        f"`python -m benchmarks pendulum --markdown FILE` makes this; version {version}, nothing is drawn.",
        "",
        f"**{figures['verdict']}**: {figures['sentence']}",
        "",
        "| effect | equation | parameter | value | 95 % |",
        "|---|---|---|--:|---|",
    ]
    for e in figures["effects"]:
        for name, q in e["parameters"].items():
            low, high = q["ci95"]
            lines.append(
                f"| `{e['name']}` | {e['equation'].replace('|', chr(92) + '|')} | {name} "
                f"| {q['value']:.4g} {q['unit']} | {low:.4g} … {high:.4g} |"
            )
    lines += [
        "",
        f"Root mean square error of the position over {figures['ahead_s']:g} s ahead, of the re-estimated "
        "base model and of the extended one:",
        "",
        "| recording | use | before [rad] | after [rad] | down |",
        "|---|---|--:|--:|--:|",
    ]
    for run, row in figures["runs"].items():
        p = row["position"]
        use = "held out" if row["held_out"] else "fitted, confirmed" if run in FIT else "—"
        lines.append(f"| `{run}` | {use} | {p['before']:.3g} | {p['after']:.3g} | {100 * p['down']:.1f} % |")
    names = list(dict.fromkeys(n for row in figures["alone"].values() for n in row))
    if names:
        short = [n.split("@")[0] + ("." + n.rsplit(".", 1)[1] if "@" in n else "") for n in names]
        lines += [
            "",
            "The same parameters fitted to one recording alone:",
            "",
            "| recording | " + " | ".join(short) + " |",
            "|---|" + "--:|" * len(names),
        ]
        for run, row in figures["alone"].items():
            lines.append(f"| `{run}` | " + " | ".join(f"{row.get(n, np.nan):.4g}" for n in names) + " |")
    return "\n".join(lines) + "\n"
