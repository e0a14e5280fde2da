"""Faults: each kind against its closed form, its statistics, and a step computed any number of times."""

import math
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM
from orchestrator.core.native import SOURCES
from specs.errors import RunError
from specs.faults import Fault
from tests.orchestrator.core.core_probe import CFault, library

CROSS_LIBRARIES = Path("/usr/aarch64-linux-gnu")
STEP = 0.02
N = 1000
T = np.arange(N) * STEP
X = np.sin(T) + 0.1 * T


def fault(kind: str, start_s: float = 2.0, end_s: float | None = 10.0, **values: Any) -> Fault:
    return Fault(target="a.x", kind=kind, start_s=start_s, end_s=end_s, **values)


ONE_OF_EACH = [
    fault("stuck"),
    fault("stuck", value=7.0),
    fault("bias", value=0.25),
    fault("drift", rate_per_s=0.5),
    fault("noise", std=0.3),
    fault("delay", delay_s=0.4),
    fault("dropout", probability=0.3),
    fault("dropout", probability=0.05, mean_ticks=8.0),
    fault("spike", probability=0.1, size=2.0),
    fault("quantise", step=0.1),
    fault("scale", factor=-1.5),
    fault("saturate", low=-0.5, high=0.75),
]
each = pytest.mark.parametrize("of", ONE_OF_EACH, ids=lambda f: str(f).replace(" on a.x, 2 s to 10 s", ""))
ACTS = (T >= 2.0 - STEP / 2) & (T < 10.0 - STEP / 2)

CLOSED_FORMS = {
    "keeps its value": (fault("stuck"), np.full(N, X[100])),
    "stuck at a value": (fault("stuck", value=7.0), np.full(N, 7.0)),
    "bias": (fault("bias", value=0.25), X + 0.25),
    "drift": (fault("drift", rate_per_s=0.5), X + 0.5 * (np.arange(N) - 100) * STEP),
    "delay": (fault("delay", delay_s=0.4), np.roll(X, 20)),
    "delay longer than the past": (fault("delay", delay_s=4.0), np.where(T < 4.0, X[0], np.roll(X, 200))),
    "quantise": (fault("quantise", step=0.1), 0.1 * np.round(X / 0.1)),
    "scale": (fault("scale", factor=-1.5), -1.5 * X),
    "saturate": (fault("saturate", low=-0.5, high=0.75), np.clip(X, -0.5, 0.75)),
}


@pytest.mark.parametrize("case", CLOSED_FORMS)
def test_closed_form(case: str) -> None:
    of, expected = CLOSED_FORMS[case]
    assert np.array_equal(CFault(of).run(X), np.where(ACTS, expected, X))


@each
def test_outside_its_time_nothing_changes(of: Fault) -> None:
    y = CFault(of).run(X)
    assert np.array_equal(y[~ACTS], X[~ACTS])
    assert not np.array_equal(y[ACTS], X[ACTS])


def test_without_an_end_it_lasts() -> None:
    y = CFault(fault("bias", end_s=None, value=1.0)).run(X)
    assert np.array_equal(y[100:], X[100:] + 1.0)


def test_delay_from_the_beginning_gives_the_first_value() -> None:
    y = CFault(fault("delay", start_s=0.0, delay_s=0.1)).run(X)
    assert np.array_equal(y[:6], np.full(6, X[0]))
    assert np.array_equal(y[5:500], X[:495])


def test_quantise_takes_halves_to_the_even_multiple_and_leaves_large_numbers() -> None:
    x = np.array([0.25, 0.75, -0.25, -0.75, 1.25, 1e300, -0.0, 3.0])
    y = CFault(fault("quantise", start_s=0.0, step=0.5)).run(x)
    assert y.tolist() == [0.0, 1.0, 0.0, -1.0, 1.0, 1e300, 0.0, 3.0]


@pytest.mark.parametrize("kind", ["saturate", "quantise", "scale", "bias"])
def test_what_is_no_number_stays_none(kind: str) -> None:
    values = {"saturate": {"low": 0.0, "high": 1.0}, "quantise": {"step": 1.0}, "scale": {"factor": 2.0}}
    of = CFault(fault(kind, start_s=0.0, **values.get(kind, {"value": 1.0})))
    assert np.isnan(of.run(np.array([math.nan]))).all()


# ---- a step computed several times, taken back, or restored ----


@each
def test_how_often_a_step_is_computed_makes_no_difference(of: Fault) -> None:
    assert np.array_equal(CFault(of).run(X, calls=4), CFault(of).run(X))


@each
def test_a_look_ahead_changes_nothing(of: Fault) -> None:
    plain, looked = CFault(of), CFault(of)
    for tick in range(0, N, 50):
        looked.look(X[tick : tick + 30], tick)
        part = slice(tick, tick + 50)
        assert np.array_equal(looked.run(X[part], tick), plain.run(X[part], tick))


@each
def test_a_tick_accepted_twice_counts_once_and_looks_the_same_afterwards(of: Fault) -> None:
    once, twice = CFault(of), CFault(of)
    for tick in range(0, N, 7):
        part = slice(tick, tick + 7)
        y = once.run(X[part], tick)
        assert np.array_equal(twice.run(X[part], tick), y)
        last = np.array([X[part][-1]])
        end = tick + len(y) - 1
        assert twice.run(last, end)[0] == y[-1]


@each
@pytest.mark.parametrize("at", [0, 90, 250, 600])
def test_a_restored_state_goes_on_the_same(of: Fault, at: int) -> None:
    first = CFault(of)
    first.run(X[:at])
    state = first.save()
    rest = first.run(X[at:], at)
    again = CFault(of)
    again.restore(state)
    assert np.array_equal(again.run(X[at:], at), rest)
    first.restore(state)
    assert np.array_equal(first.run(X[at:], at), rest)
    assert (len(state) > 0) == first.c.slw_fault_remembers(first.pointer)


@each
def test_reset_is_as_new(of: Fault) -> None:
    used = CFault(of)
    y = used.run(X)
    used.c.slw_fault_reset(used.pointer)
    assert np.array_equal(used.run(X), y)


# ---- randomness ----

MASK = 2**64 - 1
LONG = 200_000


def split_mix(seed: int, count: int) -> list[int]:
    """The first numbers of the generator of Steele, Lea and Flood (2014), in Python."""
    numbers = []
    for i in range(1, count + 1):
        z = (seed + i * 0x9E3779B97F4A7C15) & MASK
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & MASK
        z = (z ^ z >> 27) * 0x94D049BB133111EB & MASK
        numbers.append(z ^ z >> 31)
    return numbers


def endless(kind: str, **values: float) -> Fault:
    return fault(kind, start_s=0.0, end_s=None, **values)


def test_the_generator_is_the_published_one() -> None:
    """First numbers of splitmix64.c for the seed 1234567."""
    assert split_mix(1234567, 3) == [6457827717110365317, 3203168211198807973, 9817491932198370423]
    bits = split_mix(1234567, 2 * 500)
    y = CFault(endless("spike", probability=0.5, size=1.0), seed=1234567).run(np.zeros(500))
    sign = [-1.0 if word >> 63 else 1.0 for word in bits[1::2]]
    hit = [(word >> 11) / 2**53 < 0.5 for word in bits[::2]]
    assert y.tolist() == [s if h else 0.0 for s, h in zip(sign, hit, strict=True)]


def test_noise_is_that_of_box_and_muller() -> None:
    bits = split_mix(99, 2 * 1000)
    u = np.array([word >> 11 for word in bits]) / 2.0**53
    expected = np.sqrt(-2.0 * np.log(1.0 - u[::2])) * np.cos(2.0 * np.pi * u[1::2])
    y = CFault(endless("noise", std=2.0), seed=99).run(np.zeros(1000))
    assert np.allclose(y, 2.0 * expected, rtol=1e-13, atol=1e-14)


def test_noise_is_normal_and_white() -> None:
    n = CFault(endless("noise", std=3.0)).run(np.zeros(LONG)) / 3.0
    # Limits: five standard errors of each figure of so many independent normal numbers.
    assert abs(n.mean()) < 5 / math.sqrt(LONG)
    assert abs(n.var() - 1.0) < 5 * math.sqrt(2 / LONG)
    assert abs((n**3).mean()) < 5 * math.sqrt(15 / LONG)
    assert abs((n**4).mean() - 3.0) < 5 * math.sqrt(96 / LONG)
    assert all(abs((n[k:] * n[:-k]).mean()) < 5 / math.sqrt(LONG) for k in (1, 2, 7))
    share = (np.abs(n) > 3.0).mean()
    assert share == pytest.approx(0.0026998, abs=5 * math.sqrt(0.0027 / LONG))
    assert 4.0 < np.abs(n).max() < 6.5


def test_another_seed_is_another_noise() -> None:
    a, b = (CFault(endless("noise", std=1.0), seed=s).run(np.zeros(LONG)) for s in (1, 2))
    assert abs((a * b).mean()) < 5 / math.sqrt(LONG)


def lost_in(y: np.ndarray) -> np.ndarray:
    """Where tick i did not bring the number i + 1."""
    return y != np.arange(1, len(y) + 1)


def runs(lost: np.ndarray) -> np.ndarray:
    """Lengths of the stretches of lost ticks, but one at the end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
    lengths = edges[1::2] - edges[::2]
    return lengths[:-1] if lost[-1] else lengths


@pytest.mark.parametrize("p", [0.05, 0.5])
def test_each_tick_is_lost_on_its_own(p: float) -> None:
    y = CFault(endless("dropout", probability=p)).run(np.arange(1.0, LONG + 1))
    lost = lost_in(y)
    assert lost.mean() == pytest.approx(p, abs=5 * math.sqrt(p * (1 - p) / LONG))
    both = (lost[1:] & lost[:-1]).mean()
    assert both == pytest.approx(p * p, abs=5 * math.sqrt(3 * p * p / LONG))


@pytest.mark.parametrize(("p", "mean"), [(0.02, 10.0), (0.2, 1.0), (0.5, 3.0)])
def test_losses_last_as_long_as_stated(p: float, mean: float) -> None:
    y = CFault(endless("dropout", probability=p, mean_ticks=mean)).run(np.arange(1.0, LONG + 1))
    lengths, gaps = runs(lost_in(y)), runs(~lost_in(y))
    # Both are geometric: standard deviation sqrt(m (m - 1)) at a mean of m.
    assert lengths.mean() == pytest.approx(mean, abs=5 * math.sqrt(mean * (mean - 1) / len(lengths)) + 1e-12)
    assert gaps.mean() == pytest.approx(1 / p, abs=5 * math.sqrt((1 - p) / p**2 / len(gaps)))


def test_what_is_lost_is_the_last_value_that_was_not() -> None:
    x = np.arange(1.0, N + 1)
    y = CFault(endless("dropout", probability=0.5, mean_ticks=4.0)).run(x)
    good = np.maximum.accumulate(np.where(y == x, x, 0.0))
    assert np.array_equal(y[1:], np.maximum(good, 1.0)[1:])


def test_all_lost_leaves_the_value_before() -> None:
    y = CFault(fault("dropout", probability=1.0)).run(X)
    assert np.array_equal(y[ACTS], np.full(400, X[99]))
    assert np.array_equal(CFault(endless("dropout", probability=1.0)).run(X), np.full(N, X[0]))


def test_spikes() -> None:
    y = CFault(endless("spike", probability=0.02, size=5.0)).run(np.ones(LONG))
    assert set(y) == {-4.0, 1.0, 6.0}
    assert (y != 1.0).mean() == pytest.approx(0.02, abs=5 * math.sqrt(0.02 * 0.98 / LONG))
    assert (y[y != 1.0] > 1.0).mean() == pytest.approx(0.5, abs=5 * 0.5 / math.sqrt((y != 1.0).sum()))


# ---- what makes no sense is refused, also by the core ----


@pytest.mark.parametrize(
    ("kind", "a", "b"),
    [
        (5, 0.0, 0.0),
        (5, 1.1, 0.0),
        (5, 0.1, 0.5),
        (6, math.nan, 1.0),
        (7, 0.0, 0.0),
        (9, 2.0, 1.0),
        (1, math.inf, 0.0),
        (4, -0.02, 0.0),
        (4, 0.03, 0.0),
        (4, 1e9, 0.0),
        (10, 0.0, 0.0),
        (-1, 0.0, 0.0),
    ],
)
def test_the_core_refuses(kind: int, a: float, b: float) -> None:
    assert library().slw_fault_new(kind, 0, 10, a, b, 0, STEP) is None


# ---- the same bits everywhere, and nothing that a sanitizer finds ----


def bits_of(folder: Path, platform: str, run: Sequence[str] = (), extra: Sequence[str] = ()) -> list[str]:
    """What fault_bits.c prints, compiled for `platform`."""
    flags = [f"-I{SHIM}", f"-I{SOURCES}", *extra]
    sources = [SOURCES / "fault.c", Path(__file__).with_name("fault_bits.c")]
    objects = [
        compiler.compile_object(s, folder / f"{s.stem}-{platform}.o", platform, flags) for s in sources
    ]
    program = compiler.link_program(objects, folder / f"bits-{platform}", platform, extra)
    done = subprocess.run([*run, str(program)], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


@pytest.mark.qemu
@pytest.mark.skipif(shutil.which("qemu-aarch64") is None, reason="qemu-user is not installed")
@pytest.mark.skipif(not CROSS_LIBRARIES.is_dir(), reason="libc6-arm64-cross is not installed")
def test_aarch64_gives_the_same_bits(tmp_path: Path) -> None:
    here = bits_of(tmp_path, compiler.host().name)
    assert len(here) == 5000
    assert bits_of(tmp_path, "aarch64-linux", ["qemu-aarch64", "-L", str(CROSS_LIBRARIES)]) == here


def test_sanitizers_find_nothing(tmp_path: Path) -> None:
    checks = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    try:
        found = bits_of(tmp_path, compiler.host().name, extra=checks)
    except RunError as missing:  # a compiler without sanitizer run-time libraries
        pytest.skip(f"no sanitizers here: {str(missing).splitlines()[-1]}")
    assert found == bits_of(tmp_path, compiler.host().name)
