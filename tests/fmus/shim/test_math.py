"""The deterministic mathematics against mpmath, in units of the last place."""

import ctypes
import math
from pathlib import Path

import mpmath
import numpy as np
import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM

FUNCTIONS = ("sin", "cos", "tan", "exp", "log", "tanh", "atan", "floor")
EXPORT = '__attribute__((visibility("default"))) '
RANGES = {  # function -> (low, high, largest error in ulp)
    "sin": (-1e5, 1e5, 1.0),
    "cos": (-1e5, 1e5, 1.0),
    "tan": (-100.0, 100.0, 3.0),
    "exp": (-700.0, 700.0, 1.0),
    "log": (1e-300, 1e6, 1.5),
    "tanh": (-25.0, 25.0, 3.0),
    "atan": (-1e3, 1e3, 1.5),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """slw_math.h as a shared library with one exported function each."""
    folder = tmp_path_factory.mktemp("math")
    exports = "".join(
        f'__attribute__((visibility("default"))) double t_{n}(double x) {{ return slw_{n}(x); }}\n'
        for n in FUNCTIONS
    )
    exports += EXPORT + "double t_atan2(double y, double x) { return slw_atan2(y, x); }\n"
    (folder / "t.c").write_text(f'#include "{SHIM}/slw_math.h"\n' + exports)
    host = compiler.host().name
    loose = ["-Wno-missing-prototypes"]
    built = compiler.compile_object(folder / "t.c", folder / "t.o", host, extra=loose)
    shared = compiler.link_shared([built], Path(folder) / "t.so", host)
    lib = ctypes.CDLL(str(shared))
    for name in FUNCTIONS:
        function = getattr(lib, "t_" + name)
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
    lib.t_atan2.restype, lib.t_atan2.argtypes = ctypes.c_double, [ctypes.c_double, ctypes.c_double]
    return lib


def ulps(value: float, exact: mpmath.mpf) -> float:
    return float(abs(mpmath.mpf(value) - exact) / mpmath.mpf(math.ulp(float(exact))))


@pytest.mark.parametrize("name", RANGES)
def test_accuracy(library: ctypes.CDLL, name: str) -> None:
    low, high, bound = RANGES[name]
    rng = np.random.default_rng(7)
    small = rng.uniform(-1, 1, 800) if low < 0 else rng.uniform(1e-9, 2, 800)
    points = np.concatenate([rng.uniform(low, high, 800), small, small * 1e-6, small * 2e3 % high])
    function, exact = getattr(library, "t_" + name), getattr(mpmath, name)
    with mpmath.workdps(40):
        worst = max(
            (ulps(function(x), exact(mpmath.mpf(x))), x) for x in map(float, points) if x > 0 or low < 0
        )
    assert worst[0] <= bound, f"{name}({worst[1]!r}) is off by {worst[0]:.2f} ulp"


def test_atan2_in_all_quadrants_and_on_the_axes(library: ctypes.CDLL) -> None:
    rng = np.random.default_rng(8)
    with mpmath.workdps(40):
        for y, x in rng.normal(size=(2000, 2)):
            assert ulps(library.t_atan2(y, x), mpmath.atan2(mpmath.mpf(y), mpmath.mpf(x))) <= 2.0
    for y, x in ((0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (-0.0, -1.0), (0.0, 0.0)):
        assert library.t_atan2(y, x) == math.atan2(y, x)


def test_special_values(library: ctypes.CDLL) -> None:
    assert library.t_exp(1000.0) == math.inf
    assert library.t_exp(-1000.0) == 0.0
    assert library.t_exp(0.0) == 1.0
    assert library.t_log(0.0) == -math.inf
    assert math.isnan(library.t_log(-1.0))
    assert library.t_tanh(50.0) == 1.0
    for x in (-2.5, -2.0, -0.1, 0.0, 0.9, 1e17, -1e17):
        assert library.t_floor(x) == math.floor(x)
    for name in ("sin", "cos", "exp", "tanh"):
        assert math.isnan(getattr(library, "t_" + name)(math.nan))
