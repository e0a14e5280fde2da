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

from fmus.toolchain import compiler
from tests.edges import Edge
from tests.runtime.fuzz import frames, requests, settings
from tests.runtime.fuzz.native import Native

TARGETS: dict[str, ModuleType] = {"frames": frames, "requests": requests, "settings": settings}
CORPUS = Path(__file__).parent / "corpus.json.gz"
IMAGES = 20_000  # input images kept for the core with sanitizers


def read_corpus() -> dict[str, list[Any]]:
    """The cases kept, by target."""
    return json.loads(gzip.decompress(CORPUS.read_bytes())) if CORPUS.is_file() else {}


class Session:
    """Cases of all targets; the same seed and time of stopping make the same session."""

    def __init__(self, seed: int = 1, native: Native | None = None) -> None:
        """`native`: the C code under sanitizers, to which all frames go, too."""
        self.native = native
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # it says of each what is wrong with it
        self.chance = random.Random(seed)
        self.cases: dict[str, list[tuple[Any, frozenset[Edge]]]] = {name: [] for name in TARGETS}
        self.seen: dict[str, set[Edge]] = {name: set() for name in TARGETS}
        self.problems: list[str] = []
        self.images: list[bytes] = []
        self.runs = 0
        self.last_new = time.process_time()  # a busy computer makes no session shorter

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
            if self.native and name == "frames":
                edges |= self.native.edges(frames.as_bytes(case))
        except Exception:  # noqa: BLE001  (whatever it is, it is what is looked for)
            self.problems.append(f"{name}: {json.dumps(case)}\n{traceback.format_exc()}")
        if edges - self.seen[name]:
            self.seen[name] |= edges
            self.cases[name].append((case, frozenset(edges)))
            self.last_new = time.process_time()
        if len(self.images) < IMAGES:
            self.images += images

    def sanitize(self) -> None:
        """The images seen, and all frames of the cases kept, once more through a library with sanitizers."""
        from tests.runtime.core.test_platforms import CHECKED, WIRE_RUNNER, compiled, runner

        host = compiler.host().name
        with tempfile.TemporaryDirectory() as folder:
            library = compiled(Path(folder), CHECKED)
            core = runner(Path(folder), host, CHECKED)
            wire = runner(Path(folder), host, CHECKED, WIRE_RUNNER)
            cases = [frames.as_bytes(case) for case, _ in self.cases["frames"]]
            self._checked("core", [str(core), str(library)], b"".join(self.images))
            self._checked("frames", [str(wire), str(library)], b"".join(cases))

    def _checked(self, what: str, command: list[str], given: bytes) -> None:
        done = subprocess.run(command, input=given, capture_output=True, check=False)
        if done.returncode:
            self.problems.append(f"{what} with sanitizers: " + done.stderr[-2000:].decode())

    def quiet_s(self) -> float:
        """Processor time since the last new edge."""
        return time.process_time() - self.last_new

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
