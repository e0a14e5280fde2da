"""What a reproduction is asked for: how much of it, with which policies, and what results depend on."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from learning.policy.export import read
from specs.errors import InputError, nearest
from specs.policy import HISTORY
from specs.progress import Report
from specs.schema import ROOT
from verification.plants import plant as plants
from verification.plants.plant import Plant

PLANTS = {"nominal": "nominal", "published": "published", "reference": "machine"}  # column -> plant
WHERE = {
    "nominal": "nominal simulation",
    "published": "simulation with the authors' networks",
    "reference": "simulated reference machine",
}
PROJECT = ROOT.parent
ROOMS = ("specs", "records", "fmus", "orchestrator", "baselines", "learning", "verification")
SOURCES = (".py", ".toml", ".c", ".h", ".csv", ".npz", ".json")
HERE = Path(__file__).parent


@dataclass(frozen=True)
class Effort:
    """How much is run: targets of a trial, and the budget of trainings ("": nothing is trained)."""

    targets: int = 100
    training: str = "full"
    seeds: int = 3  # of a slew model
    plan: str = "paper"  # recordings to train slew models on


EFFORTS = {
    "full": Effort(targets=400),
    "quick": Effort(training=""),
    "tiny": Effort(targets=1, training="tiny", seeds=1, plan="tiny"),
}


@dataclass(frozen=True)
class Role:
    """A policy that a table needs: its task, history and recipe, the seed that ships, what is trained."""

    task: str
    recipe: str
    file: str
    seed: int = 1
    history: int = HISTORY
    trained: bool = True  # by the paper; else it is ours, and only what ships is shown

    @property
    def shipped(self) -> Path:
        """The file that ships."""
        return PROJECT / "learning" / "policies" / self.file


ROLES = {
    "paper_slew_no_history": Role("slew", "paper_slew", "paper_slew_no_history.onnx", history=1),
    "paper_slew": Role("slew", "paper_slew", "paper_slew.onnx"),
    "paper": Role("full", "paper", "paper.onnx", seed=2),
    "slew": Role("slew", "slew", "slew.onnx", trained=False),
    "ppo": Role("full", "ppo", "ppo.onnx", trained=False),
}


@dataclass(frozen=True)
class Asked:
    """Everything an item is made from; `given`: policies of someone's in the place of ours, by role."""

    budget: str
    effort: Effort
    seed: int
    workers: int
    out: Path
    report: Report
    given: Mapping[str, Path] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """The options that say the same on the command line."""
        budget = {"full": "", "quick": " --quick", "tiny": " --budget tiny"}[self.budget]
        targets = (
            "" if self.effort.targets == EFFORTS[self.budget].targets else f" --targets {self.effort.targets}"
        )
        given = "".join(f" --policy {role}={path}" for role, path in self.given.items())
        return f"{budget}{targets} --seed {self.seed}{given}"

    def key(self) -> dict[str, Any]:
        """The settings that a result depends on."""
        return {"budget": self.budget, **self.effort.__dict__, "seed": self.seed}


@cache
def plant(column: str) -> Plant:
    """The plant of a column."""
    return plants.find(PLANTS[column])


def policies(texts: list[str]) -> dict[str, Path]:
    """ROLE=FILE for each role, checked; InputError names the file and what of it does not fit."""
    found = {}
    for text in texts:
        name, equals, file = text.partition("=")
        if not equals:
            raise InputError(f"--policy {text}: valid is ROLE=FILE, with a role of: {', '.join(ROLES)}")
        if name not in ROLES:
            raise InputError(
                f"--policy {text}: no role '{name}'; {nearest(name, ROLES)} (valid: {', '.join(ROLES)})"
            )
        if name in found:
            raise InputError(f"--policy {text}: {name} is given twice")
        check(name, Path(file))
        found[name] = Path(file)
    return found


def check(name: str, path: Path) -> None:
    """InputError for a policy of another task, history or recipe, or with weights that are no numbers."""
    role, found = ROLES[name], read(path).contract
    for what, have, want in (
        ("task", found.task, role.task),
        ("history", found.history, role.history),
        ("recipe", found.made.get("recipe", role.recipe), role.recipe),
    ):
        if have != want:
            raise InputError(f"{path}: a policy of {what} {have}; {name} is of {what} {want}")


@cache
def code(whole: bool) -> str:
    """SHA-256 of the sources that results depend on; `whole`: with those of this room, which only shows."""
    found = hashlib.sha256()
    for room in ROOMS:
        for path in sorted((PROJECT / room).rglob("*")):
            if path.suffix in SOURCES and path.is_file() and (whole or HERE not in path.parents):
                found.update(path.relative_to(PROJECT).as_posix().encode() + path.read_bytes())
    return found.hexdigest()[:16]


def digest(path: Path) -> str:
    """SHA-256 of what a policy does: its file also tells when and where it was made."""
    found, own = hashlib.sha256(), read(path)
    c = own.contract
    found.update(repr((c.task, c.history, c.layout, c.change, c.prior)).encode())
    for layer in own.weights:
        for values in layer:
            found.update(values.tobytes())
    return found.hexdigest()[:16]
