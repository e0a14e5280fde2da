"""A system's next experiment is that of its most doubtful part."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.experiment.propose import Proposal
from reconcile.system import doubt


def part(name: str, verdict: str, gain: float = 0.0, each: str = "ambiguous") -> Any:
    effects = [{"verdict": each, "gain_fit": gain}] if gain else []
    return SimpleNamespace(
        part=SimpleNamespace(name=name),
        figures={"verdict": verdict, "effects": effects},
        answer=name,
        folder=name,
    )


@pytest.fixture
def proposals(monkeypatch):
    """What is proposed by part: commands, none that help, or nothing."""
    known: dict[str, Any] = {}

    def propose(answer, verdict, report, moved):
        assert (moved is None) == (answer != "tool"), "the machine moves the tool, and drives the others"
        return None if known[answer] is None else Proposal({"sentence": answer}, 0.1, known[answer])

    monkeypatch.setattr(doubt, "propose", propose)
    monkeypatch.setattr(doubt, "drivable", lambda folder: folder != "tool")
    return known


DONE = [
    part("arm", "insufficient_excitation"),
    part("slew", "ambiguous", 40.0),
    part("tool", "ambiguous", 300.0),
    part("cabin", "named", 900.0, "named"),
]


def test_the_strongest_effect_of_open_name_comes_first_and_what_did_not_move_last():
    assert [e.part.name for e in doubt.most_doubtful(DONE)] == ["tool", "slew", "arm"]


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"tool": {"u": np.ones(3)}, "slew": {}, "arm": {}}, "tool"),
        ({"tool": {}, "slew": {"u": np.ones(3)}, "arm": {}}, "slew"),  # that of the tool would not help
        ({"tool": None, "slew": {}, "arm": {}}, "slew"),  # nothing is to be told of the tool; nothing helps
    ],
)
def test_its_proposal_is_the_systems_or_else_the_next_ones(proposals, given, wanted):
    proposals.update(given)
    found = doubt.next_experiment(DONE, lambda *_: None)
    assert found is not None
    assert found[0].part.name == wanted
    assert found[1].figures["subsystem"] == wanted


def test_where_nothing_is_open_nothing_is_proposed():
    assert doubt.next_experiment(DONE[-1:], lambda *_: None) is None
