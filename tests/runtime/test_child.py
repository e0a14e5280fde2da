"""A process of the runtime ends with its parent, whenever that is killed, and shared memory does not stay."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from runtime.child import USED, end_with_parent, left_by_older, remove_unused, use
from runtime.shared import Cell

PATIENCE_S = 60.0
PARENT = """
import os, subprocess, sys
from runtime.helpers import Helper
helper = Helper("one", "tests.runtime.sleeper", {mark!r}, __import__("pathlib").Path({folder!r}))
helper.start()
print(helper.pid, flush=True)
{then}
"""


def there(pid: int) -> bool:
    """Whether a process runs; one that ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def until_gone(pid: int) -> None:
    end = time.monotonic() + PATIENCE_S
    while there(pid):
        assert time.monotonic() < end, "it lives on"
        time.sleep(0.01)


def started(tmp_path: Path, then: str) -> tuple[subprocess.Popen[str], int]:
    code = PARENT.format(mark=str(tmp_path / "mark"), folder=str(tmp_path / "run"), then=then)
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout
    return parent, int(parent.stdout.readline())


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel tells of a parent's death on Linux only")
@pytest.mark.parametrize("delay_s", [0.0, 0.01, 0.03, 0.1, 1.0])
def test_a_child_ends_with_a_parent_that_is_killed_at_any_moment(tmp_path: Path, delay_s: float):
    (tmp_path / "run").mkdir()
    parent, child = started(tmp_path, "import time; time.sleep(600)")
    time.sleep(delay_s)
    parent.kill()
    parent.wait()
    until_gone(child)


def test_the_last_process_of_a_run_removes_its_folder(tmp_path: Path):
    folder = tmp_path / "run"
    folder.mkdir()
    first, second = use(folder), use(folder)
    first.close()
    remove_unused(folder)
    assert folder.is_dir()
    second.close()
    remove_unused(folder)
    assert not folder.exists()
    remove_unused(folder)  # gone already


def test_a_parent_that_has_gone_is_noticed():
    with pytest.raises(SystemExit, match="has ended"):
        end_with_parent(1 if os.getppid() != 1 else 2)


def test_a_folder_that_says_nothing_is_left_alone(tmp_path: Path):
    (tmp_path / "other").mkdir()
    remove_unused(tmp_path / "other")
    assert (tmp_path / "other").is_dir()
    assert not (tmp_path / "other" / USED).exists()


def test_a_folder_of_an_older_version_is_named_when_nobody_uses_it(tmp_path: Path):
    folder = tmp_path / "slewright-old"
    folder.mkdir()
    cell = Cell.create(folder / "counts.cell", 8, "counts")
    assert not left_by_older(folder)  # young
    os.utime(folder, (1, 1))
    assert not left_by_older(folder)  # this process has it in its memory
    cell.close()
    assert left_by_older(folder)
    command = [sys.executable, "-c", "print(flush=True); input()", str(folder)]
    waiting = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert waiting.stdout
    waiting.stdout.readline()  # its arguments are to be read once it runs
    assert not left_by_older(folder)  # another has it in its arguments
    waiting.communicate(b"\n")
    assert left_by_older(folder)
    use(folder).close()
    assert not left_by_older(folder)  # this version's, which is removed
    assert folder.exists()
