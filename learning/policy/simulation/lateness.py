"""How well the slew networks foretell the gyro when they run ahead of the clock (plant.py, `ahead`).

    python -m learning.policy.simulation.lateness [COLLECTION]        # out/collect/paper-nominal

Mean absolute errors of speed and angle over 10 s open loop on a collection's validation recordings, for 0,
1 and 2 periods ahead.  The angle is the running sum of the error in speed.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from fmus.models.slew_nn.network import HISTORY, PERIOD_S, SlewNetwork
from learning.collection import manifest
from learning.policy.session import NETWORKS
from learning.slew.trajectory import Trajectory, of_measurement
from records.formats import read_measurement
from records.measurement import Measurement

GYRO, LATE = "imu_cabin_rate_z", "qd_slew"
START, AHEAD, STRIDE = 12, 100, 60  # periods: before the roll-out, of it, between windows
Pair = tuple[Trajectory, Trajectory]


def with_gyro(measurement: Measurement) -> Measurement:
    """The recording with the gyro's rate as the slew speed."""
    gyro = replace(measurement[GYRO], name=LATE)
    return replace(measurement, channels={**measurement.channels, LATE: gyro})


def recordings(folder: Path, split: str = "validation") -> list[Pair]:
    """(as the networks know it, with the gyro) of each recording of a split."""
    found: list[Pair] = []
    for file, entry in manifest.read(folder)[1]:
        if entry["split"] == split:
            one = read_measurement(file)
            found += zip(of_measurement(one, ""), of_measurement(with_gyro(one), ""), strict=True)
    return found


def errors(network: SlewNetwork, pairs: list[Pair], ahead: int) -> tuple[float, float]:
    """Mean absolute errors of speed [rad/s] and angle [rad] against the gyro, `ahead` periods early."""
    late, prompt = _cut([a for a, _ in pairs]), _cut([b for _, b in pairs])
    past = {k: list(late[k][:, START + ahead - HISTORY : START + ahead].T) for k in ("p_l", "p_r", "omega")}
    found = []
    for k in range(START, START + AHEAD):
        known = [min(i, k) for i in range(k + ahead - HISTORY + 1, k + ahead + 1)]
        rows = [np.array(past[name][-HISTORY:]).T for name in ("p_l", "p_r", "omega")]
        new = network.predict(late["u"][:, known], rows[0], rows[1], rows[2], late["inertia"][:, k - 1])
        for name, value in zip(past, new, strict=True):
            past[name].append(value)
        found.append(new[2])
    miss = np.array(found).T - prompt["omega"][:, START : START + AHEAD]
    return float(np.abs(miss).mean()), float(np.abs(np.cumsum(miss, axis=1) * PERIOD_S).mean())


def _cut(trajectories: list[Trajectory]) -> dict[str, np.ndarray]:
    length = START + AHEAD + HISTORY
    names = ("u", "p_l", "p_r", "omega", "inertia")
    starts = [(t, s) for t in trajectories for s in range(0, len(t) - length, STRIDE)]
    return {n: np.array([getattr(t, n)[s : s + length] for t, s in starts]) for n in names}


if __name__ == "__main__":
    pairs = recordings(Path(sys.argv[1] if len(sys.argv) > 1 else "out/collect/paper-nominal"))
    for periods in (0, 1, 2):
        speed, angle = np.degrees(errors(SlewNetwork.load(NETWORKS[0]), pairs, periods))
        print(f"{periods * PERIOD_S:.1f} s ahead: speed {speed:.2f} °/s, angle {angle:.2f}°")
