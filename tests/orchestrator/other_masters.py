"""The project's systems in other people's masters; run as a program, since their libraries may end a process.

    python -m tests.orchestrator.other_masters MASTER SYSTEM FMI_VERSION TICKS OUT.json

writes {"component.output": value after TICKS steps} with system inputs held at their given start values.
"""

import json
import sys
import tempfile
from pathlib import Path

from benchmarks.orchestrator.masters import MASTERS, Case
from fmus.toolchain.build import build_fmu
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.system import System

START = {"target_x": -3.0, "target_y": 9.0, "target_z": 4.0, "pace": 1.0}
SEED = "noise_seed"


def project_system(name: str, fmi_version: int, folder: Path) -> System:
    """One of the project's systems."""
    return load_system(pack_system(name, fmi_version, folder))  # type: ignore[arg-type]


def seeded(system: System) -> list[str]:
    """Components with noise."""
    return [c for c, v in system.components.items() if SEED in v.model.variables]


def outputs(system: System) -> list[tuple[str, str]]:
    """Component and variable of what the system shows."""
    return sorted({(o.link.source.owner, o.link.source.name) for o in system.outputs.values()})


def case(system: System, fmi_version: int, folder: Path) -> Case:
    """A project system as others are told it: START for its inputs, noise off."""
    driven = {n: i.start for n, i in system.inputs.items()} | START
    links = system.links
    return Case(
        fmi_version=fmi_version,
        step_s=system.step_s,
        folder=folder,
        files={c: build_fmu(c, fmi_version) for c in system.components},
        links=[
            ((k.source.owner, k.source.name), (k.target.owner, k.target.name))
            for k in links
            if k.source.owner
        ],
        outputs=outputs(system),
        vr={(c, n): v.vr for c, o in system.components.items() for n, v in o.model.variables.items()},
        reals={
            (k.target.owner, k.target.name): float(driven[k.source.name])  # type: ignore[arg-type]
            for k in links
            if not k.source.owner
        },
        whole={(c, SEED): 0 for c in seeded(system)},
    )


def main(master: str, name: str, fmi_version: str, ticks: str, out: str) -> None:
    """Run one case; see the module docstring."""
    with tempfile.TemporaryDirectory() as folder:
        system = project_system(name, int(fmi_version), Path(folder))
        ends = MASTERS[master](case(system, int(fmi_version), Path(folder)), int(ticks))
    Path(out).write_text(json.dumps(ends))


if __name__ == "__main__":
    main(*sys.argv[1:])
