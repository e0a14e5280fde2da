"""The FMUs of the pack as data: the model of c/models.c, its variables, its capabilities."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from benchmarks.testpack import terminals

Start = float | int | bool | str | tuple[float, ...] | None

# Units by name: base units, and what one of them is.
UNITS: Mapping[str, Mapping[str, str]] = {
    "rad": {"rad": "1"},
    "deg": {"rad": "1", "factor": "0.017453292519943295"},
    "K": {"K": "1"},
    "degC": {"K": "1", "offset": "273.15"},
    "m": {"m": "1"},
    "mm": {"m": "1", "factor": "0.001"},
    "s": {"s": "1"},
}
# Enumerations by name: their items.
ENUMERATIONS: Mapping[str, Mapping[str, int]] = {
    "Mode": {"off": 1, "slow": 2, "fast": 3},
    "Gear": {"slow": 10, "fast": 20, "off": 30},
}
# What the types that both versions of FMI have are called in each.
NAMES = {
    2: {},
    3: {"Real": "Float64", "Integer": "Int32"},
}
FMI3_TYPES = {
    "float32": "Float32",
    "int8": "Int8",
    "uint8": "UInt8",
    "int16": "Int16",
    "uint16": "UInt16",
    "uint32": "UInt32",
    "int64": "Int64",
    "uint64": "UInt64",
    "binary": "Binary",
}


@dataclass(frozen=True)
class Variable:
    """A variable as modelDescription.xml states it; its value reference is its position.

    type     Real, Integer, Boolean, String, Enumeration, or one of FMI 3
    depends  inputs on which an output depends at once
    size     elements of an array: a number, or the name of a structural parameter (with `most` at most)
    shape    sizes of the dimensions, where there is more than one
    most     elements that the C code holds at most
    discrete a real that changes at events only
    clock    name of the clock that an output belongs to
    interval, shift  of a clock, in s; ticks: how its interval may vary, where it is not as these say
    rate_of  name of the state whose derivative it is
    """

    name: str
    type: str = "Real"
    causality: str = "input"
    start: Start = 0.0
    depends: tuple[str, ...] = ()
    unit: str = ""
    enumeration: str = "Mode"
    min: float | None = None
    max: float | None = None
    relative: bool = False
    size: int | str | None = None
    shape: tuple[int, ...] = ()
    most: int = 1
    discrete: bool = False
    clock: str = ""
    interval: str = ""
    shift: str = ""
    ticks: str = ""
    rate_of: str = ""

    @property
    def continuous(self) -> bool:
        """Whether it may change at any time."""
        return self.type in ("Real", "Float64", "Float32") and not self.clock and not self.discrete


@dataclass(frozen=True)
class Fmu:
    """One FMU of the pack; `flags` replace capabilities, `versions`: FMI versions it exists for.

    names      variables that are called something else in modelDescription.xml
    exchange   it is for model exchange
    terminals  the elements of terminalsAndIcons.xml, as text
    """

    name: str
    model: str
    variables: tuple[Variable, ...]
    versions: tuple[int, ...] = (2, 3)
    flags: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    experiment: str = ""
    exchange: bool = False
    terminals: str = ""

    def shown(self, variable: str) -> str:
        """What a variable is called outside."""
        return self.names.get(variable, variable)


def _parameter(name: str, start: Start, type: str = "Real") -> Variable:
    return Variable(name, type, "parameter", start)


def _output(name: str, type: str = "Real", depends: tuple[str, ...] = ()) -> Variable:
    return Variable(name, type, "output", None, depends)


GAIN = (Variable("u"), _parameter("k", 1.0), _parameter("b", 0.0), _output("y", depends=("u",)))
SUM = (Variable("u1"), Variable("u2"), _output("y", depends=("u1", "u2")))
INTEGRATOR = (Variable("u"), _parameter("x0", 0.0), _parameter("k", 1.0), _output("y"))
SOURCE = (
    _parameter("offset", 5.0),
    _parameter("slope", 0.1),
    _parameter("period", 0.3),
    _output("y"),
    _output("count", "Integer"),
    _output("on", "Boolean"),
    _output("mode", "Enumeration"),
)


def _pair(name: str, type: str, start: Start) -> tuple[Variable, Variable]:
    return Variable(f"{name}_in", type, "input", start), _output(f"{name}_out", type, (f"{name}_in",))


ECHO2 = (
    *_pair("real", "Real", 0.0),
    *_pair("integer", "Integer", 0),
    *_pair("boolean", "Boolean", False),
    *_pair("mode", "Enumeration", 1),
    *_pair("string", "String", ""),
    _output("string_size", "Integer", ("string_in",)),
)
ECHO3 = (
    *ECHO2,
    *(v for n, t in FMI3_TYPES.items() for v in _pair(n, t, {"float32": 0.0, "binary": ""}.get(n, 0))),
    _output("binary_sum", "Integer", ("binary_in",)),
    _output("int64_rest", "Integer", ("int64_in",)),
    _output("uint64_rest", "Integer", ("uint64_in",)),
)


def _vector(size: int | str, *first: Variable) -> tuple[Variable, ...]:
    array = Variable("u", start=(1.0, 2.0, 3.0), size=size, most=8)
    return (
        *first,
        array,
        _parameter("k", 1.0),
        replace(array, name="y", causality="output", start=None, depends=("u",)),
        _output("total", depends=("u",)),
    )


def _matrix(*shape: int) -> tuple[Variable, ...]:
    start = tuple(float(i) for i in range(6))
    return tuple(
        replace(v, shape=shape, start=start if v.name == "u" else None) if v.size else v for v in _vector(6)
    )


COUNTER = (_parameter("period", 0.25), _output("count", "Integer"), replace(_output("last"), discrete=True))
SAMPLER = (
    Variable("tick", "Clock", "input", None, interval="0.2"),
    Variable("u"),
    replace(_output("count", "Integer"), clock="tick"),
    replace(_output("sampled"), clock="tick"),
)
RELAY = (
    Variable("tick", "Clock", "input", None),
    Variable("tock", "Clock", "output", None, depends=("tick",)),
    Variable("u"),
    _output("count", "Integer"),
    replace(_output("sampled"), discrete=True),
)
EXCHANGE = (
    Variable("u", start=5.0),
    _parameter("kind", 0, "Integer"),
    _output("y"),
    _output("speed"),
    _output("count", "Integer"),
    Variable("der_y", causality="local", start=None, rate_of="y"),
    Variable("der_speed", causality="local", start=None, rate_of="speed"),
)
RATES = {"der_y": "der(y)", "der_speed": "der(speed)"}
KINDS = ("lag", "ball", "stairs", "broken")  # as in c/models.c
TRICKS = (
    "none",
    "warns",
    "discards",
    "terminates",
    "fails",
    "no_number",
    "crashes",
    "hangs",
    "refuses",
)  # as in c/models.c
TROUBLE = (
    _parameter("trick", 0, "Integer"),
    _parameter("at", 0.35),
    _parameter("largest", 0.05),
    _output("y"),
)


def _changed(variables: tuple[Variable, ...], name: str, **changes: object) -> tuple[Variable, ...]:
    return tuple(replace(v, **changes) if v.name == name else v for v in variables)  # type: ignore[arg-type]


def _starting(variables: tuple[Variable, ...], **starts: Start) -> tuple[Variable, ...]:
    return tuple(replace(v, start=starts[v.name]) if v.name in starts else v for v in variables)


# Values that a conversion to another type on the way would change; for 64 bits the next one is no double.
SET: Mapping[str, Start] = {
    "real_in": 1.5,
    "integer_in": -7,
    "boolean_in": True,
    "mode_in": 2,
    "string_in": "Größe",
    "float32_in": 0.25,
    "int8_in": -100,
    "uint8_in": 200,
    "int16_in": -30_000,
    "uint16_in": 60_000,
    "uint32_in": 4_000_000_000,
    "int64_in": -(2**53) - 2,
    "uint64_in": 2**63 + 1,
    "binary_in": "00ff10",
}


def _in_units(u: str, y: str) -> tuple[Variable, ...]:
    return _changed(_changed(GAIN, "u", unit=u), "y", unit=y)


_STATELESS = {
    "canGetAndSetFMUstate": "false",
    "canSerializeFMUstate": "false",
    "canGetAndSetFMUState": "false",
    "canSerializeFMUState": "false",
}
_ALL = (
    Fmu("gain", "gain", GAIN),
    Fmu("gain_deg", "gain", _in_units("deg", "deg")),
    Fmu("gain_rad", "gain", _in_units("rad", "rad")),
    Fmu("gain_degC", "gain", _in_units("degC", "degC")),
    Fmu("gain_K", "gain", _in_units("K", "K")),
    Fmu("gain_ddegC", "gain", _changed(GAIN, "y", unit="degC", relative=True)),
    Fmu("gain_dK", "gain", _changed(GAIN, "u", unit="K", relative=True)),
    Fmu("gain_m", "gain", _in_units("m", "m")),
    Fmu("gain_mm", "gain", _changed(_in_units("mm", "mm"), "b", unit="mm")),
    Fmu("gain_bounded", "gain", _changed(GAIN, "k", min=-10.0, max=10.0)),
    Fmu("gain_stateless", "gain", GAIN, flags=_STATELESS),
    Fmu("gain_double", "gain", _starting(GAIN, k=2.0)),
    Fmu("verstärker", "gain", _starting(GAIN, k=3.0), names={"u": "größe", "y": "grösse·k", "k": "k₁"}),
    Fmu("sum", "sum", SUM),
    Fmu("gain_half", "gain", _starting(GAIN, k=0.5, b=1.0)),
    Fmu("gain_minus", "gain", _starting(GAIN, k=-1.0)),
    Fmu("gain_steep", "gain", _starting(GAIN, k=-3.0)),
    Fmu("gain_plus", "gain", _starting(GAIN, b=1.0)),
    Fmu("integrator", "integrator", INTEGRATOR),
    Fmu("integrator_one", "integrator", _starting(INTEGRATOR, x0=1.0)),
    Fmu("integrator_back", "integrator", _starting(INTEGRATOR, k=-1.0)),
    Fmu("source", "source", SOURCE, experiment='startTime="0" stopTime="1" stepSize="0.1"'),
    Fmu("echo", "echo", ECHO2, (2,)),
    Fmu("echo", "echo", ECHO3, (3,)),
    Fmu(
        "echo_gear",
        "echo",
        _changed(_changed(ECHO2, "mode_in", enumeration="Gear", start=10), "mode_out", enumeration="Gear"),
        (2,),
    ),
    Fmu(
        "echo_gear",
        "echo",
        _changed(_changed(ECHO3, "mode_in", enumeration="Gear", start=10), "mode_out", enumeration="Gear"),
        (3,),
    ),
    Fmu("echo_set", "echo", _starting(ECHO2, **SET), (2,)),
    Fmu("echo_set", "echo", _starting(ECHO3, **SET), (3,)),
    Fmu("vector3", "vector", _vector(3), (3,)),
    Fmu(
        "vector_n",
        "vector",
        _vector("n", Variable("n", "UInt64", "structuralParameter", 3)),
        (3,),
    ),
    Fmu("matrix", "vector", _matrix(2, 3), (3,)),
    Fmu("matrix_turned", "vector", _matrix(3, 2), (3,)),
    Fmu("counter", "counter", COUNTER, (2,)),
    Fmu("counter", "counter", COUNTER, (3,), {"hasEventMode": "true", "mightReturnEarlyFromDoStep": "true"}),
    Fmu("sampler", "sampler", SAMPLER, (3,), {"hasEventMode": "true"}),
    Fmu(
        "sampler_odd",
        "sampler",
        _changed(SAMPLER, "tick", interval="0.25"),
        (3,),
        {"hasEventMode": "true"},
    ),
    Fmu(
        "sampler_rigid",
        "sampler",
        _changed(SAMPLER, "tick", interval="0.25"),
        (3,),
        {"hasEventMode": "true", "canHandleVariableCommunicationStepSize": "false"},
    ),
    Fmu(
        "sampler_later",
        "sampler",
        _changed(SAMPLER, "tick", shift="0.1"),
        (3,),
        {"hasEventMode": "true"},
    ),
    Fmu("relay", "sampler", RELAY, (3,), {"hasEventMode": "true"}),
    *(
        Fmu(
            f"sampler_{ticks}",
            "sampler",
            _changed(SAMPLER, "tick", ticks=ticks),
            (3,),
            {"hasEventMode": "true"},
        )
        for ticks in ("fixed", "tunable")
    ),
    *(
        Fmu(
            f"sampler_{ticks}",
            "sampler",
            _changed(SAMPLER, "tick", ticks=ticks, interval=""),
            (3,),
            {"hasEventMode": "true"},
        )
        for ticks in ("changing", "countdown")
    ),
    *(
        Fmu(f"exchange_{n}", "exchange", _starting(EXCHANGE, kind=i), names=RATES, exchange=True)
        for i, n in enumerate(KINDS)
    ),
    Fmu("source_plug", "source", SOURCE, terminals=terminals.SOURCE),
    Fmu("echo_plug", "echo", ECHO2, (2,), terminals=terminals.ECHO),
    Fmu("echo_plug", "echo", ECHO3, (3,), terminals=terminals.ECHO),
    *(Fmu(f"trouble_{n}", "trouble", _starting(TROUBLE, trick=i)) for i, n in enumerate(TRICKS)),
)


def fmu(name: str, fmi_version: int) -> Fmu:
    """The FMU `name` of the pack for that FMI version (KeyError if there is none)."""
    return next(f for f in _ALL if f.name == name and fmi_version in f.versions)


def fmus(fmi_version: int) -> tuple[Fmu, ...]:
    """All FMUs for one FMI version."""
    return tuple(f for f in _ALL if fmi_version in f.versions)
