"""A controller that means harm: commands of any size, infinite or no number, as `load_told` says."""

from collections.abc import Sequence

import casadi as ca

from deployment.bundling.build import bundle_model
from fmus.definition import Equations, Model, Variable, from_signals
from runtime.control import ControlCore
from tests.runtime.bundles import folder

HUGE, INFINITE, NO_NUMBER = 0.0, 1000.0, 2000.0  # kg: what `load_told` makes of it
OUTPUTS = ("u_slew", "qd_boom_ref", "qd_stick_ref")


def pusher(commands: Sequence[float]) -> Model:
    """It wants the same for ever."""
    return _of("pusher", lambda x, u, m, p: {f"held_{n}": c for n, c in zip(OUTPUTS, commands, strict=True)})


def model() -> Model:
    """Its outputs are -1e300, infinity or NaN, all of a sudden."""

    def next_state(x, u, m, p):
        huge = -1e300 - 1e150 * (1e150 * u.load_told) * u.load_told * u.load_told * u.load_told
        return {f"held_{n}": ca.sqrt(1500.0 - u.load_told) * huge for n in OUTPUTS}

    return _of("wild", next_state)


def _of(name: str, next_state: Equations) -> Model:
    return Model(
        name=name,
        description="Means harm",
        kind="discrete",
        step=0.02,
        states=tuple(Variable(f"held_{n}", "1") for n in OUTPUTS),
        inputs=from_signals("load_told", "q_slew"),
        outputs=from_signals(*OUTPUTS),
        parameters=(),
        rhs=next_state,
        out=lambda x, u, m, p: {n: getattr(x, f"held_{n}") for n in OUTPUTS},
    )


def core() -> ControlCore:
    """Its core."""
    return ControlCore(bundle_model(model(), "wild", folder() / "wild"))
