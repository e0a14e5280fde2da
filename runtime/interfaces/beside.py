"""What every process of an interface does first and last: its library, its priority, its end."""

import importlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from runtime.helpers import told_to_end
from specs.errors import InputError

NICE = 10  # below everything that the machine needs
LOOK_S = 0.005  # between two looks at the images, which are new every 20 ms


def library(module: str, package: str, whose: str) -> ModuleType:
    """A library that is not in every install; InputError that says how to get it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(
            f"{whose}: {package} cannot be loaded ({error}); pip install 'slewright[interfaces]'"
        ) from None


def ready(told_port: str, text: object) -> None:
    """Tell the supervisor that the interface serves: its port, whole at once."""
    path = Path(told_port)
    made = path.with_name(path.name + ".new")
    made.write_text(str(text))
    made.replace(path)


def until_told(work: Callable[[], None], every_s: float = LOOK_S) -> None:
    """Do it again and again until the process is told to end."""
    os.nice(NICE)
    while not told_to_end():
        work()
        time.sleep(every_s)
