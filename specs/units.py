"""Units of the project: SI base-unit exponents, factor and offset to SI (as FMI and SSP write them)."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Unit:
    """value in SI = factor * value + offset; `exponents` over kg, m, s, A, K, mol, cd, rad."""

    exponents: dict[str, int] = field(default_factory=dict)
    factor: float = 1.0
    offset: float = 0.0
