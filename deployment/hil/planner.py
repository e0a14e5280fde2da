"""The planner of a scenario as a Modbus client: claims, commits targets, keeps its heartbeat going."""

import sys
import time
from collections.abc import Mapping

from pymodbus.client import ModbusTcpClient

from deployment.hil.panel import ARMING_TICKS
from deployment.hil.punctual import LATE, Punctual
from runtime.modbus.cells import HOLDING
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT, PLACES, encode
from specs.errors import RunError
from specs.scenario import TICK_S, Scenario, load
from specs.signals import definition, signal
from specs.wire import MODBUS_HEADER

NUMBER = 4711  # of its claim
BEAT_S = 0.1
BEATS = 251


class Planner:
    """A client that asks for the targets of `scenario`, counted from `start`."""

    def __init__(self, host: str, port: int, scenario: Scenario, pace: float) -> None:
        self._client = ModbusTcpClient(host, port=port, timeout=5.0)
        self._unit = definition().modbus.unit_id
        self._changes = scenario.stimuli(pace)
        self._every = scenario.interval_ticks
        self._wanted: dict[str, float] = {s.name: s.start for s in HOLDING} | self._changes[0]
        self._commits = self._beat = 0
        self._sent = -1  # number of the target written last
        self._next = 0.0
        self._start: float | None = None

    def connect(self) -> None:
        """Connect and claim; RunError if somebody else writes."""
        if not self._client.connect():
            raise RunError("the Modbus server does not answer")
        self._write(CLAIM, [NUMBER])
        self._ask(0)

    def start(self) -> None:
        """Tick -ARMING_TICKS of the scenario begins now."""
        self._start = time.monotonic() + ARMING_TICKS * TICK_S

    def work(self) -> bool:
        """Heartbeat and, when it is time, the next target; to be called often. Whether the heartbeat went."""
        now = time.monotonic()
        if self._start is not None:
            tick = int((now - self._start) / TICK_S)
            if tick // self._every != self._sent and tick >= 0 and self._due(tick) is not None:
                self._ask(tick)
        if now < self._next:
            return False
        self._beat = (self._beat + 1) % BEATS
        self._write(HEARTBEAT, [self._beat])
        self._next = now + BEAT_S
        return True

    def close(self) -> None:
        """Leave; targets lapse."""
        self._client.close()

    def _due(self, tick: int) -> Mapping[str, float] | None:
        return self._changes.get(tick // self._every * self._every)

    def _ask(self, tick: int) -> None:
        number = tick // self._every
        self._wanted |= {
            **(self._due(tick) or {}),
            "target_valid": 1.0,
            "target_number": float(number % BEATS),
        }
        self._wanted["planner_heartbeat"] = float(self._beat)
        first, registers = len(MODBUS_HEADER), []
        for s, place in zip(HOLDING, PLACES, strict=True):
            registers += encode(place, self._wanted[s.name])
        self._commits += 1
        self._write(first, registers)
        self._write(COMMIT, [(self._commits - 1) % 0xFFFF + 1])
        self._sent = number if self._start is not None else -1

    def _write(self, address: int, registers: list[int]) -> None:
        answer = self._client.write_registers(address, registers, device_id=self._unit)
        if answer.isError():
            raise RunError(f"the Modbus server refused a write at {address}: {answer}")


def main(port: int, scenario: str) -> None:
    """A planner that asks for the scenario's first target until it is ended, and says when it was late."""
    planner = Planner("127.0.0.1", port, load(scenario), 1.0)
    planner.connect()
    print("ready", flush=True)
    punctual = Punctual(signal("planner_heartbeat"))
    while True:
        if planner.work() and punctual.was_late():
            print(LATE, flush=True)
        time.sleep(BEAT_S / 10)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
