"""`slewright import slew`: networks from other tools, checked against a recording, written in our forms."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fmus.models.slew_nn.fmu import build_from, check_name
from fmus.models.slew_nn.network import HISTORY, SlewNetwork
from learning.slew.acceptance import MOST_FAR, Acceptance, accept, trajectories
from learning.slew.exchange import read_pair, to_onnx
from records.figures_file import check_target
from specs.errors import InputError
from specs.progress import Report

WIDTH = 2.0  # deviations from the mean that count as trained
RUNS_AWAY = 1000.0  # deg/s: no speed of a slew
MOST_ERROR = 2.0  # deg/s: a history turned round costs the published networks 13, the paper states 0.65


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
        if self.network.inertia_map is None:
            yield (
                "no [inertia] in the description: as a plant it is refused, or takes the project's inertia "
                "number with --our-inertia"
            )
        if self.found.inertia:
            factor, share = self.found.inertia
            yield (
                f"10 s errors are {share:.0%} of those as described with the inertia times {factor:.3g}: "
                "wrong [inertia] in the description?"
            )
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
            "inertia": network.meta.get("inertia"),
            "inertia_factor": found.inertia[0] if found.inertia else None,
            "region": dict(network.region),
            "layers": {
                "pressure": [list(net.sizes) for net in network.pressure],
                "velocity": [list(net.sizes) for net in network.velocity],
            },
        }


def bring(
    files: tuple[Path, Path],
    description: Path,
    recording: Path,
    target: Target,
    report: Report,
    most: float = MOST_ERROR,
) -> Imported:
    """Read pressure and velocity network, check them against the recording, write them.

    Raises InputError where the recording's speed is missed by more than `most` deg/s over 10 s.
    """
    target.check()
    report("reading the networks")
    network = _with_region(read_pair(*files, description))
    report("predicting the recording")
    found = accept(network, trajectories(recording, network.inertia_map))
    if found.network.velocity_mae > most:
        raise InputError(_too_far_off(found, recording, description, most))
    report("writing")
    return Imported(network, found, target.write(network))


def _too_far_off(found: Acceptance, recording: Path, description: Path, most: float) -> str:
    """How far, and what is most likely wrong: the recording, where the networks have no data of it."""
    error = found.network.velocity_mae
    far = "run away from its speed" if error > RUNS_AWAY else f"miss its speed by {error:.2f} °/s"
    said = f"{recording}: the networks {far} over 10 s in open loop (at most {most:g} °/s)"
    if found.outside is not None and found.outside > MOST_FAR:
        return (
            f"{said}: {found.outside:.0%} of it lie where {description} says no training data were; check "
            "them on a recording from within, or accept more with --most-error ERROR"
        )
    return (
        f"{said}: wrong order, residual, scale or inertia in {description}? --most-error ERROR accepts more"
    )


def _with_region(network: SlewNetwork) -> SlewNetwork:
    """A quantity without a stated range has that of its statistics: two deviations about the mean."""
    net = network.velocity[0]
    at = {"inertia": -1, "omega": 3 * HISTORY}
    known = {
        name: (float(net.mean_in[k] - WIDTH * net.std_in[k]), float(net.mean_in[k] + WIDTH * net.std_in[k]))
        for name, k in at.items()
    }
    return replace(network, region={"u": (-1.0, 1.0), **known, **network.region})
