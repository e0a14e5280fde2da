"""The registers that every client reads: the images of the control process, and the server's own numbers.

A value that is not known (never came, lost, error, not available) is not a number in a float32, 0xFFFF in a
uint16 and 0x8000 in an int16; so is everything when the control process no longer publishes.
"""

import numpy as np

from runtime.image import INPUT, OUTPUT, Status, timeout_ticks
from runtime.modbus.cells import IMAGE, placed
from runtime.modbus.holding import COMMIT, HEARTBEAT, Holding
from runtime.modbus.port import PERIOD_NS
from runtime.shared import Cell
from specs.signals import definition, signal
from specs.tables import header_values

UNKNOWN = (Status.NEVER, Status.TIMEOUT, Status.ERROR, Status.NOT_AVAILABLE, Status.TWO_SENDERS)
NO_WORD, NO_SIGNED = 0xFFFF, 0x8000
HIGHEST = 0x7FFF  # of an int16
STALE_NS = timeout_ticks(signal("controller_heartbeat")) * PERIOD_NS


class Showing:
    """The input table, worked out anew only when the control process has published something."""

    def __init__(self, cell: Cell, holding: Holding) -> None:
        self._cell, self._holding = cell, holding
        self._table = definition().modbus.tables["input"]
        self._services = {k: p.address for k, p in definition().modbus.services.items() if p.table == "input"}
        found = placed("input")
        ours = [s.name in INPUT.index for s, _ in found]
        self._ours = np.array(ours)
        self._places = np.array(
            [(INPUT if o else OUTPUT).index[s.name] for (s, _), o in zip(found, ours, strict=True)]
        )
        self._floats = np.array([p.type == "float32" for _, p in found])
        self._first = np.array([p.address for _, p in found])
        self._signed = np.array([p.type == "int16" for _, p in found])[~self._floats]
        if any(p.type == "uint32" or p.word_order != "high_first" for _, p in found):
            raise NotImplementedError("input registers are float32, uint16 or int16, high word first")
        self._scale = np.array([p.scale for _, p in found])
        self._number = 0
        self._stamp = 0
        self._fresh: list[int] = []
        self._stale = self._registers(np.full(len(found), np.nan))

    def registers(self, now: int, connections: int) -> list[int]:
        """The table at `now` [ns]; its length is header and body."""
        if self._cell.number != self._number and (found := self._cell.read()):
            self._number, image = found[0], np.frombuffer(found[1], IMAGE)[0]
            self._stamp, self._fresh = int(image["stamp_ns"]), self._registers(self._values(image))
        age = now - self._stamp
        registers = (self._stale if not self._stamp or age > STALE_NS else self._fresh).copy()
        for name, value in self._own(age, connections).items():
            registers[self._services[name]] = value
        return registers

    def _own(self, age: int, connections: int) -> dict[str, int]:
        held = self._holding
        return {
            "owner": held.owner.number if held.owner else 0,
            "committed": held.registers[COMMIT],
            "heartbeat_seen": held.registers[HEARTBEAT],
            "refused_writes": held.refused & 0xFFFF,
            "connections": connections,
            "image_age_ms": min(max(age, 0) // 1_000_000, 0xFFFF) if self._stamp else 0xFFFF,
        }

    def _values(self, image: np.void) -> np.ndarray:
        inputs, outputs, places = image["inputs"], image["outputs"], self._places
        values = np.empty(len(places))
        values[self._ours] = inputs["value"][places[self._ours]]
        values[~self._ours] = outputs["value"][places[~self._ours]]
        unknown = np.isin(inputs["status"][places[self._ours]], UNKNOWN)
        values[np.flatnonzero(self._ours)[unknown]] = np.nan
        return values

    def _registers(self, values: np.ndarray) -> list[int]:
        table = np.zeros(self._table.body.stop, dtype=np.uint16)
        table[: self._table.body.start] = header_values(self._table)
        scaled = values / self._scale
        words = scaled[self._floats].astype(">f4").view(">u2").reshape(-1, 2)
        first = self._first[self._floats]
        table[first], table[first + 1] = words[:, 0], words[:, 1]
        whole = np.rint(scaled[~self._floats])
        low, high = np.where(self._signed, -HIGHEST, 0), np.where(self._signed, HIGHEST, NO_WORD - 1)
        good = (whole >= low) & (whole <= high)  # no number is not
        known = np.where(good, whole, np.where(self._signed, NO_SIGNED, NO_WORD)).astype(np.int64)
        table[self._first[~self._floats]] = known & 0xFFFF
        return table.tolist()
