"""Why a client is not given the right to command, as it is told; the seat is a stand-in."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("asyncua")


def asked(**seat: Any) -> tuple[str, list[str]]:
    """The answer to a claim, and what the seat was told of the client."""
    from runtime.opcua.methods import Methods

    released: list[str] = []
    stand_in: Any = SimpleNamespace(has_right=False, release=lambda _, why: released.append(why), **seat)
    return asyncio.run(Methods(stand_in, lambda _: None)._granted("planner")), released


def test_a_claim_that_lapsed_while_this_process_was_held_up_is_not_called_somebody_elses():
    assert asked(client="") == ("busy: its claim lapsed before it was answered", [])


@pytest.mark.parametrize("why", ["somebody else has it", "the controller does not run yet"])
def test_a_claim_without_an_answer_says_why(why: str):
    answer, released = asked(client="planner", why_not=lambda: why)
    assert answer == f"busy: {why}"
    assert released == [f"was not given the right to command: {why}"]
