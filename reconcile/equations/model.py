"""Where effects may attach: a model's folder with its ports, and the catalogue's candidates at them."""

import sys
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.definition import Model
from fmus.toolchain.loader import load_model, model_folders
from fmus.toolchain.tried import line, tried, try_equations
from reconcile.catalogue import ALL, Effect, offset
from reconcile.catalogue.effect import AXIS_PLACES
from reconcile.equations import motion, sites
from reconcile.equations.ports import ALL_OUTPUTS, Axis, Ports, find_ports
from specs.errors import InputError

NOT_UPRIGHT = ("gravity_load", "stiffness", "cubic_stiffness", "end_stop")  # it turns freely, all around
# of all outputs they do not show without an input; a lag does, as an exponential of its own
LATE = ("sensor_delay", "clock_drift", offset.NAME)
DRIFT = "sensor_drift"


@dataclass(frozen=True)
class Attached:
    """An effect at a port; `other`: the second signal of a cross effect."""

    effect: Effect
    port: str
    other: str | None = None

    @property
    def key(self) -> str:
        """Prefix of its parameters and states."""
        return f"{self.effect.key}@{self.port}" + (f"+{self.other}" if self.other else "")

    def name(self, parameter: str) -> str:
        """Full name of a parameter, gate or hidden state."""
        return f"{self.key}.{parameter}"

    @property
    def columns(self) -> tuple[str, ...]:
        """What it is scored by linearly: its amplitudes, or its gate."""
        if self.effect.gated:
            return (self.name("gate"),)
        return tuple(self.name(p.name) for p in self.effect.amplitudes)

    @property
    def free(self) -> tuple[str, ...]:
        """What is fitted once it is in."""
        return tuple(self.name(p.name) for p in self.effect.parameters)


@dataclass(frozen=True)
class Folder:
    """A model folder read: the model, its ports and where it lies."""

    model: Model
    ports: Ports
    path: Path


def read_folder(folder: Path | str) -> Folder:
    """Load a model folder (a path or a project model's name) with its ports.

    Raises InputError for one that cannot be loaded or is a closed network (MX), which cannot be opened up.
    """
    model = load_model(folder)
    if model.symbolic == "MX":
        raise InputError(f"model {model.name} is made of matrices (MX); reconcile needs scalar equations")
    path = Path(folder) if (Path(folder) / "model.py").is_file() else model_folders()[str(folder)]
    file, module = path / "model.py", sys.modules.get("slewright_model_" + path.name)
    try_equations(model, file)
    try:
        ports = find_ports(model, getattr(module, "PORTS", None))
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    except Exception as error:  # the file is the user's: whatever it declares is wrong input
        raise InputError(f"{file}{line(error, file)}: PORTS: {type(error).__name__}: {error}") from error
    for name, own in _functions(ports):
        tried(lambda own=own: own(*model.namespaces), own, f"PORTS['{name}']", model, file)
    return Folder(model, ports, path)


def _functions(ports: Ports) -> list[tuple[str, Any]]:
    """The user's functions among what ports are declared to be, with the port's name."""
    roles = [(a.name, list(vars(a).values())) for a in ports.axes]
    roles += [(s.name, list(s.roles.values())) for s in ports.sites]
    flat = [(n, x) for n, own in roles for r in own for x in (r if isinstance(r, tuple | list) else (r,))]
    return [(n, x) for n, x in flat if callable(x)]


def candidates(
    folder: Folder,
    recorded: Sequence[str],
    catalogue: Sequence[Effect] = ALL,
    constant: Collection[str] = (),
) -> list[Attached]:
    """Every effect at every port it fits, for outputs and inputs among the `recorded` signals.

    None that cannot be told since these inputs are `constant` (see `_idle`).
    """
    ports, found = folder.ports, []
    controls = [n for n in ports.controls if n in recorded and n not in ports.offsets]
    shifted = [n for n in ports.offsets if n in recorded]
    outputs = [n for n in ports.outputs if n in recorded]
    for effect in catalogue:
        at = sites.ports_of(effect, ports, recorded)
        found += [Attached(sites.fitted(effect, ports, port, recorded), port) for port in at]
        if effect.port:
            continue
        if effect.place == "input":
            found += _crossed(effect, controls, folder)
            found += [Attached(effect, n) for n in shifted if effect.name == "input_offset"]
        elif effect.place == "output":
            if not effect.clock:
                found += _crossed(effect, outputs, folder)
            if effect.clock or (effect.delays and len(outputs) > 1):
                found.append(Attached(effect, ALL_OUTPUTS))
        elif effect.place in AXIS_PLACES:
            found += [Attached(effect, a.name) for a in ports.axes if _fits(effect, a, folder)]
    found = [a for a in found if a.effect.name not in ports.has.get(a.port, ())]
    moves = any(v.name in recorded and v.name not in constant for v in folder.model.inputs)
    if (constant or not folder.model.inputs) and not moves:
        found = [a for a in found if not _undriven(a, ports, outputs)]
    return [a for a in found if not _idle(a, ports, recorded, constant)]


def _idle(a: Attached, ports: Ports, recorded: Sequence[str], constant: Collection[str]) -> bool:
    """Whether an effect only makes another constant of a constant input, as any other does that."""
    if a.effect.place != "input" or a.port in ports.offsets:  # an offset of what is measured has a size
        return False
    signals = [n for n in (*ports.members(a.port), a.other) if n in recorded]
    return bool(signals) and all(n in constant for n in signals)


def _undriven(a: Attached, ports: Ports, outputs: Sequence[str]) -> bool:
    """Whether an effect shows only against an input that moves.

    Outputs that are all late are in step with each other, and the hidden end of a shaft that nothing drives
    swings as it would with any disturbance.  Beside what decays and has no axis, a drift is as one more
    slow decay.
    """
    late = a.effect.name in LATE and ports.holds(a.port, outputs)
    return a.effect.shaft or late or (a.effect.name == DRIFT and not ports.axes)


def _crossed(effect: Effect, names: Sequence[str], folder: Folder) -> list[Attached]:
    """At each signal, or each pair; sensors that the model tells apart do not mix (but see `turned`)."""
    model = folder.model
    if "other" in effect.needs:
        apart = effect.place == "output" and bool(folder.ports.output_groups)
        pairs = [(n, other) for n in names for other in names if other != n and not apart]
        return [Attached(effect, n, o) for n, o in pairs if unit_of(model, n) == unit_of(model, o)]
    return [Attached(effect, n) for n in names]


def _fits(effect: Effect, axis: Axis, folder: Folder) -> bool:
    model = folder.model
    unit = unit_of(model, axis.position) if axis.position else ""
    if axis.upright and effect.name in NOT_UPRIGHT:
        return False
    known = {"q": bool(axis.position), "rad": unit == "rad", "continuous": model.kind == "continuous"}
    known |= {"upright": axis.upright} | {n: getattr(axis, n) is not None for n in ("reach2", "reach2_rate")}
    if "driven" in effect.needs:
        known["driven"] = motion.driven(model, folder.ports, axis)
    return all(known.get(need, True) for need in effect.needs)


def unit_of(model: Model, name: str) -> str:
    """Unit of a variable, "" for one that has none."""
    return next(v.unit for v in (*model.states, *model.inputs, *model.outputs) if v.name == name)
