"""Input images of a working day, made without a machine: every mode, faults and acknowledgements, noise."""

import numpy as np

from runtime.image import INPUT, TICK_S, Status
from tests.runtime.bench import ALIVE, NOISY, READY

TARGET_TICKS = 750  # 15 s
ROUND = 3000  # ticks of automatic work, then of work by hand, with a fault between
HAND = 600
FAULTY = (Status.TIMEOUT, Status.RANGE, Status.CHECKSUM, Status.STUCK, Status.ERROR)
QUIET = {"machine_heartbeat": 5, "planner_heartbeat": 5, "operator_heartbeat": 1}


def images(ticks: int, seed: int = 1, wild: float = 0.0) -> np.ndarray:
    """`ticks` images; a share `wild` of all values is anything at all."""
    random = np.random.default_rng(seed)
    k = np.arange(ticks)
    found = np.zeros(ticks, INPUT.dtype)
    found["tick"] = k
    values = found["value"]
    for name, column in _columns(k, random).items():
        values[:, INPUT.at(name)] = column
    found["status"][random.random(found["status"].shape) < 2e-4] = Status.CHECKSUM
    lost = (k % ROUND > ROUND - 300) & (k % ROUND < ROUND - 200)  # by hand without a sensor
    found["status"][lost, INPUT.at("imu_cabin_rate_z")] = Status.TIMEOUT
    for n, status in enumerate(FAULTY, 1):  # one in each round, before its emergency stop; the first has none
        hit = (k // ROUND % (len(FAULTY) + 1) == n) & (k % ROUND > 1300) & (k % ROUND < 1310)
        found["status"][hit, INPUT.at("q_boom")] = status
    if wild:
        _spoil(found, wild, random)
    return found


def _columns(k: np.ndarray, random: np.random.Generator) -> dict[str, np.ndarray]:
    t, phase = k * TICK_S, k % ROUND
    target = k // TARGET_TICKS
    angle = 1.2 * np.sin(1.7 * target)
    slew = 0.9 * np.sin(0.21 * t) + 0.2 * np.sin(0.9 * t)
    rates = {n: 2e-3 * random.standard_normal(len(k)) for n in NOISY}
    rates["imu_cabin_rate_z"] = rates["imu_cabin_rate_z"] + np.gradient(slew, TICK_S)
    rates["imu_tool_roll"] = rates["imu_tool_roll"] + 0.2 * np.sin(2.3 * t)
    rates["imu_tool_rate_x"] = rates["imu_tool_rate_x"] + 0.46 * np.cos(2.3 * t)
    by_hand = phase >= ROUND - HAND
    return {
        **rates,
        **{n: np.full(len(k), v) for n, v in READY.items()},
        **{n: k // QUIET[n] % 251.0 for n in ALIVE},
        "q_slew": slew + 1e-4 * random.standard_normal(len(k)),
        "q_boom": 1.15 + 0.1 * np.sin(0.3 * t) + 1e-4 * random.standard_normal(len(k)),
        "q_stick": -1.5 + 0.3 * np.sin(0.17 * t) + 1e-4 * random.standard_normal(len(k)),
        "p_slew_a": 1e7 + 3e6 * np.sin(0.4 * t) + 5e4 * random.standard_normal(len(k)),
        "p_slew_b": 9e6 + 3e6 * np.cos(0.4 * t) + 5e4 * random.standard_normal(len(k)),
        "target_x": 9.0 * np.cos(angle),
        "target_y": 9.0 * np.sin(angle),
        "target_z": 5.0 + np.sin(2.0 * target) + 15.0 * (target % 9 == 8),  # out of reach now and then
        "target_number": target % 251.0,
        "target_valid": 1.0 * (phase % 1000 > 20),
        "load_told": 500.0 * (target % 4),
        "pace": 0.5 + 0.25 * (target % 4),
        "operator_enable": 1.0
        * ~(((phase > 1480) & (phase < 1500)) | ((phase > 1510) & (phase < 1520)) | (phase < 5)),
        "automatic_request": 1.0 * ((phase > 30) & ~by_hand & ~((phase > 1470) & (phase < 1540))),
        "joystick_slew": np.where(by_hand, np.sin(1.1 * t), 0.0),
        "joystick_boom": np.where(by_hand, 0.7 * np.sin(0.7 * t), 0.0),
        "emergency_stop": 1.0 * ((phase > 1400) & (phase < 1420)),
    }


def _spoil(found: np.ndarray, share: float, random: np.random.Generator) -> None:
    hit = random.random(found["value"].shape) < share
    bits = random.integers(0, 2**64, int(hit.sum()), dtype=np.uint64)
    found["value"][hit] = bits.view(np.float64)
    hit = random.random(found["status"].shape) < share
    found["status"][hit] = random.integers(0, 256, int(hit.sum()))
    hit = random.random(found["age"].shape) < share
    found["age"][hit] = random.integers(-(2**31), 2**31 - 1, int(hit.sum()))
