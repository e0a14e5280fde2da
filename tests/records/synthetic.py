"""Synthetic records: hand-made trajectories for the metrics, and a plausible 60 s run for the report."""

import math
from collections.abc import Sequence

import numpy as np

from records.record import Column, Record

STEP = 0.02
UNITS = {
    "true_q": "rad", "true_qd": "rad/s", "true_p": "Pa", "target": "m", "true_tool": "m", "u": "1",
    "qd": "rad/s",
}  # fmt: skip


def column(name: str) -> Column:
    """A column with a unit guessed from its name, so that these tests need no signal list."""
    if name == "time":
        return Column("time", "s", "Time")
    prefix = max((p for p in UNITS if name.startswith(f"{p}_")), key=len)
    return Column(name, UNITS[prefix], name.replace("_", " "))


def make(series: dict[str, np.ndarray], **meta: object) -> Record:
    """A record from named series of equal length."""
    return Record.from_rows(
        [column(name) for name in series], np.column_stack(list(series.values())), {"step_s": STEP, **meta}
    )


def slew_run(slew_deg: Sequence[np.ndarray], targets_deg: Sequence[float], radius: float = 10.0) -> Record:
    """A run of a machine whose tool hangs still at `radius`, one piece of slew angle [deg] a target."""
    q = np.radians(np.concatenate(slew_deg))
    aim = np.radians(np.concatenate([np.full(len(p), t) for p, t in zip(slew_deg, targets_deg, strict=True)]))
    zero = np.zeros_like(q)
    return make(
        {
            "time": np.arange(len(q)) * STEP,
            "target_x": radius * np.cos(aim), "target_y": radius * np.sin(aim), "target_z": zero + 5.0,
            "true_q_slew": q,
            "true_tool_x": radius * np.cos(q), "true_tool_y": radius * np.sin(q), "true_tool_z": zero + 5.0,
            "true_qd_tool_x": zero, "true_qd_tool_y": zero,
        }
    )  # fmt: skip


def constant(value: float, seconds: float) -> np.ndarray:
    """A stretch of one value."""
    return np.full(round(seconds / STEP), float(value))


def ramp(start: float, stop: float, seconds: float) -> np.ndarray:
    """A straight stretch from `start` (included) to `stop` (not included)."""
    n = round(seconds / STEP)
    return start + (stop - start) * np.arange(n) / n


# slew [deg], radius [m], height [m] of a run like the paper's four targets
PLACES = ((90.0, 10.5, 5.0), (-15.0, 8.0, 7.5), (105.0, 12.0, 4.0), (40.0, 9.0, 6.0))


def plausible(
    system: str = "reference", places: Sequence[tuple] = PLACES, load: float = 0.0, seed: int = 1
) -> Record:
    """A 15 s-per-target run: a second-order slew with overshoot, a lagging arm and a swinging tool."""
    nominal = system == "nominal"
    rng = np.random.default_rng(seed)
    n = round(15.0 / STEP) * len(places) + 1
    frequency, damping, arm_lag, tool_damping = (
        (0.62, 0.72, 0.25, 0.12) if nominal else (0.55, 0.55, 0.4, 0.07)
    )
    frequency /= 1 + load / 8000
    length, g = 2.0, 9.81
    out = {name: np.zeros(n) for name in _names(nominal)}
    q, qd, radius, height, r_rate, h_rate = 0.0, 0.0, 9.0, 6.0, 0.0, 0.0
    pitch = roll = pitch_rate = roll_rate = boom_rate = stick_rate = 0.0
    for k in range(n):
        slew_deg, aim_r, aim_h = places[min(k // 750, len(places) - 1)]
        aim = math.radians(slew_deg)
        qdd = float(np.clip(frequency**2 * (aim - q) - 2 * damping * frequency * qd, -0.18, 0.18))
        v_r = float(np.clip(0.6 * (aim_r - radius), -0.9, 0.9))
        v_h = float(np.clip(0.6 * (aim_h - height), -0.9, 0.9))
        r_acc = (v_r - r_rate) / arm_lag * 0.5
        boom_ref, stick_ref = v_h / radius, v_r / 7.0
        boom_rate += STEP / arm_lag * (boom_ref - boom_rate)
        stick_rate += STEP / arm_lag * (stick_ref - stick_rate)
        pitch_acc = (r_acc * math.cos(pitch) - g * math.sin(pitch) - qd**2 * radius) / length
        roll_acc = (-qdd * radius * math.cos(roll) - g * math.sin(roll)) / length
        x, y = radius - length * math.sin(pitch), length * math.sin(roll)
        row = {
            "time": k * STEP,
            "target_x": aim_r * math.cos(aim), "target_y": aim_r * math.sin(aim), "target_z": aim_h,
            "u_slew": float(np.clip(qdd * 4 + qd * 0.9, -1, 1)),
            "u_boom": boom_ref * 4, "u_stick": stick_ref * 4,
            "qd_boom_ref": boom_ref, "qd_stick_ref": stick_ref,
            "true_q_slew": q, "true_qd_slew": qd, "true_qd_boom": boom_rate, "true_qd_stick": stick_rate,
            "true_q_boom": 1.1 + 0.1 * math.sin(height), "true_q_stick": -1.2 + 0.1 * math.sin(radius),
            "true_q_tool_x": roll, "true_q_tool_y": pitch,
            "true_qd_tool_x": roll_rate, "true_qd_tool_y": pitch_rate,
            "true_tool_x": x * math.cos(q) - y * math.sin(q),
            "true_tool_y": x * math.sin(q) + y * math.cos(q),
            "true_tool_z": height + length * (1 - math.cos(pitch) * math.cos(roll)),
        }  # fmt: skip
        dp = 4.0e5 / 2.84e-3 * qdd + 4.4e4 / 2.84e-3 * qd
        pressures = {
            "slew_a": 2e6 + max(dp, 0.0), "slew_b": 2e6 + max(-dp, 0.0),
            "boom_a": 1.6e7 + 3e7 * boom_rate, "boom_b": 3e6 - 5e6 * boom_rate,
            "stick_a": 8e6 + 2e7 * stick_rate, "stick_b": 6e6 - 1e7 * stick_rate,
        }  # fmt: skip
        row |= {f"true_p_{name}": value + rng.normal(0, 1e5) for name, value in pressures.items()}
        for name, series in out.items():
            series[k] = row[name]
        q, qd = q + STEP * qd, qd + STEP * qdd
        r_rate, h_rate = r_rate + STEP * r_acc, h_rate + STEP * (v_h - h_rate) / arm_lag * 0.5
        radius, height = radius + STEP * r_rate, height + STEP * h_rate
        pitch_rate += STEP * (pitch_acc - tool_damping * pitch_rate)
        roll_rate += STEP * (roll_acc - tool_damping * roll_rate)
        pitch, roll = pitch + STEP * pitch_rate, roll + STEP * roll_rate
    return make(out, system=system, load_kg=load, scenario="four_targets", seed=seed)


def _names(nominal: bool) -> list[str]:
    names = [
        "time", "target_x", "target_y", "target_z", "u_slew", "qd_boom_ref", "qd_stick_ref",
        "true_q_slew", "true_qd_slew", "true_q_boom", "true_qd_boom", "true_q_stick", "true_qd_stick",
        "true_q_tool_x", "true_q_tool_y", "true_qd_tool_x", "true_qd_tool_y",
        "true_tool_x", "true_tool_y", "true_tool_z", "true_p_slew_a", "true_p_slew_b",
    ]  # fmt: skip
    arm = ["u_boom", "u_stick", "true_p_boom_a", "true_p_boom_b", "true_p_stick_a", "true_p_stick_b"]
    return names if nominal else names + arm
