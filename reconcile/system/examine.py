"""Find and name in a system: part after part, each given the motion of those it feels; then one answer."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from reconcile.equations.model import Folder, read_folder
from reconcile.judging.answer import Answer
from reconcile.recordings.data import Run, Signal, runs_of
from reconcile.system import neighbour_motion
from reconcile.system.parts import Part, with_signals
from reconcile.system.ways import followed
from records.measurement import Channel, Measurement
from specs.errors import InputError

Report = Callable[..., None]
Examine = Callable[..., tuple[dict[str, Any], Answer]]
MOST = 4  # sets that an ambiguous answer declares
STANDING = (
    "unexplained",
    "insufficient_excitation",
    "reestimated",
    "agrees",
)  # the first of the parts' holds


@dataclass(frozen=True)
class Examined:
    """A part's figures with its answer."""

    part: Part
    folder: Folder
    figures: dict[str, Any]
    answer: Answer


@dataclass
class Recording:
    """A recording of the whole, and the motion that its parts were found to make: by signal."""

    label: str
    measured: Measurement
    motion: dict[str, Channel] = field(default_factory=dict)


def examine(
    parts: Sequence[Part],
    sets: Sequence[Sequence[tuple[str, Measurement]]],
    one: Examine,
    report: Report,
) -> tuple[dict[str, Any], list[Examined]]:
    """The report's figures of a system, and what was found part by part.

    `sets`: recordings to fit, to confirm and to hold out, each with its label; `one` examines a single model.
    Raises InputError when no part can be examined; parts whose signals are missing are named in `left_out`.
    """
    recordings = [[Recording(label, with_signals(m)) for label, m in group] for group in sets]
    done: list[Examined] = []
    left_out: dict[str, str] = {}
    for part in parts:
        said = _within(report, part)
        folder = read_folder(part.model)
        try:
            runs = followed(part, folder, partial(_runs, folder, recordings))
        except InputError as error:
            left_out[part.name] = str(error)
            continue
        figures, answer = one(folder, *runs, report=said)
        done.append(Examined(part, folder, figures, answer))
        for group, own in zip(recordings, runs, strict=True):
            for r in group:
                _remember(r, done[-1], [run for run in own if run.name.split("#")[0] == r.label])
    if not done:
        raise InputError("; ".join(left_out.values()))
    return merged(done) | {"left_out": left_out}, done


def _runs(folder: Folder, recordings: Sequence[Sequence[Recording]], part: Part) -> list[list[Run]]:
    return [[run for r in group for run in own_runs(part, folder, r)] for group in recordings]


def _within(report: Report, part: Part) -> Report:
    return lambda what, *rest: report(f"{part.name}: {what}", *rest)


def own_runs(part: Part, folder: Folder, r: Recording) -> list[Run]:
    """Runs of a part: its own channels, and what it feels of the others."""
    runs = runs_of(_given(part, r), folder, r.label)
    return [replace(run, name=r.label if i == 0 else f"{r.label}#{i}") for i, run in enumerate(runs)]


def _given(part: Part, r: Recording) -> Measurement:
    """The recording with the part's inputs that are made of other parts' motion."""
    if part.derive is None:
        return r.measured
    columns = _felt(part, r)
    made = {n: Channel(n, unit, columns["time"], v) for n, (unit, v) in part.derive(columns).items()}
    own = {
        n: c
        for n, c in r.measured.channels.items()
        if n not in made or n not in neighbour_motion.PAIRS.values()
    }
    kept = {n: c for n, c in made.items() if n not in own or n in part.feels}
    moved = {n: replace(own[n], time=own[n].time + late) for n, late in part.later.items() if n in own}
    return replace(r.measured, channels=own | kept | moved)


def _felt(part: Part, r: Recording) -> dict[str, np.ndarray]:
    """Signals of other parts by name, on one time ("time"), with the load in kg."""
    missing = [n for n in part.feels if n not in r.motion and n not in r.measured]
    if missing:
        where = r.measured.source or r.label
        raise InputError(f"{where} has no {', '.join(missing)}, which the {part.name} feels")
    for q, v in neighbour_motion.PAIRS.items():
        if q in part.feels and q not in r.motion:
            _smooth(r, q, v)
    time = r.motion[part.feels[0]].time
    columns = {n: np.interp(time, r.motion[n].time, r.motion[n].values) for n in part.feels}
    load = r.measured.channels.get("load_told")
    columns["load"] = np.zeros_like(time) if load is None else np.interp(time, load.time, load.values)
    return columns | {"time": time}


def _smooth(r: Recording, q: str, v: str) -> None:
    """Motion straight from the recording, where the part that moves was not fitted."""
    angle, rate = r.measured[q], r.measured[v]
    signals = {n: Signal(c.time, c.values.astype(float)) for n, c in ((q, angle), (v, rate))}
    run = Run(r.label, float(angle.time[0]), float(angle.time[-1]), {}, signals)
    gyros = {
        rate: np.interp(angle.time, r.measured[n].time, r.measured[n].values)
        for rate, n in neighbour_motion.GYROS.items()
        if n in r.measured
    }
    for n, values in neighbour_motion.recorded(run, (q, v), gyros).items():
        r.motion[n] = Channel(n, "", angle.time, values)


def _remember(r: Recording, found: Examined, runs: Sequence[Run]) -> None:
    """Keep the motion of a part that was fitted, for those that feel it."""
    pieces: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for run in runs:
        motion = neighbour_motion.of_part(
            found.answer.core, found.answer.point, run, tuple(neighbour_motion.PAIRS)
        )
        if motion is None:
            motion = neighbour_motion.recorded(run, tuple(neighbour_motion.PAIRS))
        for q, v in neighbour_motion.PAIRS.items():
            for n in (q, v) if q in motion else ():
                pieces.setdefault(n, []).append((run.outputs[q].time, motion[n]))
    for n, parts in pieces.items():
        time, values = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        r.motion[n] = Channel(n, "", time, values)


# ---------------------------------------------------------------- one answer


def merged(done: Sequence[Examined]) -> dict[str, Any]:
    """The parts' figures as one report, the strongest effect first."""
    all_of = [e.figures for e in done]
    effects = [effect | {"subsystem": e.part.name} for e in done for effect in e.figures["effects"]]
    effects.sort(key=lambda e: -(e["gain_fit"] or 0.0))  # steps of a sensor are not fitted: last
    status = [f["residual_status"] for f in all_of]
    where = [w | {"subsystem": e.part.name} for e in done for w in e.figures["where"]]
    where.sort(key=lambda w: -w["share"])
    return {
        "verdict": _verdict(all_of),
        "sentence": _sentence(done),
        "effects": effects,
        "residual_status": "unexplained" if "unexplained" in status else "at_floor",
        "alternatives": _alternatives(all_of),
        "reestimated": _joined(all_of, "reestimated"),
        "nuisances": _joined(all_of, "nuisances"),
        "where": where,
        "gap": _joined(all_of, "gap"),
        "gap_by_regime": _of_parts(done, "gap_by_regime"),
        "scores": _joined(all_of, "scores"),
        "iso18571": _mean([f["iso18571"] for f in all_of if f.get("iso18571")]),
        "next_experiment": None,
        "considered": _of_parts(done, "considered"),
        "free_form": _of_parts(done, "free_form"),
        "quantization": _of_parts(done, "quantization"),
        "untold": _untold(done),
        "unseen": _of_parts(done, "unseen"),
        "data": _data(all_of),
        "parts": {e.part.name: e.figures for e in done},
    }


def _mean(rated: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Of the parts' ratings; NaN without any."""
    return {k: float(np.mean([r[k] for r in rated])) if rated else np.nan for k in ("before", "after")}


def _verdict(figures: Sequence[Mapping[str, Any]]) -> str:
    """Named when some effect is certain; else ambiguous; else what stands in the way of an answer."""
    effects = [effect for f in figures for effect in f["effects"]]
    if any(e["verdict"] == "named" for e in effects):
        return "named"
    if effects:
        return "ambiguous"
    return next(v for v in STANDING if any(f["verdict"] == v for f in figures))


def _alternatives(figures: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Whole sets: every part's own or one of its alternatives, own answer first."""
    choices = [f["alternatives"] or [[]] for f in figures]
    sets = [sorted(n for names in chosen for n in names) for chosen in product(*choices)]
    distinct = [list(names) for names in dict.fromkeys(map(tuple, sets))]
    return distinct[:MOST] if distinct[0] else []


def _of_parts(done: Sequence[Examined], key: str) -> list[dict[str, Any]]:
    """Rows of all parts, each with its part."""
    return [row | {"subsystem": e.part.name} for e in done for row in e.figures.get(key) or ()]


def _untold(done: Sequence[Examined]) -> list[dict[str, Any]]:
    """Effects that no part can tell; of one that some part can, nothing is said."""
    each = [{row["effect"]: row for row in e.figures.get("untold") or ()} for e in done]
    everywhere = [n for n in each[0] if all(n in rows for rows in each)] if each else []
    found = []
    for name in everywhere:
        reasons = list(dict.fromkeys(rows[name]["because"] for rows in each))
        found.append({"effect": name, "because": "; ".join(reasons)})
    return found


def _data(figures: Sequence[Mapping[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Stretches of the recordings by what they are for, once where several parts have the same."""
    found: dict[str, list[dict[str, Any]]] = {}
    for f in figures:
        for use, blocks in (f.get("data") or {}).items():
            rows = found.setdefault(use, [])
            rows += [b for b in blocks if b not in rows]
    return found


def _joined(figures: Sequence[Mapping[str, Any]], key: str) -> dict[str, Any]:
    return {name: value for f in figures for name, value in (f.get(key) or {}).items()}


def _sentence(done: Sequence[Examined]) -> str:
    """One for each part, those with the strongest effects first."""
    ranked = sorted(
        done, key=lambda e: -max((f["gain_fit"] or 0.0 for f in e.figures["effects"]), default=-1.0)
    )
    said = ((e.part.name.capitalize(), e.figures["sentence"]) for e in ranked)
    return " ".join(f"{part}: {text[:1].lower()}{text[1:]}" for part, text in said)
