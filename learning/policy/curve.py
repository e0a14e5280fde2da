"""The learning curve of a training: a line of figures an iteration, and the same for TensorBoard."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NAME = "curve.jsonl"


class Log:
    """The learning curve, as lines and for TensorBoard; what lies beyond the checkpoint is taken back."""

    def __init__(self, out: Path, done: int) -> None:
        self.path, self.last = out / NAME, {}
        rows = _rows(self.path)[:done]
        self.path.write_text("".join(json.dumps(r) + "\n" for r in rows), encoding="utf-8")
        self.last = rows[-1] if rows else {}
        self.writer = _writer(out, done)

    def __enter__(self) -> "Log":
        self.file = self.path.open("a", encoding="utf-8")
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()
        if self.writer is not None:
            self.writer.close()

    def add(self, iteration: int, figures: Mapping[str, float]) -> None:
        """A line, and a point of each curve."""
        self.last = {"iteration": iteration, **figures}
        self.file.write(json.dumps(self.last) + "\n")
        self.file.flush()
        if self.writer is not None:
            for name, value in figures.items():
                self.writer.add_scalar(name, value, iteration)


def _rows(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        return []
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            break  # half a line: the run was ended while it was written
    return found


def _writer(out: Path, done: int) -> Any:
    """TensorBoard's writer; None where it is not installed: the curve is in the lines as well."""
    try:
        from torch.utils.tensorboard.writer import SummaryWriter
    except ModuleNotFoundError:
        return None
    return SummaryWriter(str(out), purge_step=done + 1)
