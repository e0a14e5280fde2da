"""Verify a controller that another tool exported as an FMU.

    python examples/own_controller_fmu.py [FOLDER [FILE.fmu]]

Without FILE the project's PD controller, built as an FMU, stands for the other tool's. An FMU fits when its
inputs and outputs have the names and units of specs/signals.toml that the PI in its place has.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from fmpy import read_model_description

from fmus.toolchain.build import build_fmu
from orchestrator.system.pack import pack
from specs import ssd, systems
from verification.verify import Controller, show, verify

SLOT = "pi"  # the component of the systems that is the controller
SCENARIO = "four_targets_empty"


def packed(fmu: Path, name: str, folder: Path) -> Path:
    """The system `name` as an SSP with the FMU as its controller; the other parts are the project's."""
    variables = read_model_description(str(fmu)).modelVariables
    spec = systems.load(name).fitted(SLOT, [v.name for v in variables if v.causality == "input"])
    fmus = {c.fmu: fmu if c.name == SLOT else build_fmu(c.fmu, 2) for c in spec.components}
    return pack(ssd.render(spec, 2), {f"{n}.fmu": p for n, p in fmus.items()}, folder / f"{name}.ssp")


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    fmu = Path(sys.argv[2]) if len(sys.argv) > 2 else build_fmu("pd", 2, out=folder / "other_tool")
    packages = {name: packed(fmu, name, folder / "own_controller_fmu") for name in ("nominal", "reference")}
    controller = Controller(fmu.stem, packages=packages)
    outcome = verify([SCENARIO], out=folder / "own_controller_fmu", controller=controller)
    show(outcome)

    plt.rcParams.update({"svg.hashsalt": "slewright", "svg.fonttype": "none"})
    figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
    for name, record in outcome.own.runs[SCENARIO].items():
        axis.plot(record.time, np.degrees(record.column("true_q_slew")), label=name)
    axis.set_xlabel("time [s]")
    axis.set_ylabel("slew angle [°]")
    axis.legend(title="system")
    figure.savefig(folder / "own_controller_fmu.svg", metadata={"Date": None})


if __name__ == "__main__":  # the runs have processes of their own, which import this file
    main()
