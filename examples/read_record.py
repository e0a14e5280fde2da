"""Read a record with pandas and plot it: python examples/read_record.py [FOLDER [RECORD.parquet]]

Any program that reads Parquet can do the same. Without RECORD a short run is made.
"""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd  # comes with the extra `formats`: pip install -e ".[verify,formats]"
import pyarrow.parquet as pq

from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)
path = Path(sys.argv[2]) if len(sys.argv) > 2 else folder / "read_record.parquet"
if not path.exists():
    target = Stimuli.constant(target_x=7.0, target_y=8.0, target_z=2.0, pace=1.0)
    simulate(load_system(pack_system("nominal")), 750, target, record_path=path)

frame = pd.read_parquet(path).set_index("time")  # SI units; the time in s
print(frame[["q_slew", "qd_slew", "u_slew"]].describe().round(3))

# Units and what was run are in the file's metadata.
schema = pq.read_schema(path)
units = {f.name: (f.metadata or {}).get(b"unit", b"").decode() for f in schema}
meta = json.loads(schema.metadata[b"slewright"])
print("complete:", meta["complete"], "- versions and hashes:", ", ".join(meta))

shown = ["q_slew", "u_slew", "q_tool_x", "q_tool_y"]
plt.rcParams.update({"svg.hashsalt": "slewright", "svg.fonttype": "none"})
axes = frame[shown].plot(subplots=True, figsize=(7, 6), grid=True, legend=False)
for axis, name in zip(axes, shown, strict=True):
    axis.set_ylabel(f"{name} [{units[name]}]")
axes[0].figure.savefig(folder / "read_record.svg", metadata={"Date": None})
