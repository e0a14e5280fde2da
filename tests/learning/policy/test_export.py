"""ONNX and FMU of a policy: parity with torch, contract in the file, what is refused."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import onnx
import onnxruntime as ort
import pytest
import torch

from learning.policy import controller, export
from learning.policy.export import Policy
from learning.policy.features import OUTPUTS, features
from learning.policy.network import Interface, perceptron, set_weights, weights_of
from specs import policy as specs
from specs.errors import InputError
from tests.conftest import ROOT
from tests.fmus.importer import Imported
from tests.learning.policy.test_features import observations

PARITY = 1e-6
SHIPPED = sorted((ROOT / "learning" / "policies").glob("*.onnx"))
SEEING = ("path_field.onnx",)  # what no signal tells: no FMU of them can be
LAYERS = (32, 16)
PRIOR = {"full": "gentle", "slew": "parabola"}  # as those that ship
TICKS = 5


def made(task: str, history: int = specs.HISTORY, seed: int = 1, prior: str | None = None) -> Policy:
    """A policy with random weights whose commands are of the size of the limits."""
    torch.manual_seed(seed)
    mlp = perceptron([features(task, history).numel_out(0), *LAYERS, OUTPUTS[task]])
    weights = weights_of(mlp)
    weights[-1] = (6.0 * weights[-1][0], weights[-1][1])
    return Policy(
        specs.contract(
            task,
            history,
            prior=PRIOR[task] if prior is None else prior,
            data_sha256="ab",
            made={"seed": seed},
        ),
        weights,
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """ONNX files of both tasks."""
    folder = tmp_path_factory.mktemp("policies")
    return {task: export.write(made(task), folder / f"{task}.onnx") for task in specs.TASKS}


def answers(path: Path, seen: np.ndarray) -> np.ndarray:
    """What onnxruntime answers to observations [n, N]."""
    session = ort.InferenceSession(str(path))
    rows = [np.asarray(session.run(None, {specs.INPUT: row[None].astype(np.float32)})[0]) for row in seen]
    return np.concatenate(rows)


@pytest.mark.parametrize("prior", specs.PRIORS)
def test_every_prior_is_in_the_file_as_it_is_in_the_equations(prior: str, tmp_path: Path) -> None:
    policy = made("full", prior=prior)
    seen = observations(10)
    theirs = answers(export.write(policy, tmp_path / "full.onnx"), seen)
    ours = np.array([policy(row.astype(np.float32).astype(float)) for row in seen])
    assert np.abs(ours - theirs).max() <= PARITY


def limited_policy(change: float = 0.2) -> Policy:
    """One whose joystick changes by less than that a period."""
    policy = made("full")
    return Policy(replace(policy.contract, change=change), policy.weights)


def test_the_limit_on_the_joystick_is_in_file_torch_and_fmu(tmp_path: Path) -> None:
    """All three answer alike, within the change of the joystick that was held; without it they pass it."""
    policy, seen = limited_policy(), observations(20).astype(np.float32)
    path = export.write(policy, tmp_path / "full.onnx")
    found = answers(path, seen)
    way = Interface("full", specs.HISTORY, PRIOR["full"], change=0.2)
    mlp = perceptron(way.sizes(LAYERS))
    set_weights(mlp, policy.weights)
    batch = torch.tensor(seen.T)
    with torch.no_grad():
        ours = way.limited(way.asked(mlp(way.features(batch)), batch)).numpy().T
    assert np.abs(ours - found).max() <= 1e-4  # single precision
    held = seen[:, specs.HISTORY - 1]
    assert np.abs(found[:, 0] - np.clip(held, -1, 1)).max() <= 0.2 + 1e-6
    free = np.array([made("full")(row.astype(float)) for row in seen])
    assert np.abs(free[:, 0] - held).max() > 0.4
    check_fmu(controller.build(policy, "policy_limited", tmp_path), path, specs.HISTORY)
    assert export.read(path).contract.change == 0.2


def test_a_limit_that_is_none_is_refused(tmp_path: Path) -> None:
    path = export.write(limited_policy(2.5), tmp_path / "full.onnx")
    with pytest.raises(InputError, match=r"change 2.5 \(valid: 0 to 2\)"):
        export.read(path)


@pytest.mark.parametrize("task", specs.TASKS)
def test_torch_and_onnxruntime_agree(task: str, files: dict[str, Path]) -> None:
    """To 1e-6, commands of all sizes; in double precision torch's own functions."""
    seen = observations(40).astype(np.float32)
    policy, way = made(task), Interface(task, specs.HISTORY, PRIOR[task])
    mlp = perceptron(way.sizes(LAYERS))
    set_weights(mlp, policy.weights)
    batch = torch.tensor(seen.T, dtype=torch.float64)
    mlp = mlp.double()
    inputs = torch.tensor(
        np.array([np.array(features(task, specs.HISTORY)(r.astype(float))).ravel() for r in seen])
    )
    with torch.no_grad():
        ours = way.limited(way.asked(mlp(inputs), batch)).numpy().T
    theirs = answers(files[task], seen)
    assert np.abs(ours - theirs).max() <= PARITY
    assert np.ptp(theirs[:, 0]) > 0.1
    assert np.abs(policy(seen[0].astype(float)) - theirs[0]).max() <= PARITY


@pytest.mark.parametrize(("task", "length"), [("slew", specs.HISTORY), ("full", specs.HISTORY), ("slew", 1)])
def test_the_fmu_answers_like_onnxruntime(task: str, length: int, tmp_path: Path) -> None:
    """Random weights."""
    policy = made(task, length)
    fmu = controller.build(policy, f"policy_{task}_{length}", tmp_path)
    check_fmu(fmu, export.write(policy, tmp_path / "policy.onnx"), length)


@pytest.mark.parametrize("path", [p for p in SHIPPED if p.name not in SEEING], ids=lambda p: p.name)
def test_the_fmu_of_a_policy_that_ships_answers_like_its_file(path: Path, tmp_path: Path) -> None:
    """What is verified and compared is what the controller runs."""
    policy = export.read(path)
    check_fmu(controller.build(policy, f"policy_{path.stem}", tmp_path), path, policy.contract.history)


def check_fmu(fmu: Path, file: Path, length: int) -> None:
    """Two seconds at 50 Hz, targets changing: history, rate, holding and commands; parity 1e-6."""
    session = ort.InferenceSession(str(file))
    rng = np.random.default_rng(4)
    held: dict[str, float] = dict.fromkeys(specs.ACTIONS, 0.0)
    history, worst, seen = specs.History(length), 0.0, []
    sensors = {name: rng.normal(0, 0.1) for name in specs.SENSORS} | {"q_boom": 1.1, "q_stick": -1.2}
    told = {"target_x": 9.0, "target_y": 1.0, "target_z": 5.0, "load_told": 800.0, "pace": 0.9}
    with Imported(fmu) as instance:
        for tick in range(100):
            sensors = {name: value + rng.normal(0, 0.02) for name, value in sensors.items()}
            if tick == 50:
                told |= {"target_x": -6.0, "target_y": 7.0, "target_z": 6.5}
            if tick % TICKS == 0:
                history.push(sensors, held)
                row = np.array([history.observation(told)], np.float32)
                answer = np.asarray(session.run(None, {specs.INPUT: row})[0])[0]
                held = dict(zip(specs.ACTIONS, answer.tolist(), strict=True))
            found = instance.run(1, {**sensors, **told}, list(specs.ACTIONS))[0]
            worst = max(worst, *(abs(a - held[n]) for a, n in zip(found, specs.ACTIONS, strict=True)))
            seen.append(found)
    assert worst <= PARITY
    assert np.ptp(np.array(seen)[:, 0]) > 0.01


def test_another_policy_is_another_model_s_code(tmp_path: Path) -> None:
    """An FMU of the same name is not taken for that of a policy trained since."""
    codes = [
        (controller.write_folder(made("slew", seed=seed), "slew", tmp_path / str(i)) / "model.py").read_text()
        for i, seed in enumerate((1, 2, 1))
    ]
    assert codes[0] == codes[2] != codes[1]


def test_single_is_single_precision() -> None:
    """As numpy rounds, in the code that CasADi writes."""
    x = ca.MX.sym("x")
    rounded = ca.Function("rounded", [x], [controller.single(x)])
    values = np.random.default_rng(2).normal(0, 1, 200) * 10.0 ** np.random.default_rng(3).uniform(-5, 4, 200)
    assert [float(rounded(v)) for v in values] == [float(np.float32(v)) for v in values]


def test_what_is_written_is_read_and_the_same_bytes_again(files: dict[str, Path], tmp_path: Path) -> None:
    """Contract and weights; deterministic."""
    found = export.read(files["full"])
    assert found.contract == made("full").contract
    assert all(np.array_equal(a, b) for x, y in zip(found.weights, made("full").weights, strict=True)
               for a, b in zip(x, y, strict=True))  # fmt: skip
    again = export.write(found, tmp_path / "again.onnx")
    assert again.read_bytes() == files["full"].read_bytes()


def changed(path: Path, out: Path, how: str) -> Path:
    """A copy of an ONNX policy with something wrong."""
    model = onnx.load(str(path))
    if how == "metadata":
        del model.metadata_props[:]
    elif how == "input":
        model.graph.input[0].type.tensor_type.shape.dim[1].dim_value = 70
    elif how == "node":
        next(n for n in model.graph.node if n.op_type == "Tanh").op_type = "Sigmoid"
    elif how == "weights":
        tensor = model.graph.initializer[-1]
        values = onnx.numpy_helper.to_array(tensor).copy()
        values[...] = np.nan
        tensor.CopyFrom(onnx.numpy_helper.from_array(values, tensor.name))
    elif how in ("sizes", "between"):
        named = {t.name: t for t in model.graph.initializer}
        layer = 0 if how == "sizes" else 1
        tensor = named[export.WEIGHT.format(layer)]
        values = onnx.numpy_helper.to_array(tensor)[:, 1:]
        tensor.CopyFrom(onnx.numpy_helper.from_array(values, tensor.name))
    out.write_bytes(model.SerializeToString())
    return out


@pytest.mark.parametrize(
    ("how", "named"),
    [
        ("metadata", "no policy of this project"),
        ("input", r"input 'observation' \[1, 70\]; specs/policy.py says 'observation' \[1, 69\]"),
        ("node", "its graph is not"),
        ("sizes", "a network from 73 to 3 numbers; a full policy with a history of 5 has 74 and 3"),
        ("between", "layer 1 takes 31 numbers and is given 32"),
    ],
)
def test_another_file_is_refused(how: str, named: str, files: dict[str, Path], tmp_path: Path) -> None:
    """File and difference are named."""
    path = changed(files["full"], tmp_path / "odd.onnx", how)
    with pytest.raises(InputError, match=named) as error:
        export.read(path)
    assert "odd.onnx" in str(error.value)


def test_no_file_and_no_onnx_are_refused(tmp_path: Path) -> None:
    """With what makes one."""
    with pytest.raises(InputError, match="slewright train policy"):
        export.read(tmp_path / "none.onnx")
    (tmp_path / "text.onnx").write_bytes(os.urandom(200))
    with pytest.raises(InputError, match=r"text\.onnx"):
        export.read(tmp_path / "text.onnx")


def test_weights_of_another_task_are_refused() -> None:
    """Sizes are those of the task and its history."""
    other = made("slew")
    with pytest.raises(InputError, match="a full policy with a history of 5 has 74 and 3"):
        Policy(specs.contract("full"), other.weights)


def test_reading_and_building_need_no_torch() -> None:
    """A policy is run, verified and compared where only CasADi and onnx are installed."""
    modules = "learning.policy.controller, verification.evaluation.policies"
    code = f"import sys, {modules}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.name)
def test_shipped_policies_keep_the_contract_and_say_what_made_them(path: Path) -> None:
    """Read like any other; recipe, command, seed and commit in the file."""
    found = export.read(path).contract
    name = path.stem.removesuffix("_no_history").removesuffix("_own")
    assert found.made["recipe"] == {"full": "family", "single": "full"}.get(name, name)
    assert found.made["command"].startswith("slewright train policy")
    assert {"seed", "commit", "training"} <= set(found.made)
    assert len(found.data_sha256) == 64
