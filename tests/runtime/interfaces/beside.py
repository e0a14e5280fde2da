"""A process of an interface, with the control process's side of it: images that a test fills."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from runtime.image import INPUT, OUTPUT, Status
from runtime.interfaces.publish import ImagePort, create
from tests.conftest import ROOT


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Images with every value drawn from its signal's range, as float32 holds it, and every input known."""
    random, images = np.random.default_rng(seed), (INPUT.new(), OUTPUT.new())
    for layout, image in zip((INPUT, OUTPUT), images, strict=True):
        image["status"], image["age"] = Status.OK, 0
        for place, s in enumerate(layout.signals):
            low, high = s.min or 0.0, s.max or 0.0
            if s.modbus and s.modbus.type == "uint16":
                image["value"][place] = random.integers(int(low), int(high), endpoint=True)
            else:
                image["value"][place] = np.float32(random.uniform(low, high))
    return images


class Beside:
    """The process, its port, and what the control process publishes; a context."""

    def __init__(self, interface: str, folder: Path, over: Any = None, **told: object) -> None:
        self.port = over or ImagePort(create(folder))
        self.inputs, self.outputs = INPUT.new(), OUTPUT.new()
        self.tick, self.folder = 0, folder
        ready = folder / "ready"
        said = {"folder": str(folder), "ready": str(ready), **told}
        command = [sys.executable, "-m", f"runtime.{interface}.process", json.dumps(said)]
        self.process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 240
        while not ready.is_file():
            assert self.process.poll() is None, self.process.stderr and self.process.stderr.read()
            assert time.monotonic() < deadline
            time.sleep(0.02)
        self.ready = ready.read_text()

    def publish(self, images: tuple[np.ndarray, np.ndarray] | None = None) -> None:
        """A tick of the control process, with these images if any are given."""
        if images:
            self.inputs[...], self.outputs[...] = images
        self.tick += 1
        self.inputs["tick"] = self.outputs["tick"] = self.tick
        self.port.receive(self.inputs, self.tick)
        self.port.send(self.outputs, self.tick)

    def until(self, true: Callable[[], Any], seconds: float = 120.0) -> Any:
        """Publish ticks until something is true, and return it."""
        deadline = time.monotonic() + seconds
        while not (found := true()):
            self.publish()
            assert time.monotonic() < deadline
            time.sleep(0.02)
        return found

    def __enter__(self) -> "Beside":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.communicate(timeout=30)
        assert self.process.returncode == 0


def value(images: tuple[np.ndarray, np.ndarray], name: str) -> float:
    """A signal's value in a pair of images."""
    layout = INPUT if name in INPUT.index else OUTPUT
    return float(images[layout is OUTPUT]["value"][layout.index[name]])


def statuses(changes: Mapping[str, Status], image: np.ndarray) -> None:
    """Give inputs a status."""
    for name, status in changes.items():
        image["status"][INPUT.at(name)] = status
