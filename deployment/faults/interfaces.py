"""Clients of OPC UA and ROS 2 that are lost, displaced, late or wrong, by a clock of ours.

The parts are those that a run has: the seat of an interface's process (runtime/interfaces/seats.py) and the
port of the control process that decides (runtime/interfaces/port.py).  Sockets and processes: outsiders.py.
"""

import ctypes

import numpy as np

from deployment.faults.drive import AUTOMATIC, Drive, Moment
from deployment.faults.table import Fault, Outcome
from runtime.image import INPUT, OUTPUT, Status
from runtime.interfaces.decision import MODE
from runtime.interfaces.port import Asked, SeatsPort
from runtime.interfaces.seats import BEAT, GRANTED, HOLDS_GRANTED, HOLDS_SEAT, NAMES, PLACES, Seat
from runtime.modbus.cells import HOLDING, TARGETS
from runtime.modbus.holding import LAPSE_NS
from runtime.modbus.port import PERIOD_NS, PLACES as WHERE
from runtime.shared import Cell

Random = np.random.Generator
BEAT_TICKS = 5  # between two signs of life (10 Hz)
NONE = {"planner_heartbeat", "target_number"}  # targets that no client of an interface says


class Table:
    """Both seats, the control process's port, a clock; `library`: that of the core."""

    def __init__(self, library: ctypes.CDLL, random: Random) -> None:
        self.now = 1_000 * PERIOD_NS + int(random.integers(PERIOD_NS))
        cells = [Cell.alone(TARGETS.itemsize, HOLDS_SEAT) for _ in NAMES]
        granted = Cell.alone(GRANTED.itemsize, HOLDS_GRANTED)
        self.said: list[str] = []
        self.seats = [
            Seat(n, c, granted, lambda text, level: self.said.append(text))
            for n, c in zip(NAMES, cells, strict=True)
        ]
        asked = [Asked(i + 1, c) for i, c in enumerate(cells)]
        self.port = SeatsPort(asked, granted, library, clock=lambda: self.now)
        self.outputs = OUTPUT.new()
        self.outputs["value"][MODE] = AUTOMATIC

    def tick(self, image: np.ndarray) -> None:
        """A period: no planner over CAN; the seats' processes give their signs of life."""
        self.now += PERIOD_NS
        for seat in self.seats:
            seat.beat(self.now)
        image["value"][WHERE], image["age"][WHERE] = [s.start for s in HOLDING], -1
        image["status"][WHERE] = Status.NEVER
        self.port.receive(image, 0)
        self.port.send(self.outputs, 0)


class Lost:
    """A twist of the image: at tick 0 a client that was well is lost; `leaves`: its session ends, too."""

    def __init__(self, library: ctypes.CDLL, random: Random) -> None:
        self.table = Table(library, random)
        self.seat = self.table.seats[int(random.integers(len(NAMES)))]
        self._leaves = bool(random.integers(2))

    def __call__(self, k: int, image: np.ndarray) -> None:
        """Tick k of the fault."""
        if k == 0:
            wanted = {s.name: float(image["value"][INPUT.index[s.name]]) for s in HOLDING}
            self.seat.ask("planner", {n: v for n, v in wanted.items() if n not in NONE}, self.table.now)
            self.table.outputs["value"][MODE] = 0
            self.table.tick(image)
            self.table.outputs["value"][MODE] = AUTOMATIC
            self.lose(image)
        else:
            self.go_on(k, image)
        self.table.tick(image)

    def lose(self, image: np.ndarray) -> None:
        """What happens at tick 0."""
        if self._leaves:
            self.seat.release("planner", "left")

    def go_on(self, k: int, image: np.ndarray) -> None:
        """What happens later: nothing."""


class Followed(Lost):
    """The client leaves; another one asks at once, at the same seat or another, and goes on to ask."""

    def __init__(self, library: ctypes.CDLL, random: Random) -> None:
        super().__init__(library, random)
        self._next = self.table.seats[int(random.integers(len(NAMES)))]

    def lose(self, image: np.ndarray) -> None:
        """One goes, one comes."""
        self.seat.release("planner", "left")
        self._ask()

    def go_on(self, k: int, image: np.ndarray) -> None:
        """It keeps asking."""
        if not k % BEAT_TICKS:
            self._ask()

    def _ask(self) -> None:
        self._next.ask("another", {"target_x": 8.0, "target_valid": 1.0}, self.table.now)


def interface_second_client(
    fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome
) -> None:
    """Others ask at both seats, at any time, while one commands: what it asked for stays, and is followed."""
    table, image = Table(drive.core.library, random), INPUT.new()
    seat = table.seats[int(random.integers(len(NAMES)))]
    seat.ask("planner", {"target_x": 5.0}, table.now)
    table.outputs["value"][MODE] = 0
    table.tick(image)
    wrong = ""
    for k in range(100):
        if not k % BEAT_TICKS:
            seat.live("planner", table.now)
        if random.integers(2):
            table.seats[int(random.integers(len(NAMES)))].ask("another", {"target_x": 8.0}, table.now)
        table.tick(image)
        if image["value"][WHERE[PLACES["target_x"]]] != 5.0 or image["status"][WHERE[BEAT]] != Status.OK:
            wrong = wrong or f"in tick {k} of 100 it was displaced"
    outcome.add(moment.tick, 0.0, wrong)


def interface_nonsense(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """A client asks for numbers that are none or out of range: refused, all of the request or nothing."""
    table, wrong = Table(drive.core.library, random), ""
    for _ in range(50):
        s = HOLDING[int(random.integers(len(HOLDING)))]
        low, high = float(s.min or 0.0), float(s.max or 0.0)
        bad = (
            np.nan,
            np.inf,
            -np.inf,
            high + random.exponential(1e3) + 1e-6,
            low - random.exponential(1e3) - 1e-6,
        )
        asked = {"pace": 0.5, s.name: float(random.choice(bad))}
        if not table.seats[0].ask("planner", asked, table.now):
            wrong = f"{asked} was taken"
    untouched = table.seats[0].state["value"].tolist() == [s.start for s in HOLDING]
    outcome.add(moment.tick, 0.0, wrong or ("" if untouched else "a part of a refused request counts"))


def interface_stale(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """A process hangs with its client's claim and goes on later: what is over does not come back."""
    table, image = Table(drive.core.library, random), INPUT.new()
    seat = table.seats[int(random.integers(len(NAMES)))]
    seat.ask("planner", {"target_x": 5.0}, table.now)
    table.outputs["value"][MODE] = 0
    table.tick(image)
    table.now += LAPSE_NS + int(random.integers(1, 10**10))  # the seat's cell says what it said
    table.port.receive(image, 0)
    seat._live(table.now)  # it goes on, and does not know
    wrong = ""
    for _ in range(20):
        table.tick(image)
        if table.port.claimed():
            wrong = "a claim that was over had the right again"
    outcome.add(moment.tick, 0.0, wrong)
