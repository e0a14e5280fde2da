"""All that is measured, by the key of its figure."""

from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.orchestrator import contestants, handler, recorders
from benchmarks.orchestrator.chain import Chain
from benchmarks.orchestrator.contestants import Contestant

MASTERS = ("floor_us", "slewright_us", "fmucontainer_us", "ecos_us", "fmpy_ssp_us", "libcosim_us")
RECORDERS = ("slewright", "fmpy", "libcosim")

REGISTRY: Mapping[str, Callable[[Chain, Path], Contestant]] = {
    "floor_us": contestants.Floor,
    "slewright_us": contestants.Slewright,
    "fmucontainer_us": contestants.FmuContainer,
    "ecos_us": contestants.Ecos,
    "fmpy_ssp_us": contestants.FmpySsp,
    "libcosim_us": contestants.Libcosim,
    "isolated_us": contestants.Isolated,
    "slewright": recorders.SlewrightRecorder,
    "fmpy": recorders.FmpyRecorder,
    "libcosim": recorders.LibcosimRecorder,
    "nominal": handler.Nominal,
}
