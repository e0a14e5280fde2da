"""The four metrics on trajectories whose figures can be worked out by hand."""

import math

import numpy as np
import pytest

from records import metrics
from records.metrics import check_limits, compute
from records.record import Record
from records.targets import targets, wrap
from tests.records.synthetic import STEP, constant, make, plausible, ramp, slew_run


def test_a_straight_move_that_stops_on_the_target():
    # 0 → 90° in 9 s at 10 °/s: within 3° from 87° on, that is after 8.7 s.
    result = compute(slew_run([np.r_[ramp(0, 90, 9), constant(90, 6)]], [90]))
    target = result.per_target[0]
    assert target.time_s == pytest.approx(8.7, abs=1.5 * STEP)
    assert result.speed == pytest.approx(90 / 8.7, rel=3e-3)
    assert (result.overshoot, result.missed, result.targets) == (0.0, 0, 1)
    assert result.error == pytest.approx(0.0, abs=1e-9)
    assert (result.within_1m, result.within_2m) == (1, 1)


def test_a_target_never_reached_counts_with_its_fifteen_seconds():
    result = compute(slew_run([np.r_[ramp(0, 80, 8), constant(80, 7)]], [90]))
    assert result.missed == 1
    assert result.per_target[0].time_s == 15.0
    assert result.speed == pytest.approx(90 / 15)
    assert result.slew_error == pytest.approx(10.0)
    # the chord of 10° at 10 m
    assert result.error == pytest.approx(2 * 10 * math.sin(math.radians(5)))
    assert (result.within_1m, result.within_2m) == (0, 1)


def test_leaving_the_band_again_restarts_the_clock():
    # In the band at 8.7 s, out of it again at 94° for the tenth and eleventh second, back at 12 s for good.
    path = np.r_[ramp(0, 90, 9), constant(90, 1), constant(94, 2), constant(90, 3)]
    result = compute(slew_run([path], [90]))
    assert result.per_target[0].time_s == pytest.approx(12.0)
    assert result.speed == pytest.approx(90 / 12)
    assert result.overshoot == pytest.approx(4.0)
    assert result.missed == 0


def test_out_of_the_band_in_the_last_row_is_missed():
    path = np.r_[ramp(0, 90, 9), constant(90, 6)]
    path[-1] = 93.5
    result = compute(slew_run([path], [90]))
    assert (result.missed, result.per_target[0].time_s) == (1, 15.0)


def test_overshoot_counts_in_the_direction_of_travel():
    # clockwise 90 → 0: passing 0 to −7° is overshoot; starting far on the other side is not
    there, back = (
        np.r_[ramp(0, 90, 9), constant(90, 6)],
        np.r_[ramp(90, -7, 5), constant(-7, 1), constant(0, 9)],
    )
    result = compute(slew_run([there, back], [90, 0]))
    first, second = result.per_target
    assert (first.travel_deg, second.travel_deg) == (pytest.approx(90), pytest.approx(-90))
    assert (first.overshoot, second.overshoot) == (pytest.approx(0), pytest.approx(7))
    assert result.overshoot == pytest.approx(3.5)
    assert result.overshoot_max == pytest.approx(7)


def test_travel_goes_on_past_half_a_turn():
    # 0 → 135° → 225° (atan2 says −135°) → 315°: three moves counter-clockwise
    pieces = [constant(135, 15), constant(225, 15), constant(315, 15)]
    found = targets(slew_run([np.r_[[0.0], pieces[0][1:]], *pieces[1:]], [135, 225, 315]))
    assert [math.degrees(t.slew) for t in found] == pytest.approx([135, 225, 315])
    assert [math.degrees(t.travel) for t in found] == pytest.approx([135, 90, 90])


def test_the_first_target_is_taken_nearest_to_where_the_machine_starts():
    start = np.r_[[360.0], constant(405, 15)[1:]]
    found = targets(slew_run([start], [45]))
    assert math.degrees(found[0].slew) == pytest.approx(405)
    assert math.degrees(found[0].travel) == pytest.approx(45)


def test_speed_is_a_mean_over_targets_and_a_hold_is_none():
    # the first target is where the machine stands already: no move, no speed, no overshoot, but an error
    hold, move = constant(0, 15), np.r_[ramp(0, 60, 6), constant(60, 9)]
    result = compute(slew_run([hold, move], [0, 60]))
    assert [t.moves for t in result.per_target] == [False, True]
    assert result.speed == result.per_target[1].speed
    assert (result.targets, result.missed, result.within_1m) == (2, 0, 2)


def test_error_is_taken_over_the_last_second_only():
    # on the target until 14.5 s, then half a second 5° off: mean 2.5°
    path = np.r_[ramp(0, 90, 9), constant(90, 5.5), constant(85, 0.5)]
    assert compute(slew_run([path], [90])).slew_error == pytest.approx(2.5)


def test_tool_is_the_mean_rate_of_both_joints_over_all_of_the_target():
    record = slew_run([np.r_[ramp(0, 90, 9), constant(90, 6)]], [90])
    series = {name: record.column(name).copy() for name in record.names}
    n = len(record)
    series["true_qd_tool_x"][: n // 3] = math.radians(3)
    series["true_qd_tool_y"][: n // 3] = math.radians(-4)
    assert compute(make(series)).tool == pytest.approx(5 / 3)


def test_targets_from_metadata_keep_two_equal_ones_apart():
    record = slew_run([np.r_[ramp(0, 90, 9), constant(90, 21)]], [90])
    point = {"x": 0.0, "y": 10.0, "z": 5.0}
    told = Record(record.table, {**record.meta, "targets": [{"time": 0, **point}, {"time": 15, **point}]})
    found = targets(told)
    assert [(t.rows.start, t.rows.stop) for t in found] == [(0, 750), (750, 1500)]
    assert [t.whole for t in targets(record)] == [True], "a last target is judged over its own period"


def test_a_scenario_s_own_interval_counts():
    record = slew_run([np.r_[ramp(0, 80, 4), constant(80, 6)]], [90])
    told = Record(record.table, {**record.meta, "target_interval_s": 10.0})
    (target,) = compute(told).per_target
    assert (target.time_s, target.speed, target.reached) == (10.0, pytest.approx(9.0), False)
    assert not compute(record).complete, "15 s unless told"


def test_a_target_cut_short_is_left_out_and_said():
    record = slew_run([np.r_[ramp(0, 90, 9), constant(90, 6)], constant(90, 4)], [90, 0])
    result = compute(record)
    assert (result.targets, result.complete) == (1, False)
    verdicts = check_limits(result, {"speed": {"min": 1.0}})
    assert [(v.metric, v.passed) for v in verdicts] == [("speed", True), ("complete", False)]


def test_nothing_to_average_passes_no_limit():
    result = compute(slew_run([constant(0, 3)], [90]))
    assert math.isnan(result.speed)
    assert not check_limits(result, {"speed": {"min": 0.0}})[0].passed
    assert result.as_dict()["speed"] is None


@pytest.mark.parametrize(
    ("limit", "passed", "text"),
    [
        ({"min": 10.0}, True, "≥ 10"),
        ({"min": 11.0}, False, "≥ 11"),
        ({"max": 10.0}, False, "≤ 10"),
        ({"min": 10.0, "max": 10.4, "reason": "why"}, True, "10 … 10.4"),
    ],
)
def test_limits(limit, passed, text):
    result = compute(slew_run([np.r_[ramp(0, 90, 9), constant(90, 6)]], [90]))
    (verdict,) = check_limits(result, {"speed": limit}, "four_targets_empty", "nominal")
    assert (verdict.passed, verdict.limit, verdict.reason) == (passed, text, limit.get("reason", ""))


def test_a_limit_on_no_metric_is_refused():
    with pytest.raises(ValueError, match=r"no such metric: sped; there are .*speed"):
        check_limits(compute(plausible()), {"sped": {"min": 1}})


def test_mirrored_runs_have_equal_metrics():
    ahead = slew_run([np.r_[ramp(0, 97, 9), constant(90, 6)]], [90])
    mirrored = {name: ahead.column(name) * (-1 if name in MIRRORED else 1) for name in ahead.names}
    one, other = compute(ahead), compute(make(mirrored))
    for name in ("speed", "overshoot", "error", "tool", "missed"):
        assert getattr(one, name) == pytest.approx(getattr(other, name))


MIRRORED = {"target_y", "true_q_slew", "true_tool_y", "true_qd_tool_x"}


def test_wrap_covers_the_half_open_turn():
    assert wrap(math.pi) == pytest.approx(math.pi)
    assert wrap(-math.pi) == pytest.approx(math.pi)
    assert wrap(3 * math.pi / 2) == pytest.approx(-math.pi / 2)
    assert wrap(-7.0) == pytest.approx(-7.0 + 2 * math.pi)


def test_the_band_and_the_last_second_are_the_design_s():
    assert (metrics.BAND_DEG, metrics.LAST_S, metrics.TOLERANCES_M) == (3.0, 1.0, (1.0, 2.0))
