"""`slewright import slew`: networks from other tools, checked against a recording, written in our forms."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmus.models.slew_nn.fmu import build_from, check_name
from fmus.models.slew_nn.network import SlewNetwork
from learning.slew.acceptance import MOST_FAR, Acceptance, accept, trajectories
from learning.slew.exchange import read_pair, to_onnx
from records.figures_file import check_target
from specs.errors import InputError
from specs.progress import Report


@dataclass(frozen=True)
class Target:
    """What is written: a .npz file or a folder (`out`), and an FMU of this FMI version if one is named."""

    out: Path
    fmu: Path | None = None
    fmi: int = 2

    def check(self) -> None:
        """Refuse what could not be written, before anything is read."""
        if self.out.suffix == ".npz":
            check_target(self.out)
        elif self.out.exists() and not self.out.is_dir():
            raise InputError(f"{self.out} is a file; name a folder or a file that ends in .npz")
        if self.fmu is not None:
            check_name(self.fmu.stem)

    def write(self, network: SlewNetwork) -> list[Path]:
        """The files written; the FMU first, since it is what may fail."""
        fmu = self.fmu
        written = [build_from(network, fmu.stem, fmu.parent, self.fmi).replace(fmu)] if fmu else []
        if self.out.suffix == ".npz":
            network.save(self.out)
            return [*written, self.out]
        written += to_onnx(network, self.out)
        network.save(self.out / "weights.npz")
        return [*written, self.out / "weights.npz"]


@dataclass(frozen=True)
class Imported:
    """A network, how it fits the recording, and the files written."""

    network: SlewNetwork
    found: Acceptance
    written: list[Path]

    def warnings(self) -> Iterator[str]:
        """What speaks against using it."""
        if self.found.worthless:
            yield "no better than a speed that does not change"
        outside = self.found.outside
        if outside is not None and outside > MOST_FAR:
            yield f"{100 * outside:.0f} % of the recording lie where there was no training data"

    def figures(self) -> dict[str, Any]:
        """Errors over 10 s in open loop, and the layers."""
        found, network = self.found, self.network
        return {
            "velocity_mae": found.network.velocity_mae,
            "position_mae": found.network.position_mae,
            "held": {"velocity_mae": found.held.velocity_mae, "position_mae": found.held.position_mae},
            "windows": len(found.network.velocity),
            "outside": found.outside,
            "layers": {
                "pressure": [list(net.sizes) for net in network.pressure],
                "velocity": [list(net.sizes) for net in network.velocity],
            },
        }


def bring(
    files: tuple[Path, Path], description: Path, recording: Path, target: Target, report: Report
) -> Imported:
    """Read pressure and velocity network, check them against the recording, write them."""
    target.check()
    report("reading the networks")
    network = read_pair(*files, description)
    report("predicting the recording")
    found = accept(network, trajectories(recording, network.inertia_map))
    report("writing")
    return Imported(network, found, target.write(network))
