"""A variable of an FMU, as its modelDescription.xml states it: FMI 2.0 and FMI 3.0 in one form."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from specs.units import Unit

FMI2_TYPES = ("Real", "Integer", "Boolean", "Enumeration", "String")
FMI3_TYPES = (
    "Float64",
    "Float32",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "Enumeration",
    "String",
    "Binary",
    "Clock",
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
    interval_s            of a periodic clock, exact; None where the description does not state it
    shift_s               of its first tick after the start
    supports_fraction     the FMU can be asked for and told intervals as fractions
    can_be_deactivated    the importer may take a tick back
    """

    interval_variability: str
    interval_s: Fraction | None = None
    shift_s: Fraction = Fraction(0)
    supports_fraction: bool = False
    can_be_deactivated: bool = False

    @property
    def periodic(self) -> bool:
        """Whether the importer ticks it at times known beforehand."""
        return self.interval_variability in ("constant", "fixed", "tunable")


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


def size_of(variable: Variable, structural: Mapping[str, int]) -> int:
    """Number of elements; `structural`: the values of the FMU's structural parameters by name."""
    return math.prod(structural[d] if isinstance(d, str) else d for d in variable.dimensions)
