"""The property: a file is accepted or refused, in bounded time and memory, and nothing else ever happens."""

import gc
import resource
import signal
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import orchestrator
from orchestrator.system import overview
from orchestrator.system.check import load_system
from specs.errors import InputError, RunError
from tests.edges import Edge, traced
from tests.orchestrator.fuzz.case import Case

LIMIT_S = 10.0  # processor time for one small input, tracing included
MEMORY = 3 * 1024**3
MESSAGE = 1500  # characters


class TooSlow(BaseException):
    """Past LIMIT_S."""


@dataclass(frozen=True)
class Verdict:
    """accepted, or refused with a message; `problem`: what must not happen, "" if nothing did."""

    accepted: bool
    message: str
    problem: str = ""


def limit_memory() -> None:
    """Let allocations beyond MEMORY fail in this process."""
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, hard))


def judge(case: Case, edges: set[Edge] | None = None) -> Verdict:
    """Load a case; its edges are added to `edges`."""
    with tempfile.TemporaryDirectory(prefix="slewright-fuzz-") as folder:
        path = case.write(Path(folder), real=True)
        try:
            with _Alarm():
                said = checked(path) if edges is None else traced(lambda: checked(path), orchestrator, edges)
        except (InputError, RunError) as error:
            return Verdict(False, str(error), _unfit(str(error)))
        except TooSlow:
            return Verdict(False, "", f"took more than {LIMIT_S} s")
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            return Verdict(False, "", f"{type(error).__name__}: {error} {place(error)}")
        finally:
            gc.collect(0)
    return Verdict(True, said or "", _unfit(said or ""))


def checked(path: Path) -> str:
    """What `slewright check` does: load the system, then look into its libraries; what that refuses, or "".

    A refusal by what the libraries hold leaves the system accepted: it is stepped with another one.
    """
    system = load_system(path)
    try:
        overview.figures(system)
    except InputError as error:
        return str(error)
    return ""


def _unfit(message: str) -> str:
    if len(message.splitlines()) > 2:
        return f"a message of {len(message.splitlines())} lines: {message!r}"
    return f"a message of {len(message)} characters: {message[:200]!r}" if len(message) > MESSAGE else ""


def place(error: BaseException) -> str:
    """Where in our own files an exception came from."""
    place, trace = "", error.__traceback__
    while trace is not None:
        file = Path(trace.tb_frame.f_code.co_filename)
        if file.parent.name == "orchestrator":
            place = f"({file.name}:{trace.tb_lineno})"
        trace = trace.tb_next
    return place


class _Alarm:
    """Raises TooSlow inside the block after LIMIT_S of processor time."""

    def __enter__(self) -> None:
        signal.signal(signal.SIGPROF, _raise)
        signal.setitimer(signal.ITIMER_PROF, LIMIT_S)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _raise(signum: int, frame: FrameType | None) -> None:
    raise TooSlow
