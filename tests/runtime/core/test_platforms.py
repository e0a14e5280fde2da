"""The core elsewhere: aarch64 bits under qemu, sanitizers, and every line of the hand-written C executed."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from baselines import registry
from deployment.bundling import build
from fmus.toolchain import compiler
from runtime.bundle import Bundle
from runtime.control import ControlCore
from runtime.image import OUTPUT
from runtime.recorder.feed import SNAPSHOT_TICKS, Feed
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import identity
from runtime.recorder.segments import Disk, Folder
from runtime.ring import Ring
from runtime.scan import PERIOD_NS
from slewright.app import app
from specs.errors import RunError
from specs.version import VERSION
from tests.runtime.bench import ARMED, AUTOMATIC, FAULT, HOLD, MANUAL, STANDBY, STOPPING
from tests.runtime.bundles import built, core, folder, guarded
from tests.runtime.script import images

RUNNER = Path(__file__).parent / "core_runner.c"
WIRE_RUNNER = RUNNER.with_name("wire_runner.c")
CROSS_LIBRARIES = Path("/usr/aarch64-linux-gnu")
TEN_MINUTES = 30_000
CHECKED = [
    "-fsanitize=address,undefined",
    "-fno-sanitize-recover=all",
    "-g",
    "-O0",
]  # compiled in a third of the time


def runner(into: Path, target: str, extra: list[str] | None = None, source: Path = RUNNER) -> Path:
    flags = ["-I", str(built().folder / "sources" / "core"), *(extra or ())]
    made = compiler.compile_object(source, into / f"{source.stem}.o", target, flags, generated=True)
    return compiler.link_program([made], into / f"{source.stem}-{target}", target, [*(extra or ()), "-ldl"])


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


def for_both(controller: str) -> Bundle:
    """A bundle with a core for this computer and one for aarch64."""
    return build.bundle(controller, folder() / f"{controller}-both", [compiler.host().name, "aarch64-linux"])


def on_aarch64(made: Bundle, given: bytes, into: Path, *options: str) -> bytes:
    """What the core of aarch64 answers, run by qemu."""
    program = [str(runner(into, "aarch64-linux")), str(made.library("aarch64-linux")), *options]
    emulated = ["qemu-aarch64", "-L", str(CROSS_LIBRARIES), *program]
    return subprocess.run(emulated, input=given, capture_output=True, check=True).stdout


WITH_QEMU = pytest.mark.skipif(shutil.which("qemu-aarch64") is None, reason="qemu-user is not installed")
WITH_LIBRARIES = pytest.mark.skipif(not CROSS_LIBRARIES.is_dir(), reason="libc6-arm64-cross is not installed")


@pytest.mark.qemu
@pytest.mark.slow
@WITH_QEMU
@WITH_LIBRARIES
@pytest.mark.parametrize("controller", ["pi", pytest.param("lqr", marks=pytest.mark.soak)])
def test_aarch64_gives_the_same_bits_for_ten_minutes(controller: str, tmp_path: Path) -> None:
    made = for_both(controller)
    told = images(TEN_MINUTES)
    here = by_python(ControlCore(made), told)
    assert on_aarch64(made, told.tobytes(), tmp_path) == here


@pytest.mark.qemu
@pytest.mark.long
@WITH_QEMU
@WITH_LIBRARIES
def test_a_recording_made_on_aarch64_repeats_here_and_one_of_here_there(tmp_path: Path) -> None:
    """Ten minutes run there; what is recorded of its answers is given to `slewright replay` here.

    Then the second half once more there, from the state that was recorded here.
    """
    made, told = for_both("pd"), images(TEN_MINUTES, seed=2)
    given = on_aarch64(made, told.tobytes(), tmp_path, str(SNAPSHOT_TICKS))
    metadata = {**identity(made.identity, VERSION), "platform": "aarch64-linux"}
    recording = recorded(Answers(given, ControlCore(made)), told, tmp_path / "out", metadata)
    said = tmp_path / "replay.json"
    done = CliRunner().invoke(
        app, ["replay", str(recording), "--bundle", str(made.folder), "--json", str(said)]
    )
    assert done.exit_code == 0, done.output
    found = json.loads(said.read_text())
    assert (found["ticks"], found["gaps"], found["left_out"]) == (TEN_MINUTES, 0, 0)
    assert found["recorded_on"] == "aarch64-linux"

    control, half = ControlCore(made), TEN_MINUTES // 2
    by_python(control, told[:half])
    state = control.snapshot()
    again = on_aarch64(made, state + told[half:].tobytes(), tmp_path, "0", "from")
    outputs = b"".join(
        control.step(told[k : k + 1], int(told["tick"][k])).tobytes() for k in range(half, len(told))
    )
    assert again == outputs + control.snapshot()


class Answers:
    """What a core elsewhere answered, as if it answered now."""

    def __init__(self, given: bytes, like: ControlCore) -> None:
        self._given, self._state_bytes = memoryview(given), len(like.snapshot())
        self._state = b""

    def _next(self, size: int) -> memoryview:
        found, self._given = self._given[:size], self._given[size:]
        return found

    def snapshot(self) -> bytes:
        return self._state

    def restore(self, snapshot: bytes, /) -> None:
        raise AssertionError

    def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
        return np.frombuffer(self._next(OUTPUT.dtype.itemsize), OUTPUT.dtype).reshape(())

    def before(self, tick: int) -> None:
        if tick % SNAPSHOT_TICKS == 0:
            self._state = bytes(self._next(self._state_bytes))


def recorded(answers: Answers, told: np.ndarray, out: Path, metadata: dict[str, str]) -> Path:
    """A recording of the answers, by the runtime's own recorder."""
    ring = Ring.create(out.with_suffix(".ring"), 4 << 20)
    feed, recorder = Feed(ring), Recorder(ring, Folder(out, 1 << 30), metadata, 3000, Disk())
    for tick in range(len(told)):
        answers.before(tick)
        feed.before(tick, answers)
        image = told[tick]
        feed.tick(np.array(image), answers.step(image, tick), (tick * PERIOD_NS, 0, 0, 0, -1))
        if tick % 500 == 499:
            recorder.work()
    recorder.work()
    recorder.close()
    assert ring.lost == 0
    ring.close()
    return out


def compiled(tmp_path: Path, extra: list[str], controller: str = "pi") -> Path:
    """A core with a guard, built with more flags, object files beside it; skips where the compiler cannot."""
    try:
        sources = guarded(controller).folder / "sources"
        return build.link(sources, "test", tmp_path, compiler.host().name, extra)
    except RunError as missing:
        pytest.skip(f"this compiler cannot: {str(missing).splitlines()[-1]}")


@pytest.mark.long
@pytest.mark.parametrize("wild", [pytest.param(0.0, marks=pytest.mark.soak), 0.02])
def test_sanitizers_find_nothing(wild: float, tmp_path: Path) -> None:
    """Address and undefined-behaviour sanitizers over the whole core, also on inputs of any bits."""
    library = compiled(tmp_path, CHECKED)
    program = runner(tmp_path, compiler.host().name, CHECKED)
    given = images(3000, wild=wild).tobytes()
    done = subprocess.run([str(program), str(library)], input=given, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:].decode()


@pytest.mark.long
def test_every_line_of_the_hand_written_core_is_executed(tmp_path: Path) -> None:
    if shutil.which("gcov") is None:
        pytest.skip("gcov is not installed")
    library = compiled(tmp_path, ["--coverage", "-O0"])
    program = runner(tmp_path, compiler.host().name)
    for number, wild in enumerate((0.0, 0.02, 1e-4)):
        given = images(18_000, number, wild).tobytes()
        subprocess.run([str(program), str(library)], input=given, capture_output=True, check=True)
    missed = []
    for name in ("guard", "gate", "check", "mode", "step"):
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


COMPILED = registry.names()
SAMPLE = ("pi", "lqr")  # the others take a while to compile


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [c if c in SAMPLE else pytest.param(c, marks=pytest.mark.long) for c in COMPILED]
)
def test_every_controller_can_be_bundled_and_drives(name: str) -> None:
    control = ControlCore(built(name))
    told = images(1200)
    out = np.frombuffer(by_python(control, told)[: len(told) * OUTPUT.dtype.itemsize], OUTPUT.dtype)["value"]
    assert int(out[1190, OUTPUT.at("control_mode")]) == AUTOMATIC
    assert set(out[:, OUTPUT.at("fault_code")]) == {0.0}
    assert np.abs(out[:, OUTPUT.at("u_slew")]).max() > 0.2
