"""Follows a recipe of CONTRIBUTING.md in a copy of the project: its files written, its commands run."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.conftest import ROOT

PAGE = ROOT / "CONTRIBUTING.md"
BLOCK = re.compile(r"^```(\w+)[ ]?(>>)?[ ]?(\S*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Copy:
    """A copy of the project's files under version control."""

    folder: Path

    def run(self, command: str) -> str:
        """What a shell command prints, with the copy's modules; the test fails where the command does."""
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        env = {**os.environ, "PATH": path, "PYTHONPATH": str(self.folder), "COLUMNS": "200"}
        done = subprocess.run(
            ["bash", "-ec", command], cwd=self.folder, env=env, capture_output=True, text=True, timeout=280
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
        return done.stdout

    def python(self, code: str) -> str:
        """What a line of Python prints there."""
        return self.run(f"python -c '{code}'").strip()


def recipe(title: str) -> list[tuple[str, str, str, str]]:
    """The blocks below a heading: (language, ">>" or "", path or "", text)."""
    text = PAGE.read_text(encoding="utf-8")
    found = re.search(rf"^### {title}\n(.*?)(?=^### |\Z)", text, re.MULTILINE | re.DOTALL)
    assert found, f"CONTRIBUTING.md has no recipe '{title}'"
    return BLOCK.findall(found[1])


def follow(title: str, folder: Path) -> tuple[Copy, list[str]]:
    """The copy after the recipe, and the files that existed before and were edited by hand."""
    copy, edited = _copied(folder), list[str]()
    for language, append, name, text in recipe(title):
        path = folder / name
        if append:
            path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")
            edited.append(name)
        elif name:
            assert not path.exists(), f"{name} is there already"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        elif language == "sh":
            copy.run(text)
    return copy, edited


def _copied(folder: Path) -> Copy:
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    cache = ROOT / "build" / "cache"  # compiled objects, named by their content
    if cache.is_dir():
        shutil.copytree(cache, folder / "build" / "cache", copy_function=os.link, dirs_exist_ok=True)
    return Copy(folder)
