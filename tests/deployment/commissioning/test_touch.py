"""Step touch on the simulated machine: what it finds, and what it refuses."""

import json
from pathlib import Path

import pytest

from deployment.commissioning import calibration, hand
from deployment.commissioning.bench import Bench, Failed
from deployment.commissioning.operator import Answering, Question
from deployment.commissioning.points import JOINTS, Point
from deployment.commissioning.procedure import NAMES
from deployment.commissioning.rig import Rig
from deployment.commissioning.session import PASSED, Session
from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
from deployment.commissioning.steps import touch
from deployment.commissioning.wiring import Fault
from runtime.policy import open_core
from slewright import __main__ as entry
from specs.errors import InputError
from tests.runtime.bundles import built

SHIFTED = {"q_boom": 0.04}  # rad, that the encoder shows too much
KNOWN = tuple(Point(name=f"post {k}", x=x, y=y, z=z) for k, (x, y, z) in enumerate(hand.KNOWN, 1))


class Elsewhere(SimulatedOperator):
    """Touches something else than the last point, 0.7 m beside it."""

    def answer(self, question: Question) -> Answering:
        x, y, z = KNOWN[-1].xyz
        here, there = f"touch.{x:.3f}_{y:.3f}_{z:.3f}", f"touch.{x + 0.5:.3f}_{y - 0.5:.3f}_{z:.3f}"
        return super().answer(Question(question.kind, question.key.replace(here, there), question.text))


class Says(SimulatedOperator):
    """Types these numbers."""

    def __init__(self, machine: SimulatedMachine, told: dict[str, str]) -> None:
        super().__init__(machine)
        self.told = told

    def answer(self, question: Question) -> Answering:
        yield
        return self.told[question.key]


def bench_of(machine: SimulatedMachine, operator: SimulatedOperator, points: tuple[Point, ...] = ()) -> Bench:
    rig = Rig(open_core(built("pi")), machine, machine, simulated=True)
    rig.step(25)
    return Bench(rig, operator, points=points)


@pytest.mark.long
def test_the_reference_machine_passes_and_its_record_has_offsets_with_intervals(tmp_path: Path):
    with SimulatedMachine() as machine:
        bench = bench_of(machine, SimulatedOperator(machine))
        touch.run(bench)
    found = bench.found
    assert all(check.passed for check in bench.checks)
    for joint in JOINTS:
        low, high = found[f"interval {joint}"]
        assert low < found[f"offset {joint}"] < high
        assert abs(found[f"offset {joint}"]) < 0.01
        assert high - low < 0.03
    assert len(found["points"]) == len(found["angles"]) == len(found["residuals"]) == len(hand.KNOWN)
    kept = Session.open(tmp_path / "s", NAMES, {"machine": "m", "bundle": "0", "who": "w"}, False)
    kept.write("touch", PASSED, bench.as_dict(), bench.rig.since(0))
    calibration.write(kept)
    written = json.loads((tmp_path / "s" / calibration.FILE).read_text())["geometry"]
    assert written["offset q_boom"] == pytest.approx(found["offset q_boom"])


@pytest.mark.long
def test_an_encoder_that_shows_too_much_is_found_by_the_points():
    fault = Fault("bias", ("q_boom",), SHIFTED["q_boom"])
    with SimulatedMachine((fault,)) as machine:
        bench = bench_of(machine, SimulatedOperator(machine), KNOWN)
        with pytest.raises(Failed):
            touch.run(bench)
    assert bench.found["offset q_boom"] == pytest.approx(SHIFTED["q_boom"], abs=0.01)
    (failed,) = [str(check) for check in bench.checks if not check.passed]
    assert failed.startswith("q_boom: offset less its zero at rest: measured 0.0")


@pytest.mark.long
def test_a_point_that_was_not_the_one_is_named():
    with SimulatedMachine() as machine:
        bench = bench_of(machine, Elsewhere(machine), KNOWN)
        with pytest.raises(Failed):
            touch.run(bench)
    failed = [str(check) for check in bench.checks if not check.passed]
    assert any(text.startswith("post 4 (x 9.50, y 4.00, z 6.00 m): residual: measured 0.") for text in failed)
    assert "post 4 (x 9.50, y 4.00, z 6.00 m): without it the others fit" in failed[0]


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"known.count": "2"}, "step touch: 2 points; 3 to 20"),
        ({"known.count": "3.5"}, "step touch: 3.5 points; 3 to 20"),
        (
            {"known.count": "3"} | {f"known.{k}.{axis}": "6" for k in (1, 2, 3) for axis in "xyz"},
            "step touch: the points lie on one line",
        ),
    ],
)
def test_typed_points_that_say_nothing_are_wrong_input(told: dict[str, str], said: str):
    with SimulatedMachine() as machine, pytest.raises(InputError, match=said):
        touch.run(bench_of(machine, Says(machine, told)))


def test_a_wrong_file_of_points_is_said_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture
):
    path, out = tmp_path / "points.toml", tmp_path / "records"
    path.write_text('[[point]]\nname = "a"\nx = 9.0\ny = 0.0\nz = 3.0\n')
    told = ["commission", "--simulate", "--wiring", "none", "--out", str(out), "--points", str(path)]
    assert entry.run(told) == 2
    assert "points.toml: 1 points; 3 to 20 are needed" in capsys.readouterr().err
    assert not out.exists()
