"""What a page can ask of a running controller, by method and path."""

import threading
import time
from typing import Any

from runtime.hmi.catalogue import catalogue
from runtime.hmi.desk import Desk
from runtime.hmi.sessions import Refused, Session
from runtime.hmi.trends import ROWS
from runtime.hmi.watch import Watch
from runtime.hmi.web import FULL_STREAMS, Request, Route
from specs.errors import nearest

GRANT_S = 0.3  # in which the control process answers a claim, ten cycles and more
AUDIT_ROWS = 100
SHELVED_MINUTES = 480  # at most: a shift
REASON_LENGTH = 100


class Live:
    """The routes; those that change something need a session, and come from this computer or over TLS."""

    def __init__(self, watch: Watch, desk: Desk, about: dict[str, Any], secure: bool) -> None:
        self.watch, self.desk, self.about, self.secure = watch, desk, about, secure
        self._alarms = threading.Lock()
        names = [s["name"] for s in catalogue()["signals"]]
        self._places = {name: i for i, name in enumerate(names)}

    def routes(self) -> dict[tuple[str, str], Route]:
        """All of them."""
        return {
            ("GET", "/api/catalogue"): self._catalogue,
            ("GET", "/api/full"): lambda r: {"full": FULL_STREAMS},
            ("GET", "/api/history"): self._history,
            ("GET", "/api/audit"): self._audit,
            ("POST", "/api/session"): self._sign_in,
            ("POST", "/api/session/end"): self._sign_out,
            ("POST", "/api/control"): self._take_control,
            ("POST", "/api/control/end"): self._changed(self.desk.release),
            ("POST", "/api/beat"): self._changed(self.desk.beat),
            ("POST", "/api/hold"): self._changed(self.desk.hold),
            ("POST", "/api/target"): self._go,
            ("POST", "/api/force"): self._force,
            ("POST", "/api/force/end"): self._changed(self.desk.unforce),
            ("POST", "/api/acknowledge"): self._acknowledge,
            ("POST", "/api/shelve"): self._shelve,
            ("POST", "/api/unshelve"): self._unshelve,
        }

    def _catalogue(self, request: Request) -> dict[str, Any]:
        around = self.watch.around
        return {**catalogue(), "source": "live", "about": self.about, "around": around and around.drawn}

    def _session(self, request: Request) -> Session:
        if not (request.near or self.secure):
            raise Refused(403, "without TLS only this computer may change anything")
        return self.desk.sessions.find(request.key)

    def _changed(self, action: Any) -> Route:
        def route(request: Request) -> dict[str, Any]:
            action(self._session(request), time.monotonic_ns())
            return {}

        return route

    def _history(self, request: Request) -> dict[str, Any]:
        places = asked_places(request, self._places)
        return self.watch.trends.of(
            places, time.monotonic() - asked_number(request, "seconds", 60.0, ROWS / 10)
        )

    def _audit(self, request: Request) -> dict[str, Any]:
        self._session(request)
        return {"entries": self.watch.audit.last(AUDIT_ROWS)}

    def _sign_in(self, request: Request) -> dict[str, Any]:
        if not (request.near or self.secure):
            raise Refused(403, "without TLS only this computer may change anything")
        token, name = request.body.get("token"), request.body.get("name")
        if not isinstance(token, str) or not isinstance(name, str):
            raise Refused(400, "a token and a name are wanted")
        session = self.desk.sign_in(token.strip(), name, request.where, time.monotonic_ns())
        return {"session": session.key, "role": session.role, "name": session.name}

    def _sign_out(self, request: Request) -> dict[str, Any]:
        self.desk.sign_out(self._session(request), time.monotonic_ns())
        return {}

    def _take_control(self, request: Request) -> dict[str, Any]:
        session = self._session(request)
        number = self.desk.ask(session, time.monotonic_ns())
        end = time.monotonic() + GRANT_S
        while not self.desk.has_grant(number):
            if time.monotonic() > end:
                self.desk.release(session, time.monotonic_ns(), "not granted")
                raise Refused(
                    409, "the control process does not grant it: is it running, does another write?"
                )
            time.sleep(0.01)
        self.desk.beat(session, time.monotonic_ns())
        return {}

    def _go(self, request: Request) -> dict[str, Any]:
        self.desk.go(self._session(request), request.body, time.monotonic_ns())
        return {}

    def _force(self, request: Request) -> dict[str, Any]:
        name, value = request.body.get("signal"), request.body.get("value")
        self.desk.force(self._session(request), str(name), value, time.monotonic_ns())
        return {}

    def _acknowledge(self, request: Request) -> dict[str, Any]:
        session, number = self._session(request), request.body.get("number")
        if number is not None and (not isinstance(number, int) or isinstance(number, bool)):
            raise Refused(400, "the number of an alarm is wanted, or none for all")
        with self._alarms:
            for alarm in self.watch.alarms.unseen(number):
                about = {"alarm": alarm.text, "since": alarm.since}
                self.desk.sessions.log(session, "acknowledge", must=True, **about)
                self.watch.alarms.acknowledge(alarm.number, session.name)
        return {}

    def _shelve(self, request: Request) -> dict[str, Any]:
        session, number = self._session(request), _alarm_number(request)
        minutes, reason = request.body.get("minutes"), request.body.get("reason")
        if not isinstance(minutes, int) or isinstance(minutes, bool) or not 1 <= minutes <= SHELVED_MINUTES:
            raise Refused(400, f"minutes: 1 to {SHELVED_MINUTES}")
        if not isinstance(reason, str) or not reason.strip().isprintable() or not reason.strip():
            raise Refused(400, "say why: a reason is wanted")
        reason = reason.strip()[:REASON_LENGTH]
        end = time.strftime("%H:%M", time.localtime(time.time() + 60 * minutes))
        said = f"shelved by {session.name} until {end}: {reason}"
        self._on_shelf(session, "shelve", number, {"new": minutes, "reason": reason}, said)
        return {}

    def _unshelve(self, request: Request) -> dict[str, Any]:
        self._on_shelf(self._session(request), "unshelve", _alarm_number(request), {}, "")
        return {}

    def _on_shelf(self, session: Session, what: str, number: int, more: dict[str, Any], said: str) -> None:
        """Log it, and only then do it."""
        alarms = self.watch.alarms
        with self._alarms:
            try:
                alarm = alarms.shelvable(number) if said else alarms.on_shelf(number)
                self.desk.sessions.log(session, what, must=True, alarm=alarm.text, **more)
                if said:
                    alarms.shelve(number, time.monotonic() + 60.0 * more["new"], said)
                else:
                    alarms.unshelve(number)
            except ValueError as error:
                raise Refused(409, str(error)) from None


def _alarm_number(request: Request) -> int:
    number = request.body.get("number")
    if not isinstance(number, int) or isinstance(number, bool):
        raise Refused(400, "the number of an alarm is wanted")
    return number


def asked_places(request: Request, places: dict[str, int]) -> list[int]:
    """Places of the signals in a query's `signals`; Refused for one that is unknown, or too many."""
    names = [n for n in request.query.get("signals", "").split(",") if n]
    for name in names:
        if name not in places:
            raise Refused(400, f"no signal '{name}'; {nearest(name, places)}")
    if not 0 < len(names) <= 12:
        raise Refused(400, "signals: 1 to 12 names")
    return [places[name] for name in names]


def asked_number(request: Request, key: str, otherwise: float, largest: float) -> float:
    """A number of a query between 0 and `largest`; Refused for what is none."""
    try:
        found = float(request.query.get(key, otherwise))
    except ValueError:
        found = -1.0
    if not 0.0 <= found <= largest:
        raise Refused(400, f"{key}: 0 to {largest:g}")
    return found
