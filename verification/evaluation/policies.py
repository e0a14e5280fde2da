"""Policies as controllers: an ONNX file becomes a model folder that stands where the systems have theirs."""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from baselines import registry
from fmus.paths import ROOT
from fmus.toolchain.loader import model_folders
from learning.policy.controller import write_folder
from learning.policy.export import Policy, read
from specs.errors import InputError
from verification.comparison.plan import Question

FOLDER = Path("build/policies")
SHIPPED = ROOT / "learning" / "policies" / "full.onnx"  # drives slew, boom and stick
LOADS = ("empty", "2t", "unknown")


def model_folder(path: Path) -> Path:
    """A model folder as it is, or the one that is made of an ONNX policy; InputError if it is neither."""
    if path.suffix != ".onnx":
        return path
    policy = read(path)
    name = _plain(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
    if not name[:1].isalpha() or name in model_folders():  # a model takes the place of one of its name
        name = f"policy_{name}"
    return write_folder(policy, name, FOLDER / digest)


def short_names(paths: Sequence[Path]) -> list[str]:
    """What tables call policies: their files' names, those of one name by their folders as well.

    Raises InputError where that does not tell them apart.
    """
    plain = [_plain(path) for path in paths]
    found = [
        n if plain.count(n) == 1 else f"{_plain(path.absolute().parent)}_{n}"
        for n, path in zip(plain, paths, strict=True)
    ]
    for name, path in zip(found, paths, strict=True):
        if found.count(name) > 1:
            raise InputError(
                f"{path}: another policy is called {name} too; name each once, in folders of other names"
            )
    return found


def controllers(paths: Sequence[Path], led: bool = False) -> dict[Path, registry.Controller]:
    """Policies and model folders as controllers, by their path; not `led`: for targets that stand."""
    if not led:
        check_standing(paths)
    names = dict(zip(paths, short_names(paths), strict=True))
    return {path: registry.foreign(model_folder(path), n, f"policy {n}") for path, n in names.items()}


def lead_s(path: Path) -> float:
    """By how much a policy is led along a way; 0: it was trained for targets that stand, or says nothing."""
    return read(path).contract.lead_s if path.suffix == ".onnx" else 0.0


def seeing(path: Path) -> Policy | None:
    """The policy in a file if it sees more than signals tell: its way ahead, distances to things."""
    found = read(path) if path.suffix == ".onnx" else None
    return found if found and found.contract.ahead else None


def check_standing(paths: Sequence[Path]) -> None:
    """InputError names a policy that was trained to be led along a way."""
    for path in paths:
        if lead_s(path):
            raise InputError(
                f"{path} was trained to be led along a planned path, not for a target that stands; "
                f"slewright scenes SCENE --controller {path}@path drives it"
            )


def check_task(paths: Sequence[Path], tasks: Sequence[str]) -> None:
    """InputError names an ONNX policy that is of none of the tasks that were asked for."""
    for path in paths:
        if path.suffix == ".onnx" and (own := read(path).contract.task) not in tasks:
            raise InputError(
                f"{path}: a policy of task {own}; --task {' --task '.join(tasks)} asks for another"
            )


def _plain(path: Path) -> str:
    """A file's or folder's name in letters, digits and underscores."""
    return re.sub(r"\W", "_", path.absolute().stem)


def task_of(paths: Sequence[Path]) -> str:
    """The task of ONNX policies for targets that stand; InputError if one is none, or they are of several."""
    check_standing(paths)
    tasks = sorted({read(path).contract.task for path in paths})
    if len(tasks) != 1:
        raise InputError(f"policies of several tasks: {', '.join(tasks)}; one at a time")
    return tasks[0]


def question(
    path: Path, draw_set: str, machines: int, paces: Sequence[float], loads: Sequence[str]
) -> tuple[Any, Any]:
    """(what is asked, the policy): one policy on its task, on machines of a set."""
    policy = read(path)
    folder = model_folder(path)
    name = f"policy_{folder.name.removeprefix('policy_')}"
    controller = registry.foreign(folder, name, f"policy {path.name}")
    asked = Question(
        controllers=[controller], tasks=[policy.contract.task], loads=list(loads), draw_set=draw_set,
        machines=machines, paces=list(paces), singles=False,
    )  # fmt: skip
    return asked, policy
