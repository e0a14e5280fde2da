"""A system definition made ready to run, in memory: for tools that measure, tune or drive models."""

from pathlib import Path
from tempfile import TemporaryDirectory

from fmus.build import build_fmu
from orchestrator.check import load_system
from orchestrator.pack import pack
from orchestrator.system import System
from specs import ssd, systems


def assemble(spec: systems.SystemSpec) -> System:
    """Build the FMUs (FMI 2.0) of a system definition and load it as the orchestrator would its package."""
    fmus = {f"{component.fmu}.fmu": build_fmu(component.fmu, 2) for component in spec.components}
    with TemporaryDirectory(prefix="slewright-") as folder:
        return load_system(pack(ssd.render(spec, 2), fmus, Path(folder) / f"{spec.name}.ssp"))
