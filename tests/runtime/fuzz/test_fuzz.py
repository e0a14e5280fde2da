"""A few seconds of fuzzing with the kept corpus; the long session is for `make soak`."""

import sys
import tempfile
import time
from contextlib import ExitStack

import pytest

from specs.errors import RunError
from tests.runtime.fuzz.native import Native, compiled
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
    with compiled() as native:
        session = Session(3, native)
        session.begin()
        begun = time.monotonic()
        while session.quiet_s() < 600 and time.monotonic() - begun < 7200:
            session.step()
    session.sanitize()
    assert not session.problems, session.problems[0]


@pytest.mark.long
def test_sanitizers_find_nothing_in_the_cases_kept() -> None:
    with ExitStack() as stack:
        try:
            session = Session(4, stack.enter_context(compiled()))
        except RunError as missing:
            pytest.skip(f"this compiler cannot: {str(missing).splitlines()[-1]}")
        session.begin()
    assert not session.problems, session.problems[0]
    assert sum(name == "core" for name, *_ in session.seen["frames"]) > 500


def test_what_sanitizers_say_is_a_problem_and_the_session_goes_on() -> None:
    ends = "import sys; sys.stdin.buffer.read(8); sys.exit('AddressSanitizer: heap-buffer-overflow')"
    with tempfile.TemporaryFile() as said:
        native = Native([sys.executable, "-c", ends], said)
        session = Session(5, native)
        for _ in range(2):
            session.run("frames", TARGETS["frames"].seeds()[0])
    assert ["AddressSanitizer: heap-buffer-overflow" in text for text in session.problems] == [True, True]
