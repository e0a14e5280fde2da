"""Why the gate changed a command: every change has a reason, and nothing that passed has one."""

import numpy as np
import pytest

from deployment.hil.lockstep import lockstep
from runtime.control import AXES, REASONS
from runtime.image import INPUT, OUTPUT, Status
from specs import scenario
from specs.errors import InputError
from tests.runtime.bundles import core

TICKS = 700


def asked(controller: str = "pd", ticks: int = TICKS, change=None, authority=None) -> list[tuple]:
    """(tick, axis, wanted, passed, reasons) of every tick in automatic operation."""
    found, states, made = [], [b""], core(controller)

    def disturb(image: np.ndarray, tick: int) -> None:
        if change:
            change(image, tick)
        if tick == 0 and authority:
            made.limit(*authority)
        states[0] = made.snapshot()

    def look(image: np.ndarray, outputs: np.ndarray, tick: int) -> None:
        wanted, why = made.explained(image, states[0])
        for axis, name in enumerate(AXES):
            passed = float(outputs["value"][OUTPUT.index[name]])
            found.append((tick, axis, wanted[axis], passed, why[axis]))

    lockstep(made, scenario.load("four_targets_2t"), 1, ticks, change=disturb, look=look)
    return found


def test_every_change_has_a_reason_and_nothing_else_has_one():
    found = asked()
    limited = [f for f in found if f[2] != f[3]]
    assert len(limited) > 10
    assert all(why for *_, why in limited)
    assert all(not why for _, _, wanted, passed, why in found if wanted == passed)
    assert {"rate", "keep_out"} <= {r for *_, why in limited for r in why} <= set(REASONS)


def test_authority_is_a_reason_of_its_own():
    found = asked(ticks=100, authority=([0.1, 1.0, 1.0], 1.0, 1.0))
    assert any("authority" in why for _, axis, _, _, why in found if axis == 0)
    assert not any("authority" in why for _, axis, _, _, why in found if axis != 0)


def test_a_machine_too_fast_is_a_reason():
    def fast(image: np.ndarray, tick: int) -> None:
        """By hand with the motion, faster than the gate allows; and never the same value, or it is stuck."""
        image["value"][INPUT.index["joystick_slew"]] = 0.5
        image["value"][INPUT.index["imu_cabin_rate_z"]] = 1.0 + 1e-3 * (tick % 7)

    found = [f for f in asked(ticks=60, change=fast) if f[0] > 20 and f[1] == 0]
    assert all(why == ["speed"] and passed == 0.0 for *_, passed, why in found)


def test_a_lost_sensor_by_hand_is_no_reason_within_the_creep():
    """By hand the operator creeps on; a lost sensor stops an axis in automatic operation only."""

    def lost(image: np.ndarray, tick: int) -> None:
        image["value"][INPUT.index["joystick_slew"]] = 0.2
        image["status"][INPUT.index["imu_cabin_rate_z"]] = Status.ERROR

    found = [f for f in asked(ticks=60, change=lost) if f[0] > 20 and f[1] == 0]
    assert all("sensor" not in why for *_, why in found)


def test_a_state_of_another_size_is_refused():
    made = core("pd")
    with pytest.raises(InputError, match="snapshot"):
        made.explained(INPUT.new(), b"\0" * 8)
