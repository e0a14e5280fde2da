"""What a control process asks of Linux: absolute deadlines, FIFO priority, locked memory, no collector.

Each of them may be refused; what was is said in `Rights`, shown as flags of the runtime and never hidden.
All calls are made once at the start but `sleep_until`, which is the only thing a cycle waits for.
"""

import ctypes
import gc
import os
import resource
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from runtime.image import Flag
from specs.errors import InputError

PRIORITY = 80  # SCHED_FIFO; above it only what the kernel itself needs (threaded interrupts have 50)
MCL_CURRENT, MCL_FUTURE = 1, 2  # sys/mman.h
TIMER_ABSTIME = 1  # time.h
PR_SET_TIMERSLACK = 29  # linux/prctl.h
EINTR = 4
CPU_LATENCY = "/dev/cpu_dma_latency"  # µs wanted, as 4 bytes, while the file is open
ISOLATED = Path("/sys/devices/system/cpu/isolated")  # by isolcpus=: outside the set that processes start with
STACK_BYTES = 256 * 1024  # touched once, so that no page of the stack is fetched in a cycle


class _Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


_libc = ctypes.CDLL(None, use_errno=True)
_nanosleep = getattr(_libc, "clock_nanosleep", None)  # not on macOS, where no cycle runs
_until = _Timespec()
_until_at = ctypes.byref(_until)
_kept_open: list[int] = []


@dataclass(frozen=True)
class Rights:
    """What the process was given; `reasons` says what not, and why."""

    fifo: bool = False
    locked: bool = False
    reasons: tuple[str, ...] = field(default=())

    @property
    def flags(self) -> Flag:
        """The bits that show what is missing."""
        missing = Flag(0) if self.fifo else Flag.NO_REALTIME
        return missing if self.locked else missing | Flag.NO_LOCK


def sleep_until(deadline_ns: int) -> None:
    """Sleep until CLOCK_MONOTONIC shows `deadline_ns`, whatever signals come or clocks are set."""
    if _nanosleep is None:
        time.sleep(max(0.0, (deadline_ns - time.monotonic_ns()) / 1e9))
        return
    _until.seconds, _until.nanoseconds = divmod(deadline_ns, 1_000_000_000)
    while _nanosleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, _until_at, None) == EINTR:
        continue


def acquire(fifo: bool = True, lock: bool = True, priority: int = PRIORITY) -> Rights:
    """Take what the system gives of FIFO scheduling and locked memory, and freeze the garbage collector."""
    _touch_stack()
    gc.collect()
    gc.freeze()
    gc.disable()
    _prctl(PR_SET_TIMERSLACK, 1)
    _stay_awake()
    reasons = [] if fifo else ["real-time priority was not asked for"]
    reasons += [] if lock else ["locked memory was not asked for"]
    got_fifo = fifo and _refusal("real-time priority", _take_fifo, priority, reasons)
    got_lock = lock and _refusal("locked memory", _lock_memory, 0, reasons)
    return Rights(got_fifo, got_lock, tuple(reasons))


def release() -> None:
    """Give FIFO and locked memory back (tests run more than a control process in one interpreter)."""
    gc.enable()
    gc.unfreeze()
    while _kept_open:
        os.close(_kept_open.pop())
    if hasattr(os, "sched_setscheduler"):
        kept = os.sched_getscheduler(0) & os.SCHED_RESET_ON_FORK  # only who is privileged may give that back
        os.sched_setscheduler(0, os.SCHED_OTHER | kept, os.sched_param(0))
    getattr(_libc, "munlockall", lambda: 0)()


def check_core(core: int | None) -> None:
    """Raise InputError naming the cores there are, if a core is not one of them."""
    if core is None or not hasattr(os, "sched_setaffinity"):
        return
    there = os.sched_getaffinity(0) | isolated()
    if core not in there:
        listed = ", ".join(map(str, sorted(there)))
        raise InputError(f"realtime.core: {core} is not one of this machine's; valid: {listed}")


def isolated() -> set[int]:
    """Cores that the kernel gives to nobody who does not ask for them by number (isolcpus=)."""
    try:
        text = ISOLATED.read_text().strip()
    except OSError:
        return set()
    ends = [part.partition("-") for part in text.split(",") if part]
    return {core for first, _, last in ends for core in range(int(first), int(last or first) + 1)}


def pin(core: int | None) -> None:
    """Keep this process on one core; raises InputError naming those there are."""
    check_core(core)
    if core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})


def voluntary_switches() -> int:
    """How often this thread gave the processor away by itself: it waited for something."""
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw


def _take_fifo(priority: int) -> None:
    # Children start without it: a helper that inherits real-time priority starves the machine.
    os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))


def _lock_memory(_: int) -> None:
    if _libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _refusal(what: str, take, argument: int, reasons: list[str]) -> bool:
    try:
        take(argument)
    except (OSError, AttributeError) as error:
        reasons.append(f"no {what}: {error}")
        return False
    return True


def _stay_awake() -> None:
    """Ask for processors that do not sleep deeply, until the process ends (kernel: PM quality of service)."""
    with suppress(OSError):
        _kept_open.append(os.open(CPU_LATENCY, os.O_WRONLY))
        os.write(_kept_open[-1], bytes(4))


def _prctl(option: int, value: int) -> None:
    if hasattr(_libc, "prctl"):
        _libc.prctl(option, ctypes.c_ulong(value), 0, 0, 0)


def _touch_stack() -> None:
    (ctypes.c_char * STACK_BYTES)()
