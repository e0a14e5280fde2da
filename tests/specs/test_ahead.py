"""What a led policy sees of its way and of things: names, numbers, contract, and where it is refused."""

import json
import math
from dataclasses import replace

import pytest

from specs import policy
from specs.ahead import MOST_WAYPOINTS, NOTHING, Ahead
from specs.errors import InputError

SEES = Ahead((0.0, 0.8), 3.0)
CONTRACT = policy.contract("full", lead_s=1.2, waypoints_s=SEES.waypoints_s, field_m=SEES.field_m)


def test_what_is_ahead_comes_after_all_else() -> None:
    names = policy.layout(5, SEES)
    assert names[: policy.size()] == policy.layout()
    assert len(names) == policy.size(5, SEES) == 69 + 2 * 3 + 3 * 4
    assert names[69:72] == ("way_slew[0]", "way_radius[0]", "way_z[0]")
    assert names[75:79] == ("tool_distance", "tool_by_slew", "tool_by_boom", "tool_by_stick")
    assert NOTHING.names == ()
    assert not NOTHING


def test_entries_are_by_the_page() -> None:
    """Angles past the places in the nearest turn, distances up to where they are seen."""
    places = [(0.0, 10.0, 5.0), (-6.0, 0.0, 4.0)]
    slopes = [[9.0, 1.0, 2.0], [0.0, 0.0, 0.0], [-3.0, 0.5, 0.0]]
    found = dict(zip(SEES.names, SEES.entries(-3.0, places, [0.4, 7.0, -0.1], slopes), strict=True))
    assert found["way_slew[0]"] == pytest.approx(-3.0 - math.pi / 2 + 2 * math.pi)
    assert found["way_slew[0.8]"] == pytest.approx(-3.0 - math.pi + 2 * math.pi)
    assert (found["way_radius[0]"], found["way_z[0.8]"]) == (10.0, 4.0)
    assert (found["tool_distance"], found["tool_by_slew"]) == (0.4, 9.0)
    assert found["tool_second_distance"] == SEES.field_m
    assert (found["arm_distance"], found["arm_by_slew"]) == (-0.1, -3.0)


def test_the_contract_goes_through_the_file_and_others_stay_as_they_were() -> None:
    metadata = {policy.META: CONTRACT.as_json()}
    assert policy.read_contract(metadata, "mine.onnx") == CONTRACT
    assert CONTRACT.ahead == SEES
    told = json.loads(policy.contract("full").as_json())
    assert not {"waypoints_s", "field_m"} & set(told)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"waypoints_s": (0.8, 0.4)}, "each later than the one before"),
        ({"waypoints_s": (-0.1,)}, "waypoints_s [-0.1]"),
        ({"waypoints_s": tuple(0.1 * k for k in range(MOST_WAYPOINTS + 1))}, "waypoints_s"),
        ({"field_m": math.nan}, "field_m nan"),
        ({"field_m": 99.0}, "field_m 99.0"),
        ({"lead_s": 0.0}, "with a lead_s alone"),
        ({"task": "slew"}, "for task full"),
        ({"field_m": 0.0}, "layout of 87 entries, specs say 75"),
    ],
)
def test_what_does_not_go_together_is_refused(changed: dict[str, object], named: str) -> None:
    found = replace(CONTRACT, **changed).differences()  # type: ignore[arg-type]
    assert any(named in text for text in found), found


def test_where_signals_alone_are_there_it_is_refused() -> None:
    policy.check_signals(policy.contract("full", lead_s=1.2), "led.onnx")
    with pytest.raises(InputError, match=r"mine.onnx: it sees .* slewright scenes"):
        policy.check_signals(CONTRACT, "mine.onnx")
