"""Parameter bindings of an SSD: a parameter set, inline or a file, under a prefix and through a mapping.

Source: SSP 2.0, 5.2.4, Modelica Association.
"""

from dataclasses import dataclass, replace
from pathlib import Path

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.ssp.ssc import Definitions
from orchestrator.ssp.ssm import Entry, apply, read_mapping
from orchestrator.ssp.ssv import ParameterValue, read_parameter_set
from orchestrator.ssp.text import Text, path_in_package

SSV_TYPE = "application/x-ssp-parameter-set"
SSM_TYPE = "application/x-ssp-parameter-mapping"
BASES = ("SSD", "component")


@dataclass(frozen=True)
class Binding:
    """One <ParameterBinding>, read when its values are asked for: they may lie inside the component."""

    text: Text
    root: Path
    folder: Path
    element: Element
    values_element: Element | None
    mapping_element: Element | None
    definitions: Definitions

    def values(self, component: Path | None) -> list[ParameterValue]:
        """Its values under the names that they have for the element; `component`: the element's own folder.

        Raises InputError, naming file and line, for what is wrong with the binding or its files.
        """
        prefix = self.element.get("prefix", "")
        values = [replace(v, name=prefix + v.name) for v in self._set(component)]
        if self.mapping_element is None:
            return values
        return apply(self._mapping(self.mapping_element, component), values, self.text.warnings)

    def _set(self, component: Path | None) -> list[ParameterValue]:
        warnings = self.text.warnings
        source = self.element.get("source")
        if source is not None:
            if self.values_element is not None:
                raise self.text.error(self.element, "'source' and <ParameterValues> exclude each other")
            path = self._path(self.element, source, component)
            return read_parameter_set(xml_file.read(path, source), source, warnings, True, Definitions())
        inner = self._inline(self.values_element, "ssd:ParameterValues", "ParameterSet")
        return read_parameter_set(inner, self.text.shown, warnings, False, self.definitions)

    def _mapping(self, holder: Element, component: Path | None) -> list[Entry]:
        source = holder.get("source")
        if source is None:
            inner = self._inline(holder, "ssd:ParameterMapping", "ParameterMapping")
            return read_mapping(inner, self.text.shown, self.text.warnings)
        if len(holder):
            raise self.text.error(holder, "'source' and an inline mapping exclude each other")
        path = self._path(holder, source, component)
        return read_mapping(xml_file.read(path, source), source, self.text.warnings)

    def _inline(self, holder: Element | None, form: str, name: str) -> Element:
        groups = {} if holder is None else self.text.children(holder, form)
        found = self.text.single(groups, name)
        if found is None:
            at = self.element if holder is None else holder
            raise self.text.error(at, f"neither 'source' nor <{name}> is there")
        return found

    def _path(self, element: Element, source: str, component: Path | None) -> Path:
        base = element.get("sourceBase", BASES[0])
        if base == "component" and component is None:
            raise self.text.error(element, "sourceBase 'component' needs a component with a source")
        folder = component if base == "component" and component else self.folder
        root = folder if base == "component" else self.root
        return path_in_package(self.text.place(element), root, folder, source)


def read_bindings(
    text: Text, holders: list[Element], root: Path, folder: Path, definitions: Definitions
) -> tuple[Binding, ...]:
    """The bindings below <ParameterBindings>, in their order: the later one wins.

    `folder` is that of the file, `root` that of the package, which no file name may leave; `definitions` are
    those of the file, which count in an inline parameter set that lacks some.
    """
    found = text.items(holders, "ssd:ParameterBindings", "ParameterBinding")
    return tuple(_binding(text, element, root, folder, definitions) for element in found)


def _binding(text: Text, element: Element, root: Path, folder: Path, definitions: Definitions) -> Binding:
    groups = text.children(element, "ssd:ParameterBinding")
    mapping = text.single(groups, "ParameterMapping")
    _check_type(text, element, SSV_TYPE, "parameter binding")
    if mapping is not None:
        text.children(mapping, "ssd:ParameterMapping")
        _check_type(text, mapping, SSM_TYPE, "parameter mapping")
    values = text.single(groups, "ParameterValues")
    return Binding(text, root, folder, element, values, mapping, definitions)


def _check_type(text: Text, element: Element, only: str, what: str) -> None:
    if element.get("type", only) != only:
        raise text.error(element, f"{what} of type '{element.get('type')}'; valid: {only}")
    base = element.get("sourceBase", BASES[0])
    if base not in BASES:
        raise text.error(element, f"sourceBase '{base}'; valid: {', '.join(BASES)}")
