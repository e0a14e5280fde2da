"""Parameters of which only combinations act."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fmus.definition import Model, Variable
from reconcile.judging.combined import combined, sentence

MOTOR = Model(
    name="motor",
    description="Motor",
    kind="continuous",
    step=0.01,
    states=(Variable("speed", "rad/s"),),
    inputs=(Variable("voltage", "V"),),
    outputs=(Variable("seen", "rad/s"),),
    parameters=(
        Variable("inertia", "kg.m2", start=2e-4),
        Variable("gain", "N.m/V", start=0.02),
        Variable("friction", "N.m.s/rad", start=1e-3),
        Variable("bias", "rad/s", start=0.1),
    ),
    rhs=lambda x, u, m, p: {"speed": (p.gain * u.voltage - p.friction * x.speed) / p.inertia},
    out=lambda x, u, m, p: {"seen": x.speed + p.bias},
)


class Ground:
    """What stands for the core."""

    def __init__(self, **known: Any) -> None:
        self.__dict__.update(known)


@pytest.mark.parametrize(
    ("free", "groups"),
    [
        (["inertia", "gain", "friction", "bias"], [("inertia", "gain", "friction")]),
        (["gain", "friction", "bias"], []),  # the inertia is known
        (["inertia"], []),
    ],
)
def test_what_one_changes_and_others_undo_is_a_group(free: list[str], groups: list[tuple[str, ...]]):
    core: Any = Ground(
        model=MOTOR,
        known=lambda point: dict.fromkeys(free, 1.0),
        scales={"voltage": SimpleNamespace(u=10.0)},
        base=SimpleNamespace(values={v.name: v.start for v in MOTOR.parameters}),
        kalman=SimpleNamespace(scale=np.array([100.0]), modes=[np.zeros((5, 0))]),
    )
    assert combined(core) == groups
    assert sentence(groups).count("inertia, gain and friction") == len(groups)


def test_a_model_without_free_parameters_has_no_groups():
    core: Any = Ground(known=lambda point: {}, base=None)
    assert combined(core) == []
