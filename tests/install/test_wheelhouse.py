"""`.[runtime]` from a folder of wheels, without a network: on this computer and, emulated, on aarch64.

What is installed there runs `slewright` without what only simulation needs, repeats the lock-step drive of
the simulated machine bit for bit, and runs the whole runtime, all its processes, on a local bus.
"""

import importlib.util
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from runtime.bundle import Bundle
from runtime.can.busd import start_bus
from runtime.shared import private_folder
from tests.conftest import ROOT
from tests.install import material, roots

NOT_THERE = ("casadi", "torch", "fmpy", "pyarrow", "scipy", "control", "onnxruntime", "pytest")
WHEEL_OF_PIP = "usr/share/python-wheels"  # of Debian's python3-venv
SECONDS = 3.0


def script() -> ModuleType:
    """requirements/wheelhouse.py, which is no module of the project."""
    spec = importlib.util.spec_from_file_location("wheelhouse", ROOT / "requirements" / "wheelhouse.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


LOCK = """# a comment
first==1.0 ; python_full_version < '3.12' \\
    --hash=sha256:aa \\
    --hash=sha256:bb
    # via somebody
first==2.0 ; python_full_version >= '3.12' \\
    --hash=sha256:cc
other==3.1 ; platform_machine == 'x86_64' and sys_platform == 'linux' \\
    --hash=sha256:dd
windows-only==1 ; sys_platform == 'win32' \\
    --hash=sha256:ee
"""


def test_markers_are_those_of_the_computer_that_the_wheels_are_for() -> None:
    tool = script()
    here = tool.wanted(LOCK, tool.environment("x86_64", "3.11"))
    assert here == {
        "first": "first==1.0 --hash=sha256:aa --hash=sha256:bb",
        "other": "other==3.1 --hash=sha256:dd",
    }
    there = tool.wanted(LOCK, tool.environment("aarch64", "3.13"))
    assert there == {"first": "first==2.0 --hash=sha256:cc"}


@pytest.mark.parametrize("machine", ["x86_64", "aarch64"])
def test_the_runtime_lock_holds_nothing_that_only_simulation_needs(machine: str) -> None:
    tool = script()
    found = tool.wanted(tool.LOCKS["runtime"].read_text(), tool.environment(machine, "3.11"))
    assert {"numpy", "python-can", "pymodbus", "mcap", "cryptography"} <= set(found)
    assert set(found) & set(NOT_THERE) == set()


def test_platforms_begin_with_the_newest_glibc_and_name_the_old_ones_too() -> None:
    found = script().platforms("aarch64")
    assert found[0] == "manylinux_2_36_aarch64"
    assert {"manylinux_2_17_aarch64", "manylinux2014_aarch64"} <= set(found)


@pytest.fixture(scope="module")
def carried(tmp_path_factory: pytest.TempPathFactory) -> tuple[Bundle, Path]:
    return material.recorded(tmp_path_factory.mktemp("carried"))


@pytest.fixture(scope="module", params=["x86_64", "aarch64"])
def python(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of an environment that was made from the wheelhouse alone."""
    machine, folder = request.param, tmp_path_factory.mktemp(request.param)
    if machine == "aarch64":
        roots.need("qemu-aarch64")
        made, pip = emulated(roots.fresh("arm64"), folder / "environment")
    else:
        subprocess.run([sys.executable, "-m", "venv", str(folder / "environment")], check=True)
        made, pip = folder / "environment" / "bin" / "python", ["-m", "pip"]
    wheels = material.wheelhouse(machine, folder / "wheels")
    line = [str(made), *pip, "--isolated", "install", "--quiet", "--no-index", "--no-compile"]
    done = roots.run([*line, "--find-links", str(wheels), "slewright[runtime]"])
    assert done.returncode == 0, done.stderr
    return made


def emulated(root: Path, folder: Path) -> tuple[Path, list[str]]:
    """An environment whose python is a script that starts another computer's python; and how to call its pip.

    So the processes that it starts run emulated too, without a change to this computer's kernel.
    """
    (folder / "bin").mkdir(parents=True)
    (real,) = (root / "usr" / "bin").glob("python3.[0-9]*[0-9]")
    (folder / "lib" / real.name / "site-packages").mkdir(parents=True)
    (folder / "pyvenv.cfg").write_text("home = /usr/bin\ninclude-system-site-packages = false\n")
    made = folder / "bin" / "python"
    emulator = shutil.which("qemu-aarch64")
    made.write_text(f'#!/bin/sh\nexec {emulator} -L {root} -0 {made} {real} "$@"\n')
    made.chmod(0o755)
    (wheel,) = (root / WHEEL_OF_PIP).glob("pip-*.whl")
    return made, [str(wheel / "pip")]


@pytest.fixture
def bus() -> Iterator[Path]:
    folder = private_folder("slewright-test-")
    process = start_bus(folder / "bus")
    yield folder / "bus"
    process.terminate()
    process.wait()
    shutil.rmtree(folder)


def slewright(python: Path, *arguments: str, at: Path) -> subprocess.CompletedProcess[str]:
    return roots.run([str(python), "-m", "slewright", *arguments], cwd=at)


@pytest.mark.soak
def test_it_runs_without_what_it_must_not_need(python: Path, tmp_path: Path) -> None:
    found = f"import importlib.util as u; print([n for n in {NOT_THERE} if u.find_spec(n)])"
    assert roots.run([str(python), "-c", found], cwd=tmp_path).stdout.strip() == "[]"
    for command in ("run", "replay", "deploy"):
        done = slewright(python, command, "--help", at=tmp_path)
        assert done.returncode == 0, done.stderr
    done = slewright(python, "simulate", "x.ssp", "--out", "x.parquet", at=tmp_path)
    assert done.returncode == 2
    assert "pip install 'slewright[verify]'" in done.stderr


@pytest.mark.soak
def test_a_drive_in_lock_step_comes_out_the_same_to_the_last_bit(
    python: Path, carried: tuple[Bundle, Path], tmp_path: Path
) -> None:
    made, recording = carried
    done = slewright(
        python, "replay", str(recording), "--bundle", str(made.folder), "--json", "said", at=tmp_path
    )
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "said").read_text())
    assert (found["ticks"], found["gaps"], found["left_out"]) == (material.TICKS, 0, 0)


@pytest.mark.soak
def test_the_whole_runtime_runs(
    python: Path, carried: tuple[Bundle, Path], bus: Path, tmp_path: Path
) -> None:
    """No time is judged: an emulated computer has none."""
    (tmp_path / "machine.toml").write_text(
        f'bundle = "{carried[0].folder}"\n[can]\ninterface = "slewright"\nchannel = "{bus}"\n'
        '[realtime]\nfifo = false\nlock = false\n[recorder]\nfolder = "rec"\n[retain]\nfolder = "kept"\n'
    )
    asked = ["--config", "machine.toml", "--seconds", str(SECONDS), "--json", "said"]
    done = slewright(python, "run", *asked, at=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "said").read_text())
    assert found["ticks"] + found["skipped_ticks"] >= round(SECONDS / 0.02)
    assert found["unrecorded_ticks"] == 0
    assert list((tmp_path / "rec").glob("*.mcap"))
