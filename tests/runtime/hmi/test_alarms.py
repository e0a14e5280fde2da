"""In which order alarms are listed."""

import pytest

from runtime.hmi.alarms import Alarms, Condition, Level


def test_the_most_urgent_are_first_then_the_newest_and_of_one_time_causes() -> None:
    alarms = Alarms()
    early = Condition("early", Level.CRITICAL, "early", "")
    limit = Condition("limit", Level.WARNING, "limit", "")
    cause, effect = (Condition(name, Level.CRITICAL, name, "") for name in ("cause", "effect"))
    alarms.update([early], [], 1.0)
    alarms.update([cause, early, limit, effect], [], 2.0)
    assert [a.text for a in alarms.listed()] == ["cause", "effect", "early", "limit"]


def test_a_day_clock_that_is_set_back_ends_no_alarm_and_stops_none() -> None:
    alarms = Alarms()
    wrong = Condition("sensor", Level.WARNING, "sensor", "")
    for now, day in ((100.0, 5000.0), (100.1, 1400.0), (100.4, 1400.3), (100.5, 1400.4)):
        alarms.update([], [wrong], now, day)
    assert [a.text for a in alarms.listed()] == ["sensor"]
    assert alarms.listed()[0].since == 1400.3
    assert alarms.listed()[0].gone is None


def test_shelving_ends_by_itself_and_is_not_for_what_stops_the_machine() -> None:
    alarms = Alarms()
    note = Condition("flag:1", Level.WARNING, "No real-time priority", "")
    stops = [Condition("emergency_stop", Level.CRITICAL, "Emergency stop is open", ""),
             Condition("fault:x:", Level.WARNING, "x", "")]  # fmt: skip
    alarms.update([note, *stops], [], 100.0)
    numbers = {a.key: a.number for a in alarms.listed()}
    for stop in stops:
        with pytest.raises(ValueError, match="what stops the machine"):
            alarms.shelve(numbers[stop.key], 200.0, "said")
    alarms.shelve(numbers["flag:1"], 200.0, "shelved by Ada")
    alarms.update(stops, [], 110.0)
    alarms.update([note, *stops], [], 199.9, 5.0)  # gone and there again; the day's clock was set back
    assert [a.shelved for a in alarms.listed() if a.key == "flag:1"] == ["shelved by Ada"]
    alarms.update([note, *stops], [], 200.0, 6.0)
    assert not any(a.shelved for a in alarms.listed())
    with pytest.raises(ValueError, match="not shelved"):
        alarms.unshelve(numbers["flag:1"])
