"""Jacobi and Gauss-Seidel against closed forms: what each computes, with which order it converges."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.run.simulate import simulate
from orchestrator.ssp.conversion import UNCHANGED
from orchestrator.ssp.description import Port
from orchestrator.system.layout import lay_out
from orchestrator.system.link import Link
from orchestrator.system.order import dependency_order
from specs.errors import InputError
from tests.orchestrator.systems import OSCILLATOR, chain, load


@pytest.mark.parametrize("fmi_version", [2, 3])
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss-seidel"])
def test_an_oscillator_split_in_two_is_explicit_or_symplectic_euler(
    tmp_path: Path, fmi_version: int, algorithm: str
) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"], fmi_version)
    record = simulate(system, 500, algorithm=algorithm)
    x, v, h, expected = 1.0, 0.0, system.step_s, [(1.0, 0.0)]
    for _ in range(500):
        if algorithm == "jacobi":
            x, v = x + h * v, v - h * x
        else:
            x = x + h * v
            v = v - h * x
        expected.append((x, v))
    found = np.column_stack([record.column("place"), record.column("pace")])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_a_chain_is_stepped_in_order_of_dependency_whatever_the_declared_order(tmp_path: Path) -> None:
    text = chain()
    first, second = text.index('<ssd:Component name="decay"'), text.index('<ssd:Component name="position"')
    end = text.index("</ssd:Elements>")
    swapped = text[:first] + text[second:end] + text[first:second] + text[end:]
    assert swapped != text
    runs = [
        simulate(load(tmp_path, t, ["decay", "position"]), 100, algorithm="gauss-seidel").column("place")
        for t in (text, swapped)
    ]
    np.testing.assert_array_equal(runs[0], runs[1])


def test_a_loop_is_opened_where_fewest_inputs_are_missing() -> None:
    def link(source: str, target: str) -> Link:
        return Link(Port(source, "y"), Port(target, "u"), UNCHANGED)

    names = ["controller", "drive", "tool", "source"]
    links = [link("drive", "controller"), link("tool", "controller"), link("controller", "drive")]
    links += [link("drive", "tool"), link("source", "drive"), link("", "source")]
    order = [names[i] for i in dependency_order(names, links).positions]
    assert order == ["source", "drive", "tool", "controller"]


def test_initial_outputs_reach_the_record_and_the_first_step(tmp_path: Path) -> None:
    """Row 0 shows the initial outputs; the first step already uses them, not the input's own start value."""
    system = load(tmp_path, chain(), ["decay", "position"])
    record = simulate(system, 1, parameters={"position.start": 3.0})
    assert record.column("place").tolist() == pytest.approx([3.0, 3.0 + 0.01 * 1.0], abs=1e-12)


def test_time_is_counted_not_summed(tmp_path: Path) -> None:
    record = simulate(load(tmp_path, chain(), ["decay", "position"]), 1000)
    np.testing.assert_array_equal(record.time, np.arange(1001) * 0.01)


def test_an_unknown_algorithm_is_refused(tmp_path: Path) -> None:
    system = load(tmp_path, chain(), ["decay", "position"])
    with pytest.raises(InputError, match="unknown algorithm 'jacoby'; did you mean jacobi"):
        simulate(system, 1, algorithm="jacoby")


def test_layout_gathers_each_input_from_its_source(tmp_path: Path) -> None:
    layout = lay_out(load(tmp_path, OSCILLATOR, ["position", "speed"]))
    inputs = {slot.first: (b.component, name) for b in layout.blocks for name, slot in b.inputs.items()}
    outputs = {slot.first: (b.component, name) for b in layout.blocks for name, slot in b.outputs.items()}
    feeds = {inputs[m.target.first]: outputs[m.source.first] for m in layout.moves if m.owner >= 0}
    assert feeds == {("position", "v"): ("speed", "speed"), ("speed", "x"): ("position", "position")}
