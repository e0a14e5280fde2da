"""A plant: what a controller drives, by the name of one of ours or from a file or folder of someone's.

All plants but `machine` are the nominal system with another slew drive in it.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fmus.models.slew_nn.fmu import write_folder
from fmus.models.slew_nn.model import INERTIA_UNKNOWN
from fmus.models.slew_nn.network import SlewNetwork, unknown_inertia
from fmus.paths import BUILD, ROOT, built_here
from fmus.toolchain.loader import load_model
from orchestrator.files.archive import opened
from orchestrator.fmi.model_description import parse
from orchestrator.system.pack import pack_system
from specs import systems
from specs.errors import InputError, nearest

SLEW = "slew"  # the component of the nominal system that a plant takes the place of
AHEAD = 2  # periods of 0.1 s by which our networks' speed is late
MODELS = ROOT / "fmus" / "models"
FOLDER = BUILD / "plants"


@dataclass(frozen=True)
class Plant:
    """A system and the models that take the place of its own; `network` is its slew drive, if it is one."""

    name: str
    system: str = "nominal"
    models: Mapping[str, Path] = field(default_factory=dict)
    network: SlewNetwork | None = None

    def pack(self, controller: Mapping[str, Path], name: str) -> Path:
        """The system with the controller `name` in it, packed."""
        models = {**self.models, **controller}
        key = hashlib.sha256(repr(sorted(models.items())).encode()).hexdigest()[:12]
        return pack_system(self.system, out=FOLDER / "systems" / f"{name}-{key}", models=models)


def names() -> list[str]:
    """The plants that have a name."""
    return list(OURS)


def find(text: str, our_inertia: bool = False, also: Sequence[str] = ()) -> Plant:
    """The plant of that name, or of a .npz file, FMU or folder that `slewright import slew` wrote.

    Where a plant does not say on which inertia number it was trained, InputError; with `our_inertia` it gets
    the project's.  `also`: words that stand for several plants, to say when there is none.
    """
    if text in OURS:
        return OURS[text]()
    path = Path(text)
    if not path.exists():
        valid = nearest(text, [*names(), *also])
        raise InputError(f"no plant '{text}': {valid} (or a .npz file, FMU or folder)")
    found = _of_path(path, our_inertia)
    if found.name in OURS:
        raise InputError(f"{path}: one of the project's plants is called {found.name}; give it another name")
    return found


def _of_path(path: Path, our_inertia: bool) -> Plant:
    if path.suffix == ".fmu":
        return _of_fmu(path, our_inertia)
    weights = path / "weights.npz" if path.is_dir() else path
    if weights.suffix == ".npz" and weights.is_file():
        name = weights.absolute().parent.name if weights.name == "weights.npz" else weights.stem
        return of_network(SlewNetwork.load(weights), name, our_inertia)
    if (path / "model.py").is_file():
        model = load_model(path)
        _check_contract(path, {v.name for v in model.inputs}, {v.name for v in model.outputs})
        return Plant(model.name, models={SLEW: path.resolve()})
    raise InputError(f"{path}: no plant; valid: a .npz file, an FMU, a folder with weights.npz or model.py")


def of_network(network: SlewNetwork, name: str, our_inertia: bool = False, ahead: int = 0) -> Plant:
    """The nominal system with this network; InputError if it cannot be a plant."""
    network.check_plant(name, our_inertia)
    return Plant(name, models={SLEW: _folder(network, ahead)}, network=network)


def _folder(network: SlewNetwork, ahead: int) -> Path:
    """A model folder of the network, written once for each content."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    content = b"".join(np.ascontiguousarray(a).tobytes() for a in network.numbers)
    told = f"{ahead} {network.symmetric} {sorted(network.meta.items())}".encode()
    name = f"slew_plant_{hashlib.sha256(content + told).hexdigest()[:12]}"
    made = FOLDER / name
    return made if made.is_dir() else write_folder(network, name, FOLDER, ahead)


def _of_fmu(path: Path, our_inertia: bool) -> Plant:
    with opened(path, str(path)) as archive:
        if "modelDescription.xml" not in archive.namelist():
            raise InputError(f"{path}: no FMU: it holds no modelDescription.xml")
        content = archive.read("modelDescription.xml")
    variables = parse(content, str(path)).variables.values()
    inputs, outputs = ({v.name for v in variables if v.causality == side} for side in ("input", "output"))
    _check_contract(path, inputs, outputs)
    if not our_inertia:
        if INERTIA_UNKNOWN.encode() in content:
            raise InputError(unknown_inertia(str(path)))
        if not built_here(hashlib.sha256(path.read_bytes()).hexdigest()):
            raise InputError(
                f"plant {path}: nothing says which slew inertia an FMU that was not built here takes; "
                "--our-inertia gives it the project's"
            )
    return Plant(path.stem, models={SLEW: path.resolve()})


def _check_contract(path: Path, inputs: set[str], outputs: set[str]) -> None:
    """The connectors that the nominal system has where its slew drive is."""
    wanted = systems.load("nominal").connectors(SLEW)
    lacking = [*sorted({*wanted[0]} - inputs), *sorted({*wanted[1]} - outputs)]
    if lacking:
        raise InputError(f"{path}: no slew drive of this machine: it lacks {', '.join(lacking)}")


def _published(mirrored: bool) -> Plant:
    network = SlewNetwork.load(MODELS / "slew_published" / "weights.npz")
    return (
        of_network(network.mirrored(), "published-mirror") if mirrored else of_network(network, "published")
    )


def _own(name: str, ahead: int) -> Plant:
    return of_network(SlewNetwork.load(MODELS / "slew_nn" / "weights.npz"), name, ahead=ahead)


OURS: dict[str, Callable[[], Plant]] = {
    "nominal": lambda: Plant("nominal"),
    "networks": lambda: _own("networks", 0),
    "networks-forward": lambda: _own("networks-forward", AHEAD),
    "published": lambda: _published(mirrored=False),
    "published-mirror": lambda: _published(mirrored=True),
    "machine": lambda: Plant("machine", "reference"),
}
