"""`slewright train policy`: iterations, checkpoints and a learning curve; an ONNX policy at the end.

OUT/checkpoint.pt   the last good state: a run that was ended goes on from it
OUT/curve.jsonl     figures of every iteration
OUT/events.…        the same for TensorBoard
OUT/TASK.onnx       the policy
"""

import hashlib
import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import torch

from learning.policy import checkpoint
from learning.policy.curve import Log
from learning.policy.export import Policy, write
from learning.policy.gradient import GradientTrainer
from learning.policy.network import weights_of
from learning.policy.ppo import PpoTrainer
from learning.policy.recipe import GROUPS, RECIPES, Recipe, recipe
from learning.policy.simulation.environment import HEIGHT, POSE, RADIUS, load_networks
from learning.policy.training import Training
from learning.policy.valid import ABSENT
from specs.errors import InputError, RunError, nearest
from specs.policy import JOINED, TASKS, contract
from specs.progress import Report
from specs.schema import ROOT

BUDGETS = ("full", "short", "tiny")  # what is told of a recipe stays as it is told
DEVICES = ("auto", "cpu", "cuda")
SHORT = 0.2  # of the iterations
_MODELS = ROOT.parent / "fmus" / "models"
NETWORKS = (_MODELS / "slew_nn" / "weights.npz",)
FAMILY = (*NETWORKS, _MODELS / "slew_published" / "weights.npz")  # of a recipe with a family
PLANTS = {"networks": NETWORKS, "published": FAMILY[1:]}  # by whose slew drive


@dataclass(frozen=True)
class Options:
    """What to train, from which slew networks, and where to put it; `changed`: fields of the recipe."""

    task: str = "full"
    recipe: str = ""
    seed: int = 1
    budget: str = "full"
    networks: tuple[Path, ...] = ()
    plant: str = ""  # of PLANTS, or what `slewright import slew` wrote, in the place of networks
    our_inertia: bool = False  # for networks that do not say on which inertia number they were trained
    out: Path = Path("out/train-policy")
    changed: Mapping[str, Any] = field(default_factory=dict)
    device: str = "auto"  # of DEVICES
    stop_after: int | None = None  # iterations from now, for tests: as if it were ended there

    def chosen(self) -> Recipe:
        """The recipe with its changes; InputError for an unknown name or one of another task."""
        name = self.recipe or self.task
        if self.task not in TASKS:
            raise InputError(f"no task '{self.task}'; valid: {', '.join(TASKS)}")
        if self.budget not in BUDGETS:
            raise InputError(f"no budget '{self.budget}'; {nearest(self.budget, BUDGETS)}")
        found = recipe(name, self.budget == "tiny", **self.changed)
        if found.task != self.task:
            able = [r.name for r in RECIPES.values() if r.task == self.task]
            raise InputError(f"recipe {name} is for task {found.task}; for {self.task}: {', '.join(able)}")
        if self.budget == "short" and "iterations" not in self.changed:
            found = recipe(name, **{**self.changed, "iterations": max(1, round(SHORT * found.iterations))})
        return found

    def drives(self, chosen: Recipe) -> tuple[Path, ...]:
        """The slew networks; InputError for a plant that has none, or beside networks."""
        if self.plant and self.networks:
            raise InputError(f"--plant {self.plant} excludes --networks")
        if self.plant:
            return PLANTS.get(self.plant) or (_weights(self.plant),)
        return self.networks or (FAMILY if chosen.family else NETWORKS)

    @property
    def command(self) -> str:
        """What makes it again."""
        words = [f"--task {self.task}", f"--seed {self.seed}", f"--budget {self.budget}"]
        words += [f"--recipe {self.recipe}"] if self.recipe else []
        words += [f"--device {self.device}"] if self.device != "auto" else []
        words += [f"--plant {self.plant}"] if self.plant else []
        words += [f"--networks {path}" for path in self.networks]
        words += ["--our-inertia"] if self.our_inertia else []
        words += [f"--set {text}" for text in _settings(self.changed)]
        return "slewright train policy " + " ".join(words)


def _weights(plant: str) -> Path:
    """The weights of a plant from a file or folder."""
    path = Path(plant)
    path = path / "weights.npz" if path.is_dir() else path
    if path.suffix != ".npz" or not path.is_file():
        raise InputError(
            f"no plant '{plant}' to train on: its slew drive must be networks; valid: {', '.join(PLANTS)}, "
            "or a .npz file or folder that slewright import slew wrote"
        )
    return path


def _settings(changed: Mapping[str, Any], group: str = "") -> list[str]:
    """ "name=value" of changes, as `changes` reads them."""
    found: list[str] = []
    for name, value in changed.items():
        if isinstance(value, Mapping):
            found += _settings(value, f"{name}.")
        else:
            text = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
            found.append(f"{group}{name}={text}")
    return found


def changes(texts: Sequence[str]) -> dict[str, Any]:
    """ "name=value" of the recipe's fields, numbers, words, true or false; InputError for what is none."""
    found: dict[str, Any] = {}
    able = {f.name: f for f in fields(Recipe) if f.name not in ("name", "why")}
    for text in texts:
        name, equals, value = text.partition("=")
        group, dot, term = name.partition(".")
        if not equals or group not in able or (dot and group not in GROUPS):
            raise InputError(f"--set {text}: no field '{group}' of a recipe; {nearest(group, able)}")
        try:
            number: Any = json.loads(value)
        except ValueError:
            number = value
        number = tuple(number) if isinstance(number, list) else number
        if dot:
            if not isinstance(others := found.get(group, {}), dict):
                raise InputError(f"--set {text}: beside --set {group}={others}; valid is {group}.NAME=VALUE")
            found[group] = {**others, term: number}
        else:
            found[name] = number
    return found


def run(options: Options, report: Report) -> dict[str, Any]:
    """Train, or go on; returns the figures.  RunError if training fails: the last good checkpoint stays."""
    chosen = options.chosen()
    paths = options.drives(chosen)
    if chosen.envs < len(paths):
        raise InputError(f"envs = {chosen.envs}: valid is from {len(paths)}, one machine a slew network")
    data, commit = digest(paths), source_state()
    device = device_of(options.device, chosen)
    trainer = make_trainer(chosen, paths, options.seed, device, options.our_inertia)
    out = _folder(options.out)  # not before: what is refused leaves none
    training = Training(trainer, options.seed, out / checkpoint.NAME, data)
    training.resume()
    began = trainer.done
    with Log(out, began) as log:
        try:
            training.iterate(log, report, options.stop_after)
        except RunError as error:
            raise RunError(f"{error}; {training.last_good}") from error
    spent = training.processor_s
    figures: dict[str, Any] = {
        "task": chosen.task, "recipe": chosen.name, "iterations": trainer.done, "of": chosen.iterations,
        "command": options.command, "resumed_at": began, "last": log.last, "policy": "",
        "checkpoint": str(training.kept), "processor_s": spent and round(spent, 2),
    }  # fmt: skip
    if trainer.done >= chosen.iterations and not chosen.privileged:
        figures["policy"] = str(_export(training, options, commit, figures, out))
    return figures


def device_of(told: str, chosen: Recipe) -> str:
    """torch's name of the device; "auto" is a GPU for PPO's thousands of machines, where there is one.

    By the gradient a few hundred machines go through compiled loops, which only the processor has.
    """
    if told not in DEVICES:
        raise InputError(f"no device '{told}'; {nearest(told, DEVICES)} (valid: {', '.join(DEVICES)})")
    able = torch.cuda.is_available()
    if told == "cuda" and not able:
        raise InputError("--device cuda: torch sees no GPU here; valid are auto and cpu")
    return "cuda" if able and (told == "cuda" or chosen.method == "ppo") else "cpu"


def make_trainer(
    chosen: Recipe, paths: Any, seed: int, device: str = "cpu", our_inertia: bool = False
) -> Any:
    """The trainer of a recipe's method on slew networks from files."""
    torch.set_num_threads(1)
    networks = load_networks(paths, our_inertia)
    trainer = _made(chosen, networks, seed, device)
    if not chosen.family:
        trainer.sources = [str(path) for path in paths]
    return trainer


def _made(chosen: Recipe, networks: Any, seed: int, device: str) -> Any:
    if chosen.method == "ppo":
        try:
            return PpoTrainer(chosen, networks, seed, device)
        except ModuleNotFoundError as error:
            raise InputError(
                f"PPO needs the package {error.name}: pip install 'slewright[learning]'"
            ) from None
    return GradientTrainer(chosen, networks, seed, device)


def _folder(out: Path) -> Path:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: {error.strerror}") from None
    return out


def digest(paths: Any) -> str:
    """SHA-256 of the slew networks that a policy is trained with."""
    found = hashlib.sha256()
    for path in paths:
        try:
            found.update(Path(path).read_bytes())
        except OSError as error:
            raise InputError(f"slew network {path}: {error.strerror}") from None
    return found.hexdigest()


def _export(training: Training, options: Options, commit: str, figures: Mapping[str, Any], out: Path) -> Path:
    chosen = training.chosen
    made = {
        "command": options.command, "seed": options.seed, "commit": commit, "recipe": chosen.name,
        "iterations": chosen.iterations, "training": {k: float(v) for k, v in figures["last"].items()},
        "processor_s": figures["processor_s"],
    }  # fmt: skip
    told = contract(
        chosen.task,
        chosen.history,
        prior=chosen.prior,
        change=chosen.change,
        lead_s=chosen.lead_s,
        waypoints_s=chosen.waypoints_s,
        field_m=chosen.field_m,
        network=chosen.network if chosen.network in JOINED else "",
        data_sha256=training.data,
        ranges=ranges(training.trainer, chosen),
        made=made,
    )
    return write(Policy(told, weights_of(training.trainer.mlp)), out / f"{chosen.task}.onnx")


def ranges(trainer: Any, chosen: Recipe) -> dict[str, tuple[float, float]]:
    """Trained ranges by name: parameters of the machine, signals, and the pendulum's length, in SI."""
    r = chosen.random
    found = {
        "load_mass": r.load, "slew_dead_band": r.dead_band, "pendulum_length": r.tool_length, "pace": r.pace,
        "target_radius": RADIUS, "target_z": HEIGHT, "q_boom": POSE["boom"], "q_stick": POSE["stick"],
        "slew_error": (-r.slew_error[1], r.slew_error[1]),
    }  # fmt: skip
    region = [n.region["inertia"] for n in trainer.environment.plant.drive.networks if "inertia" in n.region]
    if region:
        found["inertia"] = (min(low for low, _ in region), max(high for _, high in region))
    told = {name: (float(low), float(high)) for name, (low, high) in found.items()}
    return {name: span for name, span in told.items() if span != ABSENT}


def source_state() -> str:
    """What git calls the state of the sources; "unknown" outside a repository."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return done.stdout.strip() or "unknown"
