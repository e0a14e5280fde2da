"""The page over a recording: what it can ask for, and one reading of the whole for alarms and statistics."""

import threading
from typing import Any

import numpy as np

from runtime.hmi import frames
from runtime.hmi.alarms import Alarms, conditions, wrong_inputs
from runtime.hmi.catalogue import catalogue
from runtime.hmi.ladder import ladder
from runtime.hmi.live import asked_number, asked_places
from runtime.hmi.timeline import Block, Timeline, worked
from runtime.hmi.trends import thinned
from runtime.hmi.watch import plain
from runtime.hmi.web import Request, Route
from runtime.image import OUTPUT
from runtime.statistics import Histogram
from specs.errors import InputError

LONGEST_S = 60.0  # of frames in one answer
HISTORY_S = 600.0
ALARMS = 2000  # kept of a recording
MODE = OUTPUT.index["control_mode"]
SEEN = "–"  # by nobody: in a recording nothing is acknowledged


class Playback:
    """The routes; `read` goes through the recording once, beside them."""

    def __init__(self, timeline: Timeline, no_ladder: str = "") -> None:
        """`no_ladder`: why nobody knows what kept the machine from its next mode."""
        self.timeline, self._no_ladder = timeline, no_ladder
        self._alarms = Alarms(ALARMS)
        self._late, self._work = Histogram(), Histogram()
        self._done = False
        self._stop = threading.Event()
        names = [s["name"] for s in catalogue()["signals"]]
        self._places = {name: i for i, name in enumerate(names)}

    def routes(self) -> dict[tuple[str, str], Route]:
        """All of them: nothing can be changed."""
        return {
            ("GET", "/api/catalogue"): self._catalogue,
            ("GET", "/api/frames"): self._frames,
            ("GET", "/api/history"): self._history,
            ("GET", "/api/overview"): self._overview,
        }

    def read(self) -> None:
        """Find alarms and statistics of the whole recording; for a thread of its own."""
        for number in range(len(self.timeline.spans)):
            if self._stop.is_set():
                return
            self._look(self.timeline.block(number))
        self._done = True

    def stop(self) -> None:
        """End `read`."""
        self._stop.set()

    def _look(self, block: Block) -> None:
        for late, work in zip(block.late_ns.tolist(), block.work_ns.tolist(), strict=True):
            self._late.add(late)
            self._work.add(work)
        if self.timeline.clock == "run":  # without a controller's state there is nothing to warn of
            return
        for when, inputs, outputs in zip(block.times.tolist(), block.inputs, block.outputs, strict=True):
            self._alarms.update(list(conditions(inputs, outputs)), list(wrong_inputs(inputs)), when)
            self._alarms.acknowledge(None, SEEN)

    def _catalogue(self, request: Request) -> dict[str, Any]:
        line = self.timeline
        span = {"begin": line.begin, "duration": round(line.duration, 2), "clock": line.clock}
        around = line.around and line.around.drawn
        return {
            **catalogue(),
            "source": "recording",
            "around": around,
            "about": line.about,
            "notes": line.notes,
            **span,
        } | {"no_ladder": self._no_ladder}

    def _frames(self, request: Request) -> dict[str, Any]:
        first = asked_number(request, "from", 0.0, 1e9)
        last = min(asked_number(request, "to", first + 10.0, 1e9), first + LONGEST_S)
        begin, found = self.timeline.begin, []
        for block in self.timeline.between(begin + first, begin + last):
            inside = np.flatnonzero(
                (block.times >= begin + first - 0.11) & (block.times <= begin + last + 0.11)
            )
            found += [_frame(block, int(i), self.timeline) for i in inside]
        return {"frames": found}

    def _history(self, request: Request) -> dict[str, Any]:
        places = asked_places(request, self._places)
        until = asked_number(request, "until", self.timeline.begin + self.timeline.duration, 1e12)
        since = until - asked_number(request, "seconds", 60.0, HISTORY_S)
        blocks = list(self.timeline.between(since, until))
        if not blocks:
            return {"t": [], "v": [[] for _ in places]}
        times = np.concatenate([b.times for b in blocks])
        return thinned(times, np.concatenate([b.rows[:, places] for b in blocks]), since, until)

    def _overview(self, request: Request) -> dict[str, Any]:
        alarms = sorted([*self._alarms.history, *self._alarms.listed()], key=lambda a: a.since)
        work = worked(self._late, self._work) | {"t": self.timeline.begin} if self._late.count else None
        return {"done": self._done, "alarms": [plain(a) for a in alarms], "work": work}


def _frame(block: Block, at: int, line: Timeline) -> dict[str, Any]:
    """A moment of a block as the page gets it, with clearance and ladder where they are known."""
    when = float(block.times[at])
    shown = frames.frame(when, block.inputs[at], block.outputs[at])
    if line.around:
        values = frames.values(block.inputs[at], block.outputs[at])
        shown["near"] = line.around.near(values, when - line.begin)
    if block.ladders is None or at >= len(block.ladders):
        return shown
    return {**shown, "ladder": ladder(block.ladders[at], int(block.outputs[at]["value"][MODE]))}


def checked(timeline: Timeline) -> Timeline:
    """The timeline, its first part read: what is wrong with it is said before a page is opened."""
    if not len(timeline.block(0).times):
        raise InputError("there is no tick in this recording")
    return timeline
