"""What an interface tells people: alarms as they come and go, and changes of the mode; in the HMI's words."""

from dataclasses import dataclass

from runtime.hmi.alarms import MODE, MODE_TEXTS, Condition, Level, conditions, wrong_inputs
from runtime.interfaces.view import Seen


@dataclass(frozen=True)
class Line:
    """An event; `key` is the alarm's, "mode" or an event's of the interface; `active` while it lasts."""

    key: str
    level: Level
    text: str
    active: bool = True


class News:
    """Compares what is abnormal now with what was; `present` are the alarms that last, by key."""

    def __init__(self) -> None:
        self.present: dict[str, Condition] = {}
        self._mode = -1

    def of(self, seen: Seen) -> list[Line]:
        """What is new in this pair of images."""
        now = {c.key: c for c in (*conditions(seen.inputs, seen.outputs), *wrong_inputs(seen.inputs))}
        came = [Line(k, c.level, f"{c.text}: {c.cause}") for k, c in now.items() if k not in self.present]
        went = [
            Line(k, Level.NOTE, f"over: {c.text}", False) for k, c in self.present.items() if k not in now
        ]
        self.present = now
        return [*came, *went, *self._change(int(seen.outputs["value"][MODE]))]

    def _change(self, mode: int) -> list[Line]:
        if mode == self._mode:
            return []
        self._mode = mode
        return [Line("mode", Level.NOTE, f"mode: {MODE_TEXTS.get(mode, mode)}")]
