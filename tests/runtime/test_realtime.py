"""Rights of a control process that is nobody's root, as under systemd."""

import os
import subprocess
import sys

import pytest

from tests.conftest import ROOT

PLAIN = """
import os, resource
from runtime import realtime
resource.setrlimit(resource.RLIMIT_RTPRIO, (realtime.PRIORITY, realtime.PRIORITY))
os.setgroups([])
os.setresgid(65534, 65534, 65534)
os.setresuid(65534, 65534, 65534)
rights = realtime.acquire(lock=False)
print(rights.fifo, os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO)
realtime.release()
print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER)
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root: it becomes another user")
def test_a_plain_user_takes_the_priority_and_gives_it_back() -> None:
    """Once given back with an error, every orderly end of the service was a failure."""
    done = subprocess.run(
        [sys.executable, "-c", PLAIN], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.stdout.startswith("False"):
        pytest.skip("this computer gives no real-time priority")
    assert (done.returncode, done.stdout.split()) == (0, ["True", "True", "True"]), done.stderr
