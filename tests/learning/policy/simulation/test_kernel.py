"""Compiled loops: the values and gradients of torch's own operations, and what is done without a compiler."""

import ctypes
from pathlib import Path

import casadi as ca
import pytest
import torch

from learning.policy.features import commands, errors, features
from learning.policy.simulation import kernel
from learning.policy.simulation.kernel import Kernel
from learning.policy.simulation.period import equations
from specs.errors import InputError

FUNCTIONS = {
    "features": lambda: Kernel(features("full", 5)),
    "commands": lambda: Kernel(commands("full", 5, "pd")),
    "errors": lambda: Kernel(errors()),
    **{name: (lambda name=name: equations()[name]) for name in ("period", "swing", "tip", "moment")},
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_values_and_gradients_are_those_of_torch(name: str) -> None:
    """On random columns, to single precision."""
    made = FUNCTIONS[name]()
    generator = torch.Generator().manual_seed(3)
    inputs = [(0.3 + 0.5 * torch.rand(k, 33, generator=generator)).requires_grad_() for k in made.inputs]
    exact = [x.detach().double().requires_grad_() for x in inputs]  # double precision is never compiled
    ours, theirs = made(*inputs), made(*exact)
    seeds = [torch.randn(o.shape, generator=generator) for o in ours]
    found = []
    for columns, outputs in ((inputs, ours), (exact, theirs)):
        total = sum((o * s).sum() for o, s in zip(outputs, seeds, strict=True))
        found.append(torch.autograd.grad(total, columns, allow_unused=True))  # type: ignore[arg-type]
    for a, b in zip(ours, theirs, strict=True):
        assert_near(a, b)
    for a, b, x in zip(*found, inputs, strict=True):
        assert_near(a, torch.zeros_like(x) if b is None else b)


def assert_near(a: torch.Tensor, b: torch.Tensor) -> None:
    """To a share of the largest: a random state jumps, and a jump over 0.02 s magnifies what is rounded."""
    assert float((a - b).abs().max()) <= 2e-3 * max(1e-2, float(b.abs().max()))


def test_without_a_compiler_torch_does_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same numbers; double precision always goes that way."""
    made = Kernel(errors())
    x = torch.rand(7, 5)
    compiled = made(x)[0]

    def none() -> None:
        raise InputError("there is no compiler")

    monkeypatch.setattr(kernel.compiler, "identity", lambda target: none())
    torch.testing.assert_close(made(x)[0], compiled, rtol=1e-5, atol=1e-5)
    assert made(x.double())[0].dtype == torch.float64


def test_an_operator_without_counterpart_is_refused() -> None:
    """By name."""
    x = ca.SX.sym("x")
    with pytest.raises(InputError, match="OP_ERF"):
        kernel.source_of(ca.Function("f", [x], [ca.erf(x)]))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_kernel_of_the_gpu_says_the_same(name: str, tmp_path: Path) -> None:
    """Its text, compiled as C with the threads as a loop: what runs on a GPU is never run by these tests."""
    made = FUNCTIONS[name]()
    code = tmp_path / "kernel.c"
    count = len(made.inputs) + len(made.outputs)
    threads = ", ".join(f"t[{i}]" for i in range(count))
    code.write_text(
        "#include <math.h>\n#define __global__ static\n#define __restrict__ restrict\n"
        "static struct { int x; } blockIdx, blockDim, threadIdx;\n"
        + kernel.cuda_source(made.f).replace('extern "C" ', "")
        + f"\nvoid run(int n, float **t) {{ blockDim.x = n; for (int i = 0; i < n + 3; i++)"
        f" {{ threadIdx.x = i; forward({threads}, n); }} }}\n"
    )
    library = tmp_path / "kernel.so"
    host = kernel.compiler.host().name
    flags = ("-O1", "-fvisibility=default")
    part = kernel.compiler.compile_object(code, tmp_path / "kernel.o", host, flags, generated=True)
    kernel.compiler.link_shared([part], library, host, ("-lm",))
    inputs = [0.3 + 0.5 * torch.rand(k, 9, generator=torch.Generator().manual_seed(3)) for k in made.inputs]
    found = [torch.full((k, 9), torch.nan) for k in made.outputs]
    pointers = (ctypes.c_void_p * count)(*(x.data_ptr() for x in (*inputs, *found)))
    ctypes.CDLL(str(library)).run(9, pointers)
    for a, b in zip(found, made(*(x.double() for x in inputs)), strict=True):
        assert_near(a, b)
