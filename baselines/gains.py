"""Gains in a file (what `slewright tune --json` writes), checked against controller and machine."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from baselines.registry import Controller
from fmus.definition import Variable
from fmus.toolchain.loader import load_model
from specs import draws, parameters
from specs.errors import InputError, nearest


def machine() -> str:
    """What the machine is: a hash of the values in its parameter files."""
    known = parameters.load(*draws.FILES)
    text = json.dumps({name: p.value for name, p in sorted(known.items())})
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def limits(gain: Variable) -> tuple[float, float]:
    """Least and greatest value of a parameter, in its unit; infinite where it has no limit."""
    low = -math.inf if gain.min is None else gain.min
    return low, math.inf if gain.max is None else gain.max


def apply(controller: Controller, path: Path) -> Controller:
    """The controller with the gains of a file over its own.

    Raises InputError for a file that is none, that is of another controller or machine, or that holds a gain
    that the controller does not have or may not have.
    """
    content = _read(path)
    owner = content.get("controller")
    if owner != controller.name:
        raise InputError(f"{path}: gains of controller {owner}, not of {controller.name}")
    if content.get("machine") != machine():
        raise InputError(f"{path}: gains for another machine: tune {controller.name} on this one")
    model = load_model(controller.folder)
    known = {v.name: v for v in model.parameters}
    for name, value in content["gains"].items():
        if name not in known:
            raise InputError(f"{path}: {controller.name} has no gain '{name}'; {nearest(name, known)}")
        low, high = limits(known[name])
        if not isinstance(value, int | float) or not low <= value <= high:
            raise InputError(f"{path}: {name} = {value} outside {low:g} … {high:g}")
    return replace(controller, settings={**controller.settings, **content["gains"]})


def apply_all(controllers: Sequence[Controller], texts: Sequence[str]) -> list[Controller]:
    """The controllers, some with gains of a file: `texts` are NAME=FILE."""
    for text in texts:
        if "=" not in text:
            raise InputError(f"--gains {text}: needs NAME=FILE, with =")
    files = {name: Path(file) for name, _, file in (text.partition("=") for text in texts)}
    names = [c.name for c in controllers]
    for name in files:
        if name not in names:
            raise InputError(f"--gains {name}=…: no such controller in this comparison ({', '.join(names)})")
    return [apply(c, files[c.name]) if c.name in files else c for c in controllers]


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    except ValueError:
        raise InputError(f"{path}: not JSON; gains are what slewright tune NAME --json FILE writes") from None
    if not isinstance(content, dict) or not isinstance(content.get("gains"), dict):
        raise InputError(f"{path}: no gains in it; they are what slewright tune NAME --json FILE writes")
    return content
