"""What a description says, and its units and types.

Written after FMI 2.0.4 (2.2) and FMI 3.0.2 (2.4), not after the reader.
"""

import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from specs.units import Unit
from tests.orchestrator.descriptions.spelling import Spelling

REALS = {2: ("Real",), 3: ("Float64", "Float32")}
WHOLE = {
    f"{sign}Int{bits}": (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for sign in ("", "U")
    for bits in (8, 16, 32, 64)
}
RANGES = {**WHOLE, "Integer": (-(2**31), 2**31 - 1)}
TYPES = {
    2: ("Real", "Real", "Integer", "Boolean", "String", "Enumeration"),
    3: ("Float64", "Float64", "Float32", *WHOLE, "Boolean", "String", "Binary", "Enumeration"),
}
CAUSALITIES = ("input", "output", "parameter", "calculatedParameter", "local")
WORDS = ("speed", "boom", "p", "Größe", "a b", "x[1]", "der(v)", "q<r", "'quoted'", "R&D", "μ", "_", "h.pipe")
EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass
class Seen:
    """A description, and what is to be read: `variables` by name, each attribute by the reader's name."""

    version: int
    text: bytes = b""
    variables: dict[str, dict[str, Any]] = field(default_factory=dict)
    dependencies: dict[str, tuple[str, ...] | None] = field(default_factory=dict)
    initial_dependencies: dict[str, tuple[str, ...] | None] = field(default_factory=dict)
    model: dict[str, Any] = field(default_factory=dict)
    terminals: dict[str, dict[str, str]] = field(default_factory=dict)
    terminal_text: str = ""


class Definitions:
    """One random description; `seen` grows with what is written."""

    def __init__(self, seed: int, version: int) -> None:
        self.r, self.version = random.Random(f"{version} {seed}"), version
        self.spell = Spelling(self.r)
        self.seen = Seen(version)
        self.units: dict[str, Unit | None] = {}
        self.types: dict[str, tuple[str, dict[str, Any]]] = {}  # name: (type, what it says)
        self.sizes: dict[str, int] = {}  # structural parameters
        self.clocks: list[str] = []
        self.names = self._names()
        self.vr = iter(self.r.sample(range(3_000_000_000 if version == 3 else 2**31), 200))

    def _names(self) -> Iterator[str]:
        number = 0
        while True:
            number += 1
            yield f"{self.r.choice(WORDS)}{number}"

    def some(self, *values: Any) -> Any:
        return self.r.choice(values)

    def number(self, kind: str) -> float | int:
        r = self.r
        if kind in RANGES:
            low, high = RANGES[kind]
            return r.choice((low, high, 0, 1, r.randint(low, high), r.randint(max(low, -9), 9)))
        if kind == "Float32":
            return float(r.randint(-(2**20), 2**20)) / 2 ** r.randint(0, 20)
        return r.choice(
            (0.0, -0.5, r.uniform(-1e3, 1e3), r.uniform(-1, 1) * 10.0 ** r.randint(-300, 300), 5e-324)
        )

    def unit_definitions(self) -> str:
        written = []
        for number in range(self.r.randint(0, 4)):
            name = self.some("m", "degC", "bar", "N.m", "1/min", "°", "kg.m2/s2") + "'" * number
            if self.r.random() < 0.15:
                self.units[name] = None
                written.append(self.spell.element("Unit", {"name": name}))
                continue
            powers = {k: self.r.randint(-3, 3) for k in self.r.sample(EXPONENTS, self.r.randint(0, 4))}
            factor, offset = self.some(None, 0.001, 3.6, 1e5), self.some(None, 273.15, -40.0)
            given = {k: self.spell.whole(e) for k, e in powers.items()}
            scale = {"factor": factor, "offset": offset}
            given |= {k: self.spell.real(x) for k, x in scale.items() if x is not None}
            inner = self.spell.element("BaseUnit", given)
            if self.r.random() < 0.3:
                inner += self.spell.element("DisplayUnit", {"name": f"{name} shown", "factor": "2"})
            written.append(self.spell.element("Unit", {"name": name}, inner))
            exponents = {k: e for k, e in powers.items() if e}
            self.units[name] = Unit(exponents, 1.0 if factor is None else factor, offset or 0.0)
        return self.spell.element("UnitDefinitions", {}, "".join(written)) if written else ""

    def _traits(self, kind: str) -> dict[str, Any]:
        """What a type or a variable may say of values of this type."""
        said: dict[str, Any] = {}
        numeric = kind in RANGES or kind in REALS[self.version]
        if numeric and self.r.random() < 0.5:
            ends = sorted(self.number(kind) for _ in range(2))
            said |= {k: v for k, v in zip(("min", "max"), ends, strict=True) if self.r.random() < 0.7}
        if kind in REALS[self.version]:
            if self.units and self.r.random() < 0.6:
                said["unit"] = self.some(*self.units)
            if self.r.random() < 0.3:
                said["nominal"] = self.some(0.1, 1e5, 2.0)
            if "unit" in said and self.r.random() < 0.3:
                said["relativeQuantity"] = self.some(True, False)
        if kind == "Binary" and self.r.random() < 0.5:
            said["maxSize"] = self.r.randint(8, 40)
        return said

    def _said(self, said: dict[str, Any], kind: str) -> dict[str, str | None]:
        spell = self.spell
        ways = {
            "unit": str, "nominal": spell.real, "relativeQuantity": spell.boolean, "maxSize": spell.whole,
        }  # fmt: skip
        return {k: ways[k](v) if k in ways else spell.value(v, kind) for k, v in said.items()}

    def type_definitions(self) -> str:
        written = []
        for number in range(self.r.randint(1, 4)):
            kind = self.some(*TYPES[self.version]) if number else "Enumeration"
            name = f"T{number} {self.some(*WORDS)}"
            said, inner = self._traits(kind), ""
            if kind == "Enumeration":
                said = {"items": self._items()}
                inner = "".join(
                    self.spell.element("Item", {"name": n, "value": self.spell.whole(v), "description": "d"})
                    for n, v in said["items"].items()
                )
            self.types[name] = kind, said
            given = {} if "items" in said else self._said(said, kind)
            given["quantity"] = self.some(None, "Q") if kind not in ("Boolean", "String", "Binary") else None
            if self.version == 2:
                text = self.spell.element(kind, given, inner)
                written.append(
                    self.spell.element("SimpleType", {"name": name, "description": "a type"}, text)
                )
            else:
                written.append(self.spell.element(f"{kind}Type", {"name": name, **given}, inner))
        return self.spell.element("TypeDefinitions", {}, "".join(written))

    def _items(self) -> dict[str, int]:
        high = 2**31 - 1 if self.version == 2 else 2**63 - 1
        values = self.r.sample((*range(-3, 9), high, -high - 1), self.r.randint(1, 5))
        return {f"{self.some(*WORDS)} {v}": v for v in values}
