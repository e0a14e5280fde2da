"""Rights of a control process that is nobody's root, as under systemd."""

import os

import pytest

from runtime import realtime


def test_priority_is_given_back_as_a_plain_user_may(monkeypatch: pytest.MonkeyPatch) -> None:
    """Children start without it (SCHED_RESET_ON_FORK), and that only the privileged may change.

    A real user with a real limit is in the virtual machine (tests/install): not every computer that runs the
    tests may set one.
    """
    asked: list[int] = []
    monkeypatch.setattr(os, "sched_getscheduler", lambda pid: os.SCHED_FIFO | os.SCHED_RESET_ON_FORK)
    monkeypatch.setattr(os, "sched_setscheduler", lambda pid, policy, param: asked.append(policy))
    realtime.release()
    assert asked == [os.SCHED_OTHER | os.SCHED_RESET_ON_FORK]
    monkeypatch.setattr(os, "sched_getscheduler", lambda pid: os.SCHED_OTHER)
    realtime.release()
    assert asked[1:] == [os.SCHED_OTHER]
