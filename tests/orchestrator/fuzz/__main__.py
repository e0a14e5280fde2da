"""`python -m tests.orchestrator.fuzz --minutes N [--until-quiet MIN]`: fuzz, then keep the smaller corpus."""

import argparse
import contextlib
import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from random import Random

from fmus.toolchain.build import BUILD
from tests.edges import Edge
from tests.orchestrator.fuzz.case import CORPUS, Case, read_corpus, write_corpus
from tests.orchestrator.fuzz.judge import Verdict, judge, limit_memory
from tests.orchestrator.fuzz.kinds import kinds
from tests.orchestrator.fuzz.mutate import Mutator
from tests.orchestrator.fuzz.seeds import packages, seeds
from tests.orchestrator.fuzz.stepper import Stepper, available

WORK = BUILD / "fuzz"
MAX_SIZE = 120_000  # characters of a case; larger ones are dropped
REPORT_S = 30.0
MEMORY = Path("/dev/shm")
ADDRESS = re.compile(r"0x[0-9a-f]+|==[0-9]+==")


class Fuzzer:
    """The cases that reached something new so far, and what was found wrong."""

    def __init__(self, seed: int, findings: Path, stepper: Stepper | None) -> None:
        self.stepper = stepper
        self.random, self.mutator, self.findings = Random(seed), Mutator(seed), findings
        self.cases: list[tuple[Case, frozenset[Edge]]] = []
        self.good: list[Case] = []  # those of them that are accepted
        self.seen: set[Edge] = set()
        self.runs = self.accepted = 0
        self.problems: dict[str, int] = {}
        self.last_new = time.monotonic()

    def run(self, case: Case) -> Verdict:
        """Judge a case and keep it if it reached a new edge."""
        edges: set[Edge] = set()
        verdict = judge(case, edges)
        self.runs += 1
        self.accepted += verdict.accepted
        problem = verdict.problem
        if verdict.accepted and self.stepper is not None and not case.foreign:
            problem, taken = self.stepper.step(case)
            edges |= {("C", 0, 0, number) for number in taken}
        if problem:
            self._found(case, problem)
        elif edges - self.seen:
            self.seen |= edges
            self.cases.append((case, frozenset(edges)))
            if verdict.accepted:
                self.good.append(case)
            self.last_new = time.monotonic()
        return verdict

    def step(self) -> None:
        """Mutate one case: mostly one that is accepted, as what is refused early hides what comes after."""
        if self.good and self.random.random() < 0.7:
            case = self.random.choice(self.good)
        else:
            case = self.random.choice(self.cases)[0]
        others = [c for c, _ in self.random.sample(self.cases, min(5, len(self.cases)))]
        mutated = self.mutator.mutate(case, others)
        if mutated != case and mutated.size < MAX_SIZE:
            self.run(mutated)

    def smallest(self) -> list[Case]:
        """Cases that together reach every edge, small ones first."""
        left, kept = set(self.seen), []
        for case, edges in sorted(self.cases, key=lambda item: item[0].size):
            if edges & left:
                left -= edges
                kept.append(case)
        return kept

    def _found(self, case: Case, problem: str) -> None:
        kind = ADDRESS.sub("0x", problem)[:120]
        self.problems[kind] = self.problems.get(kind, 0) + 1
        if self.problems[kind] == 1:
            self.findings.mkdir(parents=True, exist_ok=True)
            path = self.findings / f"{len(self.problems):03d}-{int(time.time())}.json"
            path.write_text(json.dumps({"problem": problem, "case": asdict(case)}, indent=1))
            print(f"FOUND {problem}\n  {path}", flush=True)


def _beginning() -> Iterator[Case]:
    yield from read_corpus()
    for path in sorted(WORK.glob("*.json.gz")):
        yield from read_corpus(path)
    yield from seeds()
    yield from kinds()
    yield from packages()


def main() -> int:
    """Fuzz until the time is over or nothing new came for long enough; exit 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.orchestrator.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="at most so long")
    parser.add_argument(
        "--until-quiet", type=float, metavar="MIN", help="stop when MIN minutes bring no edge"
    )
    parser.add_argument("--no-step", action="store_true", help="do not step what is accepted")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--keep", type=Path, metavar="FILE", help=f"write the corpus here, e.g. {CORPUS.name}"
    )
    options = parser.parse_args()
    if MEMORY.is_dir():  # thousands of small folders are made and removed
        os.environ["TMPDIR"] = tempfile.tempdir = str(MEMORY)
    stepper = None if options.no_step or not available() else Stepper()
    if stepper is None:
        print(
            "accepted cases are not stepped" + ("" if options.no_step else ": the compiler lacks sanitizers")
        )
    limit_memory()
    fuzzer = Fuzzer(options.seed, WORK / "findings", stepper)
    for case in _beginning():
        fuzzer.run(case)
    print(f"begin: {fuzzer.runs} cases, {len(fuzzer.seen)} edges, {fuzzer.accepted} accepted", flush=True)
    begin = time.monotonic()
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends it early, and keeps what it has
        _loop(fuzzer, 60.0 * options.minutes, 60.0 * (options.until_quiet or 1e9))
    quiet = time.monotonic() - max(fuzzer.last_new, begin)
    if stepper is not None:
        stepper.close()
    kept = fuzzer.smallest()
    write_corpus(kept, options.keep or WORK / "corpus.json.gz")
    print(f"end: {_state(fuzzer)}; {quiet / 60.0:.1f} min without a new edge; {len(kept)} cases kept")
    for problem, count in fuzzer.problems.items():
        print(f"  {count} x {problem}")
    return 1 if fuzzer.problems else 0


def _loop(fuzzer: Fuzzer, limit_s: float, quiet_s: float) -> None:
    begin = fuzzer.last_new = reported = time.monotonic()
    while (now := time.monotonic()) - begin < limit_s and now - fuzzer.last_new < quiet_s:
        fuzzer.step()
        if now - reported > REPORT_S:
            reported = now
            print(f"{(now - begin) / 60.0:6.1f} min: {_state(fuzzer)}", flush=True)
            write_corpus((case for case, _ in fuzzer.cases), WORK / "corpus.json.gz")


def _state(fuzzer: Fuzzer) -> str:
    return (
        f"{fuzzer.runs} inputs, {fuzzer.accepted} accepted, {len(fuzzer.seen)} edges, "
        f"{len(fuzzer.cases)} cases, {len(fuzzer.problems)} kinds of problem"
    )


if __name__ == "__main__":
    sys.exit(main())
