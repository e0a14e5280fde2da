"""The policy's contract: layout, how an observation is filled, and what is refused."""

import json
import math

import pytest

from specs import policy
from specs.errors import InputError
from specs.signals import signals

STILL = dict.fromkeys(policy.SENSORS, 0.0)
HELD: dict[str, float] = dict.fromkeys(policy.ACTIONS, 0.0)
TARGETS = {"target_x": 0.0, "target_y": 10.0, "target_z": 5.0, "load_told": 500.0, "pace": 0.8}


def metadata(**changed: object) -> dict[str, str]:
    """ONNX metadata of a contract with fields changed."""
    told = json.loads(policy.contract("full").as_json())
    return {policy.META: json.dumps({**told, **changed})}


def test_names_come_from_the_signals() -> None:
    """Every channel is a signal, but for the slew error and the target's radius."""
    known = signals()
    assert {n for n in (*policy.CHANNELS, *policy.ONCE) if n not in known} == {"slew_error", "target_radius"}
    assert all(n in known for n in (*policy.SENSORS, *policy.TARGETS))
    assert policy.units()["slew_error"] == "rad"
    assert policy.units()["qd_boom_ref"] == "rad/s"


def test_layout_is_channel_by_channel_oldest_first() -> None:
    """13 channels of five values and four numbers."""
    names = policy.layout()
    assert len(names) == policy.size() == 69
    assert names[:5] == ("u_slew[-4]", "u_slew[-3]", "u_slew[-2]", "u_slew[-1]", "u_slew[0]")
    assert names[15] == "slew_error[-4]"
    assert names[-4:] == policy.ONCE
    with pytest.raises(InputError, match="history of 0"):
        policy.layout(0)


def test_limits_are_the_signals_own() -> None:
    """Joystick and arm references as they cross the wire."""
    known = signals()
    for name, (low, high) in policy.LIMITS.items():
        assert (low, high) == (known[name].min, known[name].max)


def test_history_is_filled_and_relative_to_the_present_target() -> None:
    """First sensors fill it; errors are against the target of now, in the nearest turn; 0 was commanded."""
    history = policy.History(3)
    history.push({**STILL, "q_slew": 0.1, "q_boom": 1.0}, HELD)
    history.push({**STILL, "q_slew": 0.3, "q_boom": 1.1}, {**HELD, "u_slew": 0.5})
    seen = dict(zip(policy.layout(3), history.observation(TARGETS), strict=True))
    ahead = 0.3 - math.pi / 2
    assert [seen[f"slew_error[{i}]"] for i in (-2, -1, 0)] == pytest.approx([ahead - 0.2, ahead - 0.2, ahead])
    assert [seen[f"u_slew[{i}]"] for i in (-2, -1, 0)] == [0.0, 0.0, 0.5]
    assert [seen[f"q_boom[{i}]"] for i in (-2, -1, 0)] == [1.0, 1.0, 1.1]
    assert seen["target_radius"] == pytest.approx(10.0)
    behind = {**TARGETS, "target_x": -10.0, "target_y": -0.01}
    turned = dict(zip(policy.layout(3), history.observation(behind), strict=True))
    assert turned["slew_error[0]"] == pytest.approx(0.3 - math.atan2(-0.01, -10.0) - 2 * math.pi)


def test_contract_survives_the_metadata() -> None:
    """What is written is read, with ranges and what made it."""
    made = policy.contract("slew", 3, data_sha256="ab", ranges={"pace": (0.4, 1.4)}, made={"seed": 7})
    found = policy.read_contract({policy.META: made.as_json()}, "x.onnx")
    assert found == made
    assert policy.outside(found.ranges, {"pace": 2.0, "other": 1.0}) == [
        "pace 2 is outside the trained 0.4 … 1.4"
    ]


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"rate_hz": 20.0}, "rate_hz 20.0, specs say 10.0"),
        ({"format": 2}, "format 2, specs say 1"),
        ({"format": 2, "surprise": 1}, "format 2, specs say 1"),
        ({"task": "boom"}, "task 'boom'"),
        ({"actions": ["u_slew", "qd_stick_ref", "qd_boom_ref"]}, "actions entry 1 is 'qd_stick_ref'"),
        ({"layout": ["q_slew"]}, "layout of 1 entries, specs say 69"),
        ({"limits": {"u_slew": [-1, 1], "qd_boom_ref": [-0.3, 0.3]}}, "qd_boom_ref"),
        ({"surprise": 1}, "no key 'surprise'"),
        ({"prio": ""}, "no key 'prio'; did you mean prior"),
    ],
)  # fmt: skip
def test_another_contract_is_refused_with_the_difference(changed: dict[str, object], named: str) -> None:
    """The first difference is named, and the file."""
    with pytest.raises(InputError, match=named.replace("(", r"\(")) as error:
        policy.read_contract(metadata(**changed), "mine.onnx")
    assert "mine.onnx" in str(error.value)


def test_a_contract_without_one_of_its_keys_is_refused_with_the_key() -> None:
    told = json.loads(metadata()[policy.META])
    del told["ranges"]
    with pytest.raises(InputError, match=r"mine\.onnx.* lacks its key 'ranges'"):
        policy.read_contract({policy.META: json.dumps(told)}, "mine.onnx")


def test_a_stranger_is_refused() -> None:
    """No metadata of ours; other ends of the graph."""
    with pytest.raises(InputError, match="no policy of this project"):
        policy.read_contract({}, "x.onnx")
    told = policy.contract("full")
    with pytest.raises(InputError, match=r"input 'obs' \[1, 69\]"):
        policy.check_shapes({"obs": [1, 69]}, {"action": [1, 3]}, told, "x.onnx")
    with pytest.raises(InputError, match="output"):
        policy.check_shapes({"observation": [1, 69]}, {"action": [1, 1]}, told, "x.onnx")
