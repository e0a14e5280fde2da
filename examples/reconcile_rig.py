"""Find what the model of a small rig lacks: python examples/reconcile_rig.py [FOLDER]

The rig is a carriage on a rail. Its recording is simulated here, with a friction that the model lacks.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from reconcile.workflow import reconcile

MODEL = '''"""A carriage on a rail: mass v' = force - drag v, x' = v."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="carriage", description="Carriage on a rail", kind="continuous", step=0.005,
    states=(Variable("x", "m"), Variable("v", "m/s")),
    inputs=(Variable("force", "N", min=-20.0, max=20.0),),
    outputs=(Variable("position", "m"), Variable("velocity", "m/s")),
    parameters=(
        Variable("mass", "kg", start=2.1, min=0.1, max=10.0),
        Variable("drag", "N.s/m", start=1.4, min=0.0, max=20.0),
    ),
    rhs=lambda x, u, m, p: {"x": x.v, "v": (u.force - p.drag * x.v) / p.mass},
    out=lambda x, u, m, p: {"position": x.x, "velocity": x.v},
)
'''
STEP, MASS, DRAG, RUBS = 0.001, 2.0, 1.5, 1.2  # s, kg, N s/m, N
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
(folder / "carriage").mkdir(parents=True, exist_ok=True)
(folder / "carriage" / "model.py").write_text(MODEL)

# The recording: a new force every second, samples every 0.02 s with noise.
random = np.random.default_rng(1)
forces, x, v, rows = np.repeat(random.uniform(-8, 8, 20), 1000), 0.0, 0.0, []
for tick, force in enumerate(forces):
    if tick % 20 == 0:
        rows.append([tick * STEP, force, x + random.normal(0, 1e-3), v + random.normal(0, 2e-3)])
    pushed = v + STEP * (force - DRAG * v) / MASS
    v = np.sign(pushed) * max(abs(pushed) - STEP * RUBS / MASS, 0.0)  # friction slows, and never turns
    x += STEP * v
recording = folder / "carriage.csv"
np.savetxt(recording, rows, delimiter=",", header="time,force,position,velocity", comments="", fmt="%.6g")

report = reconcile([recording], str(folder / "carriage"), folder / "reconcile_rig")
print(report["sentence"])
for effect in report["effects"]:
    sizes = {name: f"{found['value']:.3g} {found['unit']}" for name, found in effect["parameters"].items()}
    print(f"{effect['name']}: {effect['equation']}, {sizes}; put into the simulation: {RUBS} N")
print(f"more in {folder / 'reconcile_rig' / 'report.html'}")

time, force, _, velocity = np.array(rows).T
without = [0.0]
for pushes in force[:-1]:
    without.append(without[-1] + 0.02 * (pushes - 1.4 * without[-1]) / 2.1)
plt.rcParams.update({"svg.hashsalt": "slewright", "svg.fonttype": "none"})
figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
axis.plot(time, velocity, label="recorded")
axis.plot(time, without, "--", label="the model as it was")
axis.set_xlabel("time [s]")
axis.set_ylabel("velocity [m/s]")
axis.set_title(report["sentence"])
axis.legend()
figure.savefig(folder / "reconcile_rig.svg", metadata={"Date": None})
