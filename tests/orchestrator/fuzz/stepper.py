"""Steps accepted cases in a process of its own, whose core is built with sanitizers; reads cases from stdin.

The process runs without address randomisation, so that the numbers of edges are the same in every one.
"""

import ctypes
import faulthandler
import json
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import asdict
from inspect import signature
from pathlib import Path
from typing import Any

from fmus.toolchain import compiler
from fmus.toolchain.build import BUILD
from orchestrator.core import native
from specs.errors import InputError, RunError
from tests.orchestrator.fuzz.case import Case, case_of

SANITIZED = BUILD / "fuzz" / "core"
FLAGS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")
COVERAGE = "-fsanitize-coverage=trace-pc"
TICKS = 3
LIMIT_S = 60.0  # for one case; far more than three ticks need
OPTIONS = {
    "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1:hard_rss_limit_mb=3000:exitcode=99",
    "UBSAN_OPTIONS": "print_stacktrace=1",
    "PYTHONMALLOC": "malloc",
}
RUNTIMES = ("libasan.so", "libubsan.so")


def available() -> bool:
    """Whether this machine's compiler has the sanitizers."""
    return all(Path(_runtime(name)).is_absolute() for name in RUNTIMES)


class Stepper:
    """A child process that steps cases; it is started again after it crashed."""

    def __init__(self) -> None:
        self.child: subprocess.Popen[str] | None = None
        self.log = tempfile.NamedTemporaryFile("w+", prefix="slewright-fuzz-", suffix=".log")  # noqa: SIM115
        self.cover = build()

    def step(self, case: Case) -> tuple[str, list[int]]:
        """(problem or "", numbers of the edges in C that were taken)."""
        child = self._started()
        assert child.stdin is not None
        assert child.stdout is not None
        try:
            child.stdin.write(json.dumps(asdict(case)) + "\n")
            child.stdin.flush()
        except OSError:
            return self._ended(child), []
        timer = _Killer(child, LIMIT_S)
        line = child.stdout.readline()
        timer.cancel()
        if not line:
            return self._ended(child) if not timer.late else f"stepping took more than {LIMIT_S} s", []
        answer = json.loads(line)
        return answer["problem"], answer["edges"]

    def close(self) -> None:
        """End the child."""
        if self.child is not None:
            self.child.kill()
            self.child.wait()

    def _started(self) -> "subprocess.Popen[str]":
        if self.child is None or self.child.poll() is not None:
            self.log.seek(0)
            self.log.truncate()
            preload = " ".join([*(_runtime(name) for name in RUNTIMES), str(self.cover)])
            self.child = subprocess.Popen(
                ["setarch", "-R", sys.executable, "-m", __name__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.log,
                text=True,
                preexec_fn=_unlimited,  # a sanitizer reserves more addresses than the parent may have
                env=os.environ | OPTIONS | {"LD_PRELOAD": preload},
            )
        return self.child

    def _ended(self, child: "subprocess.Popen[str]") -> str:
        code = child.wait()
        self.log.seek(0)
        report = self.log.read()
        for mark in ("ERROR: AddressSanitizer", "runtime error:"):
            if mark in report:
                return report[report.index(mark) :][:3000]
        return f"the stepping process ended with {code}: {report[-1500:]}"


class _Killer:
    """Kills a process that takes longer than a limit."""

    def __init__(self, child: "subprocess.Popen[str]", limit_s: float) -> None:
        import threading

        self.late, self.child = False, child
        self.timer = threading.Timer(limit_s, self._kill)
        self.timer.daemon = True
        self.timer.start()

    def _kill(self) -> None:
        self.late = True
        self.child.kill()

    def cancel(self) -> None:
        """The answer came."""
        self.timer.cancel()


def build() -> Path:
    """The library that counts edges, and the sanitized core (kept by the hash of its sources)."""
    folder = SANITIZED / native.source_hash()[:16]
    cover = folder / "cover.so"
    if not (folder / "complete").exists():
        folder.mkdir(parents=True, exist_ok=True)
        source = Path(__file__).with_name("cover.c")
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", str(source), "-o", str(cover)], check=True)
        native.build(folder, extra=(*FLAGS, COVERAGE, f"-Wl,{cover}"))
        (folder / "complete").touch()
    return cover


def _unlimited() -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))


def _runtime(name: str) -> str:
    done = subprocess.run(["cc", f"-print-file-name={name}"], capture_output=True, text=True, check=False)
    return done.stdout.strip()


# ---- in the child ----


def main() -> None:
    """Step the cases that come in, one a line; answer each with a line."""
    faulthandler.enable()
    folder = SANITIZED / native.source_hash()[:16]
    binaries = native.Binaries(folder / f"{native.LIBRARY}{compiler.host().suffix}", folder / native.HOST)
    native.binaries = lambda: binaries  # type: ignore[assignment]
    cover = ctypes.CDLL(None)
    edges = (ctypes.c_uint32 * 65536)()
    cover.cover_take.restype = ctypes.c_size_t
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # an FMU that prints does not disturb the answers
    for line in sys.stdin:
        problem = _step(case_of(json.loads(line)))
        count = cover.cover_take(edges, ctypes.c_size_t(len(edges)))
        out.write(json.dumps({"problem": problem, "edges": list(edges[:count])}) + "\n")
        out.flush()


def _step(case: Case) -> str:
    from orchestrator.run.simulate import simulate
    from orchestrator.system.check import load_system

    run: Any = simulate
    trust = {"trust": True} if "trust" in signature(simulate).parameters else {}
    with tempfile.TemporaryDirectory(prefix="slewright-fuzz-") as folder:
        try:
            run(load_system(case.write(Path(folder), real=True)), TICKS, **trust)
        except (InputError, RunError) as error:
            lines = len(str(error).splitlines())
            return f"a message of {lines} lines: {error}" if lines > 2 else ""
        except Exception as error:  # noqa: BLE001 (what comes out here is what is looked for)
            from tests.orchestrator.fuzz.judge import place

            return f"{type(error).__name__}: {error} {place(error)}"
    return ""


if __name__ == "__main__":
    main()
