"""`slewright canopen`: EDS and DCF files of the machine's CANopen devices, and those of other makers."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import make_folder, write, write_text
from slewright.figures import JsonOption

app = typer.Typer(
    help="EDS and DCF files of the machine's CANopen devices (docs/how-to/canopen.md).", no_args_is_help=True
)
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")]


@app.command()
def eds(out: OutOption) -> None:
    """Write the EDS file of every kind of device: what an exchangeable one must have."""
    from specs import canopen, canopen_eds

    found = {f"{d.name}.eds": canopen_eds.eds(d) for d in canopen.definition().devices.values()}
    _write(out, found)


@app.command()
def dcf(
    out: OutOption,
    bundle: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Bundle whose commissioning record has the sensors' zeros."),
    ] = None,
) -> None:
    """Write the DCF file of every node: its EDS with what the controller writes to it at the start."""
    from runtime.bundle import load
    from runtime.canopen.start import zeros
    from specs import canopen, canopen_eds

    offsets = zeros(load(bundle).folder) if bundle else {}
    _write(out, {f"{n.name}.dcf": canopen_eds.dcf(n, offsets) for n in canopen.definition().nodes})


@app.command()
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="EDS or DCF of a device (.eds, .dcf).")],
    node: Annotated[
        str | None, typer.Option(metavar="NAME", help="Node that it is to be (default: each of them).")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Say whether a maker's device fits, and where not; exit code 1 if it fits no node that was asked for."""
    from runtime.canopen import eds as files
    from specs import canopen

    spec = canopen.definition()
    nodes = [spec.node(node)] if node else list(spec.nodes)
    found = {n.name: files.mismatches(files.read(file, n.id), n) for n in nodes}
    who = files.identity(files.read(file))
    typer.echo(f"{file}: {', '.join(f'{k} {_hex(v)}' for k, v in who.named().items())}")
    for name, wrong in found.items():
        typer.echo(f"{name}: fits" if not wrong else f"{name}:")
        for line in wrong:
            typer.echo(f"  {line}")
    write(json, {"identity": who.named(), "mismatches": found})
    if all(found.values()):
        raise typer.Exit(1)


def _hex(value: int | None) -> str:
    return "not said" if value is None else f"0x{value:08X}"


def _write(out: Path, files: dict[str, str]) -> None:
    make_folder(out)
    for name, text in files.items():
        write_text(out / name, text)
        typer.echo(f"written: {out / name}")
