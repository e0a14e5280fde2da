"""The Foxglove process: `python -m runtime.foxglove.process JSON`, started by the supervisor.

It serves what `image.cell` holds until SIGTERM.  Clients can ask for the machine model and subscribe; nothing
that they send is used.  A client that is too slow loses the oldest messages, and holds up nobody.

    /tick           slewright.Tick            every signal with age and status, as in a recording
    /tf             foxglove.FrameTransforms  joints of the machine (specs/urdf.py)
    /joint_states   foxglove.JointStates
    /scene          foxglove.SceneUpdate      target, keep-out
    /surroundings   foxglove.SceneUpdate      the scene that the bundle's guard keeps off, if it has one
    /log            foxglove.Log              alarms that come and go, changes of the mode
"""

import json
import signal
import struct
from functools import partial
from pathlib import Path
from typing import Any

from records.foxglove import surroundings
from runtime import bundle
from runtime.foxglove import pose
from runtime.helpers import end_with, run
from runtime.hmi.alarms import Level
from runtime.interfaces.beside import library, ready, until_told
from runtime.interfaces.news import News
from runtime.interfaces.view import Seen, View
from runtime.recorder.message import PACKAGE, TICK_TOPIC, TIMING_FIELDS, places, schema, units
from specs import urdf
from specs.errors import InputError
from specs.foxglove import MODEL, SURROUNDINGS, TARGETS
from specs.scene import Scene

SCENE_EVERY = 5  # ticks between two states of the scene
AROUND_EVERY = 50  # between two messages of what stands around, for viewers that come later
BACKLOG = 256  # messages that may wait for a client
TIMING = struct.Struct(f"<{len(TIMING_FIELDS)}q")
LEVELS = {Level.CRITICAL: "Error", Level.WARNING: "Warning", Level.NOTE: "Info"}


class Live:
    """The channels, and what goes out on them."""

    def __init__(self, view: View, foxglove: Any, around: Scene | None = None) -> None:
        """`around`: what the bundle's guard keeps off."""
        self._view, self._news = view, News()
        self._messages = messages = foxglove.messages
        self.context = context = foxglove.Context()
        definition = foxglove.Schema(name=f"{PACKAGE}.Tick", encoding="protobuf", data=schema())
        self._tick = foxglove.Channel(
            TICK_TOPIC, schema=definition, message_encoding="protobuf", context=context, metadata=units()
        )
        channels = foxglove.channels
        self._parts = [
            (channels.FrameTransformsChannel("/tf", context=context), pose.transforms, 1),
            (channels.JointStatesChannel("/joint_states", context=context), pose.joint_states, 1),
            (channels.SceneUpdateChannel(TARGETS, context=context), pose.scene, SCENE_EVERY),
        ]
        if around:
            channel = channels.SceneUpdateChannel(SURROUNDINGS, context=context)
            self._parts.append((channel, partial(_still, around), AROUND_EVERY))
        self._log = channels.LogChannel("/log", context=context)
        self._lost = False
        self._levels = {level: getattr(messages.LogLevel, name) for level, name in LEVELS.items()}

    def work(self) -> None:
        """Send what is new; say once that the control process no longer publishes."""
        seen = self._view.new()
        if seen is None:
            if self._view.joined and self._view.stale != self._lost:
                self._lost = self._view.stale
                self._say(Level.CRITICAL, "the control process no longer publishes", self._view.last_ns)
            return
        self._lost = False
        self._tick.log(_tick(seen), log_time=seen.time_ns)
        for channel, made, every in self._parts:
            if seen.tick % every == 0:
                channel.log(made(seen, self._messages), log_time=seen.time_ns)
        for line in self._news.of(seen):
            self._say(line.level, line.text, seen.time_ns)

    def _say(self, level: Level, text: str, at_ns: int) -> None:
        stamp = self._messages.Timestamp(sec=at_ns // 10**9, nsec=at_ns % 10**9)
        said = self._messages.Log(timestamp=stamp, level=self._levels[level], message=text, name="slewright")
        self._log.log(said, log_time=at_ns)


def _tick(seen: Seen) -> bytes:
    """The recorder's message, with what is known of its timing here."""
    known = {"day_ns": seen.time_ns, "count": seen.tick, "clock_ns": seen.time_ns, "latency_ns": -1}
    timing = TIMING.pack(*(known.get(name, 0) for name in TIMING_FIELDS))
    return places().message(timing + seen.inputs.tobytes() + seen.outputs.tobytes())


def _still(around: Scene, seen: Seen, messages: Any) -> Any:
    # what moves everywhere that it comes, as the guard has it: nobody knows the scene's time here
    return surroundings.still(around, seen.time_ns, messages, everywhere=True)


def model(address: str) -> bytes | None:
    """The machine model, if that is asked for."""
    return urdf.render().encode() if address == MODEL else None


def main(text: str) -> None:
    """Serve until told to end."""
    end_with(signal.SIGTERM)
    told = json.loads(text)
    foxglove = library("foxglove", "foxglove-sdk", "foxglove")
    library("foxglove.channels", "foxglove-sdk", "foxglove")
    foxglove.set_log_level("CRITICAL")  # who sends nonsense must not fill our disk
    around = bundle.scene_of(Path(told["bundle"])) if told.get("bundle") else None
    live = Live(View.join(Path(told["folder"])), foxglove, around)
    try:
        server = foxglove.start_server(
            name=told["name"], host=told["host"], port=told["port"], context=live.context,
            capabilities=[], asset_handler=model, message_backlog_size=BACKLOG,
        )  # fmt: skip
    except (OSError, RuntimeError) as error:
        raise InputError(f"foxglove: port {told['port']} of {told['host']} cannot be had: {error}") from None
    ready(told["ready"], server.port)
    until_told(live.work)
    server.stop()


if __name__ == "__main__":
    run(main)
