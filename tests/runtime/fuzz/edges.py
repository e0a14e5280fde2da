"""Which edges (line to line) of a package's files a call takes."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

Edge = tuple[str, int, int]  # function, line, next line


def traced(call: Callable[[], Any], package: ModuleType, edges: set[Edge]) -> Any:
    """Return what `call` returns, its edges inside `package` added to `edges`."""
    folder = str(Path(str(package.__file__)).parent)

    def enter(frame: FrameType, event: str, arg: Any) -> Any:
        code = frame.f_code
        if not code.co_filename.startswith(folder):
            return None
        name, before = f"{Path(code.co_filename).stem}.{code.co_qualname}", 0

        def line(frame: FrameType, event: str, arg: Any) -> Any:
            nonlocal before
            if event == "line":
                edges.add((name, before, frame.f_lineno - code.co_firstlineno))
                before = frame.f_lineno - code.co_firstlineno
            return line

        return line

    sys.settrace(enter)
    try:
        return call()
    finally:
        sys.settrace(None)
