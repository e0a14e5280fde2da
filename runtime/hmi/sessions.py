"""Who is signed in at the page, and what of theirs goes to the audit log."""

import secrets
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from runtime.hmi.audit import Audit
from runtime.hmi.tokens import Entry, role_of

SESSIONS = 32
NAME_LENGTH = 40
FAILURES_NS = 1_000_000_000  # between entries of refused tokens in the audit log


class Refused(Exception):
    """A request that is not done; `status` is HTTP's."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


@dataclass
class Session:
    """Somebody who is signed in."""

    key: str
    name: str
    role: str
    where: str


class Sessions:
    """At most SESSIONS of them; the oldest that `keeps` nothing makes room."""

    def __init__(self, entries: tuple[Entry, ...], audit: Audit) -> None:
        self._entries, self._audit = entries, audit
        self._found: dict[str, Session] = {}
        self._lock = threading.Lock()
        self._failed_ns, self._failures = 0, 0

    def sign_in(
        self, token: str, name: str, where: str, now: int, keeps: Callable[[Session], bool]
    ) -> Session:
        """A session for a token; Refused for one that is not known, or without a name."""
        role = role_of(token, self._entries)
        name = "".join(c for c in name if c.isprintable()).strip()[:NAME_LENGTH]
        if role is None:
            self._note_failure(where, now)
            raise Refused(403, "this token is not known")
        if not name:
            raise Refused(400, "say who you are: the audit log needs a name")
        session = Session(secrets.token_hex(16), name, role, where)
        self.log(session, "sign in", must=True)
        with self._lock:
            idle = [k for k, s in self._found.items() if not keeps(s)]
            for key in idle[: max(0, len(self._found) + 1 - SESSIONS)]:
                del self._found[key]
            self._found[session.key] = session
        return session

    def find(self, key: str) -> Session:
        """The session of a key; Refused if there is none."""
        with self._lock:
            found = self._found.get(key)
        if found is None:
            raise Refused(401, "sign in first")
        return found

    def forget(self, session: Session) -> None:
        """End a session."""
        with self._lock:
            self._found.pop(session.key, None)
        self.log(session, "sign out")

    def log(self, session: Session, what: str, must: bool = False, **more: Any) -> None:
        """An entry in the audit log; with `must`, Refused if it cannot be written."""
        more.setdefault("result", "done")
        try:
            self._audit.write(session.name, session.role, session.where, what, **more)
        except OSError:
            if must:  # what nobody could account for is not done; holding and giving back always are
                raise Refused(503, "the audit log cannot be written; nothing was changed") from None

    def _note_failure(self, where: str, now: int) -> None:
        """Somebody who tries tokens must not fill our disk."""
        with self._lock:
            self._failures += 1
            if now - self._failed_ns < FAILURES_NS and self._failed_ns:
                return
            self._failed_ns, count, self._failures = now, self._failures, 0
        self.log(Session("", "", "", where), "sign in", result="refused", count=count)
