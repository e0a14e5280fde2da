"""Work that ends its process, or never ends; apart from the tests, whose imports each process would do."""

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

from verification.campaign.worker import Result, Task, work


def killed_once(marker: str, tasks: Sequence[Task]) -> list[Result]:
    """Ends its process in the middle of the first batch that it is given."""
    if not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return work(tasks)


def killed_by(key: str, tasks: Sequence[Task]) -> list[Result]:
    """Ends its process whenever it is to do the run `key`."""
    if any(task["key"] == key for task in tasks):
        os.kill(os.getpid(), signal.SIGKILL)
    return work(tasks)


def sleepy(tasks: Sequence[Task]) -> list[Result]:
    Path(tasks[0]["marker"]).write_text(str(os.getpid()))
    time.sleep(60.0)
    return []
