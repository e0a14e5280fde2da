"""A small transformer encoder from plain weights: as CasADi (C code, numbers) and as nodes of an ONNX graph.

Tokens are the instants of the history, oldest first, and one of all that has no history; the answer is read
from that last one.  Norms have no weights of their own, as the dense layer that follows each can hold them.
`Weights` are in this order:

    tokens of the inputs                         [tokens * width, inputs]
    of each encoder layer: queries, keys, values [3 * width, width]; heads mixed [width, width];
                           hidden [any, width]; back [width, any]
    answer of the last token                     [outputs, width]
"""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from specs.errors import InputError

WIDTH, HEADS = 32, 4  # of training; a file's width is that of its weights
EACH = 4  # dense layers in an encoder layer
EPSILON = 1e-5  # added to a token's variance, as torch does


def check(weights: Any, tokens: int) -> None:
    """InputError names the first layer whose size is not a transformer's."""
    inputs, width = weights[0][0].shape[1], weights[-1][0].shape[1]
    wanted = [(tokens * width, inputs)]
    for up, _ in weights[3:-1:EACH]:
        wanted += [(3 * width, width), (width, width), (len(up), width), (width, len(up))]
    wanted.append((len(weights[-1][1]), width))
    found = [w.shape for w, _ in weights]
    if width % HEADS or len(found) != len(wanted):
        raise InputError(f"{len(found)} layers of width {width} are no transformer of {HEADS} heads")
    for number, (have, want) in enumerate(zip(found, wanted, strict=True)):
        if have != want:
            raise InputError(f"layer {number} is {list(have)}, a transformer's {list(want)}")


def answer(weights: Any, x: Any) -> Any:
    """Outputs for inputs [M], numbers (DM) or symbols (MX); tokens are columns."""
    kind = type(x)

    def dense(number: int, x: Any) -> Any:
        w, b = (kind(ca.DM(v.astype(np.float64))) for v in weights[number])
        return ca.mtimes(w, x) + ca.repmat(b, 1, x.shape[1])

    width = weights[-1][0].shape[1]
    x = dense(0, x)
    x = ca.reshape(x, width, x.numel() // width)
    for first in range(1, len(weights) - 1, EACH):
        x += dense(first + 1, _attended(dense(first, _normed(x)), width))
        x += dense(first + 3, ca.tanh(dense(first + 2, _normed(x))))
    return dense(len(weights) - 1, _normed(x[:, -1]))


def _normed(x: Any) -> Any:
    """Every token with mean 0 and variance 1."""
    apart = x - ca.repmat(ca.sum1(x) / x.shape[0], x.shape[0], 1)
    spread = ca.sqrt(ca.sum1(apart * apart) / x.shape[0] + EPSILON)
    return apart / ca.repmat(spread, x.shape[0], 1)


def _attended(seen: Any, width: int) -> Any:
    """Queries, keys and values [3 * width, tokens] -> what the tokens' heads look at [width, tokens]."""
    heads, size = [], width // HEADS
    for first in range(0, width, size):
        q, k, v = (seen[part * width + first : part * width + first + size, :] for part in range(3))
        score = ca.mtimes(k.T, q) / math.sqrt(size)
        most = score[0, :]
        for row in range(1, score.shape[0]):
            most = ca.fmax(most, score[row, :])
        share = ca.exp(score - ca.repmat(most, score.shape[0], 1))  # no exponential overflows
        heads.append(ca.mtimes(v, share / ca.repmat(ca.sum1(share), share.shape[0], 1)))
    return ca.vertcat(*heads)


def to_onnx(graph: Any, x: str, dense: Callable[[int, str], str], weights: Any) -> str:
    """Write it into `graph`: inputs [1, M] -> outputs [1, n]; tokens are rows; `dense` writes a layer."""
    width = weights[-1][0].shape[1]
    tokens = len(weights[0][1]) // width
    x = graph.op("Reshape", dense(0, x), graph.constant([tokens, width], np.int64))
    for first in range(1, len(weights) - 1, EACH):
        heads = _heads_to_onnx(graph, dense(first, _norm_to_onnx(graph, x)), width)
        x = graph.op("Add", x, dense(first + 1, heads))
        hidden = graph.op("Tanh", dense(first + 2, _norm_to_onnx(graph, x)))
        x = graph.op("Add", x, dense(first + 3, hidden))
    last = graph.op("Gather", x, graph.constant([tokens - 1], np.int64), axis=0)
    return dense(len(weights) - 1, _norm_to_onnx(graph, last))


def _norm_to_onnx(graph: Any, x: str) -> str:
    apart = graph.op("Sub", x, graph.op("ReduceMean", x, axes=[1]))
    variance = graph.op("ReduceMean", graph.op("Mul", apart, apart), axes=[1])
    return graph.op("Div", apart, graph.op("Sqrt", graph.op("Add", variance, graph.constant(EPSILON))))


def _heads_to_onnx(graph: Any, seen: str, width: int) -> str:
    heads, size = [], width // HEADS
    for first in range(0, width, size):
        q, k, v = (graph.columns(seen, p * width + first, p * width + first + size) for p in range(3))
        score = graph.op("MatMul", q, graph.op("Transpose", k, perm=[1, 0]))
        share = graph.op("Softmax", graph.op("Div", score, graph.constant(math.sqrt(size))), axis=1)
        heads.append(graph.op("MatMul", share, v))
    return graph.op("Concat", *heads, axis=1)
