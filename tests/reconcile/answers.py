"""Answers without a search: effects that are known to be in a truth, fitted, for tests of what is shown."""

from collections.abc import Sequence
from pathlib import Path

from reconcile.catalogue import ALL
from reconcile.catalogue.kinds import kind
from reconcile.equations.model import Folder, read_folder
from reconcile.judging.answer import Answer
from reconcile.judging.judge import Judge, Judged
from reconcile.judging.refused import Refused
from reconcile.recordings.data import Run, runs_of, split
from reconcile.reporting.findings import Findings, gather
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.screen import Screen
from reconcile.search.sets import Key
from tests.reconcile.truth import Truth, record

RIG = Path(__file__).with_name("rig")
REFUSED = Refused("sensor_lag", "position", "takes 0.3 % of the error ahead away")


def rig() -> Folder:
    """The rig's model folder."""
    return read_folder(RIG)


def recorded(truth: Truth, **options) -> list[Run]:
    """Runs of a recording of a truth."""
    return runs_of(record(truth, **options), rig(), "run")


def cored(runs: Sequence[Run], *keys: str, folder: Folder | None = None) -> Core:
    """The rig (or another folder) against runs, with those effects of the catalogue that are named."""
    catalogue = [e for e in ALL if e.key in {k.partition("@")[0] for k in keys}]
    return Core(folder or rig(), split(runs, (), ()), catalogue)


def fitted(beam: Beam, keys: Sequence[str]) -> Key:
    """The set of effects `keys` (NAME@PORT), fitted one after the other from their scores."""
    beam.points.setdefault(frozenset(), beam.core.base)
    key: Key = frozenset()
    for k in keys:
        (a,) = (a for a in beam.core.candidates if a.key == k)
        scored = Screen(beam.core, beam.points[key], beam.shapes).one(a)
        assert scored is not None
        grown = beam.attempt(key, scored)
        assert grown is not None
        key = grown
    return key


def judged(beam: Beam, key: Key) -> Judged:
    """That a set is certain, and that something else was turned down."""
    names = tuple(sorted(a.effect.name for a in key))
    judge = Judge(beam)
    gains = {a: judge._gain(key, a) for a in key}
    sure = dict.fromkeys(names, 1.0)
    return Judged(key, (), sure, {kind(n): 1.0 for n in names}, [(names, 1.0)], gains, [REFUSED])


def answered(runs: Sequence[Run], keys: Sequence[str] = ()) -> Findings:
    """What is shown of an answer that holds the effects `keys` (NAME@PORT)."""
    beam = Beam(cored(runs, *keys))
    key = fitted(beam, keys)
    return gather(Answer(beam.core, beam, judged(beam, key)))
