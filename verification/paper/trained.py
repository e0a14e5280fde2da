"""The policies of the tables: given, trained as the paper trains (goes on where it was ended), or shipped."""

from functools import cache
from pathlib import Path

from baselines import registry
from baselines.registry import Controller
from specs.errors import RunError
from specs.policy import HISTORY
from specs.progress import Report
from verification.evaluation.policies import model_folder
from verification.paper.asked import ROLES, Asked, check

PLANT = "published"  # whose slew drive the paper's recipes are trained on


def policy(asked: Asked, name: str) -> Path:
    """The file of a role, checked."""
    role, budget = ROLES[name], asked.effort.training
    path = asked.given.get(name) or role.shipped
    if role.trained and budget and name not in asked.given:
        path = _trained(name, budget, asked.out / "train" / f"{name}-{budget}", asked.report)
    check(name, path)
    return path


def controller(asked: Asked, name: str) -> Controller:
    """A controller of baselines/, or a policy by its role."""
    if name not in ROLES:
        return registry.find(name)
    return registry.foreign(model_folder(policy(asked, name)), name, f"policy {name}")


@cache
def _trained(name: str, budget: str, out: Path, report: Report) -> Path:
    """Train a role's policy, or go on where it was ended; InputError for a checkpoint of another recipe."""
    from learning.policy import session

    role = ROLES[name]
    options = session.Options(
        task=role.task, recipe=role.recipe, seed=role.seed, budget=budget, plant=PLANT, out=out,
        changed={} if role.history == HISTORY else {"history": role.history},
    )  # fmt: skip
    report(f"training {name}")
    figures = session.run(options, report)
    if not figures["policy"]:
        raise RunError(f"{name}: training ended without a policy; {figures['checkpoint']} goes on")
    return Path(figures["policy"])
