"""What a rig takes for itself on a computer that others use, too."""

import pytest

from deployment.hil import rig


def test_a_free_domain_of_ros2_is_one_in_which_nobody_is(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("cyclonedds")
    from cyclonedds.domain import DomainParticipant

    from runtime.ros2.loopback import settings

    settings()
    taken = rig.free_domain()
    somebody = DomainParticipant(taken)
    monkeypatch.setattr(rig, "randbelow", lambda below: taken)  # it is tried first
    assert rig.free_domain() != taken
    assert somebody
