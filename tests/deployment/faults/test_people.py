"""The faults of audit log and retained values can be missed; processes of a run are found to their end."""

import os
import subprocess
import sys

import numpy as np
import pytest

from deployment.faults import people
from deployment.faults.orphans import of_session
from deployment.faults.people_table import FILES
from deployment.faults.table import Outcome
from runtime.hmi.audit import Audit
from runtime.retain.copies import Retained

BROKEN = {
    "audit_disk_full": (people.FullAudit, "write", lambda self, *_, **__: None),
    "audit_flood": (Audit, "last", lambda self, count: []),
    "retained_lost": (Retained, "load", lambda self: {}),
}


class _Moment:
    tick = 7


@pytest.mark.parametrize("fault", FILES, ids=lambda f: f.name)
@pytest.mark.parametrize("broken", [False, True])
def test_what_does_not_react_is_missed(monkeypatch: pytest.MonkeyPatch, fault, broken: bool):
    if broken:
        monkeypatch.setattr(*BROKEN[fault.name])
    outcome, random = Outcome(fault), np.random.default_rng(5)
    for _ in range(3):
        getattr(people, fault.name)(fault, None, _Moment(), random, outcome)
    assert (outcome.injected, outcome.caught) == (3, 0 if broken else 3), outcome.missed


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_processes_of_a_session_are_found_until_they_have_ended():
    process = subprocess.Popen(
        [sys.executable, "-c", "input()"], stdin=subprocess.PIPE, start_new_session=True
    )
    assert of_session(process.pid) == [process.pid]
    assert os.getpid() not in of_session(process.pid)
    process.kill()
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # it has ended, and waits for its parent
    assert of_session(process.pid) == []
    process.communicate()
