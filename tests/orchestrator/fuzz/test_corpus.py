"""Every case of the fuzzer's corpus, once more: accepted or refused, and nothing else."""

from collections.abc import Iterator
from random import Random

import pytest

from orchestrator.fmi.variable import FMI3_TYPES
from tests.edges import Edge
from tests.orchestrator.fuzz.case import Case, read_corpus
from tests.orchestrator.fuzz.judge import judge
from tests.orchestrator.fuzz.kinds import kinds, with_bent_binary
from tests.orchestrator.fuzz.mutate import Mutator
from tests.orchestrator.fuzz.seeds import seeds
from tests.orchestrator.fuzz.stepper import Stepper, available

CASES = read_corpus()


def test_the_corpus_is_there() -> None:
    assert len(CASES) > 50


@pytest.mark.parametrize("part", range(8))
def test_cases_of_the_corpus(part: int) -> None:
    accepted = 0
    for number, case in enumerate(CASES[part::8]):
        verdict = judge(case)
        assert not verdict.problem, f"case {part + 8 * number}: {verdict.problem}"
        accepted += verdict.accepted
    assert accepted < len(CASES[part::8])


@pytest.fixture(scope="module")
def stepper() -> Iterator[Stepper]:
    """One process for all tests: a sanitized Python takes seconds to start."""
    if not available():
        pytest.skip("the compiler has no sanitizers")
    found = Stepper()
    yield found
    found.close()


@pytest.mark.slow
@pytest.mark.parametrize("part", [0, *(pytest.param(n, marks=pytest.mark.long) for n in (1, 2, 3))])
def test_accepted_cases_are_stepped_in_a_sanitized_core(stepper: Stepper, part: int) -> None:
    accepted = [case for case in CASES[part::4] if judge(case).accepted]
    assert len(accepted) > 2
    for case in accepted:
        problem, _ = stepper.step(case)
        assert not problem, f"case {CASES.index(case)}: {problem}"


def test_a_crash_of_the_stepping_process_is_reported(stepper: Stepper) -> None:
    """Without this the test above could pass because nothing ran."""
    broken = Case("ssp", {"SystemStructure.ssd": 7})  # type: ignore[dict-item]
    assert "AttributeError" in stepper.step(broken)[0]
    good = next(case for case in seeds() if judge(case).accepted)
    assert stepper.step(good)[0] == ""  # it is started again
    assert stepper.child is not None
    stepper.child.kill()
    stepper.child.wait()
    assert stepper.step(good)[0] == ""


def test_seeds_are_mostly_accepted() -> None:
    """A corpus of refusals would test little: the seeds must get through to the end."""
    verdicts = [judge(case) for case in seeds()]
    assert sum(v.accepted for v in verdicts) > len(verdicts) / 2, [v.message for v in verdicts]


def test_the_kinds_of_other_peoples_faults_are_there_and_bent_further() -> None:
    cases = list(kinds())
    verdicts = [judge(case) for case in cases]
    assert len(cases) > 30
    assert not [v.problem for v in verdicts if v.problem]
    said = " ".join(v.message for v in verdicts)
    for words in ("is empty", "is a text", "Git LFS", "for the processor aarch64", "of FMI 1.0"):
        assert words in said
    r, messages = Random(41), set()
    for number, case in enumerate([c for c in cases if c.foreign] * 3):
        verdict = judge(with_bent_binary(case, r))
        assert not verdict.problem, f"bent case {number}: {verdict.problem}"
        messages.add(verdict.message.rpartition("its library")[2][:24])
    assert len(messages) > 8, messages


def test_edges_are_counted_per_line() -> None:
    good, bad = (set[Edge](), set[Edge]())
    case = next(seeds())
    judge(case, good)
    judge(Case("ssp", {"SystemStructure.ssd": "<x/>"}), bad)
    assert len(good) > 5 * len(bad) > 0
    assert all(name.partition(":")[0].endswith(".py") for name, *_ in good)


def test_mutations_can_be_repeated_and_change_something() -> None:
    cases = list(seeds())
    first, second = (Mutator(3), Mutator(3))
    mutated = [first.mutate(case, cases) for case in cases]
    assert mutated == [second.mutate(case, cases) for case in cases]
    assert sum(a != b for a, b in zip(mutated, cases, strict=True)) > len(cases) / 2
    assert set(FMI3_TYPES) <= set(first.words)
