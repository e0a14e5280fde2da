"""Pools of worker processes: no tracebacks at Ctrl-C, ended with the parent."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_held(how: str = "SIG_BLOCK") -> Iterator[None]:
    """Keep Ctrl-C waiting (or with SIG_UNBLOCK let it through) until the end of the block.

    Ctrl-C reaches all processes of a terminal; one that still imports would answer with a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(getattr(signal, how), {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def warm_up() -> None:
    """What a worker does before its first job: see to it that it ends with the parent, however that ends.

    One that only waits for its next job would stay for ever.
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(1)
