"""Models without states: an output that follows its input at once."""

import numpy as np

from fmus.definition import Model, Variable
from reconcile.recordings.data import runs_of
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
