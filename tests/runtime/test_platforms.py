"""The core elsewhere: aarch64 bits under qemu, sanitizers, and every line of the hand-written C executed."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from baselines import registry
from fmus import compiler
from runtime.control import ControlCore
from runtime.image import OUTPUT
from slewright.bundling import build
from specs.errors import RunError
from tests.runtime.bench import ARMED, AUTOMATIC, FAULT, HOLD, MANUAL, STANDBY, STOPPING
from tests.runtime.bundles import built, core, folder
from tests.runtime.script import images

RUNNER = Path(__file__).parent / "core_runner.c"
CROSS_LIBRARIES = Path("/usr/aarch64-linux-gnu")
TEN_MINUTES = 30_000
CHECKED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]


def runner(into: Path, target: str, extra: list[str] | None = None) -> Path:
    flags = ["-I", str(built().folder / "sources" / "core"), *(extra or ())]
    made = compiler.compile_object(RUNNER, into / "runner.o", target, flags, generated=True)
    return compiler.link_program([made], into / f"runner-{target}", target, [*(extra or ()), "-ldl"])


def by_python(control: ControlCore, told: np.ndarray) -> bytes:
    control.reset()
    outputs = b"".join(
        control.step(told[k : k + 1], int(told["tick"][k])).tobytes() for k in range(len(told))
    )
    return outputs + control.snapshot()


def test_the_script_visits_every_mode_and_moves() -> None:
    told = images(4000)
    out = np.frombuffer(by_python(core(), told)[: len(told) * OUTPUT.dtype.itemsize], OUTPUT.dtype)
    modes = set(out["value"][:, OUTPUT.at("control_mode")].astype(int))
    assert modes >= {STANDBY, ARMED, MANUAL, AUTOMATIC, HOLD, STOPPING, FAULT}
    assert np.ptp(out["value"][:, OUTPUT.at("u_slew")]) > 0.5


@pytest.mark.qemu
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("qemu-aarch64") is None, reason="qemu-user is not installed")
@pytest.mark.skipif(not CROSS_LIBRARIES.is_dir(), reason="libc6-arm64-cross is not installed")
@pytest.mark.parametrize("controller", ["pi", pytest.param("lqr", marks=pytest.mark.soak)])
def test_aarch64_gives_the_same_bits_for_ten_minutes(controller: str, tmp_path: Path) -> None:
    made = build.bundle(controller, folder() / f"{controller}-both", [compiler.host().name, "aarch64-linux"])
    told = images(TEN_MINUTES)
    here = by_python(ControlCore(made), told)
    program = [str(runner(tmp_path, "aarch64-linux")), str(made.library("aarch64-linux"))]
    emulated = ["qemu-aarch64", "-L", str(CROSS_LIBRARIES), *program]
    there = subprocess.run(emulated, input=told.tobytes(), capture_output=True, check=True).stdout
    assert there == here


def compiled(tmp_path: Path, extra: list[str], controller: str = "pi") -> Path:
    """A core built with more flags, its object files beside it; skips where the compiler cannot."""
    try:
        sources = built(controller).folder / "sources"
        return build.link(sources, "test", tmp_path, compiler.host().name, extra)
    except RunError as missing:
        pytest.skip(f"this compiler cannot: {str(missing).splitlines()[-1]}")


@pytest.mark.slow
@pytest.mark.parametrize("wild", [pytest.param(0.0, marks=pytest.mark.soak), 0.02])
def test_sanitizers_find_nothing(wild: float, tmp_path: Path) -> None:
    """Address and undefined-behaviour sanitizers over the whole core, also on inputs of any bits."""
    library = compiled(tmp_path, CHECKED)
    program = runner(tmp_path, compiler.host().name, CHECKED)
    given = images(3000, wild=wild).tobytes()
    done = subprocess.run([str(program), str(library)], input=given, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:].decode()


@pytest.mark.slow
def test_every_line_of_the_hand_written_core_is_executed(tmp_path: Path) -> None:
    if shutil.which("gcov") is None:
        pytest.skip("gcov is not installed")
    library = compiled(tmp_path, ["--coverage", "-O0"])
    program = runner(tmp_path, compiler.host().name)
    for number, wild in enumerate((0.0, 0.02, 1e-4)):
        given = images(18_000, number, wild).tobytes()
        subprocess.run([str(program), str(library)], input=given, capture_output=True, check=True)
    missed = []
    for name in ("gate", "check", "mode", "step"):
        told = subprocess.run(
            ["gcov", "-b", "-c", f"{name}.c", "-o", str(tmp_path / f"{name}.o")],
            cwd=tmp_path, capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
        of_it = told[told.index(f"{name}.c'") :]
        lines = re.search(r"Lines executed:([\d.]+)%", of_it)
        assert lines, told
        missed += [] if float(lines[1]) == 100.0 else [name, _not_executed(tmp_path / f"{name}.c.gcov")]
    assert not missed, "\n".join(missed)


def _not_executed(listing: Path) -> str:
    return "\n".join(line for line in listing.read_text().splitlines() if line.lstrip().startswith("#####"))


COMPILED = [c for c in registry.names() if registry.find(c).folder not in build.NOT_COMPILED]
SAMPLE = ("pi", "lqr", "operator_experienced")  # the others take a while to compile


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [c if c in SAMPLE else pytest.param(c, marks=pytest.mark.soak) for c in COMPILED]
)
def test_every_controller_can_be_bundled_and_drives(name: str) -> None:
    control = ControlCore(built(name))
    told = images(1200)
    out = np.frombuffer(by_python(control, told)[: len(told) * OUTPUT.dtype.itemsize], OUTPUT.dtype)["value"]
    assert int(out[1190, OUTPUT.at("control_mode")]) == AUTOMATIC
    assert set(out[:, OUTPUT.at("fault_code")]) == {0.0}
    assert np.abs(out[:, OUTPUT.at("u_slew")]).max() > 0.2
