"""Mutants of the guard: its C code with one small mistake each; what guard.h says must find every one.

    python -m tests.runtime.core.guard_mutants

As `tests.runtime.core.mutants`, whose swaps are taken.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from specs.errors import RunError
from tests.runtime.core.guard import CORE, Guard, build, check_all
from tests.runtime.core.mutants import Mutant, mutants

EQUAL = {  # part of the mutated line: why it is the same program, or who else finds it
    "return a  <= b ? a : b": "of equal numbers either is the lesser",
    "return a  >= b ? a : b": "of equal numbers either is the greater",
    "near  <= p->r": "both give more than a quarter of a turn",
    "r  >= 0.0 && z": "the length of 0 and z is z",
    "z  >= 0.0 ? length": "as above",
    "found  <= *least": "of equal rooms either part may be named",
    "near + p->swings, p->r + near": "the boom's foot is nearer to the slew axis than the swinging tool",
    "rect->r)  >= 0.0 ||": "what touches the box of all margins has room",
    "rect->z)  >= 0.0)": "as above",
    "gap < p->azimuth": "equal to the last bit only",
    "least > enough": "as above",
    "&part)  <= 0.0) continue": "as above",
    "sizeof past->sent[0] -": "every axis remembers as much",
    "- sizeof past->sent[0][0]": "as above",
    "n  <= first + SLR_GUARD_SECTORS": "one sector is looked into twice",
    "axis  <= SLR_AXES": "beyond the end: the sanitizers (test_platforms.py)",
    "side  <= 2": "as above",
    "b  <= body->balls": "as above",
    "i  <= SLR_GUARD_TRIES": "as above",
    "i  <= SLR_GUARD_SENT": "as above",
}


def every() -> list[Mutant]:
    """Those that are not the same program."""
    found = mutants((CORE / "guard.c").read_text())
    return [m for m in found if not any(part in m.after for part in EQUAL)]


def killed(mutant: Mutant, cases: int) -> bool:
    """Whether the promises (or the compiler) find the mistake."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            check_all(Guard(build(Path(folder), mutant.text, ["-O0"])), cases)
        except (AssertionError, RunError, ValueError):
            return True
    return False


def survivors(of: Sequence[Mutant], cases: int = 400) -> list[Mutant]:
    """Those that nothing found."""
    return [m for m in of if not killed(m, cases)]


if __name__ == "__main__":
    known = every()
    alive = survivors(known)
    print(f"{len(known)} mutants, {len(alive)} survive")
    for m in alive:
        print(f"guard.c:{m.line}: {m.before}\n           -> {m.after}")
