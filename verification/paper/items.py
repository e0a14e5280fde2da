"""The tables and figures of the paper in its order, and how each is made and kept."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from records.paper import SLEW_ONLY, WITH_ESTIMATE, WITHOUT_ESTIMATE
from specs.errors import InputError, nearest
from verification.paper import open_loop, pictures, slew_model, trials
from verification.paper.asked import Asked, code, digest
from verification.paper.made import Made
from verification.paper.store import Store
from verification.paper.trained import policy
from verification.paper.why import WHY


@dataclass(frozen=True)
class Item:
    """A table or figure, and the policies (roles) that it needs."""

    name: str
    place: str
    title: str
    make: Callable[[Asked], Made]
    roles: tuple[str, ...] = ()

    @property
    def why(self) -> str:
        """Where ours differ from the paper's, and why."""
        return WHY[self.name]


def _table(name: str, place: str, title: str) -> Item:
    return Item(name, place, title, partial(trials.make, place=place), trials.roles(place))


FOLDER = "items"  # of what is finished, in --out
PAPER = (pictures.POLICY,)
ITEMS = (
    Item("data", "Table I", "characteristics of the training set", slew_model.split),
    Item("networks", "Table II", "neural network design hyperparameters", slew_model.networks),
    Item("slew_ablation", "Table III", "actuator model feature crafting", slew_model.features),
    Item("open_loop", "Fig. 2", "open-loop prediction over 40 s", open_loop.prediction),
    Item("arm_and_tool", "Fig. 3", "arm controller and tool dynamics", open_loop.arm_and_tool),
    _table("slew_only", SLEW_ONLY, "performance for slew-only control"),
    Item("four_targets", "Fig. 6", "four targets, driver and controller", pictures.four_targets, PAPER),
    _table("driver", WITH_ESTIMATE, "performance with load estimation, and human drivers"),
    Item(
        "five_targets", "Fig. 7", "five targets with tolerances of 1 m and 2 m", pictures.five_targets, PAPER
    ),
    Item("strategies", "Fig. 8", "strategies with and without load", pictures.strategies, PAPER),
    _table("no_load_estimate", WITHOUT_ESTIMATE, "performance without load estimation"),
)


def names() -> list[str]:
    """All items, in the paper's order."""
    return [item.name for item in ITEMS]


def chosen(wanted: Sequence[str]) -> list[Item]:
    """The named items in the paper's order, all if none is named; InputError lists the valid names."""
    for name in wanted:
        if name not in names():
            near, valid = nearest(name, names()), f"valid: {', '.join(names())}"
            hint = valid if near.startswith("valid") else f"{near} ({valid})"
            raise InputError(f"the paper has no item '{name}'; {hint}")
    return [item for item in ITEMS if not wanted or item.name in wanted]


def make(asked: Asked, wanted: Sequence[Item]) -> dict[str, dict[str, Any]]:
    """name -> what became of it, from the store where it was made before."""
    store, found = Store(asked.out / FOLDER), {}
    for number, item in enumerate(wanted):
        asked.report(item.name, number, len(wanted))
        own = {role: digest(policy(asked, role)) for role in item.roles}
        key = {**asked.key(), "policies": own, "code": code(whole=True)}
        made = store.get(item.name, key, lambda item=item: item.make(asked).as_dict())
        found[item.name] = {**made, "command": f"slewright reproduce {item.name}{asked.words}"}
    return found
