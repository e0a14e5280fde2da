"""The first lines of every process of the runtime: `python -m runtime.child PARENT FOLDER MODULE ARGUMENTS`.

Before anything is imported the process asks to be ended with the one that started it, and looks whether that
one, PARENT, still is its parent: so no process of a runtime lives on without its supervisor, whenever that
was killed.  FOLDER is the run's shared memory, or empty: the last to leave it removes it.
"""

import ctypes
import fcntl
import os
import runpy
import shutil
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

PR_SET_PDEATHSIG = 1  # linux/prctl.h
YOUNG_S = 60.0  # for which a folder may still be in the making
USED = "in-use"  # in a run's folder: locked, and shared, by each of its processes


def die_with_parent(number: int) -> None:
    """Be sent this signal when the process that started this one ends, however it ends."""
    prctl = getattr(ctypes.CDLL(None), "prctl", None)  # Linux only
    if prctl:
        prctl(PR_SET_PDEATHSIG, ctypes.c_ulong(number), 0, 0, 0)


def end_with_parent(parent: int) -> None:
    """Be ended when the parent ends; end now if it has ended already."""
    die_with_parent(signal.SIGTERM)
    if os.getppid() != parent:
        sys.exit(f"slewright: the process {parent} that started this one has ended")


def use(folder: Path) -> IO[str]:
    """Say that this process uses a run's folder, until the file returned is closed."""
    held = (folder / USED).open("w")
    fcntl.flock(held, fcntl.LOCK_SH)
    return held


def remove_unused(folder: Path) -> None:
    """Remove a run's folder if no process uses it any more."""
    with suppress(OSError):
        descriptor = os.open(folder / USED, os.O_RDWR | os.O_CLOEXEC)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(descriptor)


def left_by_older(folder: Path) -> bool:
    """Whether a folder is of an older version, which did not say who uses it, and no process here does.

    Such a one is named, not removed: its processes may be those of another container.
    """
    if (folder / USED).exists() or time.time() - folder.stat().st_mtime < YOUNG_S:
        return False
    return not any(_names(process, folder) for process in Path("/proc").glob("[0-9]*"))


def _names(process: Path, folder: Path) -> bool:
    """Whether a process has the folder's name in its arguments, or a file of it in its memory."""
    for part in ("cmdline", "maps"):
        with suppress(OSError):
            if os.fsencode(folder) in (process / part).read_bytes():
                return True
    return False


def main() -> None:
    """Run MODULE with what follows it, as `python -m MODULE` would."""
    parent, folder, module = int(sys.argv[1]), sys.argv[2], sys.argv[3]
    end_with_parent(parent)
    sys.argv = sys.argv[3:]
    held = use(Path(folder)) if folder else None
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    finally:
        if held:
            held.close()
            if os.getppid() != parent:  # else the supervisor removes it
                remove_unused(Path(folder))


if __name__ == "__main__":
    main()
