"""`slewright reconcile` from recordings and a model folder to a report and an extended model."""

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from reconcile.catalogue import ALL, offset
from reconcile.equations.model import Folder
from reconcile.errors.ahead import ahead, noise
from reconcile.experiment import plan
from reconcile.filter.point import Point
from reconcile.judging import (
    clocks as recorded_clocks,
    combined,
    correlated,
    inputs,
    mistaken,
    offsets,
    quantization,
    unidentifiable,
    verdict as verdicts,
)
from reconcile.judging.answer import Answer
from reconcile.judging.by_itself import ByItself
from reconcile.judging.judge import Judge
from reconcile.recordings import checks
from reconcile.recordings.data import Run, read_run, split
from reconcile.recordings.offsets import input_period
from reconcile.reporting import contract, report as reports, target
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.start import units
from reconcile.system.parts import Part, part_named, parts_of, with_signals
from reconcile.tolerances import LEAST_FLOOR, OF_ERROR
from records.formats import read_measurement
from specs.errors import InputError, RunError
from specs.version import VERSION

Report = Callable[..., None]
MODEL = "model"  # the folder in DIR of the extended model, or of those of a system's parts
CUT = "The search ended early, after as much work as it may do: sets that were not tried may explain more."
MOST_AGAIN = 8  # searches after the first, each with half the noise or an offset less
SEED = 0  # nothing is drawn: the same recordings give the same report


def reconcile(
    runs: Sequence[Path],
    model: str,
    out: Path,
    confirm: Sequence[Path] = (),
    holdout: Sequence[Path] = (),
    names: Path | None = None,
    report: Report | None = None,
    report_only: bool = False,
    then: Callable[[Answer, dict[str, Any]], dict[str, Any]] | None = None,
    as_stated: bool = False,
) -> dict[str, Any]:
    """Run the whole workflow, write DIR/report.json and DIR/model, and return the report.

    `report_only` leaves out what is made from the figures: the extended model and the page.  What `then`
    makes of answer and figures is added to the report.  `as_stated`: units, signs and names of channels are
    not doubted.
    Raises InputError for recordings or a model that cannot be used; nothing is written then.
    """
    said = report or (lambda *_: None)
    began = time.monotonic()
    given = (runs, confirm, holdout)
    checks.check_runs(*given)
    target.check(out, [Path(model), *(p for paths in given for p in paths)])
    if Path(model).suffix.lower() == ".fmu":
        if then:
            raise InputError(f"{model} is closed; --drive and --before need a model folder")
        return _closed(given, Path(model), out, names, said, report_only)
    if parts := parts_of(model):
        return _system(given, parts, out, names, said, report_only, then)
    folder = checks.open_folder(model)
    said("reading")
    renamed = checks.read_names(names, _variables(folder))
    sets = _read(given, folder, renamed)
    if not as_stated:
        every = [r for runs in sets for r in runs]
        _ask(units.question(folder.model, every, renamed))
    with target.first_page(out) as page:
        first = None if report_only else partial(_show_first, page, said)
        figures, answer = examine(folder, *sets, report=said, names=renamed, first=first, as_stated=as_stated)
        moved = _moved(given, folder, renamed) if figures["verdict"] in verdicts.OPEN else None
        proposal = _next(answer, figures, said, moved)
        if then:
            figures |= then(answer, figures)
        figures |= {"seed": SEED, "versions": {"slewright": VERSION}, "elapsed_s": time.monotonic() - began}
        said("writing")
        with target.staged(out) as part:
            if not report_only and _extended(figures):
                steps = quantization.steps(figures)
                figures["model"] = _built(reports.write_model(answer, part / MODEL, steps), part)
            if proposal and proposal.commands:
                plan.write_for(part, proposal, folder, [p for paths in given for p in paths])
            if not report_only:
                _show(part, figures, [answer], folder.model.name)
            figures["files"] = sorted(p.name for p in part.iterdir())
            _write(part / target.REPORT, figures)
    return figures


def examine(
    folder: Folder,
    runs: Sequence[Run],
    confirm: Sequence[Run] = (),
    holdout: Sequence[Run] = (),
    report: Report | None = None,
    names: Mapping[str, str] | None = None,
    first: Callable[[Core], None] | None = None,
    as_stated: bool = False,
):
    """Find and name, without writing: the report's figures and the answer.

    `first` is told of the model by itself, fitted, before effects are looked for.
    Noise of measured inputs is taken out first.  Where clocks differ by recording, the recordings are set
    right and examined again.
    """
    said = report or (lambda *_: None)
    said("noise of inputs")
    given = inputs.without_noise(folder, (runs, confirm, holdout))
    answer = _searched(folder, given, said, names, first, as_stated)
    clocks = recorded_clocks.differing(answer.core, answer)
    if clocks:
        said("clocks that differ by recording")
        again = lambda sets: Core(folder, split(*sets))  # noqa: E731
        clocks = recorded_clocks.settled(given, clocks, again, answer.point)
        given = [recorded_clocks.corrected(own, clocks) for own in given]
        answer = _searched(folder, given, said, names, as_stated=as_stated)
    if not as_stated:
        _ask(mistaken.doubt(answer, names))
    by_itself = ByItself(answer)
    answer = by_itself.answer
    said("measuring the gap")
    figures = reports.build(answer, verdicts.judge(answer))
    if clocks:
        figures["sentence"] += f" {recorded_clocks.said(clocks)}."
        figures["nuisances"] = {n: c.figures() for n, c in clocks.items()}
    figures |= told(answer, figures)
    doubts = [mistaken.turned_parameters, mistaken.far_parameters]
    doubts += [mistaken.bounded_parameters, mistaken.bounded_effects]
    doubts += [offsets.short, offsets.everywhere]
    for more in (*(said_of(answer) for said_of in doubts), by_itself.said, CUT * answer.beam.cut):
        figures["sentence"] += f" {more}" if more else ""
    steps = quantization.examine(answer.core.model, answer.core.runs)
    figures |= quantization.added(figures, steps, answer.core.model.name)
    return figures, answer


def _ask(question: str) -> None:
    if question:
        raise InputError(f"{question}; --as-stated takes the recordings as they are")


def _searched(
    folder: Folder,
    given: Sequence[Sequence[Run]],
    said: Report,
    names: Mapping[str, str] | None = None,
    first: Callable[[Core], None] | None = None,
    as_stated: bool = False,
) -> Answer:
    """The search, and again with as little noise as the model's own error by then allows.

    Small effects show with less noise only; what acts seldom may be found only with more.  Where that finds
    offsets in time, it is made again with recordings that are set right.
    """
    said("filtering")
    parts = split(*given)
    catalogue = (*ALL, offset.effect(input_period([r for runs in given for r in runs])))
    core = Core(folder, parts, catalogue)
    if not as_stated:
        _ask(mistaken.evident(core, names))
    if first:
        first(core)
    if (share := _least_noise(core, core.base)) < 0.5 * core.share:  # the model is good by itself
        core = Core(folder, parts, catalogue, share)
    beam, before = Beam(core, said), None
    beam.search()
    for _ in range(MOST_AGAIN):
        share, late = _best_share(beam), offsets.found(beam)
        quieter = share < 0.5 * beam.core.share and not beam.cut
        lasting = None if quieter or late or beam.cut else correlated.likelier(beam)
        if not quieter and not late and not lasting:
            break
        changes = {
            "with less noise": quieter,
            "without offsets in time": late,
            "with noise that lasts": lasting,
        }
        said(" and ".join(["again", *(text for text, there in changes.items() if there)]))
        if late:
            given = offsets.set_right(folder, given, late)
        known = offsets.without(beam.foremost(), list(late))
        before = beam if quieter and not late else None
        share, lasts = share if quieter else beam.core.share, bool(beam.core.kalman.correlated)
        beam = Beam(lasting or Core(folder, split(*given), catalogue, share, lasts), said)
        beam.search(known)
    for each in (beam, before) if before else (beam,):
        offsets.drop(each)
    answer = _judged(beam, said)
    if before is None or answer.present:
        return answer
    return _judged(before, said)


def _best_share(beam: Beam) -> float:
    return _least_noise(beam.core, beam.points[beam.ranked()[0]])


def _least_noise(core: Core, best: Point) -> float:
    """The least noise of an output, of its spread, that the error of the best set allows."""
    return max(OF_ERROR * math.hypot(ahead(core, best), noise(core, best)), LEAST_FLOOR)


def _judged(beam: Beam, said: Report) -> Answer:
    beam.settle()
    said("judging")
    return Answer(beam.core, beam, Judge(beam).decide())


def told(answer: Answer, figures: dict[str, Any]) -> dict[str, Any]:
    """What the recordings cannot tell, and what reading them mended."""
    core = answer.core
    parameters = unidentifiable.parameters(core, answer.point)
    found: dict[str, Any] = {"untold": unidentifiable.effects(core.folder, core.runs), "unseen": parameters}
    if figures["verdict"] == "insufficient_excitation" and parameters:
        found["sentence"] = f"{figures['sentence']} {unidentifiable.sentence(parameters)}"
    elif groups := combined.combined(core):
        found["sentence"] = figures["sentence"] + combined.sentence(groups)
    alike = recorded_clocks.alike(answer.present, core.runs)
    mended = correlated.notes(core, answer.point)
    mended += [f"{n} does not change: it is left out, since it tells nothing" for n in sorted(core.still)]
    found["nuisances"] = {
        r.name: row
        for r in core.runs
        if (
            row := figures["nuisances"].get(r.recording, {})
            | alike.get(r.name, {})
            | ({"mended": notes} if (notes := [*r.notes, *mended]) else {})
        )
    }
    return found


def _next(answer: Answer, figures: dict[str, Any], said: Report, moved: Part | None) -> Any:
    """The experiment that would settle what is open; it goes into the figures."""
    proposal = None
    if figures["verdict"] in verdicts.OPEN:
        from reconcile.experiment.propose import propose

        proposal = propose(answer, figures["verdict"], said, moved)
    figures["next_experiment"] = proposal.figures if proposal else None
    return proposal


def _system(
    given: Sequence[Sequence[Path]],
    parts: Sequence[Part],
    out: Path,
    names: Path | None,
    said: Report,
    report_only: bool,
    then: Callable[[Answer, dict[str, Any]], dict[str, Any]] | None,
) -> dict[str, Any]:
    """The same for a system: every part is examined, and its extended model lies in DIR/model/PART."""
    from reconcile.system.doubt import next_experiment
    from reconcile.system.examine import examine as examine_system

    began = time.monotonic()
    said("reading")
    known = [n for part in parts for n in _variables(checks.open_folder(part.model))]
    renamed = checks.read_names(names, list(dict.fromkeys(known)))
    labels = checks.labels(p for paths in given for p in paths)
    sets = [[(labels[p], read_measurement(p, names=renamed)) for p in paths] for paths in given]
    figures, done = examine_system(parts, sets, examine, said)
    doubt = next_experiment(done, said)
    figures["next_experiment"] = doubt[1].figures if doubt else None
    if then is not None:
        for e in done:
            figures |= then(e.answer, figures)
    figures |= {"seed": SEED, "versions": {"slewright": VERSION}, "elapsed_s": time.monotonic() - began}
    said("writing")
    with target.staged(out) as part:
        extended = [e for e in done if _extended(e.figures)]
        for found in [] if report_only else extended:
            folder = part / MODEL / found.part.name
            steps = quantization.steps(found.figures)
            built = figures.setdefault("model", {"folder": MODEL, "parts": {}})["parts"]
            built[found.part.name] = _built(reports.write_model(found.answer, folder, steps), part)
        if doubt and doubt[1].commands:
            plan.write_for(part, doubt[1], doubt[0].folder, [p for paths in given for p in paths])
        if not report_only:
            _show(part, figures, [e.answer for e in done], ", ".join(e.part.name for e in done))
        figures["files"] = sorted(p.name for p in part.iterdir())
        _write(part / target.REPORT, figures)
    return figures


def _closed(
    given: Sequence[Sequence[Path]],
    model: Path,
    out: Path,
    names: Path | None,
    said: Report,
    report_only: bool,
) -> dict[str, Any]:
    """The same for a third-party FMU: effects at its ports, and an SSP that wraps it with them."""
    from reconcile.closed import holdout as closed_holdout, report as closed
    from reconcile.closed.box import Box

    began = time.monotonic()
    box = Box(model, checks.read_disturbances(names))
    said("reading")
    sets = _read(given, box, checks.read_names(names, _variables(box), ("disturbances",)))
    figures, problem, answer = closed.examine(box, *sets, report=said)
    figures |= {"seed": SEED, "versions": {"slewright": VERSION}, "elapsed_s": time.monotonic() - began}
    said("writing")
    with target.staged(out) as part:
        if not report_only and (answer.fitted.effects or figures["reestimated"]):
            figures["model"] = closed.write(problem, answer, part)
        if not report_only:
            from reconcile.page.page import write_page

            drawn = closed_holdout.shown(problem, answer)
            write_page(part / target.PAGE, _plain(figures), drawn, box.model.name)
        figures["files"] = sorted(p.name for p in part.iterdir())
        _write(part / target.REPORT, figures)
    return figures


def _show(folder: Path, figures: dict[str, Any], answers: Sequence[Answer], title: str) -> None:
    """Write the page of an answer, or of those of a system's parts, into a folder."""
    from reconcile.page.page import write_for

    write_for(folder / target.PAGE, answers, _plain(figures), title)


def _show_first(page: Path, said: Report, core: Core) -> None:
    """Write what the fitted model lacks, before effects are looked for."""
    from reconcile.page.page import write_first

    said(f"effects are looked for; what is missing so far: {write_first(page, core, core.model.name)}")


def _variables(folder) -> list[str]:
    return [v.name for v in (*folder.model.inputs, *folder.model.outputs)]


def _read(given: Sequence[Sequence[Path]], folder, names: dict[str, str] | None) -> list[list[Run]]:
    """Runs of the recordings of each purpose; `folder`: a model folder or a closed FMU."""
    labels = checks.labels(p for paths in given for p in paths)
    part = part_named(folder.model.name) if isinstance(folder, Folder) else None
    if part is not None and part.derive is not None:
        from reconcile.system.ways import followed

        def read(way: Part) -> list[list[Run]]:
            return [[r for p in paths for r in _as_part(p, way, folder, names, labels[p])] for paths in given]

        return [list(runs) for runs in followed(part, folder, read)]
    return [[r for p in paths for r in read_run(p, folder, names, labels[p])] for paths in given]


def _as_part(path: Path, part: Part, folder: Folder, names: dict[str, str] | None, label: str) -> list[Run]:
    """Runs of a model that is a part of the machine: what it feels is made of the machine's sensors."""
    from reconcile.system.examine import Recording, own_runs

    measured = with_signals(read_measurement(path, names=names))
    if measured.missing(part.feels):
        return read_run(path, folder, names, label)
    return own_runs(part, folder, Recording(label, measured))


def _moved(given: Sequence[Sequence[Path]], folder: Folder, names: dict[str, str] | None) -> Part | None:
    """The part of the machine that the model is, where the machine moves it and was recorded doing so."""
    part = part_named(folder.model.name)
    if part is None or part.derive is None or plan.drivable(folder):
        return None
    recorded = (read_measurement(p, names=names) for paths in given for p in paths)
    return None if any(m.missing(part.feels) for m in recorded) else part


def _extended(figures: dict[str, Any]) -> bool:
    """Whether a report has anything to put into a model."""
    return bool(figures["effects"] or figures["reestimated"] or figures.get("free_form"))


def _built(folder: Path, out: Path) -> dict[str, Any]:
    """The extended model in the report; its FMU, or why there is none."""
    from fmus.toolchain import codegen
    from fmus.toolchain.build import build_fmu
    from fmus.toolchain.loader import load_model

    there = {"folder": str(folder.relative_to(out))}
    if why := codegen.feedthrough(load_model(folder)):
        return there | {"fmu": None, "because": why}
    return there | {"fmu": str(build_fmu(folder, 2, out=folder).relative_to(out))}


def _write(path: Path, figures: dict[str, Any]) -> None:
    """Write report.json; RunError if it is not what everyone who reads it relies on."""
    content = _plain(figures)
    if wrong := contract.check(content):
        raise RunError(f"the report of this answer would not be in its own form: {wrong[0]}")
    unfinished = path.with_name(path.name + ".part")
    unfinished.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    unfinished.replace(path)


def _plain(value: Any) -> Any:
    """The same in JSON's own types; what is no number becomes null."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
