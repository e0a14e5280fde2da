"""What `slewright reconcile` says on the console beside the tables."""

from pathlib import Path

import numpy as np
import pytest

from reconcile import workflow
from reconcile.equations.model import candidates
from reconcile.judging import unidentifiable
from reconcile.reporting.terminal import lines, recording_notes, tables
from slewright import __main__ as entry
from tests.reconcile import models


def test_the_help_spells_the_table_of_a_map(capsys):
    assert entry.run(["reconcile", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "Names: a table [names] with theirs = 'ours [unit]'." in said


def test_what_was_left_out_of_a_recording_and_what_it_hides_is_said():
    missing = "output speed is not recorded"
    figures = {
        "nuisances": {"first": {"mended": ["speed: left out, it has no sample"], "time_offset_s": 0.0}},
        "untold": [
            {"effect": "sensor_bias", "because": missing},
            {"effect": "sensor_lag", "because": f"{missing}; there is no second signal of the same unit"},
            {"effect": "gravity_load", "because": "no axis of the model turns by an angle"},
        ],
    }
    assert recording_notes(figures) == [
        "first: speed: left out, it has no sample",
        f"{missing}, so these cannot be told: sensor_bias, sensor_lag",
    ]


def test_a_curve_is_printed_point_by_point():
    curve = {
        "terms": ["another curve of the command U"],
        "equation": "u' = u + curve(u)",
        "unit": "V",
        "over_unit": "V",
        "points": [
            {"at": -1.0, "value": 0.25, "ci95": [0.2, 0.3]},
            {"at": 1.0, "value": 0.0, "ci95": [-0.1, 0.1]},
        ],
    }
    title, head, rows = next(iter(tables({"effects": [], "free_form": [curve], "gap": {}})))
    assert title == "Another curve of the command U: u' = u + curve(u)"
    assert head == ["at [V]", "value [V]", "95 %"]
    assert rows == [("-1", "0.25", "0.2 .. 0.3"), ("1", "0", "-0.1 .. 0.1")]


@pytest.mark.parametrize(("driven", "asked"), [(True, True), (False, False)])
def test_a_drift_is_not_asked_where_a_body_only_cools(driven: bool, asked: bool):
    names = ["heat", "temperature"] if driven else ["temperature"]
    found = {a.effect.name for a in candidates(models.cooling(driven), names)}
    assert ("sensor_drift" in found) == asked
    assert "sensor_lag" in found


def test_that_no_force_is_looked_for_is_said_in_one_sentence():
    body = models.cooling(driven=False)
    figures = {
        "nuisances": {},
        "untold": unidentifiable.effects(
            body, [models.run({}, {"temperature": (np.arange(2.0), np.zeros(2))})]
        ),
    }
    said = recording_notes(figures)[-1]
    assert "no friction, spring or load is looked for" in said
    assert "declare PORTS in model.py" in said
    assert not recording_notes({"nuisances": {}, "untold": []})


def test_a_model_whose_output_follows_an_input_at_once_is_extended_without_an_fmu(tmp_path: Path):
    """The current of a motor by its voltage: everything else that was found is there all the same."""
    text = """
from fmus.definition import Model, Variable

MODEL = Model(
    name="motor", description="A motor", kind="continuous", step=0.01,
    states=(Variable("w", "rad/s"),), inputs=(Variable("u", "V"),), outputs=(Variable("i", "A"),),
    parameters=(Variable("R", "Ohm", start=8.0),),
    rhs=lambda x, u, m, p: {"w": u.u - x.w}, out=lambda x, u, m, p: {"i": (u.u - x.w) / p.R},
)
"""
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "model.py").write_text(text, encoding="utf-8")
    built = workflow._built(tmp_path / "model", tmp_path)
    because = "output i depends on input u at the same instant"
    assert built == {"folder": "model", "fmu": None, "because": because}
    figures = {"nuisances": {}, "where": [], "verdict": "named", "sentence": "It lacks friction."}
    assert list(lines(figures | {"model": built})) == [
        f"model has no FMU: {because}",
        "named: It lacks friction.",
    ]
    assert list(lines(figures)) == ["named: It lacks friction."]
