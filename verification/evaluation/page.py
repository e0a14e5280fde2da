"""The tables of an evaluation in a page, with the controllers of a comparison at the policy's speed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from records.report import markers
from specs.errors import InputError
from verification.comparison import policy_vs_controllers
from verification.comparison.policy_vs_controllers import Runs
from verification.evaluation.evaluation import markdown


@dataclass(frozen=True)
class Page:
    """A page with markers `mark`; `others`: the runs that the policy is compared with."""

    path: Path
    mark: str
    others: Runs = field(default_factory=dict)

    def fill(self, found: Mapping[str, Any], policy: str) -> None:
        """Write the figures of an evaluation between the markers; `policy` is left out of the others."""
        markers.fill(self.path, self.mark, markdown(found))
        if self.others:
            unit = "°" if found["task"] == "slew" else "m"
            text = policy_vs_controllers.table(found["runs"], list(found["loads"]), self.others, unit, policy)
            markers.fill(self.path, f"policy-beside-{found['task']}", text)


def checked(path: Path | None, task: str, mark: str, beside: Path | None) -> Page | None:
    """The page, if there is one; what is wrong with it or `beside` is refused now, not after the runs."""
    if beside and path is None:
        raise InputError("--beside fills in a page's table: it needs --page")
    others = policy_vs_controllers.known(beside, task) if beside else {}
    if path is None:
        return None
    markers.around(path, mark or f"policy-{task}")
    if others:
        markers.around(path, f"policy-beside-{task}")
    return Page(path, mark or f"policy-{task}", others)
