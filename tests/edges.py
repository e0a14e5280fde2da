"""Which edges (line to line) of a package's files a call takes: what the fuzzers keep their cases by."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

Edge = tuple[str, int, int, int]  # function, its first line, line, next line
_names: dict[tuple[CodeType, str], str | None] = {}


def folder_of(package: ModuleType) -> str:
    """Where a package's files lie."""
    return str(Path(str(package.__file__)).parent)


def traced(call: Callable[[], Any], package: ModuleType, edges: set[Edge]) -> Any:
    """Return what `call` returns, its edges inside `package` added to `edges`."""
    folder = folder_of(package)

    def enter(frame: FrameType, event: str, arg: Any) -> Any:
        code = frame.f_code
        name = _names.get((code, folder), "")
        if name == "":
            inside = code.co_filename.startswith(folder)
            name = f"{Path(code.co_filename).name}:{code.co_qualname}" if inside else None
            _names[code, folder] = name
        if name is None:
            return None
        first, before = code.co_firstlineno, 0

        def line(frame: FrameType, event: str, arg: Any) -> Any:
            nonlocal before
            if event == "line":
                at = frame.f_lineno - first
                edges.add((name, first, before, at))
                before = at
            return line

        return line

    sys.settrace(enter)
    try:
        return call()
    finally:
        sys.settrace(None)
