"""The next experiment of a system: that of its most doubtful part."""

from collections.abc import Callable, Sequence
from typing import Any

from reconcile.experiment.plan import drivable
from reconcile.experiment.propose import OPEN, Proposal, propose
from reconcile.system.examine import Examined

Report = Callable[..., None]


def most_doubtful(done: Sequence[Examined]) -> list[Examined]:
    """Parts that leave something open: first those whose effect has several names, by what it gains."""
    parts = [e for e in done if e.figures["verdict"] in OPEN]
    return sorted(parts, key=lambda e: (OPEN.index(e.figures["verdict"]), -_gain(e)))


def next_experiment(done: Sequence[Examined], report: Report) -> tuple[Examined, Proposal] | None:
    """The first of those parts with an experiment that would help; else what is said of the first of them.

    The proposal's figures name the part ("subsystem"); None where no part leaves anything open.
    """
    found: list[tuple[Examined, Proposal]] = []
    for e in most_doubtful(done):
        moved = None if drivable(e.folder) else e.part
        proposal = propose(e.answer, e.figures["verdict"], report, moved)
        if proposal is None:
            continue
        proposal.figures["subsystem"] = e.part.name
        if proposal.commands:
            return e, proposal
        found.append((e, proposal))
    return found[0] if found else None


def _gain(e: Examined) -> float:
    """Of the strongest effect that has other names as well."""
    effects: list[dict[str, Any]] = e.figures["effects"]
    return max((f["gain_fit"] or 0.0 for f in effects if f["verdict"] == "ambiguous"), default=0.0)
