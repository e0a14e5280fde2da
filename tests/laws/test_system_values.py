"""Random systems: what arrives is what units, transformations, nesting and parameters make of it."""

import math
import random
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from benchmarks.testpack.case import Case, Package
from benchmarks.testpack.pack import content
from benchmarks.testpack.render import (
    binding,
    bindings,
    component,
    connection,
    entry,
    gives,
    linear,
    parameter_mapping,
    ssd,
    system,
    takes,
    value,
)
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system

FAMILIES = (("deg", "rad"), ("mm", "m"), ("degC", "K"))
TO_SI = {
    "deg": (math.pi / 180, 0.0), "rad": (1.0, 0.0), "mm": (0.001, 0.0), "m": (1.0, 0.0),
    "degC": (1.0, 273.15), "K": (1.0, 0.0), "": (1.0, 0.0),
}  # fmt: skip
GIVEN = 5.0  # what the source gives at the start
FEW, MANY = 40, 1500


@dataclass
class Chain:
    """source a → gains, some of them inside systems → out; `x`: the value so far, `unit`: what it is in."""

    r: random.Random
    units: tuple[str, ...]
    x: float = GIVEN
    unit: str = ""
    gains: int = 0
    systems: int = 0
    apply: tuple[float, float] = (1.0, 0.0)  # k and b of the newest gain
    values: list[str] = field(default_factory=list)  # bound at the outermost system

    def link(self, source: str, target: str, unit: str) -> str:
        """A connection into `target`, which is in `unit`: first the unit, then the transformation."""
        suppressed = self.r.random() < 0.15
        if self.unit and unit and not suppressed:
            (scale, offset), (to_scale, to_offset) = TO_SI[self.unit], TO_SI[unit]
            self.x = (scale * self.x + offset - to_offset) / to_scale
        inner = ""
        if self.r.random() < 0.4:
            factor, offset = self.r.choice((2.0, -0.5, 3.25)), self.r.choice((0.0, 1.5, -100.0))
            self.x, inner = factor * self.x + offset, linear(factor, offset)
        self.unit = unit
        return connection(source, target, inner, **({"suppressUnitConversion": "true"} if suppressed else {}))

    def gain(self, path: str) -> tuple[str, str, str]:
        """(name, unit, element) of a gain whose parameters are bound in one of the ways."""
        self.gains += 1
        name, unit = f"g{self.gains}", self.r.choice(self.units)
        k, b = self.r.choice((2.0, -1.5, 0.25)), self.r.choice((0.0, 4.0))
        bound, more = [value("b", "Real", b)], ""
        way = self.r.randrange(4)
        if way == 0:
            bound.append(value("k", "Real", k))
        elif way == 1:  # at the outermost system, which wins
            self.values.append(value(f"{path}{name}.k", "Real", k))
            bound.append(value("k", "Real", 77.0))
        elif way == 2:  # by another name, transformed
            more = binding(
                value("raw", "Real", (k - 1.0) / 2.0),
                mapping=f"<ssd:ParameterMapping>{parameter_mapping(entry('raw', 'k', linear(2.0, 1.0)))}"
                "</ssd:ParameterMapping>",
            )
        else:
            k = 1.0  # as the FMU has it
        element = component(
            name, f"gain_{unit}", takes("u", unit=unit), gives("y", unit=unit),
            bindings=bindings(binding(*bound), *([more] if more else [])),
        )  # fmt: skip
        self.apply = k, b
        return name, unit, element

    def section(self, source: str, path: str, depth: int) -> tuple[str, list[str], list[str]]:
        """One to three gains or systems after `source`: (the last output, elements, connections)."""
        elements, links = [], []
        for _ in range(self.r.randint(1, 3)):
            if depth < 3 and self.r.random() < 0.3:
                source, element, into = self.inner(source, path, depth)
            else:
                name, unit, element = self.gain(path)
                k, b = self.apply
                into = self.link(source, f"{name}.u", unit)
                self.x = k * self.x + b
                source = f"{name}.y"
            elements.append(element)
            links.append(into)
        return source, elements, links

    def inner(self, source: str, path: str, depth: int) -> tuple[str, str, str]:
        self.systems += 1
        name = f"s{self.systems}"
        first, last = self.r.choice(self.units), self.r.choice(self.units)
        into = self.link(source, f"{name}.in", first)
        end, elements, links = self.section("in", f"{path}{name}.", depth + 1)
        links.append(self.link(end, "out", last))
        ports = [takes("in", unit=first), gives("out", unit=last)]
        return f"{name}.out", system(name, elements, links, ports), into


def written(seed: int) -> tuple[Case, float]:
    """A system, and the value of its output at the start."""
    r = random.Random(seed)
    chain = Chain(r, r.choice(FAMILIES))
    end, elements, links = chain.section("a.y", "", 0)
    out = r.choice(chain.units)
    links.append(chain.link(end, "out", out))
    bound = bindings(binding(*chain.values)) if chain.values else ""
    elements.insert(0, component("a", "source", gives("y")))
    whole = system("case", elements, links, [gives("out", unit=out)], bound)
    return Case(f"random-{seed}", r.choice((2, 3)), "", Package(ssd(whole))), chain.x


def found(folder: Path, case: Case) -> float:
    path = folder / "x.ssp"
    path.write_bytes(content(case))
    return float(simulate(load_system(path), 0, record=["out"], trust=True).column("out")[0])


@pytest.mark.parametrize("seed", range(FEW))
def test_values_arrive_as_they_are_described(tmp_path: Path, seed: int) -> None:
    case, expected = written(seed)
    assert found(tmp_path, case) == pytest.approx(expected, rel=1e-9, abs=1e-9), case.ssd


@pytest.mark.long
def test_values_of_many_systems(tmp_path: Path) -> None:
    wrong = {}
    for seed in range(FEW, MANY):
        case, expected = written(seed)
        got = found(tmp_path, case)
        if got != pytest.approx(expected, rel=1e-9, abs=1e-9):
            wrong[seed] = (got, expected)
    assert not wrong
