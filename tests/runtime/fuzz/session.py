"""One fuzzing session over all targets: which cases reached something new, and what went wrong."""

import gzip
import json
import logging
import random
import subprocess
import tempfile
import time
import traceback
from pathlib import Path
from types import ModuleType
from typing import Any

from fmus import compiler
from tests.runtime.fuzz import frames, requests
from tests.runtime.fuzz.edges import Edge

TARGETS: dict[str, ModuleType] = {"frames": frames, "requests": requests}
CORPUS = Path(__file__).parent / "corpus.json.gz"
IMAGES = 20_000  # input images kept for the core with sanitizers


def read_corpus() -> dict[str, list[Any]]:
    """The cases kept, by target."""
    return json.loads(gzip.decompress(CORPUS.read_bytes())) if CORPUS.is_file() else {}


class Session:
    """Cases of all targets; the same seed and time of stopping make the same session."""

    def __init__(self, seed: int = 1) -> None:
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # it says of each what is wrong with it
        self.chance = random.Random(seed)
        self.cases: dict[str, list[tuple[Any, frozenset[Edge]]]] = {name: [] for name in TARGETS}
        self.seen: dict[str, set[Edge]] = {name: set() for name in TARGETS}
        self.problems: list[str] = []
        self.images: list[bytes] = []
        self.runs = 0
        self.last_new = time.monotonic()

    def begin(self) -> None:
        """Run the seeds and the corpus."""
        corpus = read_corpus()
        for name, target in TARGETS.items():
            for case in (*target.seeds(), *corpus.get(name, [])):
                self.run(name, [tuple(entry) for entry in case])

    def step(self) -> None:
        """Run one new case."""
        name = self.chance.choice(list(TARGETS))
        case = self.chance.choice(self.cases[name])[0]
        self.run(name, TARGETS[name].mutate(case, self.chance))

    def run(self, name: str, case: Any) -> None:
        """Run a case; keep it if it took a new edge."""
        edges: set[Edge] = set()
        images: list[bytes] = []
        self.runs += 1
        try:
            TARGETS[name].run(case, edges, images)
        except Exception:  # noqa: BLE001  (whatever it is, it is what is looked for)
            self.problems.append(f"{name}: {json.dumps(case)}\n{traceback.format_exc()}")
        if edges - self.seen[name]:
            self.seen[name] |= edges
            self.cases[name].append((case, frozenset(edges)))
            self.last_new = time.monotonic()
        if len(self.images) < IMAGES:
            self.images += images

    def sanitize(self) -> None:
        """The images seen once more, through the core compiled with sanitizers."""
        from tests.runtime.test_platforms import CHECKED, compiled, runner

        with tempfile.TemporaryDirectory() as folder:
            library = compiled(Path(folder), CHECKED)
            program = runner(Path(folder), compiler.host().name, CHECKED)
            done = subprocess.run(
                [str(program), str(library)], input=b"".join(self.images), capture_output=True, check=False
            )
        if done.returncode:
            self.problems.append("core with sanitizers: " + done.stderr[-2000:].decode())

    def state(self) -> str:
        """One line."""
        edges = ", ".join(f"{name} {len(found)} edges" for name, found in self.seen.items())
        return f"{self.runs} cases, {edges}, {len(self.problems)} problems"


def keep(session: Session) -> None:
    """Write the cases that together reach every edge, the short ones first."""
    kept = {}
    for name, cases in session.cases.items():
        left, kept[name] = set(session.seen[name]), []
        for case, edges in sorted(cases, key=lambda item: len(json.dumps(item[0]))):
            if edges & left:
                left -= edges
                kept[name].append(case)
    CORPUS.write_bytes(gzip.compress(json.dumps(kept, separators=(",", ":")).encode(), mtime=0))
