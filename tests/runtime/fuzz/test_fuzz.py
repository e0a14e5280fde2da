"""A few seconds of fuzzing with the kept corpus; the long session is for `make soak`."""

import time

import pytest

from tests.runtime.fuzz.session import TARGETS, Session, read_corpus


def test_the_corpus_finds_nothing() -> None:
    session = Session()
    session.begin()
    assert not session.problems, session.problems[0]
    assert set(read_corpus()) == set(TARGETS)
    assert all(len(session.seen[name]) > 50 for name in TARGETS)


def test_new_cases_find_nothing() -> None:
    session = Session(2)
    for name, target in TARGETS.items():
        for case in target.seeds():
            session.run(name, case)
    for _ in range(12):
        session.step()
    assert not session.problems, session.problems[0]


@pytest.mark.soak
def test_ten_minutes_without_a_new_edge() -> None:
    session = Session(3)
    session.begin()
    begun = time.monotonic()
    while session.quiet_s() < 600 and time.monotonic() - begun < 7200:
        session.step()
    session.sanitize()
    assert not session.problems, session.problems[0]


@pytest.mark.slow
def test_sanitizers_find_nothing_in_the_cases_kept() -> None:
    session = Session(4)
    session.begin()
    session.sanitize()
    assert not session.problems, session.problems[0]
