"""Slew networks on the cabin gyro's rate: what the training environment turns the upper carriage with.

    python -m learning.policy.drives MACHINE [SEED]      # nominal, tuning:K  -> out/policy/drives/MACHINE.npz

The networks of `fmus/slew_nn` predict the speed as the encoder tells it, about 0.2 s late.  A policy also reads
angle, gyro and the tool's IMU, which are not late, so that in a simulation on the late speed the tool would swing
0.2 s after the machine's.  These are the same networks, trained on the same recordings, with the gyro's rate in
the place of the encoder's.  A set of them, one a tuning machine, is an ensemble over machines.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from fmus.slew_nn.network import SlewNetwork
from learning.slew.trajectory import Trajectory, of_measurement
from records.measurement import Measurement
from specs.errors import InputError

GYRO, LATE = "imu_cabin_rate_z", "qd_slew"
FOLDER = Path("out/policy/drives")
UNROLL = 30  # steps of 0.1 s of its own predictions in the second phase
Report = Callable[[str, float, float], None]


def with_gyro(measurement: Measurement) -> Measurement:
    """The recording with the gyro's rate as the slew speed; InputError if there is no gyro."""
    gyro = replace(measurement[GYRO], name=LATE)
    return replace(measurement, channels={**measurement.channels, LATE: gyro})


def trajectories(folder: Path, split: str = "train") -> list[Trajectory]:
    """Trajectories of a collection's split, their speed from the gyro."""
    from records.formats import read_measurement

    try:
        entries = json.loads((folder / "collection.json").read_text(encoding="utf-8"))["recordings"]
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{folder} holds no collection: {error}") from None
    found: list[Trajectory] = []
    for entry in entries:
        if entry["split"] == split and not entry["aborted"]:
            path = folder / entry["file"]
            found += of_measurement(with_gyro(read_measurement(path)), path.stem)
    return found


def train_drive(folder: Path, machine: str, seed: int, report: Report | None = None) -> SlewNetwork:
    """A slew network on the gyro's rate from a collection; its metadata says from which."""
    from learning.slew.recipe import recipe
    from learning.slew.region import with_region
    from learning.slew.score import HORIZON, STRIDE, predictor, score
    from learning.slew.training import train
    from learning.slew.trajectory import windows

    chosen = trajectories(folder)
    trained = train(chosen, replace(recipe("unrolled"), unroll=UNROLL), seed, report)
    network = with_region(trained.network(), chosen, mirror=True)
    held = score(predictor(network), windows(trajectories(folder, "validation"), 20, HORIZON, STRIDE))
    figures = {"velocity_mae": float(held.velocity_mae), "position_mae": float(held.position_mae)}
    meta: dict[str, Any] = {"machine": machine, "seed": seed, "speed": GYRO, "validation": figures}
    return replace(network, meta=meta)


def main(machine: str, seed: int) -> Path:
    """Train on the collection `paper` of a machine, which must be there (slewright collect paper)."""
    import torch

    torch.set_num_threads(1)
    folder = Path("out/collect") / f"paper-{machine.replace(':', '-')}"
    FOLDER.mkdir(parents=True, exist_ok=True)
    network = train_drive(folder, machine, seed, lambda *a: print(*a, flush=True))
    path = FOLDER / f"{machine.replace(':', '-')}.npz"
    network.save(path)
    print(path, dict(network.meta))
    return path


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1)
