"""Calibrate the boom's look-up table from sweeps: python examples/calibrate_lut.py [FOLDER [RECORDING...]]

Without recordings it sweeps the simulated reference machine, at fewer levels than `slewright calibrate lut`.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

from baselines.arm_velocity import lut, sweep
from records.formats import read_measurement
from specs import parameters

LEVELS = (0.08, 0.15, 0.19, 0.26, 0.34, 0.42, 0.5, 0.56, 0.62, 0.68, 0.74, 0.8, 0.88)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)
files = [Path(name) for name in sys.argv[2:]]
files = files or sweep.sweep(folder, ["boom"], conditions=sweep.CONDITIONS[1:3], levels=LEVELS)
recordings = [read_measurement(file) for file in files]
table = lut.calibrate(recordings, ["boom"], bootstraps=50)["boom"]

for direction, band in table.dead_band.items():
    print(f"dead band {direction}: {band.value:.3f} ({band.low:.3f} to {band.high:.3f})")
print("points without data:", [f"{point.velocity:g} rad/s" for point in table.lacking] or "none")

shipped = parameters.load("arm_velocity")
ships = [shipped[f"lut_boom_{number:02d}"].value for number in range(len(lut.GRID))]
plt.rcParams.update({"svg.hashsalt": "slewright", "svg.fonttype": "none"})
figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
axis.fill_between(lut.GRID, table.low, table.high, alpha=0.3, label="95 % interval")
axis.plot(lut.GRID, table.command, "o-", markersize=3, label="from these recordings")
axis.plot(lut.GRID, ships, "--", color="grey", label="the table that ships")
axis.set_xlabel("velocity of the boom [rad/s]")
axis.set_ylabel("joystick [1]")
axis.grid(alpha=0.3)
axis.legend()
figure.savefig(folder / "calibrate_lut.svg", metadata={"Date": None})
