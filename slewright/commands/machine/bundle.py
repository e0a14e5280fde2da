"""`slewright bundle`: a controller as the runtime loads it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import check_target, write
from slewright.commands.machine.deploy_keys import passphrase
from slewright.figures import JsonOption, exit_if_missed
from slewright.plants import HELP, OurInertiaOption, admission, check_inertia
from slewright.progress import progress
from specs.errors import InputError
from specs.scene_families import single


def bundle(
    controller: Annotated[
        str,
        typer.Argument(
            metavar="CONTROLLER",
            help="Which controller (docs/explanation/controllers.md), a policy's ONNX file, or: outside.",
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
    our_inertia: OurInertiaOption = False,
    guard: Annotated[
        str | None,
        typer.Option(
            metavar="SCENE", help="Keep off what stands in this scene, whatever the controller says."
        ),
    ] = None,
    fmu: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Its control core as an FMU, too (.fmu), or with the reference machine on a CAN bus (.ssp).",
        ),
    ] = None,
    can: Annotated[
        bool, typer.Option("--can", help="The FMU of --fmu has CAN (FMI-LS-BUS), not plain signals only.")
    ] = False,
    json: JsonOption = None,
) -> None:
    """Compile a controller and the control core into a folder that `slewright run` loads."""
    from deployment.bundling.build import bundle as build
    from verification.evaluation import training_range

    if sign is None and (archive or release or config):
        raise InputError("--archive, --release and --config are of a signed archive: add --sign KEY.pem")
    _check_fmu(fmu, can, controller, engine, out)
    key, target = None, archive or out
    if sign:
        from deployment.bundling import archive as signing  # needs cryptography, which a bundle does not

        target = archive or signing.default_path(out)
        key = signing.check(target, sign, release, config, passphrase)
    scene = single(guard) if guard else None
    if plants and controller == "outside":
        raise InputError("--plants: a policy outside is tried on plants by its own file")
    check_inertia(our_inertia, plants, "--plants")
    table, failures = admission(controller, plants, our_inertia) if plants else ({}, [])
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
        from deployment.bundling import commissioned
        from deployment.commissioning import again

        for text in commissioned.read(commissioning).touched:
            typer.echo(text)
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
    if fmu:
        typer.echo(f"{fmu}: {_write_fmu(made, fmu, can)}")
        figures |= {"fmu": str(fmu)}
    write(json, {**figures, "failures": failures} if plants or commissioning else figures, None)
    exit_if_missed(failures)


def _check_fmu(fmu: Path | None, can: bool, controller: str, engine: str, out: Path) -> None:
    """InputError, before anything is built, for what cannot become an FMU."""
    if fmu is None:
        if can:
            raise InputError("--can says what the FMU of --fmu FILE.fmu has; there is no --fmu")
        return
    if fmu.suffix not in (".fmu", ".ssp"):
        raise InputError(
            f"--fmu {fmu}: not a name of an FMU or system; valid: one that ends with .fmu or .ssp"
        )
    check_target(fmu)
    if fmu.resolve() == out.resolve():
        raise InputError(f"--fmu {fmu} is the folder of --out, too; name a file")
    if controller == "outside":
        raise InputError("--fmu: a policy outside commands; what it says is no part of the core")
    if engine != "native":
        raise InputError(f"--fmu: {engine} evaluates the policy outside of the core; valid: --engine native")


def _write_fmu(made: Any, path: Path, can: bool) -> str:
    """Write it; what it is."""
    from deployment.network import reference, system

    if path.suffix == ".ssp":
        system.over_the_bus(made, path)
        return "its control core and the reference machine on a CAN bus"
    if can:
        reference.build_controller(made, path)
        return "its control core as an FMU with CAN (FMI-LS-BUS) and plain signals"
    reference.build_plain(made, path)
    return "its control core as an FMU"
