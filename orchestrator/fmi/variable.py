"""A variable of an FMU, FMI 2.0 and FMI 3.0 in one form: what is stated of it, and values that suit it.

WIRE, STATUS: how types and statuses are numbered between Python and the core (orchestrator/core/fmu.h).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from specs.errors import InputError, nearest
from specs.units import Unit

FMI2_TYPES = ("Real", "Integer", "Boolean", "Enumeration", "String")
FMI3_TYPES = (
    *("Float64", "Float32"),
    *("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"),
    *("Boolean", "Enumeration", "String", "Binary", "Clock"),
)
REALS = {"Real", "Float64", "Float32"}
NOT_NUMBERS = {"String", "Binary", "Clock"}

# Whole numbers that a type can hold, of FMI 2 and FMI 3; an enumeration has 32 bits in FMI 2, 64 in FMI 3.
RANGES = {
    "Integer": (-(2**31), 2**31 - 1),
    **{f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    "Enumeration": (-(2**63), 2**63 - 1),
}

# The value of a variable in its own unit; arrays are flat tuples in row-major order.
Scalar = float | int | bool | str | bytes
Value = Scalar | tuple[Scalar, ...]


@dataclass(frozen=True)
class ClockInfo:
    """When a clock of FMI 3 ticks.

    interval_variability  constant, fixed, tunable (periodic), changing, countdown (the FMU tells the interval
                          while it runs) or triggered (no interval)
    interval_s            of a periodic clock, exact; None where the description does not state it: its FMU
                          tells it
    shift_s               of its first tick after the start
    supports_fraction     the FMU can be asked for and told intervals as fractions
    can_be_deactivated    the importer may take a tick back
    priority              of its partition in scheduled execution: of two that are due the lower number runs
                          first
    """

    interval_variability: str
    interval_s: Fraction | None = None
    shift_s: Fraction = Fraction(0)
    supports_fraction: bool = False
    can_be_deactivated: bool = False
    priority: int = 0

    @property
    def periodic(self) -> bool:
        """Whether the importer ticks it at times known beforehand."""
        return self.interval_variability in ("constant", "fixed", "tunable")

    @property
    def time_based(self) -> bool:
        """Whether the importer ticks it at times, stated or told by the FMU."""
        return self.interval_variability != "triggered"


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU; aliases of one variable have the same `vr`.

    type         FMI's name: Real ... of FMI 2, Float64 ... Clock of FMI 3
    unit         None: no unit, or one whose dimension the FMU does not say
    start        float, int (integers and enumerations), bool, str or bytes; an array's: a flat row-major
                 tuple of them at its default size; None: the FMU states none
    min, max     of reals and whole numbers, None: not limited
    dimensions   of an array: fixed sizes, or the names of the structural parameters that give them
    relative     relativeQuantity: a difference, whose unit's offset does not count
    items        of an enumeration: names and numbers
    initial      exact, approx, calculated, as given or by the standard's default; "" for the independent
    clocks       names of the clocks it belongs to
    max_size     of a binary, in bytes
    nominal      of a real: its usual magnitude, which tolerances are relative to at least; above 0
    multiple_set_per_instant  may be set more than once at one instant of event mode
    line         in modelDescription.xml
    """

    name: str
    vr: int
    type: str
    causality: str
    variability: str
    unit_name: str = ""
    unit: Unit | None = None
    start: Value | None = None
    min: float | int | None = None
    max: float | int | None = None
    description: str = ""
    dimensions: tuple[int | str, ...] = ()
    relative: bool = False
    items: Mapping[str, int] = field(default_factory=dict)
    initial: str = ""
    clocks: tuple[str, ...] = ()
    clock: ClockInfo | None = None
    max_size: int | None = None
    nominal: float = 1.0
    multiple_set_per_instant: bool = True
    line: int = 0

    @property
    def array(self) -> bool:
        """Whether it has dimensions."""
        return bool(self.dimensions)

    @property
    def start_settable(self) -> bool:
        """Whether an importer may change its start value: of parameters, inputs, and states at the start."""
        return self.variability != "constant" and self.initial in ("exact", "approx") and self.type != "Clock"


def size_of(variable: Variable, structural: Mapping[str, int]) -> int:
    """Number of elements; `structural`: the values of the FMU's structural parameters by name."""
    return math.prod(structural[d] if isinstance(d, str) else d for d in variable.dimensions)


# FMI type -> slw_type, by FMI version.
WIRE = {
    2: {"Real": 0, "Integer": 6, "Enumeration": 6, "Boolean": 10, "String": 11},
    3: {
        **{name: number for number, name in enumerate(FMI3_TYPES[:8])},
        **{"Int64": 8, "Enumeration": 8, "UInt64": 9, "Boolean": 10, "String": 11, "Binary": 12, "Clock": 13},
    },
}
BLOBS = ("String", "Binary")
BOOLEANS = ("Boolean", "Clock")

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending", "crashed", "hung")  # slw_status
HUNG = STATUS.index("hung")
WARNING, ERROR = 1, 3  # the worst status with which a run goes on; from ERROR on an FMU may only be freed


def checked_value(variable: Variable, value: Value, where: str, size: int | None = None) -> Value:
    """`value` in the type of the variable: float, int, bool, str, bytes, or a tuple of them for an array.

    Whole floats are integers, 0 and 1 Booleans, names of items enumerations and hexadecimal strings binaries;
    one value fills an array.  `size`: number of elements of an array; None: that of the value.
    Raises InputError, starting with `where`, for a value that does not suit the type, bounds or size.
    """
    if not variable.array:
        if isinstance(value, tuple):
            raise InputError(f"{where} has {len(value)} values, but is a scalar")
        return _scalar(variable, value, where)
    values = value if isinstance(value, tuple) else (value,)
    if size is not None and len(values) == 1:
        values *= size
    if size is not None and len(values) != size:
        raise InputError(f"{where} has {len(values)} values, but the variable has {size} elements")
    return tuple(_scalar(variable, v, f"{where}[{i}]") for i, v in enumerate(values))


def _scalar(variable: Variable, value: Scalar | Value, where: str) -> Scalar:
    if variable.type == "String":
        if not isinstance(value, str) or "\0" in value:
            raise InputError(f"{where}: a string without the character 0 is needed")
        return value
    if variable.type == "Binary":
        return _binary(variable, value, where)
    if variable.type == "Clock":
        raise InputError(f"{where}: a clock has no value")
    if variable.type == "Enumeration" and isinstance(value, str):
        if value not in variable.items:
            raise InputError(f"{where}: no item '{value}'; {nearest(value, variable.items)}")
        return variable.items[value]
    if not isinstance(value, bool | int | float):
        raise InputError(f"{where} = {value!r}, but its type is {variable.type}")
    return _number(variable, value, where)


def _number(variable: Variable, number: float | int | bool, where: str) -> float | int | bool:
    unit = f" {variable.unit_name}" if variable.unit_name not in ("", "1") else ""
    low = -math.inf if variable.min is None else variable.min
    high = math.inf if variable.max is None else variable.max
    if not low <= number <= high or number in (math.inf, -math.inf):
        raise InputError(f"{where} = {number:g}{unit} is out of bounds; valid: {low:g} … {high:g}{unit}")
    if variable.type in REALS:
        return float(number)
    whole = int(number)
    least, most = (0, 1) if variable.type == "Boolean" else RANGES[variable.type]
    if number != whole or not least <= whole <= most:
        raise InputError(f"{where} = {number:g}, but its type is {variable.type}")
    if variable.items and whole not in variable.items.values():
        valid = ", ".join(f"{v} ({name})" for name, v in variable.items.items())
        raise InputError(f"{where} = {whole} is no value of its enumeration; valid: {valid}")
    return bool(whole) if variable.type == "Boolean" else whole


def _binary(variable: Variable, value: Scalar | Value, where: str) -> bytes:
    if isinstance(value, str):
        try:
            value = bytes.fromhex(value)
        except ValueError:
            raise InputError(f"{where}: '{value}' is not a hexadecimal number of whole bytes") from None
    if not isinstance(value, bytes):
        raise InputError(f"{where} = {value!r}, but its type is {variable.type}")
    if variable.max_size is not None and len(value) > variable.max_size:
        raise InputError(f"{where} has {len(value)} bytes; valid: at most {variable.max_size}")
    return value
