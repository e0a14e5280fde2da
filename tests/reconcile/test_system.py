"""A system part after part: sensors to signals, the motion that neighbours feel, one answer of several."""

import copy
import shutil
from pathlib import Path

import numpy as np
import pytest

from fmus.models.arm.model import MODEL as ARM
from fmus.models.machine.model import MODEL as MACHINE
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.stepper import Stepper
from reconcile.catalogue import ALL
from reconcile.equations.model import read_folder
from reconcile.recordings.data import Run, Signal, runs_of, split
from reconcile.reporting.contract import check
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.system import neighbour_motion
from reconcile.system.examine import Recording, _given, merged
from reconcile.system.parts import SYSTEMS, parts_of, with_signals
from reconcile.workflow import _plain, _read
from records.measurement import Channel, Measurement
from specs.errors import InputError
from tests.conftest import ROOT
from tests.reconcile.effects import delay
from tests.reconcile.reports import REPORT
from tests.reconcile.truth import DT, PERIOD as TRUE_PERIOD, Truth, record_driven, simulate
from verification.runs import replacement

PERIOD = 0.02


def measured(columns: dict[str, np.ndarray], units: dict[str, str] | None = None) -> Measurement:
    n = len(next(iter(columns.values())))
    time = PERIOD * np.arange(n)
    return Measurement({k: Channel(k, (units or {}).get(k, ""), time, v) for k, v in columns.items()})


def test_a_system_is_known_by_name_and_by_its_file() -> None:
    assert [p.name for p in parts_of("nominal") or ()] == ["arm", "slew", "tool"]
    assert parts_of("specs/systems/nominal.toml") == SYSTEMS["nominal"]
    assert parts_of("slew") is None
    assert parts_of("elsewhere/nominal.toml") is None


def test_the_models_of_an_earlier_answer_take_their_parts_places(tmp_path: Path) -> None:
    for name in ("arm", "tool"):
        shutil.copytree(ROOT / "fmus" / "models" / name, tmp_path / "model" / name)
    assert [p.model for p in parts_of(str(tmp_path / "model")) or ()] == [
        str(tmp_path / "model" / "arm"),
        "slew",
        str(tmp_path / "model" / "tool"),
    ]
    assert replacement(tmp_path, ["nominal"]) == {n: tmp_path / "model" / n for n in ("arm", "tool")}
    shutil.copytree(ROOT / "fmus" / "models" / "machine", tmp_path / "model" / "machine")
    assert parts_of(str(tmp_path / "model")) is None


def test_the_tools_angles_and_rates_are_those_of_the_reference_machine() -> None:
    """Its IMU without bias, noise and mounting error against its true joints, slewing and swinging."""
    clean = {
        v.name: 0.0
        for v in MACHINE.parameters
        if v.name.startswith("imu_tool") and ("bias" in v.name or "mount" in v.name)
    }
    stepper = Stepper(MACHINE, clean, step=0.002)
    rows = []
    stepper.set(u_slew=1.0, u_boom=-0.4)
    for _ in range(200):
        stepper.advance(10)
        rows.append(stepper.outputs())
    columns = {n: np.array([r[n] for r in rows]) for n in rows[0] if n.startswith(("imu_tool", "true_q"))}
    found = with_signals(measured(columns))
    for n in ("q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y"):
        true = columns[f"true_{n}"]
        assert np.max(np.abs(true)) > 0.03
        # a rate has its zero taken off by the angle beside it, as far as that tells
        assert found[n].values == pytest.approx(true, abs=1e-6 if n.startswith("q_") else 1e-3)
    assert any("imu_tool" in said for said in found.repairs)


def driven_arm(n: int = 400) -> dict[str, np.ndarray]:
    """Recorded references and true outputs of the arm, with the inputs it makes for others."""
    stepper, rows, t = DiscreteStepper(ARM), [], PERIOD * np.arange(n)
    references = np.column_stack([0.12 * np.sign(np.sin(1.3 * t)), 0.15 * np.sin(0.9 * t)])
    for boom, stick in references:
        stepper.set(qd_boom_ref=boom, qd_stick_ref=stick)
        rows.append(stepper.outputs())
        stepper.advance()
    columns = {k: np.array([r[k] for r in rows]) for k in rows[0]}
    return columns | {"qd_boom_ref": references[:, 0], "qd_stick_ref": references[:, 1]}


def test_a_neighbour_is_given_what_the_arm_makes_of_its_motion() -> None:
    arm = driven_arm()
    joints = ("q_boom", "q_stick", "qd_boom", "qd_stick")
    time = PERIOD * np.arange(len(arm["q_boom"]))
    still = {n: np.zeros(len(time)) for n in ("u_slew", "q_slew", "qd_slew", "q_tool_x", "q_tool_y")}
    r = Recording("run", measured({n: arm[n] for n in joints} | still))
    r.motion = {n: Channel(n, "", time, (arm | still)[n]) for n in (*joints, "q_slew", "qd_slew")}
    _, slew, tool = SYSTEMS["nominal"]
    given = _given(slew, r)
    for n in ("inertia", "inertia_rate"):
        assert given[n].values == pytest.approx(arm[n], rel=1e-12, abs=1e-9)
    given = _given(tool, r)  # where slew and arm are in the middle of the tool's step
    for n in ("radius", "radius_rate", "height"):
        middle = 0.5 * (arm[n][:-1] + arm[n][1:])
        assert given[n].values[:-1] == pytest.approx(middle, rel=1e-3, abs=2e-3)


def test_what_is_felt_is_nearer_to_the_truth_than_the_recording() -> None:
    rng, t = np.random.default_rng(1), PERIOD * np.arange(600)
    angle, rate = 0.5 * np.sin(0.8 * t), 0.4 * np.cos(0.8 * t)
    noisy = {
        "q_slew": Signal(t, angle + 2e-4 * rng.standard_normal(len(t))),
        "qd_slew": Signal(t, rate + 1e-3 * rng.standard_normal(len(t))),
    }
    found = neighbour_motion.recorded(Run("run", 0.0, t[-1], {}, noisy), ("q_slew", "qd_slew"))
    assert np.std(found["q_slew"] - angle) < 0.6 * 2e-4
    assert np.std(found["qd_slew"] - rate) < 0.5 * 1e-3


def test_what_is_felt_of_a_fitted_part_is_its_motion_without_its_sensors(rig, monkeypatch) -> None:
    """A carriage whose speed sensor is late: its neighbours feel the true speed."""
    monkeypatch.setattr(neighbour_motion, "PAIRS", {"position": "velocity"})
    truth = Truth(velocity=delay(0.06))
    time = TRUE_PERIOD * np.arange(1000)
    command = 6.0 * np.sin(2.0 * time) + 3.0 * np.sin(5.3 * time)
    (run,) = runs_of(record_driven(truth, command, 3), rig, "run")
    core = Core(rig, split([run], (), ()), [e for e in ALL if e.name == "sensor_delay"])
    beam = Beam(core)
    beam.points[frozenset()] = core.base
    for scored in beam.scores(frozenset()):
        beam.attempt(frozenset(), scored)
    found = neighbour_motion.of_part(core, beam.points[beam.ranked()[0]], run, ("position", "velocity"))
    assert found is not None
    each = round(TRUE_PERIOD / DT)
    names, noises = ("position", "velocity"), (2e-4, 2e-3)
    for name, true, noise in zip(names, simulate(truth, command), noises, strict=True):
        seen = np.std(run.outputs[name].values - true[::each])
        left = np.std(found[name][20:] - true[::each][20:])
        assert left < noise
        assert name == "position" or left < 0.1 * seen


def test_a_late_rate_is_moved_and_a_gyroscope_helps() -> None:
    rng, t = np.random.default_rng(2), PERIOD * np.arange(600)
    angle, rate = 0.6 * np.sin(1.2 * t), 0.72 * np.cos(1.2 * t)
    late = np.concatenate([np.full(10, rate[0]), rate[:-10]]) + 3e-3 * rng.standard_normal(len(t))
    gyro = rate + 0.05 + 1e-3 * rng.standard_normal(len(t))
    seen = {"q_slew": Signal(t, angle + 2e-4 * rng.standard_normal(len(t))), "qd_slew": Signal(t, late)}
    run = Run("run", 0.0, t[-1], {}, seen)
    errors = [
        np.std((neighbour_motion.recorded(run, ("q_slew",), gyros)["qd_slew"] - rate)[15:-15])
        for gyros in (None, {"qd_slew": gyro})
    ]
    assert errors[0] < 1.6e-3  # 0.2 s late it would be 0.12 off
    assert errors[1] < 0.85 * errors[0]


def figures(
    verdict: str, effects: list[dict], alternatives: list[list[str]], status: str = "at_floor"
) -> dict:
    rest = {"reestimated": {}, "nuisances": {}, "where": [], "gap": {}, "scores": {}, "considered": []}
    return rest | {
        "verdict": verdict,
        "sentence": "The model lacks something.",
        "effects": effects,
        "alternatives": alternatives,
        "residual_status": status,
        "iso18571": None,
    }


class Part:
    """A part's figures without the study behind them."""

    def __init__(self, name: str, found: dict):
        self.part, self.figures = SYSTEMS["nominal"][("arm", "slew", "tool").index(name)], found


def effect(name: str, gain: float, verdict: str = "named") -> dict:
    return {"name": name, "gain_fit": gain, "verdict": verdict}


def test_one_answer_the_strongest_first_with_whole_sets_as_alternatives() -> None:
    slew = figures("named", [effect("shared_pump_flow", 50.0)], [["shared_pump_flow"]])
    rivals = [["coriolis_coupling"], ["wind_load"]]
    tool = figures("ambiguous", [effect("coriolis_coupling", 900.0, "ambiguous")], rivals, "unexplained")
    whole = merged([Part("slew", slew), Part("tool", tool)])  # type: ignore[list-item]
    assert [(e["subsystem"], e["name"]) for e in whole["effects"]] == [
        ("tool", "coriolis_coupling"),
        ("slew", "shared_pump_flow"),
    ]
    assert whole["verdict"] == "named"
    assert whole["residual_status"] == "unexplained"
    assert whole["alternatives"] == [
        ["coriolis_coupling", "shared_pump_flow"],
        ["shared_pump_flow", "wind_load"],
    ]


def test_what_single_reports_have_the_whole_has_as_well() -> None:
    slew, tool = figures("agrees", [], []), figures("agrees", [], [])
    block = {"run": "a", "start_s": 0.0, "end_s": 2.0}
    slew |= {"gap_by_regime": [{"regime": "u > 0", "gap": {}}], "data": {"fit": [block]}}
    tool |= {"data": {"fit": [block, block | {"start_s": 4.0}], "holdout": [block]}}
    slew["untold"] = [{"effect": "stiffness", "because": "a"}, {"effect": "gear_backlash", "because": "b"}]
    tool["untold"] = [{"effect": "stiffness", "because": "c"}]
    whole = merged([Part("slew", slew), Part("tool", tool)])  # type: ignore[list-item]
    assert whole["gap_by_regime"] == [{"regime": "u > 0", "gap": {}, "subsystem": "slew"}]
    assert [len(whole["data"][use]) for use in ("fit", "holdout")] == [2, 1]
    assert whole["untold"] == [{"effect": "stiffness", "because": "a; c"}]


def test_the_report_of_a_whole_has_the_contracts_form() -> None:
    slew, tool = (copy.deepcopy(REPORT[v]) for v in ("ambiguous", "named"))
    tool["gap"] = {"q_tool_x": tool["gap"]["position"]}
    whole = merged([Part("slew", slew), Part("tool", tool)])  # type: ignore[list-item]
    dated = {n: tool[n] for n in ("seed", "versions", "elapsed_s")}
    assert check(_plain(whole | dated)) == []
    assert set(whole["gap"]) == {"position", "q_tool_x"}
    without = merged([Part("tool", figures("agrees", [], []))])  # type: ignore[list-item]
    assert _plain(without)["iso18571"] == {"before": None, "after": None}


def test_without_effects_what_stands_in_the_way_is_the_verdict() -> None:
    parts = [Part("arm", figures("agrees", [], [])), Part("tool", figures("unexplained", [], []))]
    assert merged(parts)["verdict"] == "unexplained"  # type: ignore[arg-type]
    assert merged(parts[:1])["alternatives"] == []  # type: ignore[arg-type]


def test_a_part_whose_neighbours_are_not_recorded_says_so() -> None:
    tool = SYSTEMS["nominal"][2]
    with pytest.raises(InputError, match="has no q_slew, qd_slew, q_boom"):
        _given(tool, Recording("run", measured({"q_tool_x": np.zeros(50)})))


def test_runs_of_a_part_hold_its_derived_inputs() -> None:
    from reconcile.equations.model import read_folder

    arm = driven_arm()
    names = ("q_boom", "q_stick", "qd_boom", "qd_stick")
    still = {n: np.zeros(400) for n in ("u_slew", "q_slew", "qd_slew", "p_slew_a", "p_slew_b")}
    folder = read_folder("slew")
    units = {v.name: v.unit for v in (*folder.model.inputs, *folder.model.outputs)}
    r = Recording("run", measured({n: arm[n] for n in names} | still, units))
    run = runs_of(_given(SYSTEMS["nominal"][1], r), folder, "run")[0]
    assert {"u_slew", "inertia", "inertia_rate"} <= set(run.inputs)
    assert run.inputs["inertia"].values[50:] == pytest.approx(arm["inertia"][50:], rel=1e-2)


def test_a_part_alone_is_given_what_it_feels_of_the_machine(tmp_path) -> None:
    """A recording of the machine's joints against the model of its tool: radius and its rate are made."""
    t = PERIOD * np.arange(200)
    angles = {"q_slew": 0.4 * t, "q_boom": 1.1 + 0.1 * np.sin(t), "q_stick": -1.2 + 0.0 * t}
    rates = {"qd_slew": 0.4 + 0.0 * t, "qd_boom": 0.1 * np.cos(t), "qd_stick": 0.0 * t}
    swing = {"q_tool_x": 0.1 * np.sin(2.0 * t), "q_tool_y": 0.1 * np.cos(2.0 * t)}
    path = tmp_path / "machine.csv"
    columns = {"time [s]": t} | {
        f"{n} [{unit}]": v
        for unit, group in (("rad", angles | swing), ("rad/s", rates))
        for n, v in group.items()
    }
    np.savetxt(
        path, np.column_stack([*columns.values()]), delimiter=",", header=",".join(columns), comments=""
    )
    (runs,) = _read([[path]], read_folder("tool"), None)
    radius, rate = (runs[0].inputs[n].values for n in ("radius", "radius_rate"))
    assert np.gradient(radius, PERIOD)[20:-20] == pytest.approx(rate[20:-20], abs=2e-3)
    assert np.ptp(radius) > 0.3
