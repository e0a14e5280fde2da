"""The load estimate: its balance against the machine's own equations, intervals, gate, bad recordings."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from baselines.load import balance, gate, windows
from baselines.load.calibration import Calibration, calibrate, uncalibrated
from baselines.load.estimate import estimate, whole
from baselines.load.influence import influence
from baselines.load.sensors import stretches, usable
from baselines.load.trials import SENSED, Trial, run
from fmus.models.machine import dynamics
from fmus.models.machine.model import MODEL
from fmus.toolchain.stepper import Stepper
from records.measurement import Channel, Measurement
from specs.errors import InputError

DRAW = "tuning:9"  # not among those that windows and limits were chosen on


@cache
def recorded(load: float, kind: str = "score", poses: int = 2) -> Measurement:
    """A trial of a drawn machine."""
    return run(Trial(kind, 1, load, poses), DRAW)


@cache
def tared() -> Calibration:
    """The drawn machine's calibration with an empty grab."""
    return calibrate([recorded(0.0, "calibration", 5)], [0.0])


def changed(recording: Measurement, values: Mapping[str, np.ndarray | None]) -> Measurement:
    """The recording with other samples, or without the channel (None)."""
    channels = {n: c for n, c in recording.channels.items() if values.get(n, c.values) is not None}
    for name, samples in values.items():
        if samples is not None:
            channels[name] = replace(channels[name], values=samples)
    return replace(recording, channels=channels)


@pytest.mark.parametrize("load", [0.0, 800.0, 2500.0])
def test_the_balance_is_solved_by_the_load_in_any_motion(load: float) -> None:
    """At exact states and accelerations of the machine, on a slope, slewing and swinging: y = h m."""
    model = Stepper(
        MODEL, {"load_mass": load, "start_q_boom": 1.1, "start_q_stick": -1.2, "slope_pitch": 0.01}
    )
    model.set(u_boom=0.4, u_stick=-0.5, u_slew=0.6)
    model.advance(4000)
    rates = model.rates()
    q = np.array([model.state(n) for n in dynamics.ANGLES])
    v = np.array([model.state(n) for n in dynamics.RATES])
    a = np.array([rates[n] for n in dynamics.RATES])
    tilt = np.array([0.01 * np.cos(q[0]), 0.01 * np.sin(q[0])])  # pitch and roll seen from the carriage
    q[3:] += tilt
    p = [model.state(f"{j}_pressure_{s}") for j in balance.JOINTS for s in "ab"]
    seen = balance.Seen(q, v, a, np.array(p), tilt, np.ones(2), np.sign(v[1:3]))
    y, h = balance.functions()[0](*seen.columns(), np.array([u.value for u in balance.unknowns()]))
    # what is left out of the balance: the damper between stick and tool, and second-order terms of the slope
    assert np.abs(np.asarray(y) - load * np.asarray(h)).max() < 400.0
    assert np.abs(v[:3]).min() > 0.02


@pytest.mark.parametrize("load", [0.0, 1200.0, 2500.0])
def test_tared_machine_weighs(load: float) -> None:
    found = estimate(recorded(load), tared())
    errors = {m: [abs(e.load_kg - load) for e in found.estimates if e.moving is m] for m in (False, True)}
    covered = [e.interval[0] <= load <= e.interval[1] for e in found.estimates]
    assert np.mean(np.array(errors[False]) < 100.0) >= 0.95
    assert np.mean(np.array(errors[True]) < 200.0) >= 0.95
    assert np.mean(covered) >= 0.9
    assert min(len(e) for e in errors.values()) >= 5


def test_the_tare_narrows_the_interval_and_an_uncalibrated_one_still_covers() -> None:
    before, after = (estimate(recorded(1200.0), c) for c in (uncalibrated(), tared()))
    assert np.median([e.half_kg for e in after.estimates]) < 0.4 * np.median(
        [e.half_kg for e in before.estimates]
    )
    assert np.mean([abs(e.load_kg - 1200.0) < e.half_kg for e in before.estimates]) > 0.95


def test_what_the_tare_cannot_tell_apart_it_does_not_claim_to() -> None:
    """Pressure zeros and masses stay uncertain one by one; the estimate they add up to does not."""
    left = influence(tared())
    single = [v for name, v in left.items() if name not in ("total", "scatter")]
    assert max(single) > left["total"]
    assert influence(uncalibrated())["tool_mass"] == pytest.approx(99.3, rel=0.05)  # it is as good as a load


def test_calibration_finds_what_it_can_see() -> None:
    """Friction of the moving boom, drawn at random: nearer to the truth than the nominal figure."""
    from specs import draws

    names = [u.name for u in balance.unknowns()]
    truth = draws.draw("tuning", 9)
    at = names.index("tool_mass")
    assert np.sqrt(tared().covariance[at, at]) < 0.7 * balance.unknowns()[at].sd
    assert abs(tared().values[at] - truth["tool_mass"]) < 2.5 * np.sqrt(tared().covariance[at, at])


def test_gate_names_why_a_moment_does_not_count() -> None:
    found = estimate(recorded(1200.0), tared())
    known = {r.value for r in gate.Reason}
    assert set(found.left_out) <= known
    assert gate.Reason.BETWEEN.value in found.left_out


def test_saturated_pressure_closes_the_gate() -> None:
    recording = recorded(1200.0)
    pressure = recording["p_boom_a"].values.copy()
    pressure[200:400] = 60e6
    clipped = changed(recording, {"p_boom_a": pressure})
    assert gate.Reason.CLIPPED.value in estimate(clipped, tared()).left_out
    with pytest.raises(InputError, match=r"no moment counts: .*end of its range"):
        estimate(changed(recording, {"p_boom_a": 60e6 + np.arange(len(pressure)) % 2}), tared())


@pytest.mark.parametrize(
    ("gone", "note", "joints"),
    [
        (["p_boom_a"], "no channel p_boom_a: estimated from the stick alone", {("stick",)}),
        (
            ["p_stick_a", "p_stick_b"],
            "no channel p_stick_a and p_stick_b: estimated from the boom",
            {("boom",)},
        ),
        (["imu_tool_pitch"], "no imu_tool_pitch", None),
        (["imu_cabin_pitch", "imu_cabin_roll"], "taken to stand level", None),
    ],
)
def test_what_is_missing_is_named_and_the_rest_used(gone: list[str], note: str, joints: set | None) -> None:
    found = estimate(changed(recorded(1200.0), dict.fromkeys(gone)), tared())
    assert any(note in n for n in found.notes), found.notes
    if joints:
        assert {e.joints for e in found.estimates} == joints
    if gone[0].startswith("imu_tool"):
        assert not any(e.moving for e in found.estimates)
    load, _, _ = whole([e for e in found.estimates if not e.moving])
    assert abs(load - 1200.0) < 200.0


def test_dead_sensor_is_not_believed() -> None:
    recording = recorded(1200.0)
    dead = changed(recording, {"p_stick_a": np.full(len(recording["p_stick_a"].values), 9e6)})
    found = estimate(dead, tared())
    assert any("p_stick_a constant while the stick moves" in n for n in found.notes)
    assert {e.joints for e in found.estimates} == {("boom",)}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q_boom": None}, "no channel q_boom: without the pose"),
        ({"p_boom_a": None, "p_stick_b": None}, "p_boom_a; no channel p_stick_b: neither boom nor stick"),
    ],
)
def test_recordings_without_a_load_in_them(change: dict[str, None], message: str) -> None:
    with pytest.raises(InputError, match=message):
        estimate(changed(recorded(1200.0), change), tared())


def test_not_a_number_and_wrong_units_are_refused_with_their_place() -> None:
    recording = recorded(1200.0)
    broken = recording["q_stick"].values.copy()
    broken[100] = np.nan
    with pytest.raises(InputError, match=r"q_stick is no number at 2\.000 s"):
        estimate(changed(recording, {"q_stick": broken}), tared())
    channels = dict(recording.channels)
    channels["p_boom_a"] = replace(channels["p_boom_a"], unit="bar")
    with pytest.raises(InputError, match="p_boom_a is in bar; needed: Pa"):
        estimate(replace(recording, channels=channels), tared())


def test_too_short_a_recording_has_no_moment() -> None:
    short = {n: Channel(n, c.unit, c.time[:60], c.values[:60]) for n, c in recorded(1200.0).channels.items()}
    with pytest.raises(InputError, match="no moment counts"):
        estimate(Measurement(short), tared())
    with pytest.raises(InputError, match="5 are needed"):
        calibrate([Measurement(short)], [0.0])


def test_a_pull_on_the_tool_shows_as_disagreement() -> None:
    """Boom and stick weigh differently when what hangs on the arm is not hanging: the interval opens."""
    recording = recorded(1200.0)
    pushed = changed(recording, {"p_boom_a": recording["p_boom_a"].values + 30e5})
    free, bent = estimate(recording, tared()), estimate(pushed, tared())
    assert np.mean([e.agreement > 1.0 for e in free.estimates]) < 0.1
    assert np.mean([e.agreement > 1.0 for e in bent.estimates]) > 0.7
    assert np.median([e.half_kg for e in bent.estimates]) > 2 * np.median([e.half_kg for e in free.estimates])


def test_friction_that_stays_at_rest_widens_the_interval() -> None:
    """Cylinders that keep friction (the simulated ones do not): calibration sees it and says so."""
    kept = run(Trial("calibration", 1, 0.0, 5, (-0.5, 1.0)), DRAW)
    wide, narrow = calibrate([kept], [0.0]), tared()
    assert np.all(wide.residual[:, 0] > 2 * narrow.residual[:, 0])


def test_only_sensors_are_read() -> None:
    assert not [n for n in SENSED if n.startswith("true_")]
    found = usable(recorded(1200.0))
    assert set(found.channels) <= set(SENSED)
    assert not any(n.startswith("qd_") for n in found.channels)  # the encoders' velocities are late


def test_windows_are_half_a_window_apart() -> None:
    recording = recorded(1200.0)
    many, _ = windows.windows(recording)
    few, _ = windows.windows(recording, overlap=False)
    assert len(many) == pytest.approx(2 * len(few), abs=2)
    assert np.allclose(np.diff([w.time_s for w in many]), 1.0)
    assert sum(len(s) for s in stretches(recording, usable(recording))) == len(recording["q_boom"].time)
