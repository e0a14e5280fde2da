"""Answers without a search: effects that are known to be in a truth, fitted, for tests of what is shown."""

from collections.abc import Sequence
from pathlib import Path

from reconcile import verdict as verdicts
from reconcile.data import Run, runs_of, split
from reconcile.findings import Findings, gather
from reconcile.model import Folder, read_folder
from reconcile.score import Score, starts
from reconcile.search import Answer, Tried
from reconcile.study import Study
from tests.reconcile.truth import Truth, record

RIG = Path(__file__).with_name("rig")


def rig() -> Folder:
    """The rig's model folder."""
    return read_folder(RIG)


def recorded(truth: Truth, **options) -> list[Run]:
    """Runs of a recording of a truth."""
    return runs_of(record(truth, **options), rig(), "run")


def answered(runs: Sequence[Run], keys: Sequence[str] = ()) -> Findings:
    """What is shown of an answer that holds the effects `keys` (NAME@PORT)."""
    study = Study(rig(), split(runs, (), ()))
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    present = tuple(next(a for a in study.candidates if a.key == k) for k in keys)
    fitted = base
    if present:
        score = Score(study, base, list(present))
        chosen = [
            max((v for v in score.variants if v.attached == a), key=lambda v: score.scored((v,)).gain)
            for a in present
        ]
        fitted = study.fit_set(base.point, present, starts(score.scored(tuple(chosen))))
        assert fitted is not None
    refused = [{"effect": "sensor_lag", "port": "position", "because": "BIC gains 3.1, not more than 10"}]
    tried = Tried({frozenset(): base, frozenset(present): fitted}, {}, refused)
    answer = Answer(present, fitted, base, (), {a.key: (1000.0, 0.95) for a in present}, tried)
    return gather(study, answer, verdicts.nominal(study))
