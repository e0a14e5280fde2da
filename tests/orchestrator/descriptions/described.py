"""A whole random description: interface, structure, terminals, experiment, and the document around them."""

from collections.abc import Sequence

from tests.orchestrator.descriptions.definitions import WORDS, Seen
from tests.orchestrator.descriptions.variables import Variables


class Writer(Variables):
    """Adds what stands around the variables."""

    def structure(self, declared: Sequence[str]) -> str:
        """Outputs with their dependencies; FMI 2 counts variables from 1, FMI 3 names value references."""
        known = self.seen.variables
        outputs = [n for n in declared if known[n]["causality"] == "output"]
        unknown = [n for n in outputs if known[n].get("initial") in ("approx", "calculated")]
        first = [self._unknown(n, declared, "Output", self.seen.dependencies) for n in outputs]
        initial = [
            self._unknown(n, declared, "InitialUnknown", self.seen.initial_dependencies) for n in unknown
        ]
        for name in known:  # one that starts at a given value depends on nothing at the start
            if known[name]["causality"] == "output" and known[name].get("initial") == "exact":
                self.seen.initial_dependencies[name] = ()
        if self.version == 2:
            sections = [("Outputs", first), *([("InitialUnknowns", initial)] if initial else [])]
            inner = "".join(self.spell.element(name, {}, "".join(parts)) for name, parts in sections)
        else:
            inner = "".join(first + initial)
        return self.spell.element("ModelStructure", {}, inner)

    def _unknown(self, name: str, declared: Sequence[str], section: str, noted: dict) -> str:
        inputs = [n for n in declared if self.seen.variables[n]["causality"] == "input"]
        given: dict[str, str | None] = {
            "index" if self.version == 2 else "valueReference": self._reference(name, declared)
        }
        found = None
        if self.r.random() < 0.7:
            found = tuple(self.r.sample(inputs, self.r.randint(0, len(inputs))))
            given["dependencies"] = self.some(" ", "  ", "\n").join(
                self._reference(n, declared) for n in found
            )
            if self.r.random() < 0.5:
                given["dependenciesKind"] = " ".join(self.some("dependent", "constant") for _ in found)
        self._depends(name, found, noted)
        return self.spell.element("Unknown" if self.version == 2 else section, given)

    def _reference(self, name: str, declared: Sequence[str]) -> str:
        return str(declared.index(name) + 1 if self.version == 2 else self.seen.variables[name]["vr"])

    def _depends(self, name: str, found: tuple[str, ...] | None, noted: dict) -> None:
        """An alias depends as what it names does, and stands beside it where that is depended on."""
        known = self.seen.variables
        if self.version == 2 or found is None:
            same = [name] if self.version == 2 else [n for n in known if known[n]["vr"] == known[name]["vr"]]
            noted.update(dict.fromkeys(same, found))
            return
        vrs = {known[n]["vr"] for n in found}
        inputs = tuple(n for n in known if known[n]["vr"] in vrs)
        noted.update({n: inputs for n in known if known[n]["vr"] == known[name]["vr"]})

    def terminals(self) -> str:
        written = []
        for number in range(self.r.randint(0, 2)):
            name = f"{self.some(*WORDS)} {number}"
            chosen = self.r.sample(
                list(self.seen.variables), self.r.randint(1, min(4, len(self.seen.variables)))
            )
            members = {f"m{k} {self.some(*WORDS)}": v for k, v in enumerate(chosen)}
            inner = "".join(
                self.spell.element(
                    "TerminalMemberVariable", {"variableName": v, "memberName": m, "variableKind": "signal"}
                )
                for m, v in members.items()
            )
            written.append(self.spell.element("Terminal", {"name": name, "matchingRule": "bus"}, inner))
            self.seen.terminals[name] = members
        if not written:
            return ""
        inner = self.spell.element("Terminals", {}, "".join(written))
        return f'<fmiTerminalsAndIcons fmiVersion="3.0">{inner}</fmiTerminalsAndIcons>'

    def experiment(self) -> str:
        if self.r.random() < 0.3:
            return ""
        start, stop, step, tolerance = (
            self.some(None, 0.0, 1.5),
            self.some(None, 2.0, 60.0),
            self.some(None, 0.02),
            None,
        )
        self.seen.model |= {"default_start_s": start, "default_stop_s": stop, "default_step_s": step}
        values = {"startTime": start, "stopTime": stop, "stepSize": step, "tolerance": tolerance}
        given = {k: self.spell.real(v) for k, v in values.items() if v is not None}
        return self.spell.element("DefaultExperiment", given)

    def annotations(self) -> str:
        """What other tools leave there is nobody else's business."""
        if self.r.random() < 0.7:
            return ""
        inner = '<x:thing xmlns:x="urn:other" name="a"><Float64 start="?"/></x:thing>'
        if self.version == 2:
            return self.spell.element(
                "VendorAnnotations", {}, self.spell.element("Tool", {"name": "x"}, inner)
            )
        return self.spell.element("Annotations", {}, self.spell.element("Annotation", {"type": "x.y"}, inner))

    def categories(self) -> str:
        if self.r.random() < 0.5:
            return ""
        found = {
            f"{self.some(*WORDS)}{k}": self.some("", "what <it> logs") for k in range(self.r.randint(1, 3))
        }
        self.seen.model["log_categories"] = found
        inner = "".join(
            self.spell.element("Category", {"name": n, "description": d or None}) for n, d in found.items()
        )
        return self.spell.element("LogCategories", {}, inner)

    def interface(self, identifier: str) -> str:
        flags = {
            "can_get_set_state": "canGetAndSetFMUstate" if self.version == 2 else "canGetAndSetFMUState",
            "variable_step": "canHandleVariableCommunicationStepSize",
            "only_once_per_process": "canBeInstantiatedOnlyOncePerProcess",
        }
        found = {k: self.some(None, True, False) for k in flags}
        given = {flags[k]: self.spell.boolean(v) for k, v in found.items() if v is not None}
        if self.version == 3:
            given["hasEventMode"] = self.spell.boolean(True)
        self.seen.model |= {k: bool(v) for k, v in found.items()}
        return self.spell.element("CoSimulation", {"modelIdentifier": identifier, **given})

    def write(self, identifier: str) -> Seen:
        units, types = self.unit_definitions(), self.type_definitions()
        variables = [self.structural()]
        if self.version == 3:
            variables += [self.clock() for _ in range(self.r.randint(0, 2))]
        if self.r.random() < 0.5:
            variables.append(self.independent())
        variables += [self.variable() for _ in range(self.r.randint(1, 12))]
        declared = list(self.seen.variables)
        token = "guid" if self.version == 2 else "instantiationToken"
        title = f"model {self.some(*WORDS)}"
        self.seen.model |= {"model_name": title, "token": "{8c4e}", "model_identifier": identifier}
        root = {"fmiVersion": f"{self.version}.0", "modelName": title, token: "{8c4e}", "author": "somebody"}
        parts = (
            self.interface(identifier), units, types, self.categories(), self.experiment(),
            self.spell.element("ModelVariables", {}, "\n".join(variables)), self.structure(declared),
            self.annotations(),
        )  # fmt: skip
        body = self.spell.element("fmiModelDescription", root, "\n".join(parts))
        self.seen.text = self._encoded(body)
        self.seen.terminal_text = self.terminals()
        return self.seen

    def _encoded(self, body: str) -> bytes:
        """The document in an encoding of XML, with a byte order mark or without."""
        name, codec = self.some(
            *[("UTF-8", "utf-8")] * 3, ("UTF-8", "utf-8-sig"), ("UTF-16", "utf-16"), ("ISO-8859-1", "latin-1")
        )
        head = (
            f'<?xml version="1.0" encoding="{name}"?>\n' if codec != "utf-8" or self.r.random() < 0.8 else ""
        )
        return (head + body).encode(codec, "xmlcharrefreplace")


def described(seed: int, version: int, identifier: str = "m") -> Seen:
    """The description number `seed`."""
    return Writer(seed, version).write(identifier)
