"""`python -m benchmarks orchestrator` with a tiny budget: it compares what is comparable and judges by it."""

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest

from benchmarks.orchestrator import chain
from benchmarks.orchestrator.blocks import Measured, spread
from benchmarks.orchestrator.child import CHECK_STEPS, Child, Run
from benchmarks.orchestrator.comparison import Must, Result, overhead
from benchmarks.orchestrator.contestants import NotMeasured
from benchmarks.orchestrator.registry import MASTERS
from tests.benchmarks.command import benchmarks

KEYS = ("floor_us", "slewright_us", "fmucontainer_us", "ecos_us", "fmpy_ssp_us", "libcosim_us")


def computed(steps: int) -> list[float]:
    """The chain by its equations: a.y, b.y, c.y, c.rate."""
    y, rate = np.zeros(3), np.zeros(3)
    for _ in range(steps):
        u = np.array([0.5, y[0], y[1]])
        rate = rate + chain.STEP_S * ((1.0 - y * y) * rate - y + u)
        y = y + chain.STEP_S * rate
    return [*y.tolist(), float(rate[2])]


def measured(us: dict[str, list[float]], inside: float = 0.0) -> Measured:
    runs = {k: [Run(1000, t * 1e-3, 1.0, 0, t * 1e-3 * inside) for t in times] for k, times in us.items()}
    return Measured(2, runs)


def test_all_masters_are_known_by_the_keys_of_their_figures():
    assert MASTERS == KEYS


@pytest.mark.parametrize("fmi_version", [2, 3])
@pytest.mark.parametrize("key", ["floor_us", "slewright_us", "isolated_us"])
def test_a_contestant_computes_the_chain(key: str, fmi_version: int):
    chain.build(fmi_version)
    with Child(key, fmi_version) as child:
        assert child.values == pytest.approx(computed(CHECK_STEPS), rel=1e-12)
        result = child.run(50)
    assert result.steps == 50
    assert result.seconds > 0.0


@pytest.mark.interop
@pytest.mark.parametrize("key", ["fmucontainer_us", "ecos_us", "fmpy_ssp_us", "libcosim_us"])
def test_another_master_computes_the_same_chain(key: str):
    chain.build(2)
    with Child(key, 2) as child:
        assert child.values == pytest.approx(computed(CHECK_STEPS), rel=1e-9)


def test_the_end_of_a_contestants_process_is_survived_and_told():
    chain.build(2)
    with Child("floor_us", 2) as child:
        os.kill(child.process.pid, signal.SIGSEGV)
        with pytest.raises(NotMeasured, match="SIGSEGV"):
            child.run(10)


def test_ratios_are_formed_within_blocks():
    # The machine is slow in the second block; that concerns both.
    both = measured({"slewright_us": [2.0, 20.0, 2.2], "floor_us": [1.0, 10.0, 1.0]})
    ratio = both.ratio("slewright_us", "floor_us")
    assert ratio is not None
    assert ratio.median == pytest.approx(2.0)
    assert both.ratio("slewright_us", "ecos_us") is None


def test_the_overhead_is_what_is_not_inside_the_fmus():
    found = overhead(measured({"nominal": [1.0, 1.0]}, inside=0.8))
    assert found is not None
    assert found.median == pytest.approx(0.25)


def test_a_spread_is_median_and_quartiles():
    found = spread(np.array([5.0, 1.0, 3.0, 2.0, 4.0]))
    assert (found.low, found.median, found.high, found.n) == (2.0, 3.0, 4.0, 5)


def test_a_must_is_missed_beyond_its_limit_and_never_unmeasured():
    assert Must("ratio", 2.1, 2.0).missed
    assert not Must("ratio", 1.9, 2.0).missed
    assert Must("times faster", 4.0, 5.0, at_least=True).missed
    assert not Must("ratio", None, 2.0).missed
    assert str(Must("ratio", 2.1, 2.0)) == "ratio = 2.1, must be at most 2"


def test_a_slow_orchestrator_misses_its_musts():
    slow = measured({"slewright_us": [3.0], "floor_us": [1.0], "fmucontainer_us": [2.0]})
    missed = [must.name for must in Result(chain={2: slow}).musts() if must.missed]
    assert missed == ["ratio to the floor (FMI 2)", "ratio to fmucontainer (FMI 2)"]


@pytest.mark.long
def test_the_command_writes_every_figure_or_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "bench.json"
    page = tmp_path / "bench.md"
    code = benchmarks("orchestrator", "--blocks", "1", "--json", out, "--markdown", page)
    assert page.read_text().count("Slewright / ") == 2
    figures = json.loads(out.read_text())
    missed = [must["must"] for must in figures["musts"] if must["missed"]]
    assert code == (1 if missed else 0)
    errors = capsys.readouterr().err
    for must in missed:
        assert must in errors
    for key in KEYS:
        for version in ("fmi2", "fmi3"):
            if figures[key][version] is None:
                assert figures["reasons"][key][version]
            else:
                assert figures[key][version] > 0.0
    for version in ("fmi2", "fmi3"):
        ratio = figures["slewright_us"][version] / figures["floor_us"][version]
        assert figures["ratio_to_floor"][version] == pytest.approx(ratio)  # of a single block
        assert figures["nominal_overhead"][version] > 0.0
    assert figures["recording"]["slewright"]["fmi2"]["rows_per_s"] > 0.0
