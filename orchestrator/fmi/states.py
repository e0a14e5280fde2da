"""Whether an FMU of model exchange lists its states' derivatives: one that it leaves out is never integrated.

Source: FMI 2.0.4, 2.2.8; FMI 3.0.2, 2.4.8, Modelica Association.
"""

from collections import Counter
from collections.abc import Iterator

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.fmi.model_structure import StructureReader
from orchestrator.fmi.variable import REALS
from specs.errors import InputError, listed

RATES = ("local", "output")  # causalities of derivatives


def check_states(root: Element, version: int, structure: StructureReader, where: str) -> Iterator[str]:
    """Warnings; InputError for a list of derivatives that cannot be, or is empty where there are some."""
    _check_listed(structure, where)
    rates = structure.derivatives
    of = dict(_stated(root, version, structure))
    known = {of[name] for name in rates if name in of}
    vrs = {structure.variables[name].vr for name in rates}
    left = [n for n, state in of.items() if structure.variables[n].vr not in vrs and state not in known]
    if left and not rates:
        raise InputError(f"{where}: ModelStructure lists no derivative, but there is {listed(left)}: "
                         "no state would move")  # fmt: skip
    if left and len(known) == len(rates):  # else some do not say whose derivatives they are
        yield f"ModelStructure does not list {listed(left)} among the derivatives: it is not integrated"


def _check_listed(structure: StructureReader, where: str) -> None:
    rates = structure.derivatives
    for name in rates:
        v = structure.variables[name]
        if v.causality not in RATES or v.type not in REALS:
            raise InputError(f"{where}: ModelStructure lists {name} as a derivative; it is of causality "
                             f"{v.causality} and type {v.type}")  # fmt: skip
    if twice := [name for name, count in Counter(rates).items() if count > 1]:
        raise InputError(f"{where}: ModelStructure lists the derivative {twice[0]} twice")


def _stated(root: Element, version: int, structure: StructureReader) -> Iterator[tuple[str, str]]:
    """(derivative, state) as the variables' own attributes have it; derivatives of inputs are no states'."""
    for outer in root.iterfind("ModelVariables/*"):
        typed = [outer] if version == 3 else outer.iterfind("*")
        text = next((t for e in typed if (t := e.get("derivative")) is not None), None)
        number = None if text is None else xml_file.as_integer(text)
        name = outer.get("name", "")
        if number is None or structure.variables[name].causality not in RATES:
            continue
        state = structure.by_vr[number][0] if version == 3 else structure.declared[number - 1]
        if structure.variables[state].causality in RATES:
            yield name, state
