"""CasADi expressions carried over to torch (batched) and ONNX: written once, the same operations in both.

`to_torch` turns a scalar (SX) function into straight-line torch code on tensors of any shape; what is a
number stays a number.  `to_onnx` writes the same operations as double nodes of a graph.  Operators that
neither model nor controller uses are refused by name.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca

from specs.errors import InputError

# operator -> (torch, ONNX operators from the inside out); {0}, {1}: operands
_TORCH = {
    "OP_ADD": "{0} + {1}", "OP_SUB": "{0} - {1}", "OP_MUL": "{0} * {1}", "OP_DIV": "{0} / {1}",
    "OP_NEG": "-{0}", "OP_ASSIGN": "{0}", "OP_SQ": "{0} * {0}", "OP_TWICE": "2.0 * {0}",
    "OP_INV": "1.0 / {0}",
    "OP_SQRT": "m.sqrt({0})", "OP_SIN": "m.sin({0})", "OP_COS": "m.cos({0})", "OP_TANH": "m.tanh({0})",
    "OP_EXP": "m.exp({0})", "OP_FABS": "m.abs({0})", "OP_SIGN": "m.sign({0})",
    "OP_FMIN": "least({0}, {1})", "OP_FMAX": "most({0}, {1})", "OP_ATAN2": "angle({0}, {1})",
    "OP_LT": "({0} < {1}) * 1.0", "OP_LE": "({0} <= {1}) * 1.0", "OP_NOT": "({0} == 0) * 1.0",
    "OP_IF_ELSE_ZERO": "{0} * {1}",
}  # fmt: skip
_ONNX = {
    "OP_ADD": "Add", "OP_SUB": "Sub", "OP_MUL": "Mul", "OP_DIV": "Div", "OP_NEG": "Neg", "OP_SQRT": "Sqrt",
    "OP_SIN": "Sin", "OP_COS": "Cos", "OP_TANH": "Tanh", "OP_FABS": "Abs", "OP_FMIN": "Min",
    "OP_FMAX": "Max", "OP_ASSIGN": "Identity",
}  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One operation: result number, operator, operands by number; or an input, an output or a constant."""

    result: int
    operator: str
    operands: tuple[int, ...]
    place: tuple[int, int] = (0, 0)  # of an input or output: argument, element
    value: float = 0.0


def steps(f: ca.Function) -> Iterator[Step]:
    """The operations of an SX function, in order."""
    names = _operators()
    for k in range(f.n_instructions()):
        name, out, arguments = (
            names[f.instruction_id(k)],
            f.instruction_output(k),
            f.instruction_input(k),
        )
        if name == "OP_CONST":
            yield Step(out[0], name, (), value=float(f.instruction_constant(k)))
        elif name == "OP_INPUT":
            yield Step(out[0], name, (), (arguments[0], arguments[1]))
        elif name == "OP_OUTPUT":
            yield Step(-1, name, (arguments[0],), (out[0], out[1]))
        else:
            yield Step(out[0], name, tuple(arguments[: len(arguments)]))


@cache
def _operators() -> dict[int, str]:
    return {getattr(ca, n): n for n in dir(ca) if n.startswith("OP_") and isinstance(getattr(ca, n), int)}


def to_torch(f: ca.Function) -> Callable[..., list[list[Any]]]:
    """The function on sequences of tensors (or numbers): f(x, u, …) -> outputs, each a list of elements."""
    outputs = [f.numel_out(i) for i in range(f.n_out())]
    sparse = [*range(f.n_in())]
    for i in sparse:
        if f.nnz_in(i) != f.numel_in(i):
            raise InputError(f"{f.name()}: argument {i} is sparse")
    lines = [f"def made({', '.join(f'a{i}' for i in sparse)}):"]
    lines += [f"    r = [{', '.join(f'[0.0] * {n}' for n in outputs)}]"]
    for s in steps(f):
        operands = [f"w{i}" for i in s.operands]
        if s.operator == "OP_CONST":
            text = f"w{s.result} = {s.value!r}"
        elif s.operator == "OP_INPUT":
            text = f"w{s.result} = a{s.place[0]}[{s.place[1]}]"
        elif s.operator == "OP_OUTPUT":
            text = f"r[{s.place[0]}][{element(f, *s.place)}] = {operands[0]}"
        elif s.operator in _TORCH:
            text = f"w{s.result} = {_TORCH[s.operator].format(*operands)}"
        else:
            raise InputError(f"{f.name()}: operator {s.operator} has no counterpart in torch")
        lines.append("    " + text)
    lines.append("    return r")
    space = _torch_names()
    exec(
        compile("\n".join(lines), f"<{f.name()} in torch>", "exec"), space
    )  # our own text, of no one's input
    return space["made"]


def element(f: ca.Function, output: int, nonzero: int) -> int:
    """Element of a column that a stored (nonzero) entry of an output is."""
    rows = f.sparsity_out(output).row()
    return int(rows[nonzero])


def _torch_names() -> dict[str, Any]:
    """What the text needs: torch functions that leave numbers numbers."""
    import torch

    def number_or(name: str) -> Callable[[Any], Any]:
        tensor = getattr(torch, name)
        plain = {"abs": abs, "sign": lambda v: math.copysign(1.0, v) if v else 0.0}.get(name)
        plain = plain or getattr(math, name)
        return lambda v: tensor(v) if isinstance(v, torch.Tensor) else plain(v)

    class M:
        pass

    for name in ("sqrt", "sin", "cos", "tanh", "exp", "abs", "sign"):
        setattr(M, name, staticmethod(number_or(name)))

    def least(a: Any, b: Any) -> Any:
        if isinstance(a, torch.Tensor):
            return torch.minimum(a, b) if isinstance(b, torch.Tensor) else a.clamp(max=b)
        return b.clamp(max=a) if isinstance(b, torch.Tensor) else min(a, b)

    def most(a: Any, b: Any) -> Any:
        if isinstance(a, torch.Tensor):
            return torch.maximum(a, b) if isinstance(b, torch.Tensor) else a.clamp(min=b)
        return b.clamp(min=a) if isinstance(b, torch.Tensor) else max(a, b)

    def angle(y: Any, x: Any) -> Any:
        return torch.atan2(torch.as_tensor(y), torch.as_tensor(x))

    return {"m": M, "least": least, "most": most, "angle": angle}


def to_onnx(f: ca.Function, graph: Any, inputs: Sequence[str]) -> list[str]:
    """Write the function's operations into `graph` (learning/slew/onnx_write.py); returns the outputs' names.

    `inputs` are names of double results [1, n]; so are the outputs, each [1, m].
    """
    widths = [f.numel_in(i) for i in range(f.n_in())]
    columns = [
        [graph.columns(name, i, i + 1) for i in range(n)] for name, n in zip(inputs, widths, strict=True)
    ]
    names: dict[int, str] = {}
    results = [[""] * f.numel_out(i) for i in range(f.n_out())]
    for s in steps(f):
        operands = [names[i] for i in s.operands]
        if s.operator == "OP_CONST":
            names[s.result] = graph.constant([[s.value]])
        elif s.operator == "OP_INPUT":
            names[s.result] = columns[s.place[0]][s.place[1]]
        elif s.operator == "OP_OUTPUT":
            results[s.place[0]][element(f, *s.place)] = operands[0]
        elif s.operator == "OP_SQ":
            names[s.result] = graph.op("Mul", operands[0], operands[0])
        elif s.operator == "OP_TWICE":
            names[s.result] = graph.op("Add", operands[0], operands[0])
        elif s.operator == "OP_INV":
            names[s.result] = graph.op("Reciprocal", operands[0])
        elif s.operator in _ONNX:
            names[s.result] = graph.op(_ONNX[s.operator], *operands)
        else:
            raise InputError(f"{f.name()}: operator {s.operator} has no counterpart in ONNX")
    return [graph.op("Concat", *row, axis=1) for row in results]
