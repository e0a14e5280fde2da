"""The equations of an extended model and their slopes, as functions and as C code."""

from functools import cached_property

import casadi as ca
import numpy as np

from fmus.toolchain.codegen import CASADI_OPTIONS
from reconcile.extended import Extended


class Equations:
    """The equations of an extended model as C code."""

    def __init__(self, extended: Extended):
        self.extended = extended
        symbols = list(extended.symbols)
        x, u, _, p = symbols
        f_function, h_function, _ = extended.functions
        f, h = f_function(*symbols), h_function(*symbols)
        fx, fu, hx = (ca.densify(ca.jacobian(e, z)) for e, z in ((f, x), (f, u), (h, x)))
        self.functions = {
            "rx_f": ca.Function("rx_f", symbols, [f]),
            "rx_fj": ca.Function("rx_fj", symbols, [f, fx]),
            "rx_d": ca.Function("rx_d", symbols, [f, fx, fu, ca.jacobian(f, p)]),
            "rx_h": ca.Function("rx_h", symbols, [h]),
            "rx_hd": ca.Function("rx_hd", symbols, [h, hx, ca.jacobian(h, p)]),
        }

    @cached_property
    def size(self) -> int:
        """Operations of all functions: what compiling takes goes with it."""
        return int(self.operations.sum())

    @cached_property
    def operations(self) -> np.ndarray:
        """Operations of each function [5]."""
        return np.array([f.n_instructions() for f in self.functions.values()])

    def code(self) -> tuple[str, str]:
        """Generated C code and header."""
        generator = ca.CodeGenerator("equations.c", CASADI_OPTIONS)
        for function in self.functions.values():
            generator.add(function)
        return generator.dump().replace("#include <math.h>", '#include "slw_math.h"'), self._header()

    def _header(self) -> str:
        x, u, m, p = self.extended.symbols
        fp, hp = self.functions["rx_d"].sparsity_out(3), self.functions["rx_hd"].sparsity_out(2)
        sizes = {
            "NX": x.numel(),
            "NU": u.numel(),
            "NM": m.numel(),
            "NP": p.numel(),
            "NY": self.functions["rx_h"].numel_out(0),
            "NNZ_FP": fp.nnz(),
            "NNZ_HP": hp.nnz(),
            "DISCRETE": int(self.extended.model.kind == "discrete"),
            "SZ_W": max(1, *(f.sz_w() for f in self.functions.values())),
            "SZ_IW": max(1, *(f.sz_iw() for f in self.functions.values())),
        }
        header = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
        for name, pattern in (("FP", fp), ("HP", hp)):
            for what, values in (("COLUMN", pattern.colind()), ("ROW", pattern.row())):
                listed = ", ".join(map(str, values)) or "0"
                header += f"static const int {name}_{what}[] = {{{listed}}};\n"
        return header
