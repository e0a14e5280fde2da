"""The CANopen process: `python -m runtime.canopen.process JSON`, started by the supervisor.

It sets up the devices and watches them; what they send in the cycle is not its work.  A device is set up
again whenever it comes back; a process that is started again leaves alone what is set up.
"""

import json
import logging
import os
import signal
import time
from pathlib import Path
from typing import Any

import can
import numpy as np

from runtime.can.port import open_bus
from runtime.canopen import cells
from runtime.canopen.eds import Identity
from runtime.helpers import end_with, run, told_to_end
from runtime.hmi.alarms import Level
from runtime.interfaces.beside import LOOK_S, library, ready
from runtime.interfaces.told import Teller
from specs.canopen import definition
from specs.errors import InputError

NICE = 5  # below what the machine needs at once, above the interfaces that only show
AGAIN_S = 1.0  # between two tries to join a bus that is gone
# What it listens to: emergencies, SDO answers, heartbeats; not the PDOs.
FILTERS = [{"can_id": i, "can_mask": 0x780, "extended": False} for i in (0x080, 0x580, 0x700)]


class Process:
    """The bus joined, its devices looked after, for as long as that is wanted."""

    def __init__(self, told: dict[str, Any]) -> None:
        self._told, folder = told, Path(told["folder"])
        self._accepted, self._spent = cells.join(folder)
        self._teller = Teller(folder, "canopen")
        self._identities = {name: Identity(*of) for name, of in told["identities"].items()}

    def run(self) -> None:
        """Until told to end; a bus that is gone is joined again once it is back."""
        joined = self._join()
        ready(self._told["ready"], "")
        while not told_to_end():
            try:
                if joined:
                    self._look_after(joined)
            except (can.CanError, OSError) as error:
                self._teller.tell(f"the devices' bus is gone: {error}", Level.CRITICAL)
            joined = None if told_to_end() else self._join_again()

    def _join(self) -> can.BusABC:
        bus = open_bus(self._told["interface"], self._told["channel"], definition().bus.bit_rate, "CANopen")
        bus.set_filters(FILTERS)  # type: ignore[arg-type]
        return bus

    def _join_again(self) -> can.BusABC | None:
        time.sleep(AGAIN_S)
        try:
            return self._join()
        except InputError:
            return None

    def _look_after(self, bus: can.BusABC) -> None:
        """All devices on a bus; can.CanError when it is gone."""
        import canopen

        from runtime.canopen.master import Master

        network = canopen.Network(bus)
        network.NOTIFIER_CYCLE = 0.1  # type: ignore[misc]
        network.connect()
        try:
            master = Master(network, self._identities, self._told["zeros"], self._tell, self._say)
            master.adopt(cells.read(self._accepted), cells.read(self._spent))
            while not told_to_end():
                master.step(cells.read(self._spent))
                network.check()
                time.sleep(LOOK_S)
            master.stop()
        finally:
            network.disconnect()

    def _tell(self, text: str, level: Level) -> None:
        self._teller.tell(text, level)

    def _say(self, numbers: list[int]) -> None:
        self._accepted.write(np.array(numbers, np.int64))


def main(text: str) -> None:
    """Look after the devices until told to end."""
    end_with(signal.SIGTERM)
    library("canopen", "canopen", "canopen")
    for name in ("canopen", "can"):  # who sends nonsense must not fill our disk
        logging.getLogger(name).setLevel(logging.CRITICAL)
    os.nice(NICE)
    Process(json.loads(text)).run()


if __name__ == "__main__":
    run(main)
