"""Policies as ONNX files: written from weights, read back, refused where they differ from specs/policy.py.

    observation float32 [1, N]  ->  features, layers, commands, limits  ->  action float32 [1, 3]

The layers are dense ones with tanh between them, or a transformer's (attention.py).

Everything between is double, so that rounding is that of the two ends alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from learning.policy import attention
from learning.policy.features import OUTPUTS, commands, features, limited
from learning.policy.graph import to_onnx
from specs.errors import InputError
from specs.policy import ACTIONS, INPUT, META, OUTPUT, Contract, check_shapes, read_contract

Weights = list[tuple[np.ndarray, np.ndarray]]  # (weight [out, in], bias [out]) of each layer, float32
WEIGHT, BIAS = "policy.weight.{}", "policy.bias.{}"  # names of the initializers by layer


@dataclass(frozen=True)
class Policy:
    """A trained policy: its contract and its layers, (weight [out, in], bias [out]) float32 each."""

    contract: Contract
    weights: Weights

    def __post_init__(self) -> None:
        c = self.contract
        sizes = [self.weights[0][0].shape[1], *(len(b) for _, b in self.weights)]
        wanted = features(c.task, c.history, c.ahead).numel_out(0), OUTPUTS[c.task]
        if (sizes[0], sizes[-1]) != wanted:
            raise InputError(
                f"a network from {sizes[0]} to {sizes[-1]} numbers; "
                f"a {c.task} policy with a history of {c.history} has {wanted[0]} and {wanted[1]}"
            )
        if c.network:
            attention.check(self.weights, c.history + 1)
            return
        for number, (w, _) in enumerate(self.weights):
            if w.shape[1] != sizes[number]:
                raise InputError(f"layer {number} takes {w.shape[1]} numbers and is given {sizes[number]}")

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Commands [3] for an observation [N], in double precision by numpy and CasADi."""
        c = self.contract
        y = np.array(features(c.task, c.history, c.ahead)(observation)).ravel()
        y = np.array(attention.answer(self.weights, ca.DM(y))).ravel() if c.network else self._dense(y)
        asked = commands(c.task, c.history, c.prior, c.change, c.ahead)(y, observation)
        return np.array(limited()(asked)).ravel()

    def _dense(self, y: np.ndarray) -> np.ndarray:
        for number, (w, b) in enumerate(self.weights):
            y = w.astype(np.float64) @ y + b
            y = np.tanh(y) if number + 1 < len(self.weights) else y
        return y


def write(policy: Policy, path: Path) -> Path:
    """Write `path` by way of a file beside it; the same policy gives the same bytes."""
    data = model(policy).SerializeToString(deterministic=True)
    part = path.with_name(f".{path.name}.part")
    part.write_bytes(data)
    return part.replace(path)


def model(policy: Policy) -> Any:
    """The checked ONNX model with the contract in its metadata."""
    import onnx
    from onnx import TensorProto, helper

    from learning.slew.onnx_write import IR_VERSION, OPSET, Graph

    c = policy.contract
    graph = Graph("policy")
    observation = graph.op("Cast", INPUT, to=TensorProto.DOUBLE)
    (y,) = to_onnx(features(c.task, c.history, c.ahead), graph, [observation])
    y = _network(policy, graph, y)
    asked_of = commands(c.task, c.history, c.prior, c.change, c.ahead)
    (asked,) = to_onnx(asked_of, graph, [y, observation])
    (action,) = to_onnx(limited(), graph, [asked])
    graph.nodes.append(helper.make_node("Cast", [action], [OUTPUT], to=TensorProto.FLOAT))
    ends = [
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, n])]
        for name, n in ((INPUT, len(c.layout)), (OUTPUT, len(ACTIONS)))
    ]
    made = helper.make_model(
        helper.make_graph(graph.nodes, "policy", *ends, initializer=graph.constants),
        opset_imports=[helper.make_opsetid("", OPSET)],
        producer_name="slewright",
    )
    made.ir_version = IR_VERSION
    helper.set_model_props(made, {META: c.as_json()})
    onnx.checker.check_model(made)
    return made


def _network(policy: Policy, graph: Any, y: str) -> str:
    """Write the layers into `graph`; returns the name of their outputs."""
    from onnx import TensorProto, numpy_helper

    def dense(number: int, x: str) -> str:
        names = WEIGHT.format(number), BIAS.format(number)
        pair = zip(policy.weights[number], names, strict=True)
        graph.constants += [numpy_helper.from_array(v, n) for v, n in pair]
        return graph.op("Gemm", x, *(graph.op("Cast", n, to=TensorProto.DOUBLE) for n in names), transB=1)

    if policy.contract.network:
        return attention.to_onnx(graph, y, dense, policy.weights)
    for number in range(len(policy.weights)):
        y = dense(number, y)
        if number + 1 < len(policy.weights):
            y = graph.op("Tanh", y)
    return y


def read(path: Path) -> Policy:
    """The policy in an ONNX file; InputError names what is wrong, or how its contract differs from specs."""
    import onnx
    from google.protobuf.message import DecodeError
    from onnx import numpy_helper

    try:
        found = onnx.load(str(path))
    except FileNotFoundError:
        raise InputError(f"there is no policy {path}; slewright train policy makes one") from None
    except (DecodeError, OSError, ValueError) as error:
        raise InputError(f"{path} is no readable ONNX file: {error}") from None
    contract = read_contract({p.key: p.value for p in found.metadata_props}, str(path))
    check_shapes(_ends(found.graph.input), _ends(found.graph.output), contract, str(path))
    tensors = {t.name: numpy_helper.to_array(t) for t in found.graph.initializer}
    weights = _layers(tensors, str(path))
    try:
        policy = Policy(contract, weights)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if model(policy).graph != found.graph:
        raise InputError(f"{path}: its graph is not the one that this version writes for its contract")
    return policy


def _ends(values: Any) -> dict[str, list[Any]]:
    return {
        v.name: [d.dim_value or d.dim_param or None for d in v.type.tensor_type.shape.dim] for v in values
    }


def _layers(tensors: Mapping[str, np.ndarray], source: str) -> Weights:
    found: Weights = []
    while (name := WEIGHT.format(len(found))) in tensors:
        w, b = tensors[name], tensors.get(BIAS.format(len(found)))
        if b is None or w.ndim != 2 or b.shape != (len(w),):
            raise InputError(f"{source}: layer {len(found)} has no weights and biases that fit")
        if not (np.isfinite(w).all() and np.isfinite(b).all()):
            raise InputError(f"{source}: layer {len(found)} has weights that are not finite numbers")
        found.append((w, b))
    if not found:
        raise InputError(f"{source}: holds no layer '{WEIGHT.format(0)}'")
    return found
