"""Models without states: an output that follows its input at once."""

import numpy as np
import pytest

from fmus.definition import Model, Variable
from reconcile.judging.readings import rescaled
from reconcile.recordings.data import runs_of, split
from reconcile.search.core import Core
from reconcile.workflow import examine
from records.measurement import Channel, Measurement
from tests.reconcile import models

SPRING = models.folder(
    Model(
        name="scale",
        description="A spring scale",
        kind="continuous",
        step=0.01,
        states=(),
        inputs=(Variable("stretch", "m", "Stretch", min=-0.2, max=0.2),),
        outputs=(Variable("force", "N", "Force"),),
        parameters=(Variable("k", "N/m", "Spring", start=30.0, min=1.0, max=500.0),),
        rhs=lambda x, u, m, p: {},
        out=lambda x, u, m, p: {"force": p.k * u.stretch},
    )
)

CELL = models.folder(
    Model(
        name="cell",
        description="A cell at one charge",
        kind="continuous",
        step=0.1,
        states=(),
        inputs=(Variable("current", "A", "Current", min=-10.0, max=5.0),),
        outputs=(Variable("voltage", "V", "Voltage"),),
        parameters=(
            Variable("open", "V", "Open circuit", start=4.0, min=3.0, max=4.5),
            Variable("r", "ohm", "Resistance", start=0.02, min=0.0, max=1.0),
        ),
        rhs=lambda x, u, m, p: {},
        out=lambda x, u, m, p: {"voltage": p.open + p.r * u.current},
    )
)


@pytest.mark.parametrize(("ratio", "found"), [(1000.0, [0.001]), (1.0, []), (30.0, [])])
def test_a_level_a_thousand_times_the_models_is_a_reading(ratio: float, found: list[float]):
    """A cell's voltage, which is no state."""
    time = 1.0 * np.arange(60)
    current = np.where(time % 20 < 10, -5.0, 0.0)
    channels = {
        "current": Channel("current", "A", time, current),
        "voltage": Channel("voltage", "V", time, ratio * (4.1 + 0.03 * current)),
    }
    core = Core(CELL, split(runs_of(Measurement(channels, source="cell.csv"), CELL, "cell"), (), ()), ())
    assert [r.ratios for r in rescaled(core)] == [(("voltage", f),) for f in found]


def test_a_model_without_states_is_judged():
    random, time = np.random.default_rng(4), 0.05 * np.arange(300)
    stretch = 0.05 * (1.0 + np.sin(0.7 * time) + 0.4 * np.sin(2.9 * time))
    force = 26.0 * stretch + 0.3 + 0.01 * random.standard_normal(len(time))
    channels = {
        "stretch": Channel("stretch", "m", time, stretch),
        "force": Channel("force", "N", time, force),
    }
    figures, answer = examine(SPRING, runs_of(Measurement(channels, source="scale.csv"), SPRING, "scale"))
    sets = [{a.effect.name for a in k} for k in (answer.present, *answer.alternatives)]
    assert figures["verdict"] in ("named", "ambiguous")
    assert {"sensor_bias"} in sets
    assert set().union(*sets) <= {"sensor_bias", "input_offset"}
