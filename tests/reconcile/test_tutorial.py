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
LAST = "--json found.json"  # of the command that takes long


def follow(page: Path, folder: Path, until: str = "") -> list[str]:
    """Write the page's files and run its commands, in order, up to one with `until`; returns those run."""
    done = []
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "SLEWRIGHT": str(ROOT)}
    for language, name, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if name:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        elif language == "sh":
            for line in text.splitlines():
                if until and until in line:
                    return done
                subprocess.run(["sh", "-ec", line], cwd=folder, check=True, env=environment)
                done.append(line)
    return done


def test_the_first_model_is_written_and_fits_the_recordings(tmp_path: Path):
    from reconcile.recordings.checks import open_folder, read_names
    from reconcile.recordings.data import read_run

    assert len(follow(PAGE, tmp_path, LAST)) == 2
    folder = open_folder(str(tmp_path / "rig"))
    names = read_names(tmp_path / "rig" / "map.toml", ["position", "velocity", "torque"])
    for file in ("ilqr.csv", "energy_shaping.csv"):
        assert read_run(tmp_path / file, folder, names)
    values = {v.name: v.start for v in folder.model.parameters}
    assert values["gravity_torque"] / values["inertia"] == pytest.approx(
        9.81 / 0.5, rel=0.1
    )  # a rod of 0.5 m


@pytest.mark.long
def test_every_command_of_the_page_ends_well(tmp_path: Path):
    commands = follow(PAGE, tmp_path)
    assert sum(c.startswith("slewright reconcile") for c in commands) == 2
    figures = json.loads((tmp_path / "found.json").read_text())
    assert set(figures["gap"]) == {"position", "velocity"}
    for e in figures["effects"]:
        assert e["subsystem"] and e["parameters"]  # noqa: PT018
