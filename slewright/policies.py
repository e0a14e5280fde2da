"""Policies as controllers: an ONNX file becomes a model folder that stands where the systems have theirs."""

import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from specs.errors import InputError

FOLDER = Path("build/policies")
LOADS = ("empty", "2t", "unknown")


def model_folder(path: Path) -> Path:
    """A model folder as it is, or the one that is made of an ONNX policy; InputError if it is neither."""
    if path.suffix != ".onnx":
        return path
    from learning.policy.controller import write_folder
    from learning.policy.export import read

    policy = read(path)
    name = re.sub(r"\W", "_", path.stem)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
    name = name if name[:1].isalpha() else f"policy_{name}"
    return write_folder(policy, name, FOLDER / digest)


def task_of(path: Path) -> str:
    """The task of an ONNX policy; InputError if it is none of this contract."""
    from learning.policy.export import read

    return read(path).contract.task


def question(
    path: Path, draw_set: str, machines: int, paces: Sequence[float], loads: Sequence[str]
) -> tuple[Any, Any]:
    """(what is asked, the policy): one policy on its task, on machines of a set."""
    from baselines import registry
    from baselines.compare.plan import Question
    from learning.policy.export import read

    policy = read(path)
    folder = model_folder(path)
    controller = registry.foreign(folder, f"policy_{folder.name}", f"policy {path.name}")
    asked = Question(
        controllers=[controller], tasks=[policy.contract.task], loads=list(loads), draw_set=draw_set,
        machines=machines, paces=list(paces), singles=False,
    )  # fmt: skip
    return asked, policy


def warnings(path: Path, draw_set: str, machines: int) -> Iterator[str]:
    """What of the machines lies outside the policy's trained ranges, in words, each once."""
    from learning.policy.export import read
    from specs import draws, policy as contract

    ranges = read(path).contract.ranges
    seen: set[str] = set()
    for index in range(machines if draw_set != draws.SEALED else 0):
        for text in contract.outside(ranges, draws.draw(draw_set, index)):
            name = text.split()[0]
            if name not in seen:
                seen.add(name)
                yield f"{draw_set}-{index}: {text}"


def check_machines(machines: int) -> None:
    """InputError for a number that is none."""
    if machines < 1:
        raise InputError(f"--machines {machines}: valid are 1 and more")
