"""C code of a model: the CasADi functions and the tables that the shim's core.h declares."""

import math
import re
from pathlib import Path

import casadi as ca

from fmus.definition import Model, Sensor, is_multiple
from fmus.toolchain.variables import TIME_VR, exposed, model_token
from specs.errors import InputError

CASADI_OPTIONS = {"with_header": False, "with_export": False, "casadi_int": "long long"}
# functions that slw_math.h has not: a model that calls them needs libm, whose last bits differ by platform
OF_LIBM = re.compile(r"\b(pow|hypot|asin|acos|sinh|cosh|asinh|acosh|atanh|log1p|expm1|erf|fmod|copysign)\(")
DENSE_PRODUCT = Path(__file__).with_name("dense_product.c")


def model_c(model: Model) -> str:
    """`model.c`: generated equations with our mathematics, then the tables."""
    generator = ca.CodeGenerator("model.c", CASADI_OPTIONS)
    for function in _functions(model):
        generator.add(function)
    code = with_our_mathematics(generator.dump())
    if model.symbolic == "MX":
        code = _with_room(_with_our_product(code), _functions(model))
    return code + "\n" + _tables(model)


def with_our_mathematics(code: str) -> str:
    """CasADi's code with our mathematics; libm's is declared too where ours is not enough."""
    libm = "#include <math.h>\n" if needs_libm(code) else ""
    return code.replace("#include <math.h>", f'{libm}#include "slw_math.h"')


def needs_libm(code: str) -> bool:
    """Whether C code calls what slw_math.h has not."""
    return OF_LIBM.search(code) is not None


def _with_our_product(code: str) -> str:
    """CasADi's routine for matrix products replaced by ours: several times as fast, the same bits."""
    ours = DENSE_PRODUCT.read_text()
    return re.sub(r"^void casadi_mtimes_dense\(.*?^}\n", lambda _: ours, code, flags=re.DOTALL | re.MULTILINE)


def _with_room(code: str, functions: list[ca.Function]) -> str:
    """Functions of MX call others and want room behind their arguments, which the shim has for 8 alone."""
    names = [f.name() for f in functions]
    before = "".join(f"#define {name} {name}_in_mx\n" for name in names)
    after = "".join(f"#undef {name}\n" for name in names)
    return before + code + after + "".join(_roomy(f) for f in functions)


def _roomy(f: ca.Function) -> str:
    given = ", ".join(f"arg[{i}]" for i in range(f.n_in()))
    wanted = ", ".join(f"res[{i}]" for i in range(f.n_out()))
    return (
        f"int {f.name()}(const double **arg, double **res, long long *iw, double *w, int mem) {{\n"
        f"  const double *a[{f.sz_arg()}] = {{{given}}};\n"
        f"  double *r[{f.sz_res()}] = {{{wanted}}};\n"
        f"  return {f.name()}_in_mx(a, r, iw, w, mem);\n}}\n"
    )


def model_config_h(model: Model, token: str) -> str:
    """`model_config.h`: the sizes of the model."""
    continuous = model.kind == "continuous"
    seeded = any(s.noise for s in model.sensors.values())
    sizes = {
        "SLW_NX": len(model.states),
        "SLW_NU": len(model.inputs),
        "SLW_NY": len(model.outputs),
        "SLW_NP": len(model.parameters),
        "SLW_NM": len(model.modes),
        "SLW_NV": len(exposed(model)) + 1,
        "SLW_NDELAYS": len(model.delays),
        "SLW_NSENSORS": len(model.sensors),
        "SLW_LINE": whole(model.max_delay, model.step, "max_delay") + 1,
        "SLW_ECHO": whole(model.max_delay, model.sample_time, "max_delay") + 1,
        "SLW_TICKS_PER_SAMPLE": whole(model.sample_time, model.step, "sample_time"),
        "SLW_NF": model.inner[2].size1_out(1) if continuous else 0,
        "SLW_NQ": model.inner[0].size1_out(0) if continuous else 0,
        "SLW_SERVES": model.serves,
        "SLW_CONTINUOUS": int(continuous),
        "SLW_SEED_START": int(seeded),
        "SLW_SZ_W": max(f.sz_w() for f in _functions(model)),
        "SLW_SZ_IW": max(f.sz_iw() for f in _functions(model)),
    }
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    lines += [f"#define SLW_STEP {model.step!r}", f"#define SLW_SAMPLE_TIME {model.sample_time!r}"]
    lines += [f'#define SLW_TOKEN "{token}"']
    return "/* Sizes of model " + model.name + ", generated from its model.py. */\n" + "\n".join(lines) + "\n"


def token(model: Model, code: str, shim: str) -> str:
    """The model's token: from its code, its sizes and the shim."""
    return model_token(code + model_config_h(model, "") + shim)


def whole(duration: float, step: float, what: str) -> int:
    """duration / step, which must be a whole number."""
    if not is_multiple(duration, step):
        raise InputError(f"{what} of {duration} s is not a multiple of the step {step} s")
    return round(duration / step)


def feedthrough(model: Model) -> str:
    """Which output depends on an input at the same instant; "" if none does.

    Held sensors of continuous models may.
    """
    x, u, m, p = model.symbols
    pattern = ca.jacobian_sparsity(model.h(x, u, m, p), u) if model.inputs else None
    for row, column in zip(pattern.row(), pattern.get_col(), strict=True) if pattern is not None else ():
        output, source = model.outputs[row].name, model.inputs[column].name
        if model.kind == "discrete" or output not in model.sensors:
            return f"output {output} depends on input {source} at the same instant"
    return ""


def check_no_feedthrough(model: Model) -> None:
    """Raises InputError for a model of which no FMU can be built."""
    if found := feedthrough(model):
        held = "" if model.kind == "discrete" else "; among the model's sensors it would be sampled and held"
        raise InputError(f"model {model.name}: {found}{held}")


def _functions(model: Model) -> list[ca.Function]:
    step = model.inner if model.kind == "continuous" else [model.f]
    return [*step, model.h, model.x0, model.guards, model.directional]


def _tables(model: Model) -> str:
    inputs = [v.name for v in model.inputs]
    parts = [
        '#include "core.h"',
        _array("SlwVariable", "slw_variables", _variables(model)),
        _array("SlwSensor", "slw_sensors", [_sensor(model, n, s) for n, s in model.sensors.items()]),
        _array("SlwModeTable", "slw_modes", [_mode(model, i) for i in range(len(model.modes))]),
        _array("int", "slw_delay_input", [str(inputs.index(n)) for n in model.delays]),
        _array("int", "slw_delay_parameter", [str(_parameter(model, n)) for n in model.delays.values()]),
        _array("double", "slw_start_u", [_real(v.start) for v in model.inputs]),
        _array("double", "slw_start_p", [_real(v.start) for v in model.parameters]),
        _array("char *const", "slw_state_names", [f'"{v.name}"' for v in model.states]),
    ]
    return "\n".join(parts) + "\n"


def _variables(model: Model) -> list[str]:
    """All variables by value reference; InputError for one that is used twice."""
    entries = [(e.vr, e.group, e.index, e.variable.min, e.variable.max) for e in exposed(model)]
    entries.append((TIME_VR, "TIME", 0, None, None))
    numbers = [e[0] for e in entries]
    twice = sorted({n for n in numbers if numbers.count(n) > 1})
    if twice:
        raise InputError(f"model {model.name}: value references used twice: {twice}")
    rows = []
    for vr, group, index, low, high in sorted(entries, key=lambda entry: entry[0]):
        bounds = _real(-math.inf if low is None else low), _real(math.inf if high is None else high)
        rows.append(f"{{{vr}u, SLW_{group}, {index}, {', '.join(bounds)}}}")
    return rows


def _sensor(model: Model, output: str, sensor: Sensor) -> str:
    numbers = [_parameter(model, n) for n in (sensor.delay, sensor.bias, sensor.noise, sensor.quantum)]
    return f"{{{model.index('outputs', output)}, {', '.join(map(str, numbers))}}}"


def _mode(model: Model, i: int) -> str:
    mode = model.modes[i]
    delays = (_parameter(model, mode.on_delay), _parameter(model, mode.off_delay))
    return f"{{{delays[0]}, {delays[1]}, {_real(mode.start)}}}"


def _parameter(model: Model, name: str | None) -> int:
    return -1 if name is None else model.index("parameters", name)


def _real(value: float) -> str:
    if math.isinf(value):
        return "1e300" if value > 0 else "-1e300"  # wide enough, and no header needed
    return repr(float(value))


def _array(kind: str, name: str, items: list[str]) -> str:
    body = ", ".join(items) if items else "0" if kind in ("int", "double", "char *const") else "{0}"
    return f"const {kind} {name}[] = {{{body}}};"
