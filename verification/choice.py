"""Which controller a verification is of, and what it is compared with."""

from collections.abc import Sequence
from pathlib import Path

from baselines import registry
from specs.errors import InputError
from verification.evaluation.policies import SHIPPED, model_folder
from verification.runs import replacement
from verification.verify import PI, Controller

POLICY = "policy"  # what tables call the controller that ships


def choose(controller: str, model: Path | None, systems: Sequence[str]) -> list[Controller]:
    """The controller to verify, then those beside it: what was named, or else what ships.

    A `model` of the machine is verified with the controller that ships; that one is called POLICY.
    """
    if controller and model is not None:
        raise InputError("--controller and --model exclude each other")
    if controller == POLICY:
        return [Controller(POLICY, (model_folder(SHIPPED),))]
    if controller:
        found = registry.find(controller)
        return [Controller(controller, tuple(found.models.values()), found.parameters)]
    if model is None:
        return [Controller(POLICY, (model_folder(SHIPPED),)), PI]
    folder = model_folder(model)
    if registry.SLOT in replacement(folder, systems):
        return [Controller(folder.resolve().name, (folder,))]
    return [Controller(POLICY, (model_folder(SHIPPED), folder))]
