"""`slewright bundle`: a controller as the runtime loads it."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.commands.machine.deploy_keys import passphrase
from slewright.figures import JsonOption, exit_if_missed
from slewright.plants import HELP, admission
from slewright.progress import progress
from specs.errors import InputError
from specs.scene_families import single


def bundle(
    controller: Annotated[
        str,
        typer.Argument(
            metavar="CONTROLLER",
            help="Which controller (docs/explanation/controllers.md), or a policy's ONNX file.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the bundle; it is replaced.")],
    platform: Annotated[
        list[str] | None,
        typer.Option("--platform", metavar="NAME", help="For this platform (repeatable; default: this one)."),
    ] = None,
    engine: Annotated[
        str,
        typer.Option("--engine", metavar="NAME", help="What evaluates a policy: native (C) or onnxruntime."),
    ] = "native",
    calibration: Annotated[
        Path | None,
        typer.Option("--load-calibration", metavar="FILE", help="Of the load estimate (estimate calibrate)."),
    ] = None,
    commissioning: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="calibration.json of slewright commission: zeros, tables, tare."),
    ] = None,
    sign: Annotated[
        Path | None,
        typer.Option(
            "--sign", metavar="KEY.pem", help="Sign it: writes an archive (docs/how-to/bundles.md)."
        ),
    ] = None,
    archive: Annotated[
        Path | None,
        typer.Option("--archive", metavar="FILE.slwb", help="Its file (default: DIR.slwb)."),
    ] = None,
    release: Annotated[str, typer.Option(metavar="NAME", help="A name for people to tell it by.")] = "",
    config: Annotated[
        Path | None,
        typer.Option("--config", metavar="FILE.toml", help="The only configuration it is to run with."),
    ] = None,
    plants: Annotated[
        list[str] | None,
        typer.Option(
            "--plants", metavar="PLANT", help=f"Try it on these, the table goes with it: all, {HELP}."
        ),
    ] = None,
    guard: Annotated[
        str | None,
        typer.Option(
            metavar="SCENE", help="Keep off what stands in this scene, whatever the controller says."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Compile a controller and the control core into a folder that `slewright run` loads."""
    from deployment.bundling.build import bundle as build
    from verification.evaluation import training_range

    if sign is None and (archive or release or config):
        raise InputError("--archive, --release and --config are of a signed archive: add --sign KEY.pem")
    key, target = None, archive or out
    if sign:
        from deployment.bundling import archive as signing  # needs cryptography, which a bundle does not

        target = archive or signing.default_path(out)
        key = signing.check(target, sign, release, config, passphrase)
    scene = single(guard) if guard else None
    table, failures = admission(controller, plants) if plants else ({}, [])
    with progress("bundle") as report:
        report(f"compiling {controller}")
        made = build(
            controller,
            out,
            platform or (),
            engine=engine,
            calibration=calibration,
            commissioning=commissioning,
            files=table,
            guard=scene,
        )
    if commissioning:
        from deployment.commissioning import again

        failures = [*failures, *again.failures(made, commissioning)]
    for text in training_range.at_start(Path(controller)) if controller.endswith(".onnx") else ():
        typer.echo(f"warning: {text}", err=True)
    typer.echo(f"{made.folder}: {made.controller} for {', '.join(made.platforms)}, SHA-256 {made.digest}")
    figures = {"controller": made.controller, "platforms": list(made.platforms), "sha256": made.digest}
    figures |= {"identity": made.identity, "guard": made.guard}
    if key:
        from deployment.bundling import archive as signing

        signed = signing.write(made, target, key, release, config)
        typer.echo(f"{target}: {len(signed.files)} files, digest {signed.digest}, signed by {key.public.id}")
        figures |= {"archive": str(target), "digest": signed.digest, "key": key.public.id}
    write(json, {**figures, "failures": failures} if plants or commissioning else figures, None)
    exit_if_missed(failures)
