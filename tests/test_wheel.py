"""The wheel brings the compiled core: a run needs no compiler; a core of other sources is refused."""

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from benchmarks.orchestrator import chain
from records.record import read
from slewright.app import ROOMS
from tests.conftest import ROOT
from tests.test_house import tracked_files

# What an environment that cannot compile has not, and what would find this checkout.
HIDDEN = ("ziglang", "slewright", "__editable__", "_editable", "casadi")
TICKS = 50


def run(line: list[str], **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(line, capture_output=True, text=True, check=False, timeout=200, **options)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built without an index."""
    out = tmp_path_factory.mktemp("wheel")
    offline = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--disable-pip-version-check"]
    done = run([sys.executable, "-m", "pip", "wheel", str(ROOT), *offline, "--wheel-dir", str(out)])
    assert done.returncode == 0, done.stderr
    (path,) = out.glob("*.whl")
    return path


@pytest.fixture
def installed(wheel: Path, tmp_path: Path) -> Path:
    """A folder that the wheel is installed to."""
    offline = ["--no-deps", "--no-index", "--quiet", "--disable-pip-version-check", "--no-compile"]
    done = run(
        [sys.executable, "-m", "pip", "install", str(wheel), *offline, "--target", str(tmp_path / "site")]
    )
    assert done.returncode == 0, done.stderr
    return tmp_path / "site"


@pytest.fixture(scope="module")
def dependencies(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages of this environment, without a compiler and without this project."""
    folder = tmp_path_factory.mktemp("dependencies")
    for entry in Path(sysconfig.get_path("purelib")).iterdir():
        if not entry.name.startswith(HIDDEN):
            (folder / entry.name).symlink_to(entry)
    return folder


def slewright(site: Path, dependencies: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`slewright` of the installed wheel, where neither `cc` nor ziglang is to be found."""
    environment = {**os.environ, "PYTHONPATH": f"{site}{os.pathsep}{dependencies}", "PATH": str(site)}
    environment.pop("PYTHONHOME", None)
    line = [sys.executable, "-S", "-m", "slewright", *arguments]
    return run(line, cwd=site, env=environment)


@pytest.mark.long
def test_the_wheel_is_of_one_platform_and_names_no_python(wheel: Path):
    name, version, python, abi, platform = wheel.stem.split("-")
    assert (name, python, abi) == ("slewright", "py3", "none")
    assert version
    machine = sysconfig.get_platform().rpartition("-")[2]
    assert platform.endswith(machine)
    assert platform != "any"


def test_it_holds_every_file_of_the_rooms(wheel: Path):
    packed = set(zipfile.ZipFile(wheel).namelist())
    rooms = {str(f.relative_to(ROOT)) for f in tracked_files() if f.relative_to(ROOT).parts[0] in ROOMS}
    assert {"specs/signals.toml", "slewright/__main__.py"} <= rooms
    assert rooms - packed == set()
    assert not any(name.startswith("tests/") for name in packed)


@pytest.mark.parametrize("folder", ["runtime/hmi/page", "runtime/systemd", "specs/scenarios"])
def test_what_is_no_python_is_in_it(wheel: Path, folder: str):
    """Of the operator's page a missing script is seen by whoever opens it, and by nobody before."""
    with zipfile.ZipFile(wheel) as archive:
        inside = {n: archive.read(n) for n in archive.namelist() if n.startswith(f"{folder}/")}
    files = [p for p in (ROOT / folder).iterdir() if p.is_file()]
    assert {f"{folder}/{p.name}": p.read_bytes() for p in files} == inside
    assert len(files) > 2


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="glibc is Linux's")
def test_a_manylinux_wheel_asks_for_no_newer_glibc(wheel: Path):
    if "manylinux" not in wheel.name:
        pytest.skip("built with the system's compiler: ziglang is not installed")
    with zipfile.ZipFile(wheel) as archive:
        names = [n for n in archive.namelist() if n.startswith("orchestrator/core/bin/")]
        assert len(names) == 2
        for name in names:
            wanted = {part.split(b"\0")[0] for part in archive.read(name).split(b"GLIBC_")[1:]}
            versions = {tuple(map(int, w.split(b"."))) for w in wanted if w[:1].isdigit()}
            assert versions
            assert max(versions) <= (2, 17)


@pytest.mark.parametrize("how", ["--trust", "isolated"])
def test_a_system_runs_where_there_is_no_compiler(
    installed: Path, dependencies: Path, tmp_path: Path, how: str
):
    out = tmp_path / "run.parquet"
    stop = str(TICKS * chain.STEP_S)
    more = ["--trust"] if how == "--trust" else []
    system = str(chain.build(2).whole_ssp)
    record = ["--record", "all"]
    done = slewright(
        installed, dependencies, "simulate", system, "--out", str(out), "--stop", stop, *record, *more
    )
    assert done.returncode == 0, done.stderr
    result = read(out)
    assert result.table.num_rows == TICKS + 1
    y, rate = 0.0, 0.0
    for _ in range(TICKS):  # the link a, driven by its start value 0.5
        rate += chain.STEP_S * ((1.0 - y * y) * rate - y + 0.5)
        y += chain.STEP_S * rate
    assert result.column("a.y")[-1] == pytest.approx(y, rel=1e-12)
    assert not (installed / "build" / "core").exists()


def test_a_core_of_other_sources_is_refused(installed: Path, dependencies: Path, tmp_path: Path):
    source = installed / "orchestrator" / "core" / "run.c"
    source.write_text(source.read_text() + "/* changed */\n")
    system = str(chain.build(2).ssp)
    done = slewright(installed, dependencies, "simulate", system, "--out", str(tmp_path / "x.parquet"))
    assert done.returncode == 2
    assert "compiled from other sources" in done.stderr
    assert "install the package again" in done.stderr
    assert len(done.stderr.strip().splitlines()) <= 4, done.stderr
