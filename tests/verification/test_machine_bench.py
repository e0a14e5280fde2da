"""`slewright bench machine`: the builds compute the same machine; limits are said. No time is asserted."""

from pathlib import Path

import numpy as np
import pytest

from verification import machine_bench


@pytest.mark.slow
@pytest.mark.long
def test_the_builds_simulate_the_same_machine(tmp_path: Path) -> None:
    libraries = machine_bench.build(tmp_path)
    states = {}
    for name, library in libraries.items():
        library.bench_start()
        assert library.bench_samples(100) == 0
        states[name] = np.array(library.bench_states()[:5])
    assert states["every_step"] == pytest.approx(states["dense"], abs=1e-9)
    assert states["shipped"] == pytest.approx(states["dense"], abs=1e-5)
    assert np.abs(states["shipped"]).max() > 0.1


def test_says_what_is_too_slow() -> None:
    figures = {"shipped": {"speed_up": 2.0, "realtime_factor": 10.0}}
    assert [line.split(" × ")[0] for line in machine_bench.missed(figures)] == ["2.00", "10"]
    assert machine_bench.missed({"shipped": {"speed_up": 3.1, "realtime_factor": 300.0}}) == []
