"""Verify a controller of one's own, written in Python: python examples/own_controller.py [FOLDER]

It runs in a scenario on the nominal system and is held to the scenario's limits, as `slewright verify` does.
"""

import math
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from fmus.equations import kinematics
from verification.python_controller import verify_python
from verification.verify import show

SCENARIO = "four_targets_empty"


class Damped:
    """P on the slew angle with damping, past the valve's dead band; boom and stick by inverse kinematics."""

    def __init__(self):
        self.geometry = kinematics.geometry()

    def step(self, sensors):
        """Sensors and target (SI) of this tick in, commands out; called every 0.02 s."""
        x, y, z = (sensors[name] for name in ("target_x", "target_y", "target_z"))
        slew, boom, stick = kinematics.inverse(x, y, z, self.geometry)
        error = math.remainder(slew - sensors["q_slew"], math.tau)
        wanted = 1.2 * error - 1.5 * sensors["qd_slew"]  # rad/s
        past_dead_band = 0.1 * math.tanh(wanted / 0.02)
        return {
            "u_slew": float(np.clip(past_dead_band + 0.6 * wanted, -0.5, 0.5)),
            "qd_boom_ref": float(np.clip(boom - sensors["q_boom"], -0.1, 0.1)),
            "qd_stick_ref": float(np.clip(stick - sensors["q_stick"], -0.1, 0.1)),
        }


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
outcome = verify_python("damped", Damped, [SCENARIO], systems=["nominal"], out=folder / "own_controller")
show(outcome)

record = outcome.own.runs[SCENARIO]["nominal"]
asked = np.unwrap(np.arctan2(record.column("target_y"), record.column("target_x")))
plt.rcParams.update({"svg.hashsalt": "slewright", "svg.fonttype": "none"})
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 4), layout="constrained")
above.plot(record.time, np.degrees(asked), "--", color="grey", label="target")
above.plot(record.time, np.degrees(record.column("true_q_slew")), label="slew")
above.set_ylabel("angle [°]")
above.legend()
below.plot(record.time, record.column("u_slew"))
below.set_ylabel("u_slew [1]")
below.set_xlabel("time [s]")
figure.savefig(folder / "own_controller.svg", metadata={"Date": None})
