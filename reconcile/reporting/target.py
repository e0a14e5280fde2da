"""DIR, where the report goes: checked before anything is computed, written in one go at the end."""

import json
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from specs.errors import InputError, RunError

REPORT, PAGE = "report.json", "report.html"
BEFORE = "before"  # folder: the answer whose experiment was driven


def check(out: Path, used: Iterable[Path]) -> None:
    """Raise InputError if DIR is no folder to write to, holds something else, or holds what is `used`.

    A DIR that an earlier reconcile wrote is replaced, so long as nothing was put beside its files.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder for the report")
    _check_writable(out)
    if not out.is_dir() or not any(out.iterdir()):
        return
    foreign = _foreign(out)
    if foreign:
        raise InputError(f"{out} holds {foreign}, which is not from reconcile; name a new or empty folder")
    for path in used:
        if path.resolve().is_relative_to(out.resolve()):
            raise InputError(f"{path} lies in {out}, which would be replaced; name another folder")


def _check_writable(out: Path) -> None:
    above = next(p for p in (out.absolute(), *out.absolute().parents) if p.exists())
    if not above.is_dir():
        raise InputError(f"{out}: {above} is a file, not a folder")
    try:
        Path(tempfile.mkdtemp(prefix=".reconcile-", dir=above)).rmdir()
        if above == out.absolute():  # it is renamed: the folder around it counts, too
            Path(tempfile.mkdtemp(prefix=".reconcile-", dir=above.parent)).rmdir()
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror} ({above})") from None


def _foreign(out: Path) -> str:
    """The first entry of a folder that no earlier reconcile wrote; "" if there is none."""
    try:
        report: Any = json.loads((out / REPORT).read_text(encoding="utf-8"))
        own = {REPORT, BEFORE, *report["files"]} if "verdict" in report and "gap" in report else set()
    except (OSError, ValueError, KeyError, TypeError):
        own = set()
    return next((name for name in sorted(p.name for p in out.iterdir()) if name not in own), "")


@contextmanager
def first_page(out: Path) -> Iterator[Path]:
    """Beside DIR, a page for as long as the report is not there; it goes when the block ends."""
    page = out.with_name(f"{out.absolute().name}-first.html")
    try:
        yield page
    finally:
        page.unlink(missing_ok=True)


@contextmanager
def staged(out: Path) -> Iterator[Path]:
    """A folder that takes the place of DIR when the block ends well, and goes when it does not.

    Raises RunError if the disk refuses.
    """
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f"{out.name}.part-", dir=out.absolute().parent))
        part.chmod(0o755)
        try:
            yield part
            _replace(out, part)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    except OSError as error:
        raise RunError(f"cannot write {out}: {error.strerror or error}") from error


def _replace(out: Path, part: Path) -> None:
    if not out.exists():
        part.rename(out)
        return
    old = part.with_name(part.name + "-old")
    out.rename(old)
    try:
        part.rename(out)
    except OSError:
        old.rename(out)
        raise
    shutil.rmtree(old, ignore_errors=True)
