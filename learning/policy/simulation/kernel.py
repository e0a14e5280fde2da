"""CasADi expressions as compiled loops over a batch, with their derivatives.

A scalar (SX) function becomes C: one loop over the machines, straight-line inside, which the compiler
vectorises; and so does its reverse derivative.  torch then sees one operation in the place of hundreds.
Compiled on first use for this processor and kept under build/kernels by content.  Fast arithmetic, single
precision: for training alone, held to the FMUs by a test.  On an NVIDIA GPU the same lines are one kernel, a
thread a machine, compiled there by torch; without a derivative.  Without a compiler, `graph.to_torch` does
the same in torch.
"""

import ctypes
import functools
import hashlib
import tempfile
from collections.abc import Sequence
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import torch
from torch import Tensor

from fmus.paths import BUILD
from fmus.toolchain import compiler
from learning.policy.graph import element, steps, to_torch
from specs.errors import InputError, RunError

FAST = ("-O3", "-march=native", "-mprefer-vector-width=512", "-ffast-math", "-ffp-contract=fast")
LIBRARIES = ("-Wl,--no-as-needed", "-lmvec", "-lm")
# Sine and cosine of one angle gcc joins to a sincos that it cannot vectorise: so the cosine is a later sine.
_C = {
    "OP_ADD": "{0} + {1}", "OP_SUB": "{0} - {1}", "OP_MUL": "{0} * {1}", "OP_DIV": "{0} / {1}",
    "OP_NEG": "-{0}", "OP_ASSIGN": "{0}", "OP_SQ": "{0} * {0}", "OP_TWICE": "2.0f * {0}",
    "OP_INV": "1.0f / {0}", "OP_SQRT": "sqrtf({0})", "OP_SIN": "sinf({0})",
    "OP_COS": "sinf({0} + 1.57079633f)",
    "OP_TANH": "tanhf({0})", "OP_EXP": "expf({0})", "OP_FABS": "fabsf({0})",
    "OP_SIGN": "(float)(({0} > 0.0f) - ({0} < 0.0f))", "OP_FMIN": "fminf({0}, {1})",
    "OP_FMAX": "fmaxf({0}, {1})", "OP_LT": "(float)({0} < {1})", "OP_LE": "(float)({0} <= {1})",
    "OP_EQ": "(float)({0} == {1})", "OP_NOT": "(float)({0} == 0.0f)",
    "OP_AND": "(float)({0} != 0.0f && {1} != 0.0f)",
    "OP_OR": "(float)({0} != 0.0f || {1} != 0.0f)", "OP_IF_ELSE_ZERO": "({0} != 0.0f ? {1} : 0.0f)",
}  # fmt: skip

THREADS = 128  # of a block of the GPU
_INDEPENDENT = """#ifdef __clang__
#pragma clang loop vectorize(assume_safety)
#else
#pragma GCC ivdep
#endif"""  # columns do not meet: otherwise compilers give up proving it of hundreds of rows


class Kernel:
    """f on tensors [elements, n] or [n], one an argument; one [elements, n] an output.  Differentiable."""

    def __init__(self, f: ca.Function) -> None:
        self.f = f
        self.inputs = [f.numel_in(i) for i in range(f.n_in())]
        self.outputs = [f.numel_out(i) for i in range(f.n_out())]
        self._plain = to_torch(f)

    def __call__(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Outputs [elements, n]; compiled for single precision, else operation by operation."""
        if _on_gpu(inputs) and (launch := _launched(self.f)):
            return self._launch(launch, inputs)
        compiled = _compiled(self.f) if _able(inputs) else None
        if compiled is None:
            return self._slowly(inputs)
        return _Call.apply(compiled, self.outputs, *inputs)  # type: ignore[return-value]

    def _launch(self, launch: Any, inputs: Sequence[Tensor]) -> tuple[Tensor, ...]:
        n = inputs[0].shape[-1]
        outputs = tuple(torch.empty(size, n, device=inputs[0].device) for size in self.outputs)
        arguments = [*(x.contiguous() for x in inputs), *outputs, n]
        launch(grid=(-(-n // THREADS), 1, 1), block=(THREADS, 1, 1), args=arguments)
        return outputs

    def _slowly(self, inputs: Sequence[Tensor]) -> tuple[Tensor, ...]:
        rows = [x[None] if x.dim() == 1 else x for x in inputs]
        like = torch.zeros_like(rows[0][0])
        found = self._plain(*(x.unbind(0) for x in rows))
        return tuple(torch.stack([row + like for row in rows]) for rows in found)


def _able(inputs: Sequence[Tensor]) -> bool:
    return all(x.dtype == torch.float32 and x.device.type == "cpu" for x in inputs)


def _on_gpu(inputs: Sequence[Tensor]) -> bool:
    able = all(x.dtype == torch.float32 and x.device.type == "cuda" for x in inputs)
    return able and not (torch.is_grad_enabled() and any(x.requires_grad for x in inputs))


class _Call(torch.autograd.Function):
    """The compiled loop as one operation of torch."""

    @staticmethod
    def forward(ctx: Any, library: Any, sizes: Sequence[int], *inputs: Tensor) -> tuple[Tensor, ...]:  # type: ignore[override]
        inputs = tuple(x.contiguous() for x in inputs)
        ctx.library = library
        ctx.save_for_backward(*inputs)
        n = inputs[0].shape[-1]
        outputs = tuple(torch.empty(size, n) for size in sizes)
        _run(library.forward, n, (*inputs, *outputs))
        return outputs

    @staticmethod
    def backward(ctx: Any, *seeds: Tensor) -> tuple[Any, ...]:  # type: ignore[override]
        inputs = ctx.saved_tensors
        found = tuple(torch.empty_like(x) for x in inputs)
        _run(ctx.library.reverse, inputs[0].shape[-1], (*inputs, *(s.contiguous() for s in seeds), *found))
        return (None, None, *found)


class Tanh(torch.nn.Module):
    """tanh by the compiler's vector library, a few times as fast as torch's; torch's where there is none."""

    def forward(self, x: Tensor) -> Tensor:
        """Element by element, in single precision or bfloat16."""
        return _Tanh.apply(x)  # type: ignore[return-value]


class _Tanh(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:  # type: ignore[override]
        able = x.device.type == "cpu" and x.dtype in (torch.float32, torch.bfloat16)
        library = _compiled(_tanh()) if able else None
        if library is None:
            y = torch.tanh(x)
        else:
            wide = x.float().contiguous()
            found = torch.empty_like(wide)
            _run(library.forward, wide.numel(), (wide, found))
            y = found.to(x.dtype)
        ctx.save_for_backward(y)
        return y

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Tensor:  # type: ignore[override]
        return torch.ops.aten.tanh_backward(gradients[0], ctx.saved_tensors[0])


@functools.cache
def _tanh() -> ca.Function:
    x = ca.SX.sym("x")
    return ca.Function("tanh", [x], [ca.tanh(x)])


def _run(function: Any, n: int, tensors: Sequence[Tensor]) -> None:
    pointers = (ctypes.c_void_p * len(tensors))(*(t.data_ptr() for t in tensors))
    function(ctypes.c_long(n), pointers)


@functools.cache
def _compiled(f: ca.Function) -> Any:
    """The library of a function and its reverse derivative; None without a compiler that can."""
    source = source_of(f)
    host = compiler.host().name
    try:
        key = hashlib.sha256(f"{source}{compiler.identity(host)}{FAST}".encode()).hexdigest()[:24]
        path = BUILD / "kernels" / f"{f.name()}-{key}{compiler.host().suffix}"
        if not path.is_file():
            _compile(source, path, host)
        return ctypes.CDLL(str(path))
    except (InputError, RunError, OSError):
        return None


@functools.cache
def _launched(f: ca.Function) -> Any:
    """The function as a kernel of the GPU; None where torch cannot compile one."""
    try:
        return torch.cuda._compile_kernel(cuda_source(f), "forward")  # type: ignore[attr-defined]
    except (AttributeError, RuntimeError, OSError):  # no such torch, no compiler, no such processor
        return None


def _compile(source: str, path: Path, host: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        code = Path(scratch) / "kernel.c"
        code.write_text(source, encoding="utf-8")
        made = compiler.compile_object(code, code.with_suffix(".o"), host, FAST, generated=True)
        part = path.with_name(f".{path.name}.part")
        compiler.link_shared([made], part, host, LIBRARIES)
        part.replace(path)


def source_of(f: ca.Function) -> str:
    """C of a function: `forward` and `reverse`, each (n, pointers to inputs, then to outputs)."""
    return "\n".join(["#include <math.h>", _loop("forward", f), _loop("reverse", reverse_of(f))])


def reverse_of(f: ca.Function) -> ca.Function:
    """(inputs, a seed for each output) -> a gradient for each input."""
    inputs = [ca.SX.sym(f"x{i}", f.numel_in(i)) for i in range(f.n_in())]
    seeds = [ca.SX.sym(f"s{i}", f.numel_out(i)) for i in range(f.n_out())]
    outputs = f(*inputs)
    outputs = list(outputs) if isinstance(outputs, tuple | list) else [outputs]
    whole = ca.jtimes(ca.vertcat(*outputs), ca.vertcat(*inputs), ca.vertcat(*seeds), True)
    places = accumulate((f.numel_in(i) for i in range(f.n_in())), initial=0)
    parts = [ca.densify(whole[a:b]) for a, b in pairwise(places)]
    return ca.Function(f"{f.name()}_reverse", [*inputs, *seeds], ca.cse(parts))


def cuda_source(f: ca.Function) -> str:
    """CUDA of a function: `forward`(inputs, outputs, n), a thread a column."""
    tensors = [f"const float *__restrict__ t{i}" for i in range(f.n_in())]
    tensors += [f"float *__restrict__ t{f.n_in() + i}" for i in range(f.n_out())]
    return "\n".join([
        f'extern "C" __global__ void forward({", ".join(tensors)}, int n) {{',
        "    int i = blockIdx.x * blockDim.x + threadIdx.x;", "    if (i >= n) return;", *_body(f), "}",
    ])  # fmt: skip


def _loop(name: str, f: ca.Function) -> str:
    """void name(long n, float **t): one pass over n columns."""
    tensors = [f"    float *restrict t{i} = t[{i}];" for i in range(f.n_in() + f.n_out())]
    return "\n".join([
        f'__attribute__((visibility("default"))) void {name}(long n, float **t) {{', *tensors,
        _INDEPENDENT, "    for (long i = 0; i < n; i++) {", *_body(f), "    }", "}",
    ])  # fmt: skip


def _body(f: ca.Function) -> list[str]:
    """The operations on column i; outputs that are never written are zero."""
    count = f.n_in()
    rows, outputs = [], [(i, j) for i in range(f.n_out()) for j in range(f.numel_out(i))]
    for s in steps(f):
        operands = [f"w{i}" for i in s.operands]
        if s.operator == "OP_CONST":
            rows.append(f"w{s.result} = {s.value!r}f;")
        elif s.operator == "OP_INPUT":
            rows.append(f"w{s.result} = t{s.place[0]}[{s.place[1]} * n + i];")
        elif s.operator == "OP_OUTPUT":
            place = (s.place[0], element(f, *s.place))
            outputs.remove(place)
            rows.append(f"t{count + place[0]}[{place[1]} * n + i] = {operands[0]};")
        elif s.operator in _C:
            rows.append(f"w{s.result} = {_C[s.operator].format(*operands)};")
        else:
            raise InputError(f"{f.name()}: operator {s.operator} has no counterpart in C")
    rows += [f"t{count + i}[{j} * n + i] = 0.0f;" for i, j in outputs]
    work = ", ".join(f"w{i}" for i in range(max(1, f.sz_w())))
    return [f"        float {work};", *(f"        {row}" for row in rows)]
