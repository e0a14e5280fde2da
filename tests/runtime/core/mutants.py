"""Mutants of the gate: its C code with one small mistake each; the promises of gate.h must find every one.

    python -m tests.runtime.core.mutants

A mutant that survives is either a hole in the tests or the same program; the latter are listed in EQUAL with
the reason.
"""

import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from specs.errors import RunError
from tests.runtime.core.gate import CORE, Gate, build, check_all

SWAPS = (
    (r"(?<![-<=])<(?!=)", (" <=", " >")),
    (r"(?<![->=])>(?!=)", (" >=", " <")),
    (r"<=", ("<", ">=")),
    (r">=", (">", "<=")),
    (r"==", ("!=",)),
    (r"&&", ("||",)),
    (r"\|\|", ("&&",)),
    (r"(?<=[\w)\]]) \+ ", (" - ",)),
    (r"(?<=[\w)\]]) - ", (" + ",)),
    (r" \* ", (" / ",)),
    (r"(?<=[(, ])-(?=[\w])", ("",)),
    (r"!(?=[\w(])", ("",)),
    (r"\|=", ("=", "&=")),
    (r"\b0\.0\b", ("1.0", "0.1")),
    (r"(?<=[ (])0(?=[;, )])", ("1",)),
    (r"(?<=return )1\b", ("0",)),
    (r"\bfall\b", ("rise",)),
    (r"\brise\b", ("fall",)),
    (r"l->range", ("l->creep",)),
    (r"l->creep", ("l->range",)),
    (r"\blesser\((?=\w)", ("greater(",)),
    (r"\bgreater\((?=\w)", ("lesser(",)),
    (r"\bSLR_FIRST_JOINT_WALL : 0", ("0 : SLR_FIRST_JOINT_WALL", "SLR_WALLS : 0")),
    (r"\[axis\](?! = towards)", ("[0]",)),
    (r"i\+\+", ("i += 2",)),
)
EQUAL = {  # part of the mutated line: why it is the same program
    "return a  <= b ? a : b": "of equal numbers either is the lesser",
    "return a  >= b ? a : b": "of equal numbers either is the greater",
    "if (command  >= 0.0) return v->speed": "neutral is what is left of a neutral command",
    "return command  <= 0.0 && v->speed": "as above",
    "return command < 1.0 && v->speed": "only commands up to neutral come here",
    "return command < 0.1 && v->speed": "as above",
    "(a > 0.0 && b  <= 0.0)": "neutral is what is left of a neutral command",
    "(a < 0.0 && b  >= 0.0)": "as above",
    "const double low = held  >= 0.0": "from neutral both say -rise, for fall is not below rise",
    "const double high = held  <= 0.0": "as above",
}


@dataclass(frozen=True)
class Mutant:
    """One changed place."""

    line: int
    before: str
    after: str
    text: str


def mutants(text: str) -> Iterator[Mutant]:
    """Every mutant of the code in `text`, comments and preprocessor lines left alone."""
    offset, inside = 0, False  # a comment that goes on
    for number, line in enumerate(text.splitlines(keepends=True), 1):
        code = "" if inside else line.partition("/*")[0]
        inside = (inside or "/*" in line) and "*/" not in line
        if not code.startswith("#") and not _declares(code):
            for pattern, others in SWAPS:
                for match in re.finditer(pattern, code):
                    for other in others:
                        start, end = offset + match.start(), offset + match.end()
                        changed = line[: match.start()] + other + line[match.end() :]
                        yield Mutant(number, line.strip(), changed.strip(), text[:start] + other + text[end:])
        offset += len(line)


def _declares(code: str) -> bool:
    return bool(re.match(r"(static )?(int|double) \w+\([^;]*\) \{$|\s+double held\[", code.rstrip()))


def killed(mutant: Mutant, cases: int) -> bool:
    """Whether the promises (or the compiler) find the mistake."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            check_all(Gate(build(Path(folder), mutant.text, ["-O0"])), cases)
        except (AssertionError, RunError):
            return True
    return False


def survivors(cases: int = 20000) -> tuple[int, list[Mutant]]:
    """(number of mutants, those that nothing found and that are not the same program)."""
    every = list(mutants((CORE / "gate.c").read_text()))
    different = [m for m in every if not any(part in m.after for part in EQUAL)]
    alive = [m for m in different if not killed(m, cases)]
    return len(every), alive


if __name__ == "__main__":
    count, alive = survivors()
    print(f"{count} mutants, {len(alive)} survive")
    for m in alive:
        print(f"gate.c:{m.line}: {m.before}\n          -> {m.after}")
