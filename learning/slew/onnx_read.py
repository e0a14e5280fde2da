"""ONNX graphs of networks trained elsewhere, read as chains of linear layers with ReLU between them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import onnx
from onnx import helper, numpy_helper

from specs.errors import InputError

RESHAPED = ("Flatten", "Reshape", "Squeeze", "Unsqueeze")  # the same numbers in the same order
PASSED = ("Identity", "Cast", "Dropout", *RESHAPED)


class Reader:
    """A graph as chains of layers; raises InputError naming file and node for whatever is no such chain."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise InputError(f"there is no ONNX file at {path}")
        try:
            graph = onnx.load(str(path)).graph
            self.constants = {t.name: numpy_helper.to_array(t) for t in graph.initializer}
        except onnx.checker.ValidationError as error:
            raise InputError(f"{path}: its weights lie in a file that cannot be read: {error}") from error
        except Exception as error:  # protobuf's and onnx's own errors, of many kinds
            raise InputError(f"{path}: not a readable ONNX file ({type(error).__name__})") from error
        self.makers = {name: node for node in graph.node for name in node.output}
        for node in graph.node:
            if node.op_type == "Constant":
                values = {a.name: helper.get_attribute_value(a) for a in node.attribute}
                if "value" in values:
                    self.constants[node.output[0]] = numpy_helper.to_array(values["value"])
        inputs = [i.name for i in graph.input if i.name not in self.constants]
        if len(inputs) != 1 or len(graph.output) != 1:
            raise InputError(
                f"{path}: {len(inputs)} inputs and {len(graph.output)} outputs; one of each is needed"
            )
        self.input, self.output = inputs[0], graph.output[0].name

    def members(self) -> list["Chain"]:
        """One chain, or those that a mean is taken over."""
        return [self._chain(value) for value in self._averaged(self.output)]

    def _averaged(self, value: str) -> Sequence[str]:
        node = self._maker(value)
        while node.op_type in PASSED:
            value = node.input[0]
            node = self._maker(value)
        if node.op_type == "Mean":
            return node.input
        if node.op_type in ("Mul", "Div") and self._is_computed(node.input[0]):
            inner, factor = self._maker(node.input[0]), self.constants.get(node.input[1])
            share = 1 / len(inner.input) if node.op_type == "Mul" else float(len(inner.input))
            if inner.op_type == "Sum" and factor is not None and np.allclose(factor, share):
                return inner.input
        return [value]

    def _chain(self, value: str) -> "Chain":
        chain = Chain(self.path)
        for node in reversed([*self._back(value)]):
            try:
                chain.add(node, [self.constants.get(name) for name in node.input], self._gathered(node))
            except ValueError as error:
                raise InputError(f"{self.path}: node {_shown(node)}: sizes do not fit: {error}") from None
        return chain.closed()

    def _back(self, value: str) -> Iterator[onnx.NodeProto]:
        """The nodes from a value back to the graph's input."""
        while value != self.input:
            node = self._maker(value)
            yield node
            values = node.input[:1] if node.op_type in RESHAPED else node.input  # not the shape
            moving = [n for n in values if n not in self.constants and not self._is_gather(n)]
            if len(moving) != 1:
                raise InputError(
                    f"{self.path}: node {_shown(node)} joins {len(moving)} values: no plain chain"
                )
            value = moving[0]

    def _gathered(self, node: onnx.NodeProto) -> list[int] | None:
        """Columns of the input that a node adds: the last known values of a network that gives changes."""
        for name in node.input:
            if node.op_type == "Add" and self._is_gather(name):
                return np.ravel(self.constants[self.makers[name].input[1]]).astype(int).tolist()
        return None

    def _is_gather(self, value: str) -> bool:
        node = self.makers.get(value)
        return (
            node is not None
            and node.op_type == "Gather"
            and node.input[0] == self.input
            and node.input[1] in self.constants
        )

    def _is_computed(self, value: str) -> bool:
        return value in self.makers and value not in self.constants

    def _maker(self, value: str) -> onnx.NodeProto:
        if value not in self.makers:
            raise InputError(f"{self.path}: nothing computes the value '{value}'")
        return self.makers[value]


class Chain:
    """Layers, read one after the other; what scales values around them is kept or folded in."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.weights: list[np.ndarray] = []  # [out, in]
        self.biases: list[np.ndarray] = []
        self.mean_in, self.std_in = np.zeros(1), np.ones(1)
        self.last: list[int] | None = None
        self.active = True  # a Relu stands before the next layer (or it is the first)
        self._factor, self._shift = np.ones(1), np.zeros(1)  # value = factor * stored + shift
        self._bias_is_open = False  # the last layer came without a bias, and nothing has followed it

    def add(self, node: onnx.NodeProto, values: list[np.ndarray | None], gathered: list[int] | None) -> None:
        """Take the next node; `values` are its constant inputs, None where the chain goes on."""
        kind = node.op_type
        if gathered is not None:
            self.last = gathered
        elif kind in ("Gemm", "MatMul"):
            self._layer(node, values)
        elif kind in ("Add", "Sub", "Mul", "Div"):
            self._scale(node, values)
        elif kind == "Relu" and self.weights and not self.active:
            self._fold_back()
            self.active = True
        elif kind not in PASSED:
            raise InputError(
                f"{self.path}: node {_shown(node)} does not belong in a chain of Gemm (MatMul, Add) and Relu"
            )

    def closed(self) -> "Chain":
        """The finished chain: its last layer is a linear one."""
        if not self.weights or self.active:
            raise InputError(f"{self.path}: the chain does not end in a linear layer")
        return self

    @property
    def mean_out(self) -> np.ndarray:
        return np.broadcast_to(self._shift, len(self.biases[-1])).copy()

    @property
    def std_out(self) -> np.ndarray:
        return np.broadcast_to(self._factor, len(self.biases[-1])).copy()

    def _layer(self, node: onnx.NodeProto, values: list[np.ndarray | None]) -> None:
        attributes = {a.name: helper.get_attribute_value(a) for a in node.attribute}
        w = values[1]
        plain = attributes.get("alpha", 1.0) == attributes.get("beta", 1.0) == 1.0
        if w is None or w.ndim != 2 or not plain or attributes.get("transA", 0):
            raise InputError(f"{self.path}: node {_shown(node)} is not value × constant weights (+ bias)")
        w = w.astype(np.float64) if attributes.get("transB", 0) else w.astype(np.float64).T
        b = values[2] if len(values) > 2 else None
        if not self.weights:
            self._normalise(w.shape[1])
        elif not self.active:
            raise InputError(f"{self.path}: two linear layers without a Relu between ({_shown(node)})")
        bias = np.zeros(len(w)) if b is None else np.broadcast_to(b.ravel(), len(w)).astype(np.float64)
        if self.weights:
            bias = bias + w @ np.broadcast_to(self._shift, w.shape[1])
            w = w * self._factor
        self.weights.append(w)
        self.biases.append(bias)
        self._factor, self._shift, self.active = np.ones(1), np.zeros(1), False
        self._bias_is_open = b is None

    def _normalise(self, width: int) -> None:
        factor, shift = (np.broadcast_to(v, width) for v in (self._factor, self._shift))
        if not np.all(factor):
            raise InputError(f"{self.path}: an input is multiplied by 0")
        self.mean_in, self.std_in = -shift / factor, 1 / factor

    def _scale(self, node: onnx.NodeProto, values: list[np.ndarray | None]) -> None:
        constant = next((v for v in values if v is not None), None)
        if constant is None or (values[0] is not None and node.op_type in ("Sub", "Div")):
            raise InputError(f"{self.path}: node {_shown(node)} has no constant second operand")
        v = constant.ravel().astype(np.float64)
        if node.op_type == "Add" and self.weights and self._bias_is_open and not self.active:
            self.biases[-1] = self.biases[-1] + v
        elif node.op_type in ("Add", "Sub"):
            self._shift = self._shift + (v if node.op_type == "Add" else -v)
        else:
            v = v if node.op_type == "Mul" else 1 / v
            self._factor, self._shift = self._factor * v, self._shift * v
        self._bias_is_open = False

    def _fold_back(self) -> None:
        """What scales a layer's values before its Relu becomes part of the layer."""
        factor = np.broadcast_to(self._factor, len(self.biases[-1]))
        self.weights[-1] = self.weights[-1] * factor[:, None]
        self.biases[-1] = self.biases[-1] * factor + self._shift
        self._factor, self._shift = np.ones(1), np.zeros(1)


def _shown(node: onnx.NodeProto) -> str:
    return f"{node.op_type} '{node.name}'" if node.name else node.op_type
