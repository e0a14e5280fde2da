"""What happens to a value on a connection: units and LinearTransformation, or a table of whole numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.fmi.units import IDENTITY, Affine
from orchestrator.fmi.variable import RANGES, REALS, Scalar, Value
from orchestrator.ssp.text import Place
from specs.errors import InputError, nearest


@dataclass(frozen=True)
class Conversion:
    """y = affine(x) for reals; y = table[x] for Booleans (0, 1), integers and enumerations.

    An empty table and the identity leave the value as it is.  A value that a table does not hold passes
    unchanged (SSP 2.0, 4.5.2), unless the table is `strict`: it then holds every value that the enumerations
    on both sides know, and any other is an error of the run.
    """

    affine: Affine = IDENTITY
    table: Mapping[int, int] = field(default_factory=dict)
    strict: bool = False

    @property
    def is_identity(self) -> bool:
        """Whether the value passes unchanged."""
        return self.affine == IDENTITY and not self.table

    def then(self, other: "Conversion") -> "Conversion":
        """The conversion that applies `self` first and `other` to its result."""
        if not (self.table and other.table):
            table, strict = self.table or other.table, (self if self.table else other).strict
            return Conversion(self.affine.then(other.affine), table, strict)
        joined = {x: other.table.get(y, y) for x, y in self.table.items()}
        if not self.strict:
            joined |= {x: y for x, y in other.table.items() if x not in joined}
        return Conversion(self.affine.then(other.affine), joined, self.strict or other.strict)


UNCHANGED = Conversion()


def apply(value: Value, conversion: Conversion) -> Value:
    """A value, or each element of an array, through a conversion."""
    if isinstance(value, tuple):
        return tuple(apply_one(v, conversion) for v in value)
    return apply_one(value, conversion)


def undo(value: Value, conversion: Conversion) -> Value | None:
    """The value whose conversion is `value`; None where a table gives it for none."""
    if not conversion.table:
        return apply(value, Conversion(conversion.affine.inverse()))
    back = Conversion(table={y: x for x, y in reversed(list(conversion.table.items()))})
    values = value if isinstance(value, tuple) else (value,)
    reached = all(conversion.table.get(int(v), v) == v or v in back.table for v in values)  # type: ignore[arg-type]
    return apply(value, back) if reached else None


def apply_one(scalar: Scalar, conversion: Conversion) -> Scalar:
    """A single value through a conversion."""
    if conversion.table and isinstance(scalar, int):
        return conversion.table.get(int(scalar), int(scalar))
    if conversion.affine != IDENTITY and isinstance(scalar, int | float):
        return conversion.affine(float(scalar))
    return scalar


# Element names, and the kind of value each is for.
LINEAR, BOOLEAN = "LinearTransformation", "BooleanMappingTransformation"
INTEGER, ENUMERATION = "IntegerMappingTransformation", "EnumerationMappingTransformation"


@dataclass(frozen=True)
class Transformation:
    """A transformation as written: target = affine(source), or pairs of source and target values.

    Source and target are those of the flow of data, whichever way round a connection is written
    (SSP 2.0, 4.5.2 and 5.3.2).
    """

    kind: str
    place: Place
    affine: Affine = IDENTITY
    entries: tuple[tuple[int | str, int | str], ...] = ()


@dataclass(frozen=True)
class ValueType:
    """What a value is at one point of its way: its type, items of an enumeration, bounds.

    type     of FMI; "": not known
    generic  "real" or "integer" where only that is known: SSP 1.0's types stand for all of their kind
    """

    type: str = ""
    generic: str = ""
    items: Mapping[str, int] = field(default_factory=dict)
    min: float | int | None = None
    max: float | int | None = None

    @property
    def kind(self) -> str:
        """Its kind, as `kind_of`."""
        return kind_of(self.type) or self.generic


def kind_of(type_name: str) -> str:
    """Which types fit each other: real, integer, boolean, enumeration, string, binary, clock; "": unknown."""
    if type_name in REALS:
        return "real"
    return "integer" if type_name.startswith(("Int", "UInt")) else type_name.lower()


def transform(transformation: Transformation, source: ValueType, target: ValueType) -> Conversion:
    """The conversion that a transformation is between two types (unknown ones fit).

    Raises InputError, naming the line, for types that it is not for, and values that are not of the types.
    """
    _check_kinds(transformation, source, target)
    if transformation.kind == LINEAR:
        return Conversion(transformation.affine)
    if transformation.kind == BOOLEAN:
        return Conversion(table={0: 0, 1: 1} | _pairs(transformation, {}, {}))
    if transformation.kind == INTEGER:
        table = _pairs(transformation, {}, {})
        for value in table.values():
            _check_target(transformation, value, target)
        return _completed(transformation, table, source, target)
    table = _pairs(transformation, source.items, target.items)
    return _completed(transformation, table, source, target)


def _check_kinds(transformation: Transformation, source: ValueType, target: ValueType) -> None:
    fitting = {
        LINEAR: ("real",),
        BOOLEAN: ("boolean",),
        INTEGER: ("integer", "enumeration"),
        ENUMERATION: ("enumeration",),
    }[transformation.kind]
    for end in (source, target):
        if end.kind and end.kind not in fitting:
            raise InputError(
                f"{transformation.place}: {transformation.kind} needs {' or '.join(fitting)} signals, "
                f"but this one is {end.kind}"
            )


def _pairs(
    transformation: Transformation, sources: Mapping[str, int], targets: Mapping[str, int]
) -> dict[int, int]:
    """The entries as numbers; names of items are looked up in `sources` and `targets`."""
    table: dict[int, int] = {}
    for source, target in transformation.entries:
        x, y = _number(transformation, source, sources), _number(transformation, target, targets)
        if x in table:
            raise InputError(f"{transformation.place}: second MapEntry for the source '{source}'")
        table[x] = y
    return table


def _number(transformation: Transformation, value: int | str, items: Mapping[str, int]) -> int:
    if isinstance(value, int):
        return value
    if not items:
        raise InputError(
            f"{transformation.place}: the items of the enumeration with '{value}' are nowhere defined"
        )
    if value not in items:
        raise InputError(
            f"{transformation.place}: the enumeration has no item '{value}'; {nearest(value, items)}"
        )
    return items[value]


def _check_target(transformation: Transformation, value: int, target: ValueType) -> None:
    low, high = RANGES.get(target.type, (value, value))
    if target.items and value not in target.items.values():
        valid = ", ".join(f"{v} ({n})" for n, v in target.items.items())
        raise InputError(f"{transformation.place}: {value} is no value of the enumeration; valid: {valid}")
    if not low <= value <= high:
        raise InputError(f"{transformation.place}: {value} does not fit {target.type}; valid: {low} … {high}")


def _completed(
    transformation: Transformation, table: dict[int, int], source: ValueType, target: ValueType
) -> Conversion:
    """Between enumerations that are known: every value named, as unmapped ones must be valid unchanged."""
    if not (source.items and target.items):
        return Conversion(table=table)
    table = {x: y for x, y in table.items() if x in source.items.values()}
    for name, value in source.items.items():
        if value not in table and value not in target.items.values():
            raise InputError(
                f"{transformation.place}: '{name}' ({value}) has no MapEntry and is no value of the target; "
                f"its items: {', '.join(target.items)}"
            )
        table.setdefault(value, value)
    return Conversion(table=table, strict=True)
