"""Reads the variables of modelDescription.xml: types, sizes, start values and clocks, each checked alone.

Read but without influence on a co-simulation: quantity, displayUnit, unbounded, derivative, reinit,
previous, intermediateUpdate, mimeType, canBeDeactivated of clocks that stay active, and the descriptions.
Source: FMI 2.0.4, 2.2.3 and 2.2.7; FMI 3.0.2, 2.4.4 and 2.4.7, Modelica Association.
"""

import math
from collections.abc import Iterator, Mapping

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element, local
from orchestrator.fmi import value_texts
from orchestrator.fmi.variable import FMI2_TYPES, FMI3_TYPES, REALS, Value, Variable
from specs.errors import InputError, nearest
from specs.units import Unit

MAX_ELEMENTS = 2**22  # of all arrays of one FMU at their default sizes
MAX_VR = 2**32 - 1
CAUSALITIES = ("input", "output", "parameter", "calculatedParameter", "local", "independent")
VARIABILITIES = ("constant", "fixed", "tunable", "discrete", "continuous")
INITIALS = ("exact", "approx", "calculated")
# Children of a variable element that are read (Alias, Dimension, Start) or carry nothing for the run.
CHILDREN = ("Alias", "Annotations", "Dimension", "Start")


class VariableReader:
    """The variables of one modelDescription.xml; `where` names the file in messages (InputError)."""

    def __init__(self, root: Element, version: int, units: Mapping[str, Unit | None], where: str) -> None:
        self.version, self.units, self.where = version, units, where
        self.types = self._declared_types(root.find("TypeDefinitions"))
        holder = root.find("ModelVariables")
        # (element with name and causality, element with type, unit and start): the same one in FMI 3
        self.elements = [] if holder is None else [(e, self._typed(e)) for e in holder]
        self.names: dict[int, tuple[str, Element]] = {}  # FMI 3: by value reference
        self.undefined_units: set[str] = set()
        self.total = 0
        if version == 3:
            self._index()

    def variables(self) -> Iterator[Variable]:
        """In declared order, an alias of FMI 3 after the variable that it names."""
        for outer, typed in self.elements:
            variable = self._variable(outer, typed)
            yield variable
            for alias in outer.iterfind("Alias") if self.version == 3 else ():
                name = xml_file.required(alias, "name", self.where)
                text = alias.get("description", "")
                fields = {
                    **variable.__dict__,
                    "name": name,
                    "description": text,
                    "line": alias.sourceline or 0,
                }
                yield Variable(**fields)

    # ---- parts of a variable ----

    def _variable(self, outer: Element, typed: Element) -> Variable:
        declared = self._declared(typed)
        type_name = local(typed)
        causality = self._choice(
            outer,
            "causality",
            CAUSALITIES if self.version == 2 else (*CAUSALITIES, "structuralParameter"),
            "local",
        )
        variability = self._choice(
            outer, "variability", VARIABILITIES, self._variability(causality, type_name)
        )
        dimensions = tuple(self._dimension(d) for d in outer.iterfind("Dimension"))
        unit_name = typed.get("unit", declared.get("unit", "")) if type_name in REALS else ""
        self._check_references(outer, typed)
        if unit_name and unit_name not in self.units:
            self.undefined_units.add(unit_name)
        return Variable(
            name=xml_file.required(outer, "name", self.where),
            vr=self._vr(outer),
            type=type_name,
            causality=causality,
            variability=variability,
            unit_name=unit_name,
            unit=self.units.get(unit_name),
            start=self._start(typed, type_name, dimensions),
            min=value_texts.bound(typed, declared, "min", self.where),
            max=value_texts.bound(typed, declared, "max", self.where),
            nominal=self._nominal(typed, declared) if type_name in REALS else 1.0,
            description=outer.get("description", ""),
            dimensions=tuple(self.names[d][0] if by_vr else d for by_vr, d in dimensions),
            relative=self._inherited(typed, declared, "relativeQuantity"),
            items=value_texts.items(declared, self.version, self.where) if type_name == "Enumeration" else {},
            initial=self._initial(outer, typed, causality, variability),
            clocks=tuple(self._clocks(outer)),
            clock=value_texts.clock_info(typed, declared, self.where) if type_name == "Clock" else None,
            max_size=self._max_size(typed, declared) if type_name == "Binary" else None,
            multiple_set_per_instant=xml_file.boolean(
                outer, "canHandleMultipleSetPerTimeInstant", True, self.where
            ),
            line=outer.sourceline or 0,
        )

    def _nominal(self, typed: Element, declared: Element) -> float:
        """A magnitude: its sign does not count, and what is none is as if not given."""
        found = abs(float(value_texts.bound(typed, declared, "nominal", self.where) or 1.0))
        return found if 0.0 < found < math.inf else 1.0

    def _variability(self, causality: str, type_name: str) -> str:
        """The default; a parameter without one is taken as fixed, the most careful reading."""
        if causality in ("parameter", "calculatedParameter", "structuralParameter"):
            return "fixed"
        return "continuous" if type_name in REALS else "discrete"

    def _initial(self, outer: Element, typed: Element, causality: str, variability: str) -> str:
        """As given, or the standard's default for this causality and variability; an input has no choice."""
        if causality in ("independent", "input"):
            return "exact" if causality == "input" else ""
        exact = causality in ("parameter", "structuralParameter") or variability == "constant"
        holder = outer if self.version == 2 else typed
        return self._choice(holder, "initial", INITIALS, "exact" if exact else "calculated")

    def _start(
        self, typed: Element, type_name: str, dimensions: tuple[tuple[bool, int], ...]
    ) -> Value | None:
        """One value for a scalar, all of them for an array, of which one value given fills all (2.4.7.5)."""
        texts = value_texts.start_texts(typed, type_name, self.version)
        size = math.prod(self._structural(d) if by_vr else d for by_vr, d in dimensions)
        self.total += size
        if self.total > MAX_ELEMENTS:
            raise self.error(typed, f"the arrays have more than {MAX_ELEMENTS} elements in all")
        if texts is None:
            return None
        if len(texts) not in (1, size):
            raise self.error(typed, f"start has {len(texts)} values, but the variable has {size}")
        values = tuple(value_texts.scalar(typed, type_name, text, self.where) for text in texts)
        if not dimensions:
            return values[0]
        return values * size if len(values) == 1 else values

    def _inherited(self, typed: Element, declared: Element, name: str) -> bool:
        return xml_file.boolean(typed if typed.get(name) is not None else declared, name, False, self.where)

    def _max_size(self, typed: Element, declared: Element) -> int | None:
        holder = typed if typed.get("maxSize") is not None else declared
        size = xml_file.integer(holder, "maxSize", -1, self.where)
        return None if size < 0 else size

    # ---- references ----

    def _dimension(self, element: Element) -> tuple[bool, int]:
        """(False, fixed size) or (True, value reference of the structural parameter that gives the size)."""
        start, vr = element.get("start"), element.get("valueReference")
        if (start is None) == (vr is None):
            raise self.error(element, "<Dimension> needs either 'start' or 'valueReference'")
        if vr is None:
            size = xml_file.integer(element, "start", 0, self.where)
            if not 0 < size <= MAX_ELEMENTS:
                raise self.error(element, f"dimension of size {size}; valid: 1 … {MAX_ELEMENTS}")
            return False, size
        reference = self._vr(element)
        size = self._structural(reference, element)
        constant = self.names[reference][1].get("variability") == "constant"
        return (False, size) if constant else (True, reference)

    def _structural(self, vr: int, element: Element | None = None) -> int:
        """Default size that the variable with this value reference gives a dimension."""
        name, given = self.names.get(vr, ("", None))
        if given is None:
            raise xml_file.error(
                element, f"dimension refers to value reference {vr}; there is none", self.where
            )
        constant = given.get("variability") == "constant"
        if local(given) != "UInt64" or not (constant or given.get("causality") == "structuralParameter"):
            raise xml_file.error(
                element,
                f"dimension refers to '{name}', which is no structural parameter of type UInt64",
                self.where,
            )
        size = xml_file.integer(given, "start", 0, self.where)
        if not 0 < size <= MAX_ELEMENTS:
            raise self.error(given, f"'{name}' gives a dimension the size {size}; valid: 1 … {MAX_ELEMENTS}")
        return size

    def _check_references(self, outer: Element, typed: Element) -> None:
        """`derivative` and `previous` do not matter to a co-simulation, but what they name must exist."""
        for name in ("derivative", "previous"):
            text = typed.get(name)
            number = None if text is None else xml_file.as_integer(text)
            there = number in self.names if self.version == 3 else 0 < (number or 0) <= len(self.elements)
            if text is not None and not there:
                raise self.error(outer, f"{name}='{xml_file.shortened(text)}' names no variable")

    def _clocks(self, outer: Element) -> Iterator[str]:
        for text in outer.get("clocks", "").split():
            vr = xml_file.as_integer(text)
            name, clock = ("", None) if vr is None else self.names.get(vr, ("", None))
            if clock is None or local(clock) != "Clock":
                raise self.error(
                    outer, f"clocks='{xml_file.shortened(text)}' is not the value reference of a clock"
                )
            yield name

    # ---- elements ----

    def _typed(self, element: Element) -> Element:
        if self.version == 3:
            if element.tag not in FMI3_TYPES:
                raise self.error(element, f"unknown variable type <{local(element)}>")
            for child in element:
                if child.tag not in CHILDREN:
                    raise self.error(child, f"unknown element <{local(child)}> in a variable")
            return element
        typed = [child for child in element if child.tag in FMI2_TYPES]
        if element.tag != "ScalarVariable" or len(typed) != 1:
            raise self.error(
                element, f"<{local(element)}> without a known type; valid: {', '.join(FMI2_TYPES)}"
            )
        return typed[0]

    def _index(self) -> None:
        for element, _ in self.elements:
            vr, name = self._vr(element), xml_file.required(element, "name", self.where)
            if vr in self.names:
                raise self.error(element, f"'{name}' has the value reference {vr} of '{self.names[vr][0]}'")
            self.names[vr] = name, element

    def _declared_types(self, holder: Element | None) -> dict[str, Element]:
        """Type definitions by name: their attributes are defaults of the variables that refer to them."""
        types: dict[str, Element] = {}
        for element in () if holder is None else holder:
            inner = element
            if self.version == 2:
                found = [child for child in element if child.tag in FMI2_TYPES]
                if not found:
                    raise self.error(element, "type definition without a known type")
                inner = found[0]
            types[xml_file.required(element, "name", self.where)] = inner
        return types

    def _declared(self, typed: Element) -> Element:
        name = typed.get("declaredType")
        if name is None:
            return typed
        found = self.types.get(name)
        if found is None:
            raise self.error(typed, f"unknown declaredType '{name}'; {nearest(name, self.types)}")
        if local(found).removesuffix("Type") != local(typed):
            raise self.error(
                typed, f"declaredType '{name}' is <{local(found)}>, but the variable {local(typed)}"
            )
        return found

    def _vr(self, element: Element) -> int:
        xml_file.required(element, "valueReference", self.where)
        vr = xml_file.integer(element, "valueReference", 0, self.where)
        if not 0 <= vr <= MAX_VR:
            raise self.error(element, f"valueReference {vr}; valid: 0 … {MAX_VR}")
        return vr

    def _choice(self, element: Element, name: str, valid: tuple[str, ...], default: str) -> str:
        text = element.get(name, default)
        if text not in valid:
            raise self.error(element, f"{name}='{xml_file.shortened(text)}'; valid: {', '.join(valid)}")
        return text

    def error(self, element: Element, message: str) -> InputError:
        """`message` with the element's line, and the name of the variable where the element has one."""
        return xml_file.error(element, message, self.where)
