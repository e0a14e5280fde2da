"""What our FMUs carry in themselves (FMI-LS-REF): they do it, and one that does otherwise is found out."""

import csv
import json
import shutil
import struct
import zipfile
from pathlib import Path

import pytest

from fmus.toolchain.build import FMI_VERSIONS, build_fmu
from fmus.toolchain.loader import model_folders
from fmus.toolchain.reference import FOLDER
from tests.conftest import Command
from verification.reference import compare, experiments

OSCILLATOR = Path(__file__).parents[1] / "samples" / "oscillator"
SMALL = 25_000  # bytes, packed
ROUNDED = 1e-8  # of a signal's largest value: nine digits


@pytest.mark.parametrize("version", FMI_VERSIONS)
@pytest.mark.parametrize("name", sorted(model_folders()))
def test_every_fmu_does_what_it_carries(name: str, version: int) -> None:
    fmu = build_fmu(name, version)
    (experiment,) = experiments.read(fmu)
    signals, notes = compare.run(fmu, experiment, "any", None)
    assert notes == []
    assert experiment.tolerance is not None
    assert [s.name for s in signals if s.difference > s.allowed * ROUNDED / experiment.tolerance] == []


@pytest.mark.parametrize("name", sorted(model_folders()))
def test_references_are_small_and_show_something(name: str) -> None:
    with zipfile.ZipFile(build_fmu(name, 2)) as archive:
        carried = [entry for entry in archive.infolist() if entry.filename.startswith(FOLDER)]
        head, *rows = csv.reader(archive.read(FOLDER + "outputs.csv").decode().splitlines())
    assert sum(entry.compress_size for entry in carried) < SMALL
    moving = [n for n, column in zip(head, zip(*rows, strict=True), strict=True) if len(set(column)) > 1]
    assert len(moving) > 1  # more than the time


def test_both_versions_carry_the_same() -> None:
    carried = []
    for version in FMI_VERSIONS:
        with zipfile.ZipFile(build_fmu("arm", version)) as archive:
            names = [n for n in archive.namelist() if n.startswith(FOLDER)]
            carried.append({n: archive.read(n) for n in names})
    assert carried[0] == carried[1] != {}


def test_another_computation_is_found_out(slewright_here: Command, tmp_path: Path) -> None:
    """A model whose stiffness is changed in its code, with the reference of the one before."""
    right = build_fmu(OSCILLATOR, 2, out=tmp_path / "right")
    folder = tmp_path / "oscillator"
    shutil.copytree(OSCILLATOR, folder)
    text = (folder / "model.py").read_text()
    (folder / "model.py").write_text(text.replace("-p.stiffness *", "-1.0001 * p.stiffness *"))
    wrong = tmp_path / "wrong.fmu"
    changed = build_fmu(folder, 2, out=tmp_path / "changed")
    with zipfile.ZipFile(changed) as new, zipfile.ZipFile(right) as old, zipfile.ZipFile(wrong, "w") as out:
        for name in new.namelist():
            out.writestr(name, (old if name.startswith(FOLDER) else new).read(name))
    for fmu, code in ((right, 0), (wrong, 1)):
        done = slewright_here("check", fmu, "--reference", "--json", tmp_path / "r.json")
        assert done.returncode == code, done.stderr
    found = json.loads((tmp_path / "r.json").read_text())["reference"]["steps"]["signals"]["angle"]
    assert found["difference"] > found["allowed"]


def test_a_damaged_fmu_is_refused(slewright_here: Command, tmp_path: Path) -> None:
    fmu = tmp_path / "arm.fmu"
    data = bytearray(build_fmu("arm", 2).read_bytes())
    place = data.index(f"{FOLDER}outputs.csv".encode()) + len(f"{FOLDER}outputs.csv") + 40
    data[place] ^= 0xFF
    fmu.write_bytes(data)
    done = slewright_here("check", fmu, "--reference")
    assert done.returncode == 2
    assert "is damaged" in done.stderr


@pytest.mark.parametrize("step", [1e-5, 30.0])
def test_models_of_very_short_and_long_steps(tmp_path: Path, step: float) -> None:
    folder = tmp_path / "slow"
    folder.mkdir()
    (folder / "model.py").write_text(
        "from fmus.definition import Model, Variable\n"
        f"MODEL = Model(name='slow', description='A lag', kind='continuous', step={step},\n"
        "    states=(Variable('x', '1'),), inputs=(Variable('u', '1'),), outputs=(Variable('y', '1'),),\n"
        f"    parameters=(), rhs=lambda x, u, m, p: {{'x': (u.u - x.x) / {10 * step}}},\n"
        "    out=lambda x, u, m, p: {'y': x.x})\n"
    )
    fmu = build_fmu(folder, 2, out=tmp_path)
    (experiment,) = experiments.read(fmu)
    signals, _ = compare.run(fmu, experiment, "any", None)
    assert [s.agrees for s in signals] == [True]


def test_a_model_that_fails_at_once_carries_none(tmp_path: Path) -> None:
    folder = tmp_path / "wild"
    folder.mkdir()
    (folder / "model.py").write_text(
        "from fmus.definition import Model, Variable\n"
        "MODEL = Model(name='wild', description='Fails at its start', kind='continuous', step=0.01,\n"
        "    states=(Variable('x', '1', start=1.0),), inputs=(), outputs=(Variable('y', '1'),),\n"
        "    parameters=(), rhs=lambda x, u, m, p: {'x': 1.0 / (x.x - 1.0)},\n"
        "    out=lambda x, u, m, p: {'y': x.x})\n"
    )
    with zipfile.ZipFile(build_fmu(folder, 2, out=tmp_path)) as archive:
        assert [n for n in archive.namelist() if n.startswith(FOLDER)] == []


def test_a_damaged_library_is_found_out(slewright_here: Command, tmp_path: Path) -> None:
    """One number of the machine code is another: the sensor's delay of 0.06 s is 0.08 s."""
    built, wrong = build_fmu(OSCILLATOR, 2, out=tmp_path), tmp_path / "wrong.fmu"
    was, instead = struct.pack("<d", 0.06), struct.pack("<d", 0.08)
    with zipfile.ZipFile(built) as archive, zipfile.ZipFile(wrong, "w") as out:
        for name in archive.namelist():
            content = archive.read(name)
            assert was in content or not name.startswith("binaries/")
            out.writestr(name, content.replace(was, instead))
    done = slewright_here("check", wrong, "--reference", "--json", tmp_path / "r.json")
    assert done.returncode == 1, done.stderr
    signals = json.loads((tmp_path / "r.json").read_text())["reference"]["steps"]["signals"]
    differing = [name for name, s in signals.items() if s["difference"] > s["allowed"]]
    assert differing == ["measured"]
