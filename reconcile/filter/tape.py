"""The equations of a model as tapes of operations, which tape.c plays; and the header that says how."""

import ctypes
from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

# CasADi's operations in C, of a and b; as its generated code has them, so that both compute the same bits
OPERATIONS = {
    "OP_ASSIGN": "a",
    "OP_ADD": "a + b",
    "OP_SUB": "a - b",
    "OP_MUL": "a * b",
    "OP_DIV": "a / b",
    "OP_NEG": "-a",
    "OP_EXP": "exp(a)",
    "OP_LOG": "log(a)",
    "OP_POW": "pow(a, b)",
    "OP_CONSTPOW": "pow(a, b)",
    "OP_SQRT": "sqrt(a)",
    "OP_SQ": "a * a",
    "OP_TWICE": "2. * a",
    "OP_SIN": "sin(a)",
    "OP_COS": "cos(a)",
    "OP_TAN": "tan(a)",
    "OP_ASIN": "asin(a)",
    "OP_ACOS": "acos(a)",
    "OP_ATAN": "atan(a)",
    "OP_LT": "a < b",
    "OP_LE": "a <= b",
    "OP_EQ": "a == b",
    "OP_NE": "a != b",
    "OP_NOT": "!a",
    "OP_AND": "a && b",
    "OP_OR": "a || b",
    "OP_FLOOR": "floor(a)",
    "OP_CEIL": "ceil(a)",
    "OP_FMOD": "fmod(a, b)",
    "OP_FABS": "fabs(a)",
    "OP_SIGN": "a < 0 ? -1 : a > 0 ? 1 : a",
    "OP_COPYSIGN": "copysign(a, b)",
    "OP_IF_ELSE_ZERO": "a ? b : 0",
    "OP_ERF": "erf(a)",
    "OP_FMIN": "fmin(a, b)",
    "OP_FMAX": "fmax(a, b)",
    "OP_INV": "1. / a",
    "OP_SINH": "sinh(a)",
    "OP_COSH": "cosh(a)",
    "OP_TANH": "tanh(a)",
    "OP_ASINH": "asinh(a)",
    "OP_ACOSH": "acosh(a)",
    "OP_ATANH": "atanh(a)",
    "OP_ATAN2": "atan2(a, b)",
    "OP_LOG1P": "log1p(a)",
    "OP_EXPM1": "expm1(a)",
    "OP_HYPOT": "hypot(a, b)",
}
KNOWN = {getattr(ca, name): c for name, c in OPERATIONS.items()}
END = 1 + max(KNOWN)  # of a tape
DONE = {number: f"w[o[1]] = {c}" for number, c in KNOWN.items()} | {
    ca.OP_CONST: "w[o[1]] = *constant++",
    ca.OP_INPUT: "w[o[1]] = arg[o[2]] ? arg[o[2]][o[3]] : 0",
    ca.OP_OUTPUT: "if (res[o[1]]) res[o[1]][o[3]] = a",
    END: "return 0",
}
HEADERS = {  # of tape.c
    "places.h": "".join(f"[{n}] = &&done_{n},\n" for n in DONE),
    "operations.h": "".join(f"done_{n}: {done}; NEXT\n" for n, done in DONE.items()),
}
# sizes of what is played; larger models are compiled
MOST = {"NX": 48, "NU": 256, "NW": 24, "NY": 24, "NI": 64, "AXES": 16, "W": 16384}
TAPES = ("kf_in", "kf_f", "kf_dry", "kf_post", "kf_fj", "kf_hj", "kf_first")
SIZES = ("NX", "NU", "NM", "NW", "NY", "NI", "NH", "AXES", "POSTS", "W0", "DT", "EARLY", "DISCRETE")


class _Tape(ctypes.Structure):
    _fields_ = (("operations", ctypes.c_void_p), ("constants", ctypes.c_void_p))


class Played(ctypes.Structure):
    """`Model` of any_model.h: sizes and equations."""

    _fields_ = (
        *((n, ctypes.c_int) for n in SIZES),
        ("STEP", ctypes.c_double),
        ("axis_v", ctypes.c_void_p),
        ("axis_q", ctypes.c_void_p),
        ("tapes", ctypes.c_void_p),
    )

    def __init__(
        self,
        functions: Mapping[str, ca.Function],
        sizes: Mapping[str, float],
        axes: Sequence[tuple[int, int]],
    ):
        given = {n: sizes[n] for n in (*SIZES, "STEP")}
        self.arrays = [np.array(column, np.int32) for column in zip(*axes, strict=True)] or [np.empty(0)] * 2
        found = [_tape(functions[n]) for n in TAPES]
        self.arrays += [a for pair in found for a in pair]
        self.operations = sum(len(o) for o, _ in found)
        self.made = (_Tape * len(found))(*((o.ctypes.data, c.ctypes.data) for o, c in found))
        places = {n: a.ctypes.data for n, a in zip(("axis_v", "axis_q"), self.arrays, strict=False)}
        super().__init__(**given, **places, tapes=ctypes.addressof(self.made))


def playable(functions: Mapping[str, ca.Function], sizes: Mapping[str, float]) -> bool:
    """Whether tape.c has room for such a model, and knows all of its operations."""
    small = all(sizes[n] <= most for n, most in MOST.items() if n in sizes)
    return small and all(
        f.sz_w() + f.nnz_in() + f.nnz_out() < MOST["W"] and _numbers(f) <= KNOWN.keys()
        for f in functions.values()
    )


def _numbers(function: ca.Function) -> set[int]:
    moved = {ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT}
    return {function.instruction_id(k) for k in range(function.n_instructions())} - moved


def _tape(function: ca.Function) -> tuple[np.ndarray, np.ndarray]:
    """Operations [n, 4] and constants."""
    operations, constants = [], []
    for k in range(function.n_instructions()):
        number, given, made = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if number == ca.OP_CONST:
            constants.append(function.instruction_constant(k))
        if number == ca.OP_OUTPUT:
            operations.append((number, made[0], given[0], made[1]))
        else:
            operations.append((number, made[0], *given, *[0] * (2 - len(given))))
    return np.array([*operations, (END, 0, 0, 0)], np.int32), np.array(constants)
