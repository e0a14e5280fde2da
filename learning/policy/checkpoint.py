"""Checkpoints: all that a training needs to go on along the same curve; refused where they do not fit."""

from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

import torch

from learning.policy.recipe import Recipe
from learning.policy.simulation.plant import Machine, State
from learning.policy.simulation.situation import Situation
from specs.errors import InputError
from specs.policy import layout

FORMAT = 3
NAME = "checkpoint.pt"
KEYS = ("format", "task", "history", "layout", "recipe", "seed", "data_sha256", "state")
KINDS = {kind.__name__: kind for kind in (Situation, State, Machine)}


def save(path: Path, recipe: Recipe, seed: int, data: str, state: Mapping[str, Any]) -> None:
    """Write by way of a file beside it: there is always a whole checkpoint."""
    content = {**_told(recipe, seed, data), "state": _plain(dict(state))}
    part = path.with_name(f".{path.name}.part")
    torch.save(content, part)
    part.replace(path)


def read(path: Path) -> dict[str, Any]:
    """All that a checkpoint holds, on the processor; InputError names a file that is none."""
    if not path.is_file():
        raise InputError(f"no checkpoint {path}; slewright train policy writes it into --out")
    try:
        found = torch.load(path, map_location="cpu", weights_only=True)
        return {key: found[key] for key in KEYS}
    except Exception as error:  # a damaged file: zip, pickle and torch errors of many kinds
        raise InputError(f"{path} is no readable checkpoint ({type(error).__name__}); remove it") from error


def load(path: Path, recipe: Recipe, seed: int, data: str) -> dict[str, Any]:
    """The trainer's state; InputError names file and what of it is of another training."""
    told = read(path)
    for key, value in _told(recipe, seed, data).items():
        if told[key] != value:
            raise InputError(f"{path}: a checkpoint of another {_difference(key, told[key], value)}; "
                             "name another --out, or remove it")  # fmt: skip
    return {key: _whole(value) for key, value in told["state"].items()}


def _told(recipe: Recipe, seed: int, data: str) -> dict[str, Any]:
    """What must be the same for a training to go on."""
    return {
        "format": FORMAT,
        "task": recipe.task,
        "history": recipe.history,
        "layout": list(layout(recipe.history, recipe.ahead)),
        "seed": seed,
        "data_sha256": data,
        "recipe": _plain(asdict(recipe)),
    }


def _difference(key: str, have: Any, want: Any) -> str:
    if key == "recipe" and isinstance(have, dict):
        names = [n for n in want if have.get(n) != want[n]] or [n for n in have if n not in want]
        return f"recipe: {names[0]} = {have.get(names[0])}, here {want.get(names[0])}"
    if key == "layout":
        at = next(
            (i for i, (a, b) in enumerate(zip(have, want, strict=False)) if a != b), min(len(have), len(want))
        )
        return f"layout: {len(have)} entries, here {len(want)}; the first difference at {at}"
    text = {"data_sha256": "set of slew networks"}.get(key, key)
    return f"{text}: {str(have)[:16]}, here {str(want)[:16]}"


def _plain(value: Any) -> Any:
    """Nested dicts, lists, numbers and tensors, of what may hold situations."""
    if is_dataclass(value) and not isinstance(value, type):
        own = {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
        return {"kind": type(value).__name__, **own}
    if isinstance(value, Mapping):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value


def _whole(value: Any) -> Any:
    """Situations again, of what `_plain` made of them."""
    if isinstance(value, dict):
        inner = {key: _whole(v) for key, v in value.items() if key != "kind"}
        return KINDS[value["kind"]](**inner) if value.get("kind") in KINDS else inner
    return value
