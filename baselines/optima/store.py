"""The best found optima, kept in `found.json` beside this file: what was reached, and how it was found.

An entry is one command for one case: a machine (nominal, tuning:K, validation:K), a load (kg), a travel
(deg), in the full task the number of its move, and the speed asked for (deg/s; 0: least time).  Its figures
are those of the command run on the whole machine.  All are local optima: a better one may exist.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from baselines.optima.case import Case, full
from specs.errors import InputError

PATH = Path(__file__).with_name("found.json")
MOST_ERROR_M = 1.0  # from grab to target at the end, of a command that counts: open loop, the arm drifts


@dataclass(frozen=True, order=True)
class Key:
    """What an entry is the optimum of; speed 0: least time."""

    machine: str
    load_kg: float
    travel_deg: float
    speed: float = 0.0
    move: int = 0  # 1, 2, … of the full task; 0: slew only

    @property
    def name(self) -> str:
        """As it stands in the file and in progress lines."""
        wanted = f"{self.speed:g} deg/s" if self.speed else "least time"
        move = f"move {self.move}, " if self.move else ""
        return f"{self.machine}, {self.load_kg:g} kg, {move}{self.travel_deg:g} deg, {wanted}"

    @property
    def case(self) -> Case:
        """The move it is of."""
        if self.move:
            return full(self.move, self.load_kg, self.machine)
        return Case(self.travel_deg, self.load_kg, self.machine)


@dataclass(frozen=True)
class Entry:
    """One optimum; `found` is the whole machine's, `predicted_*` the collocation's."""

    key: Key
    found: Mapping[str, Any]  # time_s, speed, overshoot, slew_error, error, tool, reached
    predicted_time_s: float
    predicted_tool: float
    status: str
    iterations: int
    reserve_deg: float
    guess: str  # where the search began
    lengths_s: tuple[float, ...]  # of the command's phases
    joystick: tuple[tuple[float, ...], ...]  # by interval of each phase
    arm: tuple[tuple[tuple[float, ...], ...], ...] = ()  # boom and stick references by phase, rad/s

    @property
    def counts(self) -> bool:
        """Whether the whole machine got there: it can be done, then, converged or not."""
        return bool(self.found["reached"] and self.found["error"] <= MOST_ERROR_M)


def read(path: Path = PATH) -> dict[Key, Entry]:
    """All entries by key; InputError for a file that is not one of ours."""
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        entries = [Entry(**{**item, "key": Key(**item["key"])}) for item in data["entries"]]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a file of optima ({error}); `slewright optimum` writes one") from error
    return {entry.key: entry for entry in entries}


def write(entries: Iterable[Entry], how: Mapping[str, Any], path: Path = PATH) -> None:
    """Write all entries with `how` they were found, whole or not at all: one line an entry."""
    rows = [json.dumps(asdict(entry)) for entry in sorted(entries, key=lambda entry: entry.key)]
    head = json.dumps({"what": "local optima, found by `slewright optimum`", **how}, indent=1)
    text = head[:-2] + ',\n "entries": [\n' + ",\n".join(rows) + "\n]}\n"
    temporary = path.with_suffix(".part")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)
