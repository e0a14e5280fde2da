"""Which edges (line to line) of orchestrator/*.py a call takes."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import orchestrator

FOLDER = str(Path(orchestrator.__file__).parent)
Edge = tuple[str, int, int, int]  # function, its first line, line, next line

_names: dict[CodeType, str | None] = {}


def traced(call: Callable[[], Any], edges: set[Edge]) -> Any:
    """Return what `call` returns, its edges added to `edges`."""

    def enter(frame: FrameType, event: str, arg: Any) -> Any:
        code = frame.f_code
        name = _names.get(code, "")
        if name == "":
            inside = code.co_filename.startswith(FOLDER)
            name = _names[code] = f"{Path(code.co_filename).name}:{code.co_qualname}" if inside else None
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
