"""From a recording to the name of what is missing, at time scales from 10 µs to hours, as a rig's owner goes.

Simulated rigs with a disturbance of their own that no effect describes; `--init` writes the model.
"""

import json
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.long
FINER = 10  # steps of the simulation in a sample


def wandering(random: np.random.Generator, n: int, samples: float, size: float) -> np.ndarray:
    """A disturbance of a standard deviation that forgets itself in so many samples."""
    keep = np.exp(-1.0 / samples)
    out = np.zeros(n)
    for k in range(1, n):
        out[k] = keep * out[k - 1] + size * np.sqrt(1.0 - keep**2) * random.normal()
    return out


def first_order(u: np.ndarray, step: float, start: float, rate) -> np.ndarray:
    """y' = rate(y, u, sample), u held over each sample."""
    y, out = start, np.zeros(len(u))
    for k, held in enumerate(u):
        out[k] = y
        for _ in range(FINER):
            y += step / FINER * rate(y, held, k)
    return out


def oven(random: np.random.Generator) -> list[dict[str, np.ndarray]]:
    """A sample every 30 s; the heater's command comes 300 s late."""
    n, step = 1200, 30.0
    u = np.repeat(random.uniform(0, 100, n // 80), 80)
    late, d = np.r_[np.full(10, u[0]), u[:-10]], wandering(random, n, 10, 2e-4)
    y = first_order(late, step, 20 + 0.6 * u[0], lambda y, u, k: (0.6 * u + 20 - y) / 1500 + d[k])
    noise = 0.05 * random.normal(size=n)
    return [{"time [s]": step * np.arange(n), "heater [%]": u, "temperature [degC]": y + noise}]


def low_pass(random: np.random.Generator) -> list[dict[str, np.ndarray]]:
    """A sample every 10 µs; the driver of a resistor and a capacitor gives no more than 4 V."""
    n, step = 3000, 1e-5
    t = step * np.arange(n)
    waves = [1.6 * np.sin(2 * np.pi * f * t + random.uniform(0, 6.28)) for f in np.geomspace(80, 3000, 12)]
    u = np.sum(waves, axis=0)
    d = wandering(random, n, 10, 20.0)
    y = first_order(np.clip(u, -4, 4), step, 0.0, lambda y, u, k: (u - y) / 4.7e-4 + d[k])
    return [{"time [s]": t, "u_in [V]": u, "u_out [V]": y + 0.004 * random.normal(size=n)}]


def coasting(random: np.random.Generator) -> list[dict[str, np.ndarray]]:
    """Six runs of 40 samples without an input: a vehicle rolls, slowed by air."""
    runs = []
    for i in range(6):
        d = wandering(random, 40, 2, 0.01)
        v = first_order(
            np.zeros(40), 0.5, 9 + 1.4 * i, lambda v, _, k, d=d: -0.09 - 0.0055 * v * abs(v) + d[k]
        )
        runs.append(
            {"time [s]": 0.5 * np.arange(40), "speed [km/h]": 3.6 * (v + 0.02 * random.normal(size=40))}
        )
    return runs


def let_go(random: np.random.Generator) -> list[dict[str, np.ndarray]]:
    """A carriage on a spring, held for half a second and then let go; read in steps of 2 mm."""
    step, x, v, read = 0.01, 0.07, 0.0, []
    d = wandering(random, 250, 5, 0.05)
    for k in range(250):
        read.append(0.002 * np.round(x / 0.002))
        for _ in range(FINER if k >= 50 else 0):
            pull = -330.0 * x - 3.0 * v + d[k]
            slowed = v + step / FINER * pull
            v = np.sign(slowed) * max(0.0, abs(slowed) - step / FINER * 0.8)
            x += step / FINER * v
    return [{"time [s]": step * np.arange(250), "position [m]": np.array(read)}]


@pytest.mark.parametrize(
    ("rig", "template", "truth", "parameter", "value"),
    [
        (oven, "first-order", {"input_delay", "sensor_delay"}, "delay", 300.0),
        (low_pass, "first-order", {"input_saturation"}, "limit", 4.0),
        (coasting, "linear", {"quadratic_drag", "wind_load"}, "k", 0.0055),
        (let_go, "linear", {"stiffness", "coulomb_friction", "sensor_quantization"}, "k", 330.0),
    ],
)
def test_what_is_missing_is_named(slewright, tmp_path: Path, rig, template, truth, parameter, value):
    files = []
    for i, columns in enumerate(rig(np.random.default_rng(11))):
        files.append(tmp_path / f"run{i}.csv")
        rows = [",".join(f"{x:.9g}" for x in r) for r in zip(*columns.values(), strict=True)]
        files[-1].write_text("\n".join([",".join(columns), *rows]) + "\n", encoding="utf-8")
    model, figures = tmp_path / "rig", tmp_path / "figures.json"
    assert slewright("reconcile", files[0], "--init", model, "--template", template).returncode == 0
    done = slewright(
        "reconcile", *files, "--model", model, "--map", model / "map.toml",
        "--out", tmp_path / "found", "--json", figures, timeout=900.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(figures.read_text())
    effects = {e["name"]: e for e in found["effects"]}
    assert effects, found["sentence"]
    assert set(effects) <= truth
    fitted = next(p[parameter] for p in (e["parameters"] for e in effects.values()) if parameter in p)
    assert fitted["value"] == pytest.approx(value, rel=0.1)
    assert (tmp_path / "found" / "model" / "model.py").is_file()
