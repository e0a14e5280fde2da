"""The proposed experiment: within the limits, its margin as predicted, and said so where none would help.

Candidates are given, not searched for: what is tested is what is proposed between them.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

from learning.collection.plan import load_plan
from reconcile.catalogue import ALL
from reconcile.equations.model import Folder
from reconcile.experiment import plan, say
from reconcile.experiment.achieved import candidates, compared, margins, seen
from reconcile.experiment.choose import LONGEST, NEEDED, rough, spread
from reconcile.experiment.excitation import SHAPES, Excitation, commands, of_dict
from reconcile.experiment.judges import Pairs
from reconcile.experiment.limits import Limit, limits_of
from reconcile.experiment.predict import Bench
from reconcile.experiment.propose import Proposal, propose
from reconcile.judging.answer import Answer
from reconcile.judging.judge import Judged
from reconcile.recordings.data import Block, Parts, Run, Signal, runs_of, split
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.sets import Key
from records.formats import read_measurement
from specs.errors import InputError
from tests.reconcile.effects import delay, lag
from tests.reconcile.truth import PERIOD, Truth, record, record_driven

NOISE = (1e-3, 1e-2)


def answered(core: Core, beam: Beam | None = None, sets: tuple[Key, ...] = (frozenset(),)) -> Answer:
    """An answer between given sets, the first of them the answer."""
    beam = beam or Beam(core)
    beam.points.setdefault(frozenset(), core.base)
    return Answer(core, beam, Judged(sets[0], sets[1:], {}, {}, [], {}, []))


def between(rig: Folder, parts: Parts, names: Sequence[str]) -> Answer:
    """An answer between effects of the catalogue, each at its best port, the first of them the answer."""
    core = Core(rig, parts, [e for e in ALL if e.name in names])
    beam = Beam(core)
    beam.points[frozenset()] = core.base
    for scored in beam.scores(frozenset()):
        beam.attempt(frozenset(), scored)
    found = {n: next(k for k in beam.ranked() if {a.effect.name for a in k} == {n}) for n in names}
    return answered(core, beam, tuple(found.values()))


@dataclass
class Doubt:
    """Recordings of a truth, and an answer between candidates of one effect each, the first one true."""

    rig: Folder
    truth: Truth
    names: tuple[str, ...]
    seconds: float
    size: float = 8.0
    seed: int = 4

    def __post_init__(self) -> None:
        options = {"seconds": self.seconds, "seed": self.seed, "noise": NOISE, "size": self.size}
        self.runs = runs_of(record(self.truth, **options), self.rig, "short")  # type: ignore[arg-type]
        self.answer = self.answered(self.runs)

    def answered(self, runs) -> Answer:
        return between(self.rig, split(runs, (), ()), self.names)

    def proposal(self) -> Proposal:
        found = propose(self.answer, "ambiguous")
        assert found is not None
        return found

    def driven(self, proposal: Proposal, seed: int = 77) -> Answer:
        """The answer with the experiment's recording in front of the others."""
        start = proposal.figures["excitation"]["start"].get("position", 0.0)
        measured = record_driven(self.truth, proposal.commands["force"], seed, NOISE, start)
        return self.answered([*runs_of(measured, self.rig, "experiment"), *self.runs])


def undriven(rig: Folder) -> tuple[list, Core]:
    """A rig that stood still."""
    runs = runs_of(record(Truth(), 10.0, 1, NOISE, 0.0), rig, "still")
    return runs, Core(rig, split(runs, (), ()), [])


@pytest.fixture(scope="module")
def lags(rig: Folder) -> Doubt:
    """A speed that comes late: smoothed, or delayed?  The motion was too slow to show it."""
    return Doubt(rig, Truth(velocity=lag(0.03)), ("sensor_lag", "sensor_delay"), 8.0, 1.5)


@pytest.fixture(scope="module")
def proposed(lags: Doubt) -> Proposal:
    return lags.proposal()


def test_shapes_stay_within_the_range_and_begin_and_end_at_rest():
    for kind in SHAPES:
        chosen = Excitation(kind, ("u",), 1.0, 3.0, 0.3, 20.0, 5)
        found = commands(chosen, {"u": (-2.0, 6.0), "other": (1.0, 4.0)}, 0.02)
        assert len(found["u"]) == 1000
        assert found["u"].min() >= -2.0
        assert found["u"].max() <= 6.0
        assert np.ptp(found["u"][50:-60]) > 2.0
        assert not found["u"][:50].any()
        assert not found["u"][-50:].any()
        assert (found["other"] == 1.0).all()
        assert of_dict(json.loads(json.dumps(chosen.as_dict()))) == chosen


@pytest.mark.long
def test_what_tells_two_sensors_apart_does_so_by_about_the_margin_predicted(lags, proposed):
    figures = proposed.figures
    assert figures["separable"]
    assert figures["predicted_margin"] > NEEDED
    answer = lags.driven(proposed)
    declared = candidates(lags.answer)
    before, after = margins(lags.answer, declared)[0], margins(answer, declared)[0]
    assert abs(before["achieved_margin"]) < NEEDED  # the recordings alone do not tell
    assert after["one"] == ["sensor_lag"]
    assert after["achieved_margin"] > NEEDED
    assert 0.5 < after["achieved_margin"] / figures["pairs"][0]["if_one"] < 2.0


def test_gentle_excitations_are_tried_first_and_one_that_tells_plenty_is_short(lags, proposed):
    bench = Bench(lags.answer.core, limits_of(lags.answer.core), PERIOD)
    tried = spread(bench)
    assert [rough(e) for e in tried] == sorted(rough(e) for e in tried)
    assert {e.kind for e in tried} == set(SHAPES)
    assert min(e.fastest_s for e in tried) < 0.2  # as fast as its commands' ticks allow
    chosen = of_dict(proposed.figures["excitation"])
    assert chosen.period_s <= chosen.duration_s < LONGEST * bench.duration_s
    assert rough(chosen) < 0.1 * rough(tried[-1])


def test_the_loop_is_closed_with_nothing_but_the_first_report_and_the_new_recording(lags, proposed):
    """As `slewright reconcile NEW RUN --before report.json` does it, the candidates being given."""
    first = {"verdict": "ambiguous", "sentence": "either", "next_experiment": proposed.figures}
    answer = lags.driven(proposed, seed=78)
    found = compared(answer, json.loads(json.dumps(first)))
    (pair,) = found["pairs"]
    assert {tuple(pair["one"]), tuple(pair["other"])} == {("sensor_lag",), ("sensor_delay",)}
    assert pair["promised"]
    assert pair["one"] == ["sensor_lag"]  # the true one
    assert found["achieved_margin"] == pair["achieved_margin"] > NEEDED


@pytest.mark.long
def test_a_simple_effect_needs_no_margin_over_the_general_one_that_includes_it(rig):
    truth = Truth(static=(0.9, 0.8), kinetic=lambda v: 0.9 if v > 0 else -0.8)
    doubt = Doubt(rig, truth, ("asymmetric_coulomb_friction", "coulomb_friction"), 8.0)
    proposal = doubt.proposal()
    pair = proposal.figures["pairs"][0]
    assert pair["if_other"] is None  # that needs no margin
    assert pair["predicted_margin"] == pair["if_one"] > NEEDED


def test_the_experiment_keeps_where_the_recordings_were(lags, proposed):
    figures = proposed.figures
    measured = record_driven(lags.truth, proposed.commands["force"], 1, (0.0, 0.0))
    for name in ("position", "velocity"):
        limit = figures["limits"][name]
        assert limit["source"] == "recorded"
        low, high = figures["predicted_range"][name]
        assert limit["low"] <= low < high <= limit["high"]
        seen = measured[name].values
        span = limit["high"] - limit["low"]
        assert seen.min() > limit["low"] - 0.1 * span  # the truth is near what was predicted
        assert seen.max() < limit["high"] + 0.1 * span


def test_stated_limits_of_outputs_open_a_wider_range(lags):
    core, stated = lags.answer.core, {"position": 4.0, "velocity": 5.0}
    wider = [replace(v, min=-stated[v.name], max=stated[v.name]) for v in lags.rig.model.outputs]
    chosen = Excitation("reversals", ("force",), 0.5, 2.0, 0.0, 12.0)
    narrow = Bench(core, limits_of(core), PERIOD)
    core.model = replace(lags.rig.model, outputs=tuple(wider))
    try:
        wide, figures = Bench(core, limits_of(core), PERIOD), lags.proposal().figures
    finally:
        core.model = lags.rig.model
    assert figures["limits"]["position"] == {"low": -4.0, "high": 4.0, "source": "stated"}
    motion = wide.motion(chosen, lags.answer.point)
    assert motion is not None
    assert wide.excess(chosen, motion) < 1.0 < narrow.excess(chosen, motion)


@pytest.mark.long
def test_a_bias_and_a_drift_are_told_apart_by_a_longer_run(rig):
    doubt = Doubt(
        rig,
        Truth(velocity=lambda y: y + 0.012),
        ("sensor_bias", "sensor_drift"),
        5.0,
    )
    proposal = doubt.proposal()
    assert proposal.figures["separable"]
    answer = doubt.driven(proposal)
    reached = margins(answer, candidates(doubt.answer))
    assert reached[0]["one"] == ["sensor_bias"]
    assert reached[0]["achieved_margin"] > NEEDED


def test_where_no_excitation_helps_that_is_said_with_the_sensor_that_would(rig):
    doubt = Doubt(rig, Truth(inputs=delay(0.06)), ("input_delay", "sensor_delay"), 10.0)
    late = doubt.answer.alternatives
    both = [
        a for a in doubt.answer.core.candidates if a.effect.name == "sensor_delay" and a.port == "all outputs"
    ]
    assert [list(s) for s in late] == [both]  # all sensors late by as much: exactly the same
    proposal = doubt.proposal()
    assert proposal.figures["separable"] is False
    assert proposal.figures["predicted_margin"] < NEEDED
    assert proposal.figures["plan"] is None
    assert proposal.commands == {}
    assert (
        "No excitation within the limits tells input_delay from sensor_delay" in proposal.figures["sentence"]
    )
    assert "a sensor of what really arrives behind force would" in proposal.figures["sentence"]


def test_a_rig_that_was_not_driven_is_told_what_to_drive_for_each_parameter(rig):
    runs, core = undriven(rig)
    proposal = propose(answered(core), "insufficient_excitation")
    assert proposal is not None
    assert sorted(p["name"] for p in proposal.figures["parameters"]) == ["drag", "mass"]
    assert "To see mass, drag, drive force with" in proposal.figures["sentence"]
    assert "No limits of the outputs are stated" in proposal.figures["sentence"]
    new = runs_of(record_driven(Truth(), proposal.commands["force"], 3, NOISE), rig, "experiment")
    second = Core(rig, split([*new, *runs], (), ()), [])
    for p in proposal.figures["parameters"]:
        error = (p["predicted_margin"] / seen(second.base, p["name"])) ** 0.5  # over the foretold one
        assert 0.3 < error < 3.0


def test_where_recordings_led_the_fit_astray_the_model_as_it_came_counts_as_well(rig):
    _, core = undriven(rig)
    heavy = core.base.values | {"mass": 4.0 * core.base.values["mass"]}  # whose motion is a quarter
    core.base = replace(core.base, values=heavy)
    proposal = propose(answered(core), "insufficient_excitation")
    assert proposal is not None
    figures, came = proposal.figures, core.nominal()
    assert came is not None
    played = Bench(core, limits_of(core, True), figures["tick_s"]).motion(
        of_dict(figures["excitation"]), came
    )
    assert played is not None
    for n, (low, high) in figures["predicted_range"].items():
        assert low <= np.min(played.outputs[n].values)
        assert np.max(played.outputs[n].values) <= high


@pytest.mark.parametrize(
    ("period", "offset", "part"),
    [(3.0, 0.0, False), (30.0, 0.0, True), (3.0, 0.75, True)],
    ids=["whole", "a longer shape than the experiment", "cut off by the range"],
)
def test_what_is_driven_of_a_shape_is_said(lags, period, offset, part):
    ranges = {"force": [-20.0, 20.0]}
    e = Excitation("ladder", ("force",), 0.5, period, offset, 20.0)
    text = say.drive(lags.rig, {"excitation": e.as_dict(), "ranges": ranges, "tick_s": PERIOD})
    assert (" (of that " in text) is part
    if part:
        told = commands(e, {"force": (-20.0, 20.0)}, PERIOD)["force"]
        assert f" (of that {np.min(told):.3g} to {np.max(told):.3g} N)" in text


def test_long_times_are_said_without_powers_of_ten(lags):
    e = Excitation("sine", ("force",), 0.5, 1758.3, 0.0, 27000.0)
    figures = {"excitation": e.as_dict(), "ranges": {"force": [-20.0, 20.0]}, "tick_s": 10.0}
    assert say.drive(lags.rig, figures).endswith("a sine of ±10 N and 1760 s for 27000 s")


def test_nothing_is_proposed_where_nothing_is_open(lags):
    assert propose(lags.answer, "named") is None


def test_a_rig_of_ones_own_gets_the_table_of_its_inputs(proposed, lags, tmp_path):
    plan.write_for(tmp_path, proposed, lags.rig, [])
    table = read_measurement(tmp_path / "experiment.csv")
    assert table["force"].unit == "N"
    assert table["force"].values == pytest.approx(proposed.commands["force"])
    assert np.diff(table["force"].time) == pytest.approx(PERIOD)
    text = (tmp_path / "experiment.toml").read_text()
    assert 'table = "experiment.csv"' in text
    assert proposed.figures["sentence"] in text


def test_a_plan_for_the_machine_is_one_that_collect_takes(tmp_path):
    time = np.arange(200) * 0.1
    told = {"u_slew": 0.5 * np.sin(time), "qd_boom_ref": 0.1 * np.sin(0.7 * time)}
    figures = {"sentence": "Drive.", "ranges": dict.fromkeys(told), "duration_s": 20.0, "tick_s": 0.1}
    units = {"u_slew": "1", "qd_boom_ref": "rad/s"}
    plan.write(tmp_path, figures, told, units, {"q_boom": 1.2, "q_stick": -9.0, "load_kg": 500.0})
    found = load_plan(tmp_path / "experiment.toml")
    assert [r.seconds for r in found.recordings] == [20.0]
    only = found.recordings[0]
    assert only.q_boom == pytest.approx(1.2, abs=0.03)
    assert found.limits.stick_rad[0] <= only.q_stick <= found.limits.stick_rad[0] + 0.05  # as near as allowed
    assert only.load_kg == 500.0
    stated = found.parts["experiment"].commands
    assert stated is not None
    for name, values in told.items():
        assert stated[name] == pytest.approx(values, abs=1e-4)  # type: ignore[index]


def test_a_margin_grows_with_the_length_of_the_experiment(lags, proposed):
    bench = Bench(lags.answer.core, limits_of(lags.answer.core), PERIOD)
    fits = [lags.answer.point, *(lags.answer.beam.points[k] for k in lags.answer.alternatives)]
    e = of_dict(proposed.figures["excitation"])
    found = []
    for seconds in (10.0, 20.0, 40.0):
        played = [p for f in fits if (p := bench.play(replace(e, duration_s=seconds), f))]
        found.append(float(Pairs(fits)(bench, played)[0]))
    assert all(a < b for a, b in pairwise(found))


@pytest.mark.parametrize("pace", [5e-4, 200.0], ids=["10 us", "4 s"])
def test_a_rig_of_another_pace_gets_the_same_experiment_at_its_own(lags, proposed, pace):
    """The same carriage with time stretched: speeds are smaller by it, drag and mass larger."""
    sizes = {"mass": pace**2, "drag": pace, "velocity": 1.0 / pace}

    def stretched(signals):
        return {n: Signal(pace * s.time, sizes.get(n, 1.0) * s.values) for n, s in signals.items()}

    (r,) = lags.runs
    run = Run(r.name, pace * r.start_s, pace * r.end_s, stretched(r.inputs), stretched(r.outputs))
    known = split([r], (), ())
    blocks = [[Block(run, pace * b.start_s, pace * b.end_s) for b in own] for own in vars(known).values()]
    parameters = [
        replace(v, start=sizes[v.name] * v.start, min=sizes[v.name] * v.min, max=sizes[v.name] * v.max)
        for v in lags.rig.model.parameters
    ]
    rig = replace(lags.rig, model=replace(lags.rig.model, parameters=tuple(parameters)))
    found = propose(between(rig, Parts(*map(tuple, blocks)), lags.names), "ambiguous")
    assert found is not None
    ours, theirs = found.figures["excitation"], proposed.figures["excitation"]
    assert ours["kind"] == theirs["kind"]
    for k in ("period_s", "duration_s", "shortest_s"):
        assert ours[k] == pytest.approx(pace * theirs[k], rel=1e-3)
    assert found.figures["predicted_margin"] == pytest.approx(proposed.figures["predicted_margin"], rel=0.3)


def test_an_input_without_a_range_is_named(lags):
    inputs = [replace(v, min=None, max=None) for v in lags.rig.model.inputs]
    _, core = undriven(lags.rig)
    core.model = replace(lags.rig.model, inputs=tuple(inputs))
    with pytest.raises(InputError, match=r"no input has a range \(force\)"):
        limits_of(core)
    proposal = propose(answered(core), "insufficient_excitation")
    assert proposal is not None
    assert proposal.commands == {}
    assert proposal.figures["excitation"] is None
    assert "state min and max in model.py" in proposal.figures["sentence"]


@pytest.mark.parametrize("verdict", ["ambiguous", "insufficient_excitation"])
def test_a_model_that_nothing_can_drive_is_told_so(lags, verdict):
    core = lags.answer.core
    folder, core.folder = core.folder, replace(core.folder, ports=replace(core.folder.ports, controls=()))
    try:
        proposal = propose(lags.answer, verdict)
    finally:
        core.folder = folder
    assert proposal is not None
    assert (
        proposal.figures["sentence"]
        == "No experiment: model rig has no input that an experiment could drive."
    )
    assert proposal.figures["plan"] is None


def test_a_signal_that_starts_near_an_end_of_its_range_has_room_to_move_there_too():
    pressure = Limit(-1e6, 6e7, "stated")  # Pa, of an oil that rests at 20 bar
    assert pressure.excess(np.array([2e6, 1e6, 2.5e7])) < 1.0
    assert pressure.excess(np.array([2e6, 0.0])) > 1.0  # within, but not with room
    assert pressure.excess(np.array([2e6, 5.9e7])) > 1.0
    assert np.isinf(pressure.excess(np.array([-2e6, 0.0])))  # begins outside
