"""Units as FMI and SSP write them, and the affine maps between them."""

from dataclasses import dataclass

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from specs.errors import InputError
from specs.units import Unit

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Affine:
    """y = scale * x + offset."""

    scale: float = 1.0
    offset: float = 0.0

    def then(self, other: "Affine") -> "Affine":
        """The map that applies `self` first and `other` to its result."""
        return Affine(other.scale * self.scale, other.scale * self.offset + other.offset)

    def inverse(self) -> "Affine":
        """The map from y back to x."""
        return Affine(1.0 / self.scale, -self.offset / self.scale)

    def __call__(self, value: float) -> float:
        return self.scale * value + self.offset


IDENTITY = Affine()


def conversion(source: Unit | None, target: Unit | None) -> Affine:
    """Map from `source` to `target` unit (the identity where one is unknown).

    The units must be compatible: see `compatible`.
    """
    if source is None or target is None or source == target:
        return IDENTITY
    return Affine(source.factor / target.factor, (source.offset - target.offset) / target.factor)


def compatible(source: Unit | None, target: Unit | None) -> bool:
    """Whether two units have the same dimension; an unknown unit fits every other."""
    if source is None or target is None:
        return True
    return _nonzero(source) == _nonzero(target)


def dimension(unit: Unit | None) -> str:
    """Base units with their exponents, e.g. `m·s^-2`; `1` without any."""
    powers = [] if unit is None else [f"{k}" if e == 1 else f"{k}^{e}" for k, e in _nonzero(unit).items()]
    return "·".join(powers) or "1"


def undefined(source: str, source_unit: Unit | None, target: str, target_unit: Unit | None) -> str:
    """Which of two unit names, that differ, has no definition and so cannot be converted; "": none."""
    if not source or not target or source == target:
        return ""
    return source if source_unit is None else target if target_unit is None else ""


def parse_units(holder: Element | None, where: str) -> dict[str, Unit | None]:
    """Unit definitions under `holder` (SSD `Units`, FMI `UnitDefinitions`); None: dimension not given."""
    units = [element for element in (() if holder is None else holder) if xml_file.local(element) == "Unit"]
    return {xml_file.required(unit, "name", where): _base_unit(unit, where) for unit in units}


def _base_unit(unit: Element, where: str) -> Unit | None:
    base = next((child for child in unit if xml_file.local(child) == "BaseUnit"), None)
    if base is None:
        return None
    exponents = {key: xml_file.integer(base, key, 0, where) for key in BASES}
    if xml_file.number(base, "factor", 1.0, where) == 0.0:
        raise InputError(f"{where} line {base.sourceline}: unit '{unit.get('name')}' has the factor 0")
    return Unit(
        {key: value for key, value in exponents.items() if value},
        xml_file.number(base, "factor", 1.0, where),
        xml_file.number(base, "offset", 0.0, where),
    )


def _nonzero(unit: Unit) -> dict[str, int]:
    return {key: value for key, value in unit.exponents.items() if value}
