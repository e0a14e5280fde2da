"""The controllers there are, found by their folders: label, settings and what is tuned.

A controller is a folder of `baselines/`: `model.py` (equations), `parameters.toml` (gains), `controller.toml`
(what tables call it, the gains that tuning may move, and where it has variants, the parameters that make
them).  All run at 50 Hz and have the same connectors, so that any of them can stand where the systems have
their controller.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from baselines import variants
from fmus.toolchain.loader import load_model, model_folders
from specs import parameters, systems
from specs.errors import InputError, nearest
from specs.schema import STRICT, read_toml, shown_path, validate

FOLDER = Path(__file__).parent
SLOT = "pi"  # the component of the systems that a controller takes the place of
RATE_HZ = 50.0
Aim = Literal["fast", "gentle"]  # what tuning asks for: baselines/tuning/cost.py


@dataclass(frozen=True)
class Range:
    """Where tuning may look for a gain; `log`: on a logarithmic scale."""

    name: str
    low: float
    high: float
    log: bool = True


@dataclass(frozen=True)
class Controller:
    """One controller; `gains` is whose parameters.toml it has, `label` what tables call it."""

    name: str
    folder: str
    gains: str
    label: str
    settings: Mapping[str, float] = field(default_factory=dict)
    tuned: Sequence[Range] = ()
    aim: Aim = "fast"
    human: bool = False  # a model of an operator: made to be like one, not as good as can be
    linear: str = ""  # why its loop cannot be analysed as a linear one; "" if it can
    rate_hz: float = RATE_HZ
    family: str = ""  # whose gains it has where it has none of its own (baselines/variants.py)
    place: Path | None = None  # of a model folder outside of the project

    @property
    def path(self) -> Path:
        """Its model folder."""
        return self.place or model_folders()[self.folder]

    @property
    def models(self) -> dict[str, Path]:
        """Model folders by the name that the systems know them by."""
        return {} if self.folder == SLOT else {SLOT: self.path}

    @property
    def parameters(self) -> dict[str, float]:
        """The settings as parameters of the system: "component.parameter" -> value."""
        return {f"{SLOT}.{name}": value for name, value in self.settings.items()}


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Where tuning may look for a gain, as a file states it."""

    __pydantic_config__: ClassVar[Any] = STRICT

    low: float
    high: float
    log: bool = True


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One of several controllers of a folder: values of parameters that make it, gains it does `without`."""

    __pydantic_config__: ClassVar[Any] = STRICT

    label: str
    settings: dict[str, float]
    without: list[str] = field(default_factory=list)
    family: str = ""


@dataclass(frozen=True, kw_only=True)
class Description:
    """A `controller.toml`; `order` is where tables have it, the fields else are those of `Controller`."""

    __pydantic_config__: ClassVar[Any] = STRICT

    label: str
    order: int
    aim: Aim = "fast"
    human: bool = False
    linear: str = ""
    tuned: dict[str, Bounds] = field(default_factory=dict)
    variants: dict[str, Variant] = field(default_factory=dict)


def names() -> list[str]:
    """Names of all controllers, in the order of tables."""
    return list(_known())


@cache
def _known() -> dict[str, Controller]:
    """All controllers: every folder of baselines/ with a controller.toml.

    Raises InputError for a mistake in one, and for a parameter or value reference that two have.
    """
    parameters.check()
    found = {
        path.parent.name: validate(Description, read_toml(path), shown_path(path))
        for path in sorted(FOLDER.glob("*/controller.toml"))
    }
    ordered = sorted(found.items(), key=lambda item: (item[1].order, item[0]))
    return {c.name: c for folder, description in ordered for c in _controllers(folder, description)}


def _controllers(folder: str, of: Description) -> Iterator[Controller]:
    """The controllers of a folder: one of its name, or its variants."""
    ranges = [Range(name, b.low, b.high, b.log) for name, b in of.tuned.items()]
    shared = {"aim": of.aim, "human": of.human, "linear": of.linear}
    if not of.variants:
        yield Controller(folder, folder, folder, of.label, tuned=ranges, **shared)
    found = variants.read()  # gains of a variant, where it was tuned by itself
    for name, v in of.variants.items():
        yield Controller(
            *(name, folder, folder, v.label),
            settings={**v.settings, **found.get(name, {})},
            tuned=[r for r in ranges if r.name not in v.without],
            family=v.family,
            **shared,
        )


def find(name: str, also: tuple[str, ...] = ()) -> Controller:
    """The controller of this name; InputError names the valid ones, and what is `also` valid there."""
    if name not in _known():
        near, valid = nearest(name, [*names(), *also]), f"valid: {', '.join([*names(), *also])}"
        hint = valid if near.startswith("valid") else f"{near} ({valid})"
        raise InputError(f"no controller '{name}'; {hint}")
    return _known()[name]


def foreign(path: Path, name: str, label: str) -> Controller:
    """A controller from a model folder that is none of the project's: a policy, say.

    Raises InputError where there is no such model, or its connectors are not those of a controller, or the
    name is taken, or the model's own name is that of another part of the systems, whose place it would take.
    """
    if name in _known():
        raise InputError(f"{path}: a controller '{name}' is there already; give yours another name")
    model = load_model(path)
    wanted = [v for side in systems.load("reference").connectors(SLOT) for v in side]
    lacking = sorted(set(wanted) - {v.name for v in (*model.inputs, *model.outputs)})
    if lacking:
        raise InputError(
            f"{path}: no controller of this machine: model {model.name} lacks {', '.join(lacking)}"
        )
    parts = {c.fmu for which in systems.names() for c in systems.load(which).components} - {SLOT}
    if model.name in parts:
        raise InputError(
            f"{path}: a part of the systems is called {model.name}; give your model another name"
        )
    return Controller(name, "", "", label, linear="it is not one of the project's", place=path.resolve())


def select(wanted: Sequence[str] = ()) -> list[Controller]:
    """The named controllers, all if none is named, each once."""
    return [find(name) for name in dict.fromkeys(wanted or names())]
