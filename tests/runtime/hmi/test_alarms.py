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
