"""The HMI in this process: a control core with its port, a machine that only moves its angles, desk and site.

What crosses processes goes through the real cells; only the processes are missing.
"""

import json
import math
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from runtime.bundle import scene_of
from runtime.control import ControlCore
from runtime.hmi import tokens
from runtime.hmi.around import of_bundle
from runtime.hmi.audit import Audit
from runtime.hmi.cells import create
from runtime.hmi.desk import Desk
from runtime.hmi.hub import Hub
from runtime.hmi.live import Live
from runtime.hmi.port import HmiPort
from runtime.hmi.sessions import Sessions
from runtime.hmi.watch import Watch
from runtime.hmi.web import Site
from runtime.image import INPUT
from runtime.statistics import Statistics
from tests.runtime.bench import TARGET, Bench

PERIOD_S = 0.02
PLANNER = ("planner_heartbeat", *TARGET)


class Served:
    """A context: `bench` sets what the machine's sensors and switches show."""

    def __init__(self, core: ControlCore, folder: Path, planner: bool = False, moving: bool = True) -> None:
        self.bench, self.planner, self.moving = Bench(core), planner, moving
        self.bench.set(p_pump=2.1e7)
        self.found = Statistics()
        cells = create(folder)
        self.port = HmiPort(cells, core.library, self.found)
        self.hub, self.audit = Hub(), Audit(folder / "audit")
        around = of_bundle(scene_of(core.bundle.folder))
        self.watch = Watch(cells, self.audit, self.hub, around=around)
        self.tokens = tokens.make(folder / "tokens.json")
        sessions = Sessions(tokens.read(folder / "tokens.json"), self.audit)
        self.desk = self.watch.desk = Desk(sessions, cells[2].write, self.watch.granted, self.watch.mode)
        about = {"machine": "simulated machine", "controller": "pd", "bundle": "0123456789ab"}
        self.site = Site("127.0.0.1", 0, Live(self.watch, self.desk, about, False).routes(), self.hub)
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=self._machine, daemon=True),
            threading.Thread(target=self._look, daemon=True),
            threading.Thread(target=self.site.serve_forever, args=(0.1,), daemon=True),
        ]
        self.hold_still = threading.Event()  # set: the control process stands still

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://127.0.0.1:{self.site.port}/"

    @property
    def mode(self) -> int:
        """That the core is in."""
        return self.bench.mode

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        until(lambda: self.watch.newest is not None)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self._stop.set()
        self.hub.close()
        self.site.shutdown()
        self.site.server_close()

    def ask(
        self, path: str, body: Any = None, session: str = "", headers: dict[str, str] | None = None
    ) -> tuple[int, Any]:
        """Status and content of a request; `body` makes it a POST."""
        data = None if body is None else json.dumps(body).encode()
        more = {"Content-Type": "application/json"} if data is not None else {}
        more |= {"Authorization": f"Bearer {session}"} if session else {}
        request = urllib.request.Request(self.address + path, data, {**more, **(headers or {})})
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                return answer.status, json.loads(answer.read())
        except urllib.error.HTTPError as error:
            return error.code, json.loads(error.read())

    def sign_in(self, role: str, name: str = "Ada") -> str:
        """The key of a new session."""
        status, found = self.ask("api/session", {"token": self.tokens[role], "name": name})
        assert status == 200, found
        return found["session"]

    def _machine(self) -> None:
        bench, begun = self.bench, time.monotonic()
        while not self._stop.is_set():
            time.sleep(PERIOD_S)
            if self.hold_still.is_set():
                continue
            t = time.monotonic() - begun
            if self.moving:
                bench.set(q_slew=0.6 * math.sin(0.5 * t), q_boom=1.1 + 0.1 * math.sin(0.3 * t))
            self.cycle()

    def cycle(self) -> None:
        """One tick, as the scan does it."""
        bench = self.bench
        bench.now += 1
        bench.fill()
        if not self.planner:
            places = [INPUT.at(name) for name in PLANNER]
            bench.image["status"][places], bench.image["age"][places] = 1, -1
        self.port.receive(bench.image, bench.now)
        bench.image["flags"] = self.port.flags()
        outputs = bench.core.step(bench.image, bench.now)
        bench.seen[:] = [*bench.seen[-2:], outputs.copy()]
        self.found.lateness.add(6_000 + 900 * (bench.now % 11))
        self.found.other_work.add(180_000 + 9_000 * (bench.now % 7))
        self.found.ticks += 1
        self.port.send(outputs, bench.now)

    def _look(self) -> None:
        while not self._stop.is_set():
            self.watch.look(time.monotonic_ns())
            self.desk.tick(time.monotonic_ns())
            time.sleep(0.025)


def until(condition: Any, seconds: float = 20.0) -> None:
    """Wait for a condition; AssertionError if it never comes."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


def value(served: Served, name: str) -> float:
    """Of an input as the core saw it last."""
    return float(served.bench.image["value"][INPUT.at(name)])
