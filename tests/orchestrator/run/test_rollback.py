"""The algorithms that take steps back: observed orders of convergence, tolerances kept, failures named."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.testpack import kit
from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.layout import lay_out
from orchestrator.system.pack import pack_system
from orchestrator.system.system import System
from specs.errors import RunError
from tests.orchestrator.systems import component, connection, connector, load, ssd

MODELS = ["fine_position", "fine_speed"]
END_S = 2.0


def oscillator(folder: Path, step_s: float, fmi_version: int = 2) -> System:
    """x' = v, v' = -x from x = 1 in two FMUs: x = cos t."""
    text = ssd(
        [
            component("position", MODELS[0], connector("v", "input"), connector("position", "output")),
            component("speed", MODELS[1], connector("x", "input"), connector("speed", "output")),
        ],
        [
            connection("speed.speed", "position.v"),
            connection("position.position", "speed.x"),
            connection("position.position", "place"),
            connection("speed.speed", "pace"),
        ],
        [connector("place", "output"), connector("pace", "output")],
        step=repr(step_s),
    )
    return load(folder, text, MODELS, fmi_version)


def error(folder: Path, step_s: float, algorithm: str, **settings: Any) -> tuple[float, dict[str, Any]]:
    """Distance from (cos t, -sin t) at the end, and the run's statistics."""
    system = oscillator(folder, step_s)
    statistics: dict[str, Any] = {}
    record = simulate(
        system,
        round(END_S / step_s),
        algorithm=algorithm,
        settings=replace(system.settings, **settings),
        statistics=statistics,
    )
    x, v = record.column("place")[-1], record.column("pace")[-1]
    return math.hypot(x - math.cos(END_S), v + math.sin(END_S)), statistics


def test_iteration_is_the_trapezoidal_rule(tmp_path: Path) -> None:
    system = oscillator(tmp_path, 0.125)
    settings = replace(system.settings, algorithm="iterate", tolerance=1e-13)
    record = simulate(system, 40, settings=settings)
    a = np.array([[0.0, 0.125 / 2], [-0.125 / 2, 0.0]])
    step = np.linalg.solve(np.eye(2) - a, np.eye(2) + a)
    state = np.array([1.0, 0.0])
    for x, v in zip(record.column("place"), record.column("pace"), strict=True):
        assert (x, v) == pytest.approx(tuple(state), abs=1e-11)
        state = step @ state


def test_adaptive_steps_keep_the_local_error_within_the_tolerance(tmp_path: Path) -> None:
    """The error of a step goes with h², so h and with it the global error go with the square root."""
    errors, steps = [], []
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7):
        found, statistics = error(tmp_path, 0.125, "adaptive", tolerance=tolerance, max_halvings=12)
        errors.append(found)
        steps.append(statistics["steps"])
    assert all(b < a for a, b in pairwise(errors))
    slopes = np.polyfit(range(4), np.log10(errors), 1)[0], np.polyfit(range(4), np.log10(steps), 1)[0]
    assert slopes == pytest.approx((-0.5, 0.5), abs=0.12)


def test_adaptive_takes_steps_back_and_rows_stay_on_their_grid(tmp_path: Path) -> None:
    system = oscillator(tmp_path, 0.125)
    statistics: dict[str, Any] = {}
    settings = replace(system.settings, algorithm="adaptive", tolerance=1e-5, max_halvings=12)
    record = simulate(system, 16, settings=settings, statistics=statistics)
    np.testing.assert_array_equal(record.time, np.arange(17) * 0.125)
    assert statistics["rejected"] > 0
    assert statistics["components"]["speed"]["rollbacks"] > statistics["rejected"]
    np.testing.assert_allclose(record.column("place"), np.cos(record.time), atol=5e-3)


@pytest.mark.parametrize("algorithm", ["iterate", "adaptive"])
def test_both_fmi_versions_give_the_same_bits(tmp_path: Path, algorithm: str) -> None:
    places = []
    for version in (2, 3):
        system = oscillator(tmp_path, 0.125, version)
        settings = replace(system.settings, algorithm=algorithm, tolerance=1e-4, max_halvings=12)
        places.append(simulate(system, 16, settings=settings).column("place"))
    np.testing.assert_array_equal(*places)


def test_iteration_that_does_not_converge_is_a_failure(tmp_path: Path) -> None:
    system = oscillator(tmp_path, 0.125)
    settings = replace(system.settings, algorithm="iterate", tolerance=1e-12, max_iterations=2)
    with pytest.raises(RunError, match=r"system test failed .* still changes after 2 iterations"):
        simulate(system, 4, settings=settings)


def test_a_smallest_step_that_misses_the_tolerance_is_a_failure(tmp_path: Path) -> None:
    system = oscillator(tmp_path, 0.125)
    settings = replace(system.settings, algorithm="adaptive", tolerance=1e-9, max_halvings=2)
    with pytest.raises(RunError, match=r"misses the tolerance 1e-09 with the smallest step, 0\.03125 s"):
        simulate(system, 4, settings=settings)


def test_strings_are_taken_back_with_the_steps(tmp_path: Path) -> None:
    """A change of string travels through as many FMUs in a step as one of a whole number does."""
    names, kinds = ("a", "b", "c"), (("string", "String"), ("integer", "Integer"))
    text = ssd(
        [
            component(
                name,
                "echo",
                *(connector(f"{k}_{way}", f"{way}put", type_) for k, type_ in kinds for way in ("in", "out")),
            )
            for name in names
        ],
        [connection(kind, f"a.{kind}_in") for kind, _ in kinds]
        + [connection(f"{x}.{k}_out", f"{y}.{k}_in") for x, y in pairwise(names) for k, _ in kinds],
        [connector(kind, "input", type_) for kind, type_ in kinds],
    )
    system = load(tmp_path, text, {"echo": kit.build("echo", 2)})
    settings = replace(system.settings, algorithm="adaptive")
    with Master(system, lay_out(system), system.start_values({}), Options(settings=settings)) as master:
        master.initialise()
        for name, value in (("string", "new"), ("integer", 5)):
            master.set_input(name, value)
        found = []
        for _ in range(4):
            master.run(master.tick + 1)
            values = master.instances[2].values(["string_out", "integer_out"])
            found.append((values["string_out"], values["integer_out"]))
    changes = [[now != then for now, then in zip(row, found[0], strict=True)] for row in found]
    assert changes == [[False, False], [True, True], [True, True], [True, True]], found


def test_tolerances_are_relative_to_nominal_values(tmp_path: Path) -> None:
    """Pressures are of the order of their nominal value: a tolerance of 1e-6 of them is a pascal or so."""
    system = load_system(pack_system("nominal", out=tmp_path))
    layout = lay_out(system)
    slew = system.components["slew"].model.variables
    assert slew["p_slew_a"].nominal > 1e5
    with Master(system, layout, system.start_values({})) as master:
        cell = layout.blocks[layout.block("slew")].outputs["p_slew_a"].first
        with pytest.raises(RunError, match="a nominal value is positive"):
            master.plan.call("nominal", cell, 0.0)
