"""The tutorial's commands, as they are written there, in an empty folder."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

PAGE = ROOT / "docs" / "tutorials" / "reconcile-your-rig.md"
BLOCK = re.compile(r"^```(\w+)[ ]?(\S*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
RUBS = 0.035  # as in the page's record.py


def follow(page: Path, folder: Path) -> list[str]:
    """Write the page's files and run its commands, in order; returns the commands run."""
    done = []
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    for language, name, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if name:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        elif language == "sh":
            for line in text.splitlines():
                subprocess.run(["sh", "-ec", line], cwd=folder, check=True, env={**os.environ, "PATH": path})
                done.append(line)
    return done


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tutorial")
    commands = follow(PAGE, folder)
    assert sum(c.startswith("slewright reconcile") for c in commands) == 2
    return folder


@pytest.mark.long
def test_the_brushes_are_named_with_their_friction(followed: Path):
    figures = json.loads((followed / "found.json").read_text())
    assert figures["verdict"] == "named"
    assert [e["name"] for e in figures["effects"]] == ["coulomb_friction"]
    level = figures["effects"][0]["parameters"]["Fc"]
    assert level["value"] == pytest.approx(RUBS, rel=0.03)
    assert level["unit"] == "N.m"
    for gap in figures["gap"].values():
        assert gap["after"] < 0.1 * gap["reestimated"]


@pytest.mark.long
def test_the_extended_model_lacks_nothing_on_a_recording_it_has_not_seen(followed: Path):
    figures = json.loads((followed / "again.json").read_text())
    assert figures["verdict"] in ("agrees", "reestimated")
    assert figures["effects"] == []
    assert figures["residual_status"] == "at_floor"
