"""The audit log on a full disk or under a flood of one peer, and retained values that were lost."""

import errno
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from deployment.faults.drive import Drive, Moment
from deployment.faults.table import Fault, Outcome
from runtime.hmi import tokens
from runtime.hmi.audit import Audit
from runtime.hmi.cells import GRANT, Writer
from runtime.hmi.desk import Desk
from runtime.hmi.port import STANDBY
from runtime.hmi.sessions import Refused, Sessions
from runtime.retain.copies import COPIES, Folder, Retained
from runtime.shared import private_folder
from specs.errors import InputError

Random = np.random.Generator
LAYOUT = "0123456789abcdef"
TARGET = {"target_x": 6.0, "target_y": 7.0, "target_z": 5.0}
SMALL, FILES = 4000, 3  # bytes of a file of the log, files
FLOOD = 80  # entries of one peer: several times as much as they hold
UNAVAILABLE = 503  # HTTP's


class FullAudit(Audit):
    """An audit log whose disk is full from some moment on."""

    full = False

    def write(self, who: str, role: str, where: str, what: str, **more: Any) -> None:
        """Append, or refuse as the disk does."""
        if self.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        super().write(who, role, where, what, **more)


def audit_disk_full(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """Somebody at work at the page asks for something when his actions can no longer be accounted for."""
    with tempfile.TemporaryDirectory() as folder:
        audit, granted = FullAudit(Path(folder) / "audit"), np.zeros(1, GRANT)[0]
        made = tokens.make(Path(folder) / "tokens.json")
        sessions = Sessions(tokens.read(Path(folder) / "tokens.json"), audit)
        states: list[np.ndarray] = []
        desk = Desk(sessions, lambda state: states.append(state.copy()), lambda: granted, lambda: STANDBY)
        now = int(random.integers(1, 1 << 40))
        session = desk.sign_in(made["service"], "Grace", "127.0.0.1", now)
        granted["owner"], granted["writer"] = desk.ask(session, now), Writer.HMI
        desk.go(session, TARGET, now)
        audit.full, before = True, states[-1].tobytes()
        asked: list[Callable[[], object]] = [
            lambda: desk.go(session, {**TARGET, "target_x": 9.0}, now),
            lambda: desk.force(session, "q_boom", 1.0, now),
            lambda: desk.sign_in(made["operator"], "Eve", "127.0.0.1", now),
        ]
        done = [k for k in random.permutation(len(asked)) if not _is_refused(asked[k])]
        why = f"request {done[0]} was done, and nobody could account for it" if done else ""
        why = why or ("something changed" if states[-1].tobytes() != before else "")
        desk.hold(session, now)
        why = why or ("hold was refused" if states[-1].tobytes() == before else "")
    outcome.add(moment.tick, 0.0, why)


def _is_refused(ask: Callable[[], object]) -> bool:
    try:
        ask()
    except Refused as error:
        return error.status == UNAVAILABLE
    return False


def audit_flood(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """Others do something at random moments while one peer asks for nonsense without end."""
    folder = private_folder("slewright-audit-")  # in memory: each entry waits for the disk
    try:
        audit = Audit(folder, largest=SMALL, kept=FILES)
        others = set(random.choice(FLOOD, 5, replace=False).tolist())
        for k in range(FLOOD):
            if k in others:
                audit.write(f"person {k}", "operator", f"10.0.0.{k}", "acknowledge", result="done")
            result = "done" if random.integers(2) else "refused"
            audit.write("Eve", "operator", "10.0.1.1", "x" * int(random.integers(1, 200)), result=result)
        left = {entry["who"] for entry in audit.last(10 * FLOOD)}
    finally:
        shutil.rmtree(folder)
    gone = [k for k in sorted(others) if f"person {k}" not in left]
    outcome.add(moment.tick, 0.0, f"the entry of person {gone[0]} was pushed out" if gone else "")


def retained_lost(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """One copy has a wrong bit or is cut, the other one is not there: no first start."""
    folder = Path(tempfile.mkdtemp())
    try:
        kept = Retained(Folder(folder), LAYOUT)
        for number in range(int(random.integers(1, 4))):
            kept.save({"fault_code": 3.0, "ticks": float(number)})
        left, gone = random.permutation(COPIES) if (folder / COPIES[1]).is_file() else COPIES
        (folder / gone).unlink(missing_ok=True)
        data = bytearray((folder / left).read_bytes())
        at = int(random.integers(len(data)))
        data[at] ^= 1 << int(random.integers(8))
        (folder / left).write_bytes(bytes(data) if random.integers(2) else bytes(data[:at]))
        why = "it starts as for the first time"
        try:
            Retained(Folder(folder), LAYOUT).load()
        except InputError as error:
            why = "" if str(folder) in str(error) else "the message names no folder"
    finally:
        shutil.rmtree(folder)
    outcome.add(moment.tick, 0.0, why)
