"""`slewright import`: what was made elsewhere, checked and brought into the project's forms."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from records.figures_file import check_target, write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError

if TYPE_CHECKING:
    from fmus.models.slew_nn.network import SlewNetwork
    from learning.slew.acceptance import Acceptance

app = typer.Typer(help="Bring what was made elsewhere.", no_args_is_help=True)


@app.callback()
def import_() -> None:
    """Bring what was made elsewhere."""


@app.command()
def slew(
    pressure: Annotated[Path, typer.Option(metavar="FILE", help="Pressure network: .onnx, .pt or .pth.")],
    velocity: Annotated[Path, typer.Option(metavar="FILE", help="Velocity network, of the same kind.")],
    description: Annotated[
        Path,
        typer.Option(metavar="FILE.toml", help="Order, senses and units of the channels, means, deviations."),
    ],
    check: Annotated[
        Path, typer.Option(metavar="TRACE", help="A recording that the networks must fit: any known format.")
    ],
    out: Annotated[
        Path,
        typer.Option(metavar="DIR|FILE.npz", help="The network as .npz; a folder gets weights.npz and ONNX."),
    ],
    fmu: Annotated[
        Path | None,
        typer.Option(metavar="OUT.fmu", callback=check_target, help="Also build an FMU with these weights."),
    ] = None,
    fmi: Annotated[int, typer.Option(min=2, max=3, help="FMI version of the FMU.")] = 2,
    json: JsonOption = None,
) -> None:
    """Bring a slew model trained elsewhere: check it against a recording, write it as .npz, ONNX and FMU."""
    from fmus.models.slew_nn.fmu import check_name
    from learning.slew.acceptance import accept, trajectories
    from learning.slew.exchange import read_pair

    _check_out(out)
    if fmu is not None:
        check_name(fmu.stem)
    with progress("import slew") as report:
        report("reading the networks")
        network = read_pair(pressure, velocity, description)
        report("predicting the recording")
        found = accept(network, trajectories(check))
        report("writing")
        written = _write(network, out, fmu, fmi)
    _show(network, found)
    write(json, _figures(network, found, check, written))


def _check_out(out: Path) -> None:

    if out.suffix == ".npz":
        check_target(out)
    elif out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder or a file that ends in .npz")


def _write(network: "SlewNetwork", out: Path, fmu: Path | None, fmi: int) -> list[Path]:
    from fmus.models.slew_nn.fmu import build_from
    from learning.slew.exchange import to_onnx

    written = []
    if fmu is not None:  # first: it is what may fail
        written.append(build_from(network, fmu.stem, fmu.parent, fmi).replace(fmu))
    if out.suffix == ".npz":
        network.save(out)
        return [*written, out]
    written += to_onnx(network, out)
    network.save(out / "weights.npz")
    return [*written, out / "weights.npz"]


def _show(network: "SlewNetwork", found: "Acceptance") -> None:
    from learning.slew.acceptance import MOST_FAR

    parts = {"pressure": network.pressure, "velocity": network.velocity}
    for name, members in parts.items():
        layers = "→".join(map(str, members[0].sizes))
        typer.echo(f"{name}: {layers}{f', {len(members)} members' if len(members) > 1 else ''}")
    rows = [
        (name, s.velocity_mae, s.position_mae)
        for name, s in (("network", found.network), ("speed held", found.held))
    ]
    show(f"10 s open loop, {len(found.network.velocity)} windows", ["", "speed, °/s", "angle, °"], rows)
    if found.worthless:
        typer.echo("slewright: warning: no better than a speed that does not change", err=True)
    if found.outside is not None and found.outside > MOST_FAR:
        share = f"{100 * found.outside:.0f} %"
        typer.echo(
            f"slewright: warning: {share} of the recording lie where there was no training data", err=True
        )


def _figures(network: "SlewNetwork", found: "Acceptance", check: Path, written: list[Path]) -> dict[str, Any]:
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
        "check": check,
        "written": written,
    }
