"""A policy on the control core: native C and onnxruntime behind one block give the same commands."""

import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from runtime import bundle as form
from runtime.control import ControlCore
from runtime.image import OUTPUT
from specs.errors import InputError
from specs.policy import ACTIONS
from tests.runtime.bench import AUTOMATIC, FAULT, STANDBY, Bench
from tests.runtime.bundles import built, folder

pytest.importorskip("onnxruntime")
pytest.importorskip("torch")

from deployment.bundling.build import bundle
from learning.policy import export
from runtime.policy import TOLERANCE, PolicyCore, open_core
from tests.learning.policy.test_export import made
from tests.learning.policy.test_network import attentive

TICKS = 100


@pytest.fixture(scope="module")
def onnx(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A policy with random weights."""
    return export.write(made("full"), tmp_path_factory.mktemp("policy") / "random.onnx")


@pytest.fixture(scope="module")
def bundles(onnx: Path) -> dict[str, form.Bundle]:
    return {
        engine: bundle(str(onnx), folder() / f"policy-{engine}", engine=engine)
        for engine in (form.NATIVE, form.ONNXRUNTIME)
    }


def commands(core: ControlCore) -> np.ndarray:
    """Actions [ticks, 3] that it sends while targets and sensors move."""
    bench = Bench(core).armed().set(automatic_request=1.0)
    start = len(bench.seen)
    for k in range(TICKS):
        bench.set(q_slew=0.2 + 0.01 * k, q_boom=1.2 - 0.001 * k, imu_tool_roll=0.2 * np.sin(0.2 * k)).tick()
    assert bench.mode == AUTOMATIC
    places = [OUTPUT.at(n) for n in ACTIONS]
    return np.array([s["value"][places] for s in bench.seen[start:]])


def test_both_engines_drive_alike(bundles: dict[str, form.Bundle]) -> None:
    native, other = (commands(open_core(bundles[engine])) for engine in (form.NATIVE, form.ONNXRUNTIME))
    assert np.ptp(native, axis=0).min() > 0.005
    assert np.abs(native - other).max() < 20 * TOLERANCE  # the history feeds differences of float32 back


def test_a_transformer_drives_alike_on_both_engines(tmp_path: Path) -> None:
    """It is C like any other network."""
    path = export.write(attentive("full", 5)[2], tmp_path / "attentive.onnx")
    engines = form.NATIVE, form.ONNXRUNTIME
    native, other = (commands(open_core(bundle(str(path), tmp_path / e, engine=e))) for e in engines)
    assert np.ptp(native[:, :2], axis=0).min() > 0.005
    assert np.abs(native - other).max() < 20 * TOLERANCE


def test_commands_are_held_for_five_ticks(bundles: dict[str, form.Bundle]) -> None:
    for engine in (form.NATIVE, form.ONNXRUNTIME):
        references = commands(open_core(bundles[engine]))[:, 1]
        changes = np.flatnonzero(np.diff(references)) + 1
        assert set(changes % 5) == {0}, engine
        assert len(changes) > 10


def test_what_is_held_is_in_the_state_not_in_memory_that_another_core_uses(
    bundles: dict[str, form.Bundle],
) -> None:
    """Cores of one library that run in turn do not disturb each other."""
    alone, among, other = (Bench(open_core(bundles[form.NATIVE])) for _ in range(3))
    for bench in (alone, among, other):
        bench.armed()
    for bench in (alone, among):
        bench.set(automatic_request=1.0)
    for _ in range(30):
        alone.tick()
    for _ in range(30):
        other.tick()
        among.tick()
    assert alone.commands[0] != 0.0 == other.commands[0]
    shown = [[s["value"].tobytes() for s in bench.seen] for bench in (alone, among)]
    assert shown[0] == shown[1]


def test_bundles_hold_the_policy_and_say_their_engine(bundles: dict[str, form.Bundle], onnx: Path) -> None:
    for engine, found in bundles.items():
        assert (found.engine, found.controller) == (engine, "random")
        assert (found.folder / "policy.onnx").read_bytes() == onnx.read_bytes()
        assert isinstance(open_core(found), PolicyCore) == (engine == form.ONNXRUNTIME)


def test_a_snapshot_of_the_second_engine_holds_the_history(bundles: dict[str, form.Bundle]) -> None:
    bench = Bench(open_core(bundles[form.ONNXRUNTIME])).automatic(13)
    snapshot, now = bench.core.snapshot(), bench.now
    after = [bench.set(q_slew=0.3 + 0.01 * k).tick().seen[-1].tobytes() for k in range(20)]
    other = Bench(open_core(bundles[form.ONNXRUNTIME]))
    other.core.restore(snapshot)
    other.now, other.values = now, dict(bench.values)
    assert [other.set(q_slew=0.3 + 0.01 * k).tick().seen[-1].tobytes() for k in range(20)] == after
    with pytest.raises(InputError, match="bytes of history"):
        other.core.restore(snapshot[:-8])


def test_an_answer_that_does_not_come_or_is_no_number_stops(
    bundles: dict[str, form.Bundle], monkeypatch: pytest.MonkeyPatch
) -> None:
    for wrong in (np.full(3, np.nan), None):
        core = open_core(bundles[form.ONNXRUNTIME])
        assert isinstance(core, PolicyCore)
        bench = Bench(core).automatic(21)
        if wrong is None:
            monkeypatch.setattr(core, "step", partial(ControlCore.step, core))  # nobody evaluates the policy
        else:
            monkeypatch.setattr(core, "answer", lambda _, value=wrong: value)
        ticks = next(k for k in range(1, 20) if bench.tick().mode == FAULT)
        assert ticks <= 10
        assert bench.fault == "controller_failed"
        assert bench.tick(3).commands == [0.0, 0.0, 0.0]


def test_engines_that_disagree_are_refused(bundles: dict[str, form.Bundle], tmp_path: Path) -> None:
    copy = Path(shutil.copytree(bundles[form.ONNXRUNTIME].folder, tmp_path / "b"))
    told = json.loads((copy / "parity.json").read_text())
    told["pairs"][3]["action"][0] += 1e-3
    (copy / "parity.json").write_text(json.dumps(told))
    manifest = json.loads((copy / form.MANIFEST).read_text())
    manifest["files"] = form.hashes(copy)
    (copy / form.MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"its answer 3 differs by 0\.001"):
        open_core(form.load(copy))


def test_another_policy_may_take_the_place_but_only_of_the_same_contract(
    bundles: dict[str, form.Bundle], tmp_path: Path
) -> None:
    found = bundles[form.ONNXRUNTIME]
    other = export.write(made("full", seed=2), tmp_path / "other.onnx")
    assert np.abs(commands(PolicyCore(found, other)) - commands(PolicyCore(found))).max() > 0.01
    (tmp_path / "none.onnx").write_bytes(b"none")
    with pytest.raises(InputError, match=r"none\.onnx cannot be read by onnxruntime"):
        PolicyCore(found, tmp_path / "none.onnx")


def test_what_is_no_policy_or_no_engine_is_said(onnx: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no policy"):
        bundle(str(tmp_path / "gone.onnx"), tmp_path / "b")
    with pytest.raises(InputError, match="no engine 'tensorrt'; valid: native, onnxruntime"):
        bundle(str(onnx), tmp_path / "b", engine="tensorrt")
    with pytest.raises(InputError, match="controller pi is no policy"):
        bundle("pi", tmp_path / "b", engine="onnxruntime")
    assert Bench(ControlCore(built())).tick(2).mode == STANDBY
