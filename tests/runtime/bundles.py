"""Bundles for tests, each built once a session (compiled cores are cached beyond that)."""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

from deployment.bundling.build import bundle
from runtime.bundle import Bundle
from runtime.control import ControlCore
from specs import scene as scenes

NO_RATE_LIMIT = (("gate_rise", 100.0), ("gate_fall", 100.0))  # 2 a tick: from one end to the other


@cache
def built(controller: str = "pi", changes: tuple[tuple[str, float], ...] = ()) -> Bundle:
    """The bundle of a controller with changed parameters of specs/parameters/gate.toml."""
    return bundle(controller, folder() / f"{controller}-{len(changes)}", changes=dict(changes))


@cache
def guarded(controller: str = "pi", scene: str = "truck") -> Bundle:
    """The bundle of a controller whose guard keeps off a scene."""
    return bundle(controller, folder() / f"{controller}-{scene}", guard=scenes.load(scene))


def core(controller: str = "pi", changes: tuple[tuple[str, float], ...] = ()) -> ControlCore:
    """A fresh core of it."""
    return ControlCore(built(controller, changes))


@cache
def folder() -> Path:
    """Where the bundles of this session lie."""
    made = Path(tempfile.mkdtemp(prefix="slewright-bundles-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made
