"""Which inputs an FMU's outputs depend on directly: ModelStructure of FMI 2.0 and 3.0.

For model exchange also the states' derivatives and the event indicators. Read but without influence:
clocked states, and the kind of a dependency.
Source: FMI 2.0.4, 2.2.8; FMI 3.0.2, 2.4.8, Modelica Association.
"""

from collections.abc import Iterator, Mapping, Sequence

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element, local
from orchestrator.fmi.variable import Variable
from specs.errors import InputError, listed

# Names of inputs; None: the FMU does not say, it may be all of them.
Dependencies = Mapping[str, tuple[str, ...] | None]

MAX_REFERENCES = 10_000_000  # dependencies of all outputs, aliases counted
SECTIONS2 = ("Outputs", "Derivatives", "InitialUnknowns")
SECTIONS3 = ("Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator")


class StructureReader:
    """`outputs`: what outputs depend on while stepping; `initial`: the same during initialisation.

    `variables` are in declared order.  Raises InputError, naming `where` and line, for references to
    variables that do not exist, and for elements that the standard does not know.
    """

    def __init__(self, root: Element, version: int, variables: Mapping[str, Variable], where: str) -> None:
        self.version, self.variables, self.where = version, variables, where
        self.declared = list(variables)
        self.read = 0
        self.by_vr: dict[int, list[str]] = {}
        for variable in variables.values():
            self.by_vr.setdefault(variable.vr, []).append(variable.name)
        outputs = [v.name for v in variables.values() if v.causality == "output"]
        self.derivatives: list[str] = []
        self.indicators: list[str] = []  # FMI 3
        listed = self._listed(root.find("ModelStructure"))
        self.outputs: Dependencies = {name: listed[0].get(name) for name in outputs}
        self.initial: Dependencies = {name: self._initially(listed[1], name) for name in outputs}
        self.missing = [name for name in outputs if name not in listed[0]]
        self.not_outputs = [name for name in listed[0] if name not in self.outputs]

    def warnings(self) -> Iterator[str]:
        """Sentences on what the structure lacks."""
        if self.missing and any(v.causality == "input" for v in self.variables.values()):
            yield f"outputs missing from ModelStructure may depend on every input: {listed(self.missing)}"
        if self.not_outputs:
            yield f"ModelStructure lists variables as outputs that are none: {listed(self.not_outputs)}"

    def _initially(self, listed: Dependencies, name: str) -> tuple[str, ...] | None:
        """An output that starts at a given value depends on nothing at the start."""
        if name not in listed and self.variables[name].initial == "exact":
            return ()
        return listed.get(name)

    def _listed(self, holder: Element | None) -> tuple[Dependencies, Dependencies]:
        """(output, initial unknown) to inputs, as far as listed."""
        found: dict[str, dict[str, tuple[str, ...] | None]] = {"output": {}, "initial": {}, "": {}}
        for section, element in self._unknowns(holder):
            key = {"Output": "output", "InitialUnknown": "initial"}.get(section, "")
            inputs = self._inputs(element)
            names = self._names(element, "index" if self.version == 2 else "valueReference")
            if section in ("Derivative", "ContinuousStateDerivative"):
                self.derivatives.extend(names[:1])  # of aliases one: it is one derivative
            elif section == "EventIndicator":
                self.indicators.extend(names[:1])
            for name in names:
                found[key][name] = inputs
        return found["output"], found["initial"]

    def _unknowns(self, holder: Element | None) -> Iterator[tuple[str, Element]]:
        """(section in FMI 3's words, element)"""
        for child in () if holder is None else holder:
            name = local(child)
            if name not in (SECTIONS2 if self.version == 2 else SECTIONS3) and name != "Annotations":
                raise self._error(child, f"unknown element <{name}> in ModelStructure")
            if self.version == 3 and name != "Annotations":
                yield name, child
            elif self.version == 2:
                yield from ((name.removesuffix("s"), unknown) for unknown in child.iterfind("Unknown"))

    def _inputs(self, element: Element) -> tuple[str, ...] | None:
        if element.get("dependencies") is None:
            return None
        return tuple(
            name for name in self._names(element, "dependencies") if self.variables[name].causality == "input"
        )

    def _names(self, element: Element, attribute: str) -> list[str]:
        """Variables that an attribute refers to: by index from 1 in FMI 2, by value reference in FMI 3."""
        names: list[str] = []
        if attribute != "dependencies":
            xml_file.required(element, attribute, self.where)
        for text in element.get(attribute, "").split():
            number = xml_file.as_integer(text)
            found: Sequence[str] = ()
            if number is not None and self.version == 3:
                found = self.by_vr.get(number, ())
            elif number is not None and 0 < number <= len(self.declared):
                found = (self.declared[number - 1],)
            if not found:
                raise self._error(
                    element, f"{attribute} names variable {xml_file.shortened(text)}; there is none"
                )
            names.extend(found)
            self.read += len(found)
            if self.read > MAX_REFERENCES:
                raise self._error(element, f"ModelStructure has more than {MAX_REFERENCES} references")
        return names

    def _error(self, element: Element, message: str) -> InputError:
        return InputError(f"{self.where} line {element.sourceline}: {message}")
