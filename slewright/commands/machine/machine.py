"""`slewright machine`: the simulated machine alone on a bus, for `slewright run`."""

import signal
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated

import typer

from slewright.progress import progress


def machine(
    channel: Annotated[
        str, typer.Option(metavar="NAME", help="The bus: a socket to make or join, or a CAN interface.")
    ] = "bus",
    interface: Annotated[
        str, typer.Option(metavar="KIND", help="slewright (on this computer), socketcan or slcan.")
    ] = "slewright",
    scenario: Annotated[
        str, typer.Option(metavar="NAME", help="Pose and load at the start.")
    ] = "four_targets_empty",
    draw: Annotated[
        str, typer.Option("--machine", metavar="M", help="nominal, tuning:K or validation:K.")
    ] = "nominal",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sensors' noise.")] = 1,
    canopen: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Encoders, inclinometers and valves as CANopen devices on this bus, too."
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(metavar="S", min=0.02, help="End after so long (default: when told to).")
    ] = None,
    by_hand: Annotated[
        bool, typer.Option("--by-hand", help="No simulated operator: switches by lines on the input only.")
    ] = False,
) -> None:
    """The simulated machine and its operator on a bus, for slewright run.

    docs/tutorials/first-machine.md shows it.
    """
    from deployment.hil import machine as plants, standalone_machine
    from deployment.hil.machine_node import MachineNode
    from specs.scenario import TICK_S, load

    found, ticks = load(scenario), None if seconds is None else round(seconds / TICK_S)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does: the bus goes, too
    with progress("machine") as report:
        report("starting")
        plant = plants.Machine(found, seed, draw)
    with ExitStack() as stack:
        stack.enter_context(plant)
        end = stack.enter_context(standalone_machine.MachineOnBus(interface, channel))
        devices = stack.enter_context(standalone_machine.devices(interface, canopen)) if canopen else None
        where = Path(channel).resolve() if interface == standalone_machine.LOCAL_BUS else channel
        typer.echo(f"simulated machine on {interface} {where}; Ctrl-C ends it")
        if canopen:
            typer.echo(f"its CANopen devices on {interface} {canopen}")
        with suppress(KeyboardInterrupt):
            operator = None if by_hand else standalone_machine.Operator()
            node = MachineNode(end.bus, found, plant, devices=devices)
            standalone_machine.drive(node, ticks, typer.echo, operator)
