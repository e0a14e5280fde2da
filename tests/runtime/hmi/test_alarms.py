"""In which order alarms are listed."""

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
