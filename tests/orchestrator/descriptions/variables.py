"""The variables of a random description, clocks and arrays among them."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from tests.orchestrator.descriptions.definitions import CAUSALITIES, REALS, TYPES, Definitions


class Variables(Definitions):
    """Adds elements of ModelVariables."""

    def structural(self) -> str:
        if self.version == 2 or self.r.random() < 0.5:
            return ""
        name, size = next(self.names), self.r.randint(1, 4)
        vr = next(self.vr)
        self.sizes[name] = size
        self._note(name, vr, "UInt64", "structuralParameter", "fixed", "exact", {}, start=size)
        given = {"name": name, "valueReference": self.spell.whole(vr), "causality": "structuralParameter"}
        given |= {"variability": self.some("fixed", None), "start": self.spell.whole(size)}
        return self.spell.element("UInt64", given)

    def clock(self) -> str:
        name, vr = next(self.names), next(self.vr)
        causality = self.some("input", "input", "output")
        kinds = ("constant", "fixed", "tunable", "changing", "countdown", "triggered")
        kind = self.some(*kinds) if causality == "input" else "triggered"
        times: tuple[Fraction | None, Fraction] = (None, Fraction(0))
        given: dict[str, str | None] = {}
        if kind in ("constant", "fixed", "tunable") and (kind == "constant" or self.r.random() < 0.6):
            times, stated = self._times()
            given |= stated
        priority = self.some(None, 0, 3)
        fraction = self.some(None, True, False)
        clock = {
            "interval_variability": kind, "interval_s": times[0], "shift_s": times[1],
            "supports_fraction": bool(fraction), "priority": priority or 0, "can_be_deactivated": False,
        }  # fmt: skip
        self._note(name, vr, "Clock", causality, "discrete", None, {}, clock=clock)
        self.clocks.append(name)
        given |= {"name": name, "valueReference": self.spell.whole(vr), "causality": causality}
        given |= {"intervalVariability": kind, "variability": self.some(None, "discrete")}
        given["priority"] = None if priority is None else self.spell.whole(priority)
        given["supportsFraction"] = None if fraction is None else self.spell.boolean(fraction)
        return self.spell.element("Clock", given)

    def independent(self) -> str:
        name, vr = next(self.names), next(self.vr)
        kind = REALS[self.version][0]
        self._note(name, vr, kind, "independent", "continuous", "", {})
        outer = {"name": name, "valueReference": self.spell.whole(vr), "causality": "independent"}
        outer["variability"] = self.some(None, "continuous")
        if self.version == 3:
            return self.spell.element(kind, outer)
        return self.spell.element("ScalarVariable", outer, self.spell.element(kind, {}))

    def _times(self) -> tuple[tuple[Fraction, Fraction], Mapping[str, str | None]]:
        resolution, counter, shift = self.some(1000, 3, 10**6), self.r.randint(1, 500), self.r.randint(0, 9)
        if self.r.random() < 0.4:
            exact = Fraction(counter, resolution), Fraction(shift, resolution)
            numbers = {"resolution": resolution, "intervalCounter": counter, "shiftCounter": shift}
            given = {k: self.spell.whole(v) for k, v in numbers.items()}
            return exact, given | {"intervalDecimal": repr(counter / resolution)}
        decimal, late = self.some("0.1", "2.5e-1", " 0.02", "1"), self.some(None, "0.05", "0")
        return (Fraction(decimal.strip()), Fraction(late or 0)), {
            "intervalDecimal": decimal,
            "shiftDecimal": late,
        }

    def variable(self) -> str:
        kind, causality = self.some(*TYPES[self.version]), self.some(*CAUSALITIES)
        variability, written = self._variability(kind, causality)
        initial, given_initial = self._initial(causality, variability)
        declared = self._type_for(kind)
        own = {} if kind == "Enumeration" else self._traits(kind)
        said = {**(self.types[declared][1] if declared else {}), **own}
        if not said.get("min", 0) <= said.get(
            "max", said.get("min", 0)
        ):  # one is its own, one is of the type
            own.pop("min", None)
            own.pop("max", None)
            said = {**(self.types[declared][1] if declared else {}), **own}
        shape = self._shape(kind)
        name, vr = next(self.names), next(self.vr)
        start = None
        if initial in ("exact", "approx"):
            start = self._start(kind, said, shape)
        clocks = self._clocks(variability, causality)
        self._note(
            name, vr, kind, causality, variability, initial, said, start=start, shape=shape, clocks=clocks
        )
        typed = self._said(own, kind) | {"declaredType": declared}
        outer = {
            "name": name, "valueReference": self.spell.whole(vr), "causality": causality,
            "variability": variability if written else None, "description": self.some(None, "<&> \"marks\""),
        }  # fmt: skip
        if causality == "local" and self.r.random() < 0.5:
            outer["causality"] = None
        self.seen.variables[name]["description"] = outer["description"] or ""
        return self._written(kind, outer, typed, initial if given_initial else None, start, shape, clocks)

    def _written(
        self,
        kind: str,
        outer: dict,
        typed: dict,
        initial: str | None,
        start: Any,
        shape: tuple,
        clocks: tuple,
    ) -> str:
        flat = start if isinstance(start, tuple) else () if start is None else (start,)
        texts = [self.spell.value(x, kind) for x in flat]
        if self.version == 2:
            typed["start"] = texts[0] if texts else None
            return self.spell.element(
                "ScalarVariable", outer | {"initial": initial}, self.spell.element(kind, typed)
            )
        given = {**outer, **typed, "initial": initial}
        if clocks:
            given["clocks"] = " ".join(str(self.seen.variables[c]["vr"]) for c in clocks)
        inner = "".join(self._dimension(d) for d in shape)
        if kind in ("String", "Binary"):
            inner += "".join(self.spell.element("Start", {"value": text}) for text in texts)
        elif texts:
            if len(set(texts)) == 1 and len(set(flat)) == 1 and self.r.random() < 0.5:
                texts = texts[:1]  # one value fills an array
            given["start"] = self.some(" ", "\n", "  ").join(t.strip() for t in texts)
        if self.r.random() < 0.2:
            inner += self._alias(given["name"])
        return self.spell.element(kind, given, inner)

    def _alias(self, name: str) -> str:
        other = next(self.names)
        self.seen.variables[other] = {**self.seen.variables[name], "description": "another name"}
        return self.spell.element("Alias", {"name": other, "description": "another name"})

    def _dimension(self, size: int | str) -> str:
        if isinstance(size, int):
            return self.spell.element("Dimension", {"start": self.spell.whole(size)})
        return self.spell.element("Dimension", {"valueReference": str(self.seen.variables[size]["vr"])})

    def _variability(self, kind: str, causality: str) -> tuple[str, bool]:
        real = kind in REALS[self.version]
        if causality in ("parameter", "calculatedParameter"):
            found = self.some("fixed", "tunable")
            return found, self.version == 2 or found != "fixed" or self.r.random() < 0.5
        choices = ["discrete", *(["continuous"] if real else [])]
        if causality in ("output", "local"):
            choices.append("constant")
        if causality == "local":
            choices += ["fixed", "tunable"]
        found = self.some(*choices)
        default = found == ("continuous" if real else "discrete") and (real or self.version == 3)
        return found, not default or self.r.random() < 0.5

    def _initial(self, causality: str, variability: str) -> tuple[str, bool]:
        """(initial, whether it is written)"""
        if causality == "input":
            return "exact", False
        if causality == "parameter" or variability == "constant":
            return "exact", self.some(True, False)
        choices = ["calculated", "approx"]
        if variability in ("discrete", "continuous"):
            choices.append("exact")
        found = self.some(*choices)
        return found, found != "calculated" or self.some(True, False)

    def _type_for(self, kind: str) -> str | None:
        fitting = [n for n, (k, _) in self.types.items() if k == kind]
        if kind == "Enumeration":
            return self.some(*fitting)
        return self.some(*fitting, None) if fitting else None

    def _shape(self, kind: str) -> tuple[int | str, ...]:
        if self.version == 2 or self.r.random() < 0.6:
            return ()
        return tuple(self.some(1, 2, 3, *self.sizes) for _ in range(self.r.randint(1, 2)))

    def _start(self, kind: str, said: dict, shape: tuple) -> Any:
        count = 1
        for size in shape:
            count *= self.sizes[size] if isinstance(size, str) else size
        values = tuple(self._one(kind, said) for _ in range(count))
        if shape and self.r.random() < 0.3:
            values = values[:1] * count
        return values if shape else values[0]

    def _one(self, kind: str, said: dict) -> Any:
        if kind == "Boolean":
            return self.some(True, False)
        if kind == "String":
            return self.some("", "a", "two words", "<&>", "ä€", "'\"")
        if kind == "Binary":
            return self.r.randbytes(self.r.randint(0, 8))
        if kind == "Enumeration":
            return self.some(*said["items"].values())
        low, high = said.get("min"), said.get("max")
        number = self.number(kind)
        if low is not None and number < low:
            number = low
        return high if high is not None and number > high else number

    def _clocks(self, variability: str, causality: str) -> tuple[str, ...]:
        fitting = variability == "discrete" and causality in ("input", "output", "local")
        if not self.clocks or not fitting or self.r.random() < 0.5:
            return ()
        return tuple(self.r.sample(self.clocks, self.r.randint(1, min(2, len(self.clocks)))))

    def _note(
        self, name: str, vr: int, kind: str, causality: str, variability: str, initial: str | None,
        said: dict, start: Any = None, shape: tuple = (), clocks: tuple = (), clock: dict | None = None,
    ) -> None:  # fmt: skip
        unit = said.get("unit", "")
        self.seen.variables[name] = {
            "vr": vr, "type": kind, "causality": causality, "variability": variability, "start": start,
            "unit_name": unit, "unit": self.units.get(unit), "min": said.get("min"), "max": said.get("max"),
            "nominal": said.get("nominal", 1.0), "relative": said.get("relativeQuantity", False),
            "items": said.get("items", {}), "dimensions": shape, "max_size": said.get("maxSize"),
            "clocks": clocks, "clock": clock, "description": "",
        }  # fmt: skip
        if initial is not None:
            self.seen.variables[name]["initial"] = initial
