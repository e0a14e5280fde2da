"""Parameter bindings of an SSD: values given inline or in a parameter file (SSV)."""

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from orchestrator import xmlfile
from orchestrator.description import ParameterValue
from orchestrator.units import parse_units
from orchestrator.xmlfile import Element
from specs.errors import InputError
from specs.units import Unit

SSV_TYPE = "application/x-ssp-parameter-set"
IGNORED = ("Annotations", "MetaData", "Signature")


def read_bindings(holder: Element, ssd: Path, units: dict[str, Unit | None]) -> Iterator[ParameterValue]:
    """Values of all bindings under `holder` in their order (the later one wins).

    Raises InputError for what is not honoured (a mapping, a foreign type), naming file and line.
    """
    for binding in holder:
        where = f"{ssd.name} line {binding.sourceline}"
        if binding.get("type", SSV_TYPE) != SSV_TYPE:
            raise InputError(f"{where}: parameter binding of type '{binding.get('type')}'; valid: {SSV_TYPE}")
        parts = {xmlfile.local(child): child for child in binding if xmlfile.local(child) not in IGNORED}
        unknown = sorted(set(parts) - {"ParameterValues"})
        if unknown:
            raise InputError(f"{where}: <{unknown[0]}> is not supported; valid: ParameterValues")
        prefix = binding.get("prefix", "")
        for value in _values(binding, parts.get("ParameterValues"), ssd, units):
            yield ParameterValue(prefix + value.name, value.value, value.type, value.unit, value.where)


def _values(
    binding: Element, inline: Element | None, ssd: Path, units: dict[str, Unit | None]
) -> Iterator[ParameterValue]:
    source = binding.get("source")
    if source:
        path = _beside(ssd, source, binding)
        yield from _parameter_set(xmlfile.read(path, source), source, {})
    for parameter_set in () if inline is None else inline:
        yield from _parameter_set(parameter_set, ssd.name, units)


def _beside(ssd: Path, source: str, binding: Element) -> Path:
    """The file a relative URI names; one that leaves the folder of the SSD is refused."""
    parts = PurePosixPath(source)
    if parts.is_absolute() or ".." in parts.parts or ":" in source:
        raise InputError(f"{ssd.name} line {binding.sourceline}: source '{source}' is not inside the package")
    return ssd.parent / parts


def _parameter_set(root: Element, shown: str, outer: dict[str, Unit | None]) -> Iterator[ParameterValue]:
    if xmlfile.local(root) != "ParameterSet":
        raise InputError(f"{shown} line {root.sourceline}: <{xmlfile.local(root)}> is not a ParameterSet")
    units = outer | parse_units(root.find("{*}Units"), shown)
    for parameter in root.iterfind("{*}Parameters/{*}Parameter"):
        typed = [child for child in parameter if xmlfile.local(child) not in IGNORED]
        if len(typed) != 1:
            raise InputError(f"{shown} line {parameter.sourceline}: a parameter has exactly one value")
        yield _value(xmlfile.required(parameter, "name", shown), typed[0], shown, units)


def _value(name: str, typed: Element, shown: str, units: dict[str, Unit | None]) -> ParameterValue:
    where = f"{shown} line {typed.sourceline}"
    unit = typed.get("unit")
    if unit and unit not in units:
        raise InputError(f"{where}: parameter '{name}' has the undefined unit '{unit}'")
    text, kind = xmlfile.required(typed, "value", shown), xmlfile.local(typed)
    if kind in ("String", "Enumeration", "Binary"):
        return ParameterValue(name, text, kind, None, where)
    if text in ("true", "false"):
        return ParameterValue(name, float(text == "true"), kind, None, where)
    return ParameterValue(
        name, xmlfile.number(typed, "value", 0.0, shown), kind, units.get(unit or ""), where
    )
