"""The controllers there are: folder, gain file, settings and what is tuned, in one place.

A controller is a model folder (`baselines/<folder>`), the parameters that make it this variant (`settings`)
and the gains that tuning may move.  All run at 50 Hz and have the same connectors, so that any of them can
stand where the systems have their controller.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal

from baselines import variants
from fmus.toolchain.loader import load_model, model_folders
from specs import systems
from specs.errors import InputError, nearest

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
    """One controller; `gains` is its file in specs/parameters, `label` what tables call it."""

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


_FOUND = variants.read()  # gains of a variant, where it was tuned by itself
_SHAPER = (
    Range("shaper_speed_limit", 0.25, 0.7, log=False),
    Range("shaper_brake_share", 0.3, 1.2),
    Range("shaper_angle_gain", 0.3, 3.0),
    Range("shaper_brake_lead", 0.5, 4.0),
    Range("shaper_sway_gain", 0.03, 0.5),
    Range("shaper_sway_lead", 0.2, 0.9, log=False),
)

_ALL = (
    Controller(
        "pi",
        "pi",
        "pi",
        "PI (the paper's kind)",
        tuned=(
            Range("pi_slew_gain", 0.2, 4.0),
            Range("pi_slew_reset_rate", 0.0, 0.5, log=False),
            Range("pi_slew_limit", 0.3, 1.0, log=False),
            Range("pi_arm_gain", 0.4, 2.0),
        ),
    ),
    Controller(
        "pd",
        "pd",
        "pd",
        "PD, dead band compensated",
        tuned=(
            Range("pd_gain", 0.3, 6.0),
            Range("pd_damping", 0.2, 8.0),
            Range("pd_speed_limit", 0.3, 1.0, log=False),
        ),
    ),
    Controller(
        "parabola",
        "parabola",
        "parabola",
        "braking parabola, dead band compensated",
        tuned=(
            Range("parabola_speed_limit", 0.3, 0.75, log=False),
            Range("parabola_brake_share", 0.4, 1.4),
            Range("parabola_slope", 0.4, 2.0),
            Range("parabola_speed_gain", 0.5, 6.0),
            Range("parabola_preview", 0.15, 0.6, log=False),
        ),
    ),
    Controller(
        "lqr",
        "lqr",
        "lqr",
        "LQG on slew and roll, scheduled",
        tuned=(
            Range("lqr_share", 0.15, 1.5),
            Range("lqr_speed_limit", 0.25, 0.7, log=False),
            Range("lqr_brake_share", 0.3, 1.2),
            Range("lqr_brake_lead", 0.3, 2.0),
        ),
        aim="gentle",
    ),
    *(
        Controller(
            kind + ("_sway" if sway else ""),
            "shaper",
            "shaper",
            f"{kind.upper()}-shaped profile, tracked" + (", with sway feedback" if sway else ""),
            settings={
                "shaper_kind": float(number),
                "shaper_sway": float(sway),
                **_FOUND.get(kind + ("_sway" if sway else ""), {}),
            },
            tuned=_SHAPER if sway else _SHAPER[:-2],
            aim="gentle",
            family="" if (kind, sway) == ("zv", True) else "zv_sway",
        )
        for sway in (False, True)
        for number, kind in enumerate(("zv", "zvd", "ei"), 1)
    ),
    Controller(
        "plan",
        "plan",
        "plan",
        "plan by flatness, tracked, with sway feedback",
        tuned=(
            Range("plan_speed_limit", 0.25, 0.7, log=False),
            Range("plan_rise_share", 0.3, 1.5),
            Range("plan_brake_share", 0.3, 1.5),
            Range("plan_least_time", 0.8, 3.0),
            Range("plan_angle_gain", 0.3, 3.0),
            Range("plan_brake_lead", 0.5, 4.0),
            Range("plan_sway_gain", 0.03, 0.5),
        ),
        aim="gentle",
    ),
    Controller(
        "nmpc",
        "nmpc",
        "nmpc",
        "model predictive control of slew, arm and tool",
        tuned=(
            Range("nmpc_error", 1.0, 20.0),
            Range("nmpc_end_error", 10.0, 300.0),
            Range("nmpc_tool", 0.5, 20.0),
            Range("nmpc_arm", 5.0, 100.0),
            Range("nmpc_speed_limit", 0.25, 0.7, log=False),
        ),
        aim="gentle",
        linear="it optimises anew from step to step",
    ),
    *(
        Controller(
            f"operator_{who}",
            "operator",
            "operator",
            f"model of an {who} operator",
            settings={"operator_skill": skill},
            human=True,
            linear="it looks now and then",
        )
        for who, skill in (("experienced", 1.0), ("inexperienced", 0.0))
    ),
)


def names() -> list[str]:
    """Names of all controllers, in the order of tables."""
    return [c.name for c in _ALL]


@cache
def _known() -> dict[str, Controller]:
    return {c.name: c for c in _ALL}


def find(name: str) -> Controller:
    """The controller of this name; InputError names the valid ones."""
    if name not in _known():
        near, valid = nearest(name, names()), f"valid: {', '.join(names())}"
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
