"""A contestant in a process of its own: other people's libraries may end it, and it is survived.

    python -m benchmarks.orchestrator.child KEY FMI_VERSION

reads a number of steps a line and answers with a line of JSON: a Run, or {"reason"} and the end.
"""

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, Self, TextIO, cast

from benchmarks.orchestrator import chain as chains
from benchmarks.orchestrator.contestants import Contestant, NotMeasured
from benchmarks.orchestrator.registry import REGISTRY

CHECK_STEPS = 100  # after which all contestants show the same values
PATIENCE_S = 60.0
UNDISTURBED = 0.9  # processor time in time, of a run that nobody disturbed
TOO_LONG_S, TRIES = 0.01, 3  # a long run is always disturbed, if little
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Run:
    """What a run came to: time a contestant says it took, share of it on a processor, and what it wrote."""

    steps: int
    seconds: float
    busy: float
    bytes: int  # 0 where nothing is written
    inside: float  # s inside the FMUs, 0 where this is not measured


class Child:
    """The parent's side of one contestant."""

    def __init__(self, key: str, fmi_version: int) -> None:
        """Start it and check its first steps; raises NotMeasured if it cannot run the chain."""
        self.key, self.fmi_version = key, fmi_version
        self.said = tempfile.TemporaryFile("w+")  # noqa: SIM115 (closed with the child)
        command = [sys.executable, "-m", "benchmarks.orchestrator.child", key, str(fmi_version)]
        self.process = subprocess.Popen(
            command,
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.said,
            text=True,
            bufsize=1,
        )
        self.orders, self.answers = cast(IO[str], self.process.stdin), cast(IO[str], self.process.stdout)
        try:
            self.values: list[float] = self._answer()["values"]
        except NotMeasured:
            self.close()
            raise

    def run(self, steps: int) -> Run:
        """`steps` further steps; a run during which others had its processor is tried again."""
        for _ in range(TRIES - 1):
            run = self._try(steps)
            if run.busy > UNDISTURBED or run.seconds > TOO_LONG_S:
                return run
        return self._try(steps)

    def _try(self, steps: int) -> Run:
        with contextlib.suppress(BrokenPipeError):  # the answer says why
            self.orders.write(f"{steps}\n")
        return Run(**self._answer())

    def _answer(self) -> dict[str, Any]:
        if not select.select([self.answers], [], [], PATIENCE_S)[0]:
            self.process.kill()
            raise NotMeasured(f"no answer within {PATIENCE_S:.0f} s")
        line = self.answers.readline()
        if not line:
            raise NotMeasured(self._end())
        answer = json.loads(line)
        if "reason" in answer:
            raise NotMeasured(answer["reason"])
        return answer

    def _end(self) -> str:
        """How the process ended, with the last line it said."""
        code = self.process.wait(PATIENCE_S)
        self.said.seek(0)
        last = self.said.read().split("\n")[-2:]
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        return f"the process {how}" + (f": {' '.join(last).strip()[:200]}" if any(last) else "")

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.communicate()
        self.said.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _own_output() -> TextIO:
    """Standard output for the answers alone: whatever a library prints goes to standard error."""
    ours = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    return ours


def _timed(contestant: Contestant, steps: int) -> Run:
    wall, cpu = time.perf_counter(), time.process_time()
    seconds = contestant.run(steps)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    written, inside = getattr(contestant, "bytes", 0), getattr(contestant, "inside", 0.0)
    return Run(steps, seconds, cpu / wall, written, inside)


def _answers(key: str, fmi_version: int, lines: Iterator[str]) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        try:
            contestant = REGISTRY[key](chains.build(fmi_version), Path(folder))
            contestant.run(CHECK_STEPS)
            yield {"values": contestant.values()}
            for line in lines:
                yield asdict(_timed(contestant, int(line)))
        except NotMeasured as why:
            yield {"reason": str(why)}
        except ModuleNotFoundError as error:
            yield {"reason": f"{error.name} is not installed"}
        except Exception as error:  # noqa: BLE001 (it is handed to the parent)
            yield {"reason": f"{type(error).__name__}: {error}"}


def main(key: str, fmi_version: str) -> None:
    """The child's side."""
    out = _own_output()
    for answer in _answers(key, int(fmi_version), iter(sys.stdin.readline, "")):
        print(json.dumps(answer), file=out, flush=True)
    os._exit(0)  # no library's clean-up may turn a measured result into a crash


if __name__ == "__main__":
    main(*sys.argv[1:])
