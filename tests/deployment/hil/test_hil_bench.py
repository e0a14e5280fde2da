"""`slewright bench runtime` without the long measurement: quantiles, limits, skipping that is said."""

import pytest

from deployment.hil import bench
from deployment.hil.bench import Block, Result, quantiles

HISTOGRAM = """# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000
000005 000050
000010 000048
000100 000001
002673 000001
# Total: 000000100
# Max Latencies: 02673
"""


def quiet(what: str, done: float | None = None, total: float | None = None) -> None:
    pass


def block(p99: float, policy: float = 100.0, overruns: int = 0, step: float = 50.0) -> Block:
    times = {"p50": 5.0, "p99": p99, "p999": 50.0, "max": 60.0}
    tick = {**times, "p50": policy}
    theirs = {"p50": 10.0, "p99": 20.0, "p999": 30.0, "max": 40.0}
    return Block(
        times, theirs, tick, tick, tick, tick, {"p50": step}, {"p50": 10.0}, tick, tick,
        stolen=1, overruns=overruns, ticks=100,
    )  # fmt: skip


def test_quantiles_of_cyclictests_histogram():
    assert quantiles(HISTOGRAM) == {"p50": 5.5, "p99": 100.5, "p999": 2673.5, "max": 2673.0}


def test_figures_are_medians_over_blocks_and_ratios_are_formed_within_them():
    figures = Result({"idle": [block(10.0), block(20.0), block(80.0)]}).figures()["idle"]
    assert figures["ratio_p99"] == 1.0
    assert figures["ours"]["p99"] == 20.0
    assert (figures["stolen_ticks"], figures["ticks"], figures["blocks"]) == (3, 300, 3)
    assert figures["modbus_rps"] is None


def test_what_is_beyond_a_limit_is_said():
    assert Result({"idle": [block(29.0)], "stress": [block(59.0)]}).misses() == []
    late = Result({"idle": [block(31.0)], "stress": [block(61.0)]}).misses()
    assert [text.split(":")[0] for text in late] == ["idle", "stress"]
    assert "policy tick" in Result({"idle": [block(10.0, policy=151.0)]}).misses()[0]
    assert "1 overruns of our own" in Result({"modbus": [block(10.0, overruns=1)]}).misses()[0]


def test_a_tick_is_measured_by_the_cores_step_in_it():
    result = Result({"idle": [block(10.0, step=20.0), block(10.0, step=24.0), block(10.0, step=25.0)]})
    figures = result.figures()["idle"]
    assert figures["tick_ratio"] == 100.0 / 24.0
    assert figures["tick_ratio_without_bus"] == 90.0 / 24.0
    assert result.misses() == ["tick: 4.2 × the core's step in it, limit 4 ×"]


def test_what_pages_cost_is_compared_with_what_idle_varies_by_itself():
    idle = [block(10.0), block(14.0), block(12.0)]
    assert Result({"idle": idle}).costs("hmi") == {}
    within = Result({"idle": idle, "hmi": [block(12.0), block(17.0), block(15.0)]})
    expected = {"smallest": 2.0, "median": 3.0, "largest": 3.0, "idle_varies": 4.0}
    assert within.costs("hmi")["lateness p99"] == expected
    assert within.misses() == []
    beyond = Result({"idle": idle, "hmi": [block(17.0), block(22.0), block(18.0)]})
    assert beyond.misses()[0].startswith("hmi: lateness p99 7 µs more than idle; that varies by 4")


def test_without_cyclictest_or_rights_it_says_so_and_measures_nothing(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(bench.shutil, "which", lambda name: None)
    result = bench.run(bench.Path("none"), 1, 2.0, ["idle"], quiet)
    assert result.figures() == {"skipped": "cyclictest is not installed (Debian: rt-tests)"}
    assert result.misses() == []

    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(bench.shutil, "which", lambda name: "/usr/bin/true")
    monkeypatch.setattr(bench.os, "sched_setscheduler", refuse)
    skipped = bench.run(bench.Path("none"), 1, 2.0, ["idle"], quiet).skipped
    assert skipped == "no real-time priority: Operation not permitted"
