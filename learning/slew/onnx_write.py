"""Slew networks as ONNX graphs, written with onnx.helper from plain weights."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from fmus.models.slew_nn.network import HISTORY, INPUTS, Mlp, SlewNetwork

OPSET, IR_VERSION = 17, 9
LAST = {"pressure": [2 * HISTORY - 1, 3 * HISTORY - 1], "velocity": [4 * HISTORY - 1]}  # of residual outputs


class Graph:
    """A graph being written: each `op` adds a node and returns the name of its result."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def constant(self, values: Any, kind: Any = np.float64) -> str:
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(values, kind), name))
        return name

    def op(self, kind: str, *inputs: str, **attributes: Any) -> str:
        name = f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def columns(self, x: str, first: int, last: int) -> str:
        """Columns first..last-1."""
        return self.op("Gather", x, self.constant(range(first, last), np.int64), axis=1)

    def model(self, inputs: dict[str, int], outputs: dict[str, tuple[str, int]]) -> onnx.ModelProto:
        """The checked model; inputs name -> width, outputs name -> (result, width)."""
        for name, (result, _) in outputs.items():
            self.nodes.append(helper.make_node("Identity", [result], [name]))
        ends = [_floats(n, w) for n, w in inputs.items()], [_floats(n, w) for n, (_, w) in outputs.items()]
        graph = helper.make_graph(self.nodes, self.name, *ends, initializer=self.constants)
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="slewright"
        )
        model.ir_version = IR_VERSION
        onnx.checker.check_model(model)
        return model


def part_model(members: Sequence[Mlp], name: str) -> onnx.ModelProto:
    """`pressure` or `velocity`: inputs [n, 41] in SI -> outputs [n, 2 or 1] in SI, mean over the members."""
    graph = Graph(name)
    y = _mean(graph, members, "inputs", LAST[name])
    return graph.model({"inputs": INPUTS}, {"outputs": (y, len(LAST[name]))})


def step_model(network: SlewNetwork) -> onnx.ModelProto:
    """The whole step: u, p_l, p_r, omega [n, 10], inertia [n, 1] -> next_p_l, next_p_r, next_omega [n, 1]."""
    graph = Graph("step")
    found = _one_way(graph, network, "u", "p_l", "p_r", "omega")
    if network.symmetric:
        turned = graph.op("Neg", "u"), graph.op("Neg", "omega")
        right, left, speed = _one_way(graph, network, turned[0], "p_r", "p_l", turned[1])
        half = graph.constant(0.5)
        images = (left, right, graph.op("Neg", speed))
        found = tuple(
            graph.op("Mul", graph.op("Add", a, b), half) for a, b in zip(found, images, strict=True)
        )
    widths = {"u": HISTORY, "p_l": HISTORY, "p_r": HISTORY, "omega": HISTORY, "inertia": 1}
    names = ("next_p_l", "next_p_r", "next_omega")
    return graph.model(widths, {n: (value, 1) for n, value in zip(names, found, strict=True)})


def _one_way(graph: Graph, network: SlewNetwork, u: str, p_l: str, p_r: str, omega: str) -> tuple[str, ...]:
    known = graph.op("Concat", u, p_l, p_r, omega, "inertia", axis=1)
    p = _mean(graph, network.pressure, known, LAST["pressure"])
    new = [graph.columns(p, i, i + 1) for i in (0, 1)]
    left, right = (
        graph.op("Concat", graph.columns(old, 1, HISTORY), now, axis=1)
        for old, now in zip((p_l, p_r), new, strict=True)
    )
    now = graph.op("Concat", u, left, right, omega, "inertia", axis=1)
    return (*new, _mean(graph, network.velocity, now, LAST["velocity"]))


def _mean(graph: Graph, members: Sequence[Mlp], x: str, last: list[int]) -> str:
    results = [_net(graph, net, x, last) for net in members]
    if len(results) == 1:
        return results[0]
    return graph.op("Mul", graph.op("Sum", *results), graph.constant(1 / len(results)))


def _net(graph: Graph, net: Mlp, x: str, last: list[int]) -> str:
    y = graph.op("Sub", x, graph.constant(net.mean_in))
    y = graph.op("Div", y, graph.constant(net.std_in))
    for number, (w, b) in enumerate(zip(net.weights, net.biases, strict=True)):
        y = graph.op("Gemm", y, graph.constant(w), graph.constant(b), transB=1)
        if number + 1 < len(net.weights):
            y = graph.op("Relu", y)
    y = graph.op("Mul", y, graph.constant(net.std_out))
    y = graph.op("Add", y, graph.constant(net.mean_out))
    if net.residual:
        y = graph.op("Add", y, graph.op("Gather", x, graph.constant(last, np.int64), axis=1))
    return y


def _floats(name: str, width: int) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.DOUBLE, ["n", width])
