"""What the page may ask for, and who: sessions, the right to write, targets, forcing.  No sockets, no clock.

One session writes targets at a time, and one forces.  Both rights last while the page that has them sends its
beat: they end 0.5 s after the last one, as a Modbus client's do, whether the browser, its computer or this
process was lost.  Whether a right is granted at all the control process says (runtime/hmi/port.py).
"""

import secrets
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.hmi.cells import HMI, Writer
from runtime.hmi.port import STANDBY
from runtime.hmi.sessions import Refused, Session, Sessions
from runtime.hmi.tokens import SERVICE
from runtime.image import INPUT, forceable
from runtime.modbus.cells import HOLDING
from runtime.modbus.holding import HIGHEST_HEARTBEAT, LAPSE_NS
from specs.errors import nearest
from specs.signals import Signal

LARGEST = 1e300  # whole numbers of JSON may be larger than any float
PLACE = {s.name: i for i, s in enumerate(HOLDING)}
ASKED = ("target_x", "target_y", "target_z", "pace", "load_told")


@dataclass
class Right:
    """A session that writes, or forces, and when it gave its last sign of life."""

    session: Session
    number: int
    beat_ns: int
    granted: bool = False


class Desk:
    """All that can be changed from a page; `publish` is given every new state (cells.HMI)."""

    def __init__(
        self,
        sessions: Sessions,
        publish: Callable[[np.ndarray], None],
        granted: Callable[[], np.void],
        mode: Callable[[], int],
    ) -> None:
        self.sessions, self._publish = sessions, publish
        self._granted, self._mode = granted, mode
        self._lock = threading.RLock()
        self.state = np.zeros((), HMI)
        self.state["targets"]["value"] = [s.start for s in HOLDING]
        self.writer: Right | None = None
        self.forcer: Right | None = None

    def sign_in(self, token: str, name: str, where: str, now: int) -> Session:
        """A session for a token; Refused for one that is not known."""
        return self.sessions.sign_in(token, name, where, now, self._has_right)

    def sign_out(self, session: Session, now: int) -> None:
        """Give back what the session holds, and forget it."""
        with self._lock:
            if self.writer and self.writer.session is session:
                self._end_writing(now, "given back")
            if self.forcer and self.forcer.session is session:
                self._end_forcing(now, "given back")
        self.sessions.forget(session)

    # --- the right to write targets ---

    def ask(self, session: Session, now: int) -> int:
        """Ask for the right; the number of the claim, which the control process may grant."""
        with self._lock:
            held = self.writer
            if held and held.session is session:
                return held.number
            if held:
                raise Refused(409, f"{held.session.name} ({held.session.role}) has the control")
            if self._granted()["writer"] == Writer.PLANNER:
                raise Refused(409, "a planner (CAN or Modbus) writes targets; it must end first")
            self.sessions.log(session, "take control", must=True)
            self.writer = Right(session, secrets.randbits(31) | 1, now)
            targets = self.state["targets"]
            targets["commits"], targets["owner"], targets["heartbeat_ns"] = 0, self.writer.number, now
            self._send(now)
            return self.writer.number

    def has_grant(self, number: int) -> bool:
        """Whether the control process has granted a claim."""
        granted = self._granted()
        return granted["writer"] == Writer.HMI and granted["owner"] == number

    def release(self, session: Session, now: int, why: str = "given back") -> None:
        """Give the right back: all targets lapse."""
        with self._lock:
            if self.writer is None or self.writer.session is not session:
                raise Refused(409, "you do not have the control")
            self._end_writing(now, why)

    def beat(self, session: Session, now: int) -> None:
        """A sign of life of the page: its rights go on."""
        with self._lock:
            self.lapse(now)
            rights = [r for r in (self.writer, self.forcer) if r and r.session is session]
            if not rights:
                raise Refused(409, "you do not have the control")
            for right in rights:
                right.beat_ns = now
            if self.writer in rights:
                targets = self.state["targets"]
                targets["heartbeat_ns"] = now
                place = PLACE["planner_heartbeat"]
                targets["value"][place] = (targets["value"][place] + 1) % (HIGHEST_HEARTBEAT + 1)
            self._send(now)

    def lapse(self, now: int) -> None:
        """End rights whose page gives no sign of life, and those the control process has ended."""
        with self._lock:
            writer, forcer = self.writer, self.forcer
            granted = writer is not None and self.has_grant(writer.number)
            if writer and now - writer.beat_ns >= LAPSE_NS:
                self._end_writing(now, "the page was lost")
            elif writer and writer.granted and not granted:
                self._end_writing(now, "the control process ended it")
            elif writer:
                writer.granted = granted
            if forcer and now - forcer.beat_ns >= LAPSE_NS:
                self._end_forcing(now, "the page was lost")
            elif forcer and self._granted()["force_ended"] == self.state["force_number"]:
                self._end_forcing(now, "STANDBY was left")

    def tick(self, now: int) -> None:
        """To be called at least every BEAT_S: rights end, and who forces is seen to be alive."""
        with self._lock:
            self.lapse(now)
            if self.writer or self.forcer:  # else nobody asks for anything, and the control process rests
                self._send(now)

    # --- what is asked for ---

    def go(self, session: Session, asked: Mapping[str, Any], now: int) -> None:
        """Set a target and follow it; Refused, and nothing changed, if a value is not in its range."""
        with self._lock:
            targets = self._targets_of(session, now)
            wanted = {name: _number(name, asked) for name in ASKED if name in asked}
            missing = [n for n in ASKED[:3] if n not in wanted and not targets["commits"]]
            if missing:
                raise Refused(400, f"missing: {', '.join(missing)}")
            old = {name: float(targets["value"][PLACE[name]]) for name in wanted}
            self.sessions.log(session, "go to target", must=True, old=old, new=wanted)
            for name, value in wanted.items():
                targets["value"][PLACE[name]] = value
            place = PLACE["target_number"]
            targets["value"][place] = (targets["value"][place] + 1) % (HIGHEST_HEARTBEAT + 1)
            targets["value"][PLACE["target_valid"]] = 1.0
            targets["commits"] += 1
            self._send(now)

    def hold(self, session: Session, now: int) -> None:
        """Follow no target; never refused for want of an audit log."""
        with self._lock:
            targets = self._targets_of(session, now)
            old = float(targets["value"][PLACE["target_valid"]])
            targets["value"][PLACE["target_valid"]] = 0.0
            targets["commits"] += 1
            self._send(now)
            self.sessions.log(session, "hold", old=old, new=0.0)

    def target(self) -> dict[str, float] | None:
        """What is asked for now; None if nobody has the right."""
        if self.writer is None:
            return None
        return {s.name: float(v) for s, v in zip(HOLDING, self.state["targets"]["value"], strict=True)}

    # --- forcing ---

    def force(self, session: Session, name: str, value: Any, now: int) -> None:
        """Put a value in the place of a sensor's; only the service role, only in STANDBY."""
        with self._lock:
            try:
                place, wanted = self._forceable(session, name), _in_range(_input(name), value)
                held = self.forcer
                if held and held.session is not session:
                    raise Refused(409, f"{held.session.name} is forcing inputs")
            except Refused as error:
                self.sessions.log(session, "force", signal=name, new=value, result=f"refused: {error}")
                raise
            old = float(self.state["value"][place]) if self.state["forced"][place] else None
            self.sessions.log(session, "force", must=True, signal=name, old=old, new=wanted)
            self.forcer = Right(session, 0, now)
            self.state["forced"][place], self.state["value"][place] = 1, wanted
            self.state["force_number"] = secrets.randbits(31) | 1
            self._send(now)

    def unforce(self, session: Session, now: int) -> None:
        """End all forcing; whoever is signed in may."""
        with self._lock:
            self._end_forcing(now, f"by {session.name} ({session.role})")

    def forced(self) -> dict[str, float]:
        """What is asked to be forced."""
        places = np.flatnonzero(self.state["forced"])
        return {INPUT.signals[i].name: float(self.state["value"][i]) for i in places}

    # --- inside ---

    def _forceable(self, session: Session, name: str) -> int:
        if session.role != SERVICE:
            raise Refused(403, "only the service role may force inputs")
        if not forceable(_input(name)):
            raise Refused(400, f"{name} decides who may move, and is never forced")
        if self._mode() != STANDBY:
            raise Refused(409, "inputs are forced in STANDBY only")
        return INPUT.index[name]

    def _targets_of(self, session: Session, now: int) -> Any:
        self.lapse(now)
        if (
            self.writer is None
            or self.writer.session is not session
            or not self.has_grant(self.writer.number)
        ):
            raise Refused(409, "you do not have the control")
        return self.state["targets"]

    def _end_writing(self, now: int, why: str) -> None:
        right, self.writer = self.writer, None
        targets = self.state["targets"]
        for key in ("owner", "commits", "heartbeat_ns"):
            targets[key] = 0
        targets["value"] = [s.start for s in HOLDING]
        self._send(now)
        if right:
            self.sessions.log(right.session, "control ended", result=why)

    def _end_forcing(self, now: int, why: str) -> None:
        right, old = self.forcer, self.forced()
        self.forcer = None
        self.state["forced"], self.state["value"], self.state["force_number"] = 0, 0.0, 0
        self._send(now)
        if right:
            self.sessions.log(right.session, "forcing ended", old=old, result=why)

    def _has_right(self, session: Session) -> bool:
        return any(r is not None and r.session is session for r in (self.writer, self.forcer))

    def _send(self, now: int) -> None:
        self.state["targets"]["stamp_ns"] = now
        self._publish(self.state)


def _input(name: str) -> Signal:
    if name not in INPUT.index:
        raise Refused(400, f"no input signal '{name}'; {nearest(name, INPUT.index)}")
    return INPUT.signals[INPUT.index[name]]


def _number(name: str, asked: Mapping[str, Any]) -> float:
    return _in_range(HOLDING[PLACE[name]], asked[name])


def _in_range(s: Signal, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST:
        raise Refused(400, f"{s.name}: a number is wanted")
    low, high = s.min if s.min is not None else -np.inf, s.max if s.max is not None else np.inf
    if not low <= value <= high:
        raise Refused(400, f"{s.name} = {value:g} {s.unit}: {low:g} to {high:g}")
    return float(value)
