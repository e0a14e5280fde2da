"""Simulate a system from an SSP and plot it: python examples/simulate_ssp.py [FOLDER [FILE.ssp]]

Without FILE it packs the nominal system (controller, slew drive, arm, tool) and gives it one target.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)
system = load_system(sys.argv[2] if len(sys.argv) > 2 else pack_system("nominal"))
print("inputs:", ", ".join(system.inputs))

# Inputs hold until they change; all values are SI. Others keep the start values of the SSP.
target = {"target_x": 7.0, "target_y": 8.0, "target_z": 2.0, "pace": 1.0}
stimuli = Stimuli({0: {name: value for name, value in target.items() if name in system.inputs}})
ticks = round(15.0 / system.step_s)
record = simulate(system, ticks, stimuli, record_path=folder / "simulate_ssp.parquet")
print(f"{len(record)} rows of {len(record.names)} columns in {folder / 'simulate_ssp.parquet'}")

shown = [name for name in ("q_slew", "u_slew", "q_tool_x") if name in record] or record.names[1:4]
plt.rcParams.update({"svg.hashsalt": "slewright", "svg.fonttype": "none"})
figure, axes = plt.subplots(len(shown), 1, sharex=True, figsize=(7, 1.7 * len(shown)), layout="constrained")
for axis, name in zip(np.atleast_1d(axes), shown, strict=True):
    axis.plot(record.time, record.column(name))
    axis.set_ylabel(f"{name} [{record.units[name]}]")
    axis.grid(alpha=0.3)
axis.set_xlabel("time [s]")
figure.savefig(folder / "simulate_ssp.svg", metadata={"Date": None})
