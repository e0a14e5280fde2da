"""Mutants of check.c and mode.c, of seats.c and page.c: the tests of inputs and state machine, and those of
who commands, must find every one.

    python -m tests.runtime.core.core_mutants [check.c] [mode.c] [seats.c] [page.c]

Each mutant is linked into the core of the tests' bundle; a process forked for it runs the tests until the
first failure.  What survives is a hole in the tests or the same program; the latter are listed in EQUAL.
"""

import os
import resource
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from deployment.bundling import build
from fmus.toolchain import compiler
from runtime.bundle import Bundle
from specs.errors import RunError
from tests.runtime import bundles
from tests.runtime.core.mutants import Mutant, mutants

OF_CORE = tuple(f"tests/runtime/core/test_{name}.py" for name in ("check", "mode", "restart"))
OF_COMMANDS = ("tests/runtime/interfaces/test_seats.py", "tests/runtime/hmi/test_port.py")
TESTS = {
    "check.c": OF_CORE,
    "mode.c": OF_CORE,
    "seats.c": OF_COMMANDS,
    "page.c": OF_COMMANDS,
}
MOST_CPU_S = 120  # of a mutant's tests, which take 5: a loop without end
EQUAL = {  # part of the mutated line: why it is the same program, or what else finds it
    "for (int i = 1; i < SLR_OUT_COUNT; i++) view->board": "controllers write the slew command in every tick",
    "in->value[i] + slr_zero[i]": "zeros are 0 in the core of these tests: tests/deployment/bundling",
    "i  <= SLR_IN_COUNT": "one step past the end: for the sanitizers",
    "i  <= SLR_OUT_COUNT": "as above",
    "k  <= LENGTH(": "as above",
    "return x  <= 0.0 ? -x": "0 either way",
    "int i = 1; i < SLR_IN_COUNT; i++) {": "its repeats do not count: a target",
    "after  >= 0 && s->same": "every time limit is more than a tick",
    "after > 1 && s->same": "as above",
    "s->bad[i]  <= INT32_MAX": "a year and four months of one fault",
    "s->bad[i]  >= 0 && (at_once": "without a bad step the status is OK, which is never lost",
    "s->last[i] = s->raw[i] = signals": "what was never heard is lost, and nothing lost is used",
    "SLR_MOVING)) s->same[angles[k][0]] = 1": "stuck a tick earlier",
    "none = {SLR_FAULT_NONE, 1}": "without a fault nobody asks for its input",
    "(input = slr_first_lost(view, SLR_GROUP_OPERATOR)) > 0)": "input 0 is the planner's",
    "(input = slr_first_lost(view, SLR_GROUP_OPERATOR)) >= 1)": "as above",
    "(input = slr_first_lost(view, SLR_GROUP_MACHINE)) > 0)": "as above",
    "(input = slr_first_lost(view, SLR_GROUP_MACHINE)) >= 1)": "as above",
    "(input = slr_first_lost(view, SLR_GROUP_SENSOR)) > 0)": "as above",
    "(input = slr_first_lost(view, SLR_GROUP_SENSOR)) >= 1)": "as above",
    "slr_first_lost(view, SLR_GROUP_OPERATOR)  <= 0": "as above",
    "slr_first_lost(view, SLR_GROUP_OPERATOR) < 1": "as above",
    "slr_first_lost(view, SLR_GROUP_MACHINE)  <= 0": "as above",
    "view->reach > 0.0": "a target is never exactly at the end of reach",
    "]])  >= SLR_MOVING": "a measured rate is never exactly the limit",
    "board[i])  >= SLR_DEFLECTED": "a joystick is never exactly at the limit: its steps are finer",
    "starts - first": "targets are the first inputs",
    "now  >= then ? (now - then)": "0 either way",
    "if (!seat->cell.memory) return 1": "nobody is alive there; only sooner done",
    "int asks = 1": "as above",
    "i  <= SLR_SCAN_SEATS": "one step past the end: for the sanitizers",
    "i  <= SLR_SCAN_HEARD": "as above",
}


@dataclass(frozen=True)
class Mutated(Bundle):
    """A bundle with another library of the same sources."""

    path: Path = Path()

    def library(self, name: str = "") -> Path:
        """That one."""
        return self.path


class Workshop:
    """The tests' core as object files, one of which is made anew for each mutant."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.host, self.made = folder, compiler.host().name, bundles.built()
        self.sources = self.made.folder / "sources"
        self.objects = build.objects_of(self.sources, self.made.identity, folder, self.host)

    def library(self, name: str, mutant: Mutant) -> Path:
        """The core with a mutant of `name`; RunError where the compiler finds the mistake."""
        source = self.folder / name
        source.write_text(mutant.text)
        flags = [*build.UNUSED_OUT, "-O0", "-I", str(self.sources / "core")]
        compiler.compile_object(source, self.folder / f"{source.stem}.o", self.host, flags)
        out = self.folder / "mutant.so"
        out.unlink(missing_ok=True)
        return compiler.link_shared(self.objects, out, self.host)

    def killed(self, name: str, mutant: Mutant) -> bool:
        """Whether compiler or tests find the mistake."""
        try:
            path = self.library(name, mutant)
        except RunError:
            return True
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S, MOST_CPU_S))
            os._exit(_tested(self.made, path, TESTS[name]))
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0

    def restore(self, name: str) -> None:
        """The file as it is."""
        original = self.sources / "core" / name
        flags = [*build.UNUSED_OUT, "-I", str(self.sources / "core")]
        compiler.compile_object(original, self.folder / f"{original.stem}.o", self.host, flags)


def _tested(made: Bundle, path: Path, tests: Sequence[str]) -> int:
    """pytest's exit code with that core; nothing of it is shown."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    fields = {name: getattr(made, name) for name in Bundle.__dataclass_fields__}
    other = Mutated(**fields, path=path)
    bundles.built = lambda *_: other  # type: ignore[assignment]
    return int(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests]))


def survivors(name: str, every: int = 1) -> tuple[int, list[Mutant]]:
    """(number of mutants tried, those that nothing found and that are not the same program)."""
    with tempfile.TemporaryDirectory() as folder:
        shop = Workshop(Path(folder))
        found = list(mutants((shop.sources / "core" / name).read_text()))
        tried = [m for m in found if not any(part in m.after for part in EQUAL)][::every]
        alive = [m for m in tried if not shop.killed(name, m)]
        shop.restore(name)
    return len(tried), alive


def main(names: list[str]) -> int:
    """Try all; 1 if any survives."""
    left = 0
    for name in names or TESTS:
        count, alive = survivors(name)
        print(f"{name}: {count} mutants, {len(alive)} survive", flush=True)
        for m in alive:
            print(f"{name}:{m.line}: {m.before}\n          -> {m.after}", flush=True)
        left += len(alive)
    return 1 if left else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
