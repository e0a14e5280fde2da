"""`slewright run`: the machine controller."""

import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from records import figures_file
from slewright.commands.machine.hmi import show_tokens
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show

if TYPE_CHECKING:
    from runtime.configuration import Ros2
    from runtime.supervisor import Counts, Supervisor


def run(
    config: Annotated[
        Path,
        typer.Option(
            "--config", metavar="FILE.toml", help="What runs on which wires (docs/reference/runtime.md)."
        ),
    ],
    seconds: Annotated[
        float | None, typer.Option(metavar="S", min=0.02, help="End after so long (default: when told to).")
    ] = None,
    hmi: Annotated[
        bool,
        typer.Option(
            "--hmi", help="With the operator's page, also without [hmi] in the file (docs/how-to/hmi.md)."
        ),
    ] = False,
    shadow: Annotated[
        bool,
        typer.Option(
            "--shadow", help="Read and compute everything, command nothing (docs/how-to/shadow.md)."
        ),
    ] = False,
    foxglove: Annotated[
        bool,
        typer.Option("--foxglove", help="With the live picture for Foxglove (docs/how-to/foxglove.md)."),
    ] = False,
    opcua: Annotated[
        bool, typer.Option("--opcua", help="With the OPC UA server (docs/how-to/opcua.md).")
    ] = False,
    ros2: Annotated[
        bool, typer.Option("--ros2", help="With ROS 2 topics on this computer (docs/how-to/ros2.md).")
    ] = False,
    json: JsonOption = None,
) -> None:
    """Run the cyclic controller on CAN and Modbus until Ctrl-C.

    It is no safety function: docs/explanation/hazards.md.
    """
    from runtime.image import OUTPUT, TICK_S
    from runtime.supervisor import Counts, Supervisor

    ticks = None if seconds is None else round(seconds / TICK_S)
    modes = OUTPUT.signals[OUTPUT.at("control_mode")].values
    stopped = False
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does: processes and memory go

    with progress("run") as report:

        def show(found: Counts) -> None:
            report(modes.get(found.mode, str(found.mode)), found.ticks, ticks)

        interfaces = [name for name, on in {"foxglove": foxglove, "opcua": opcua, "ros2": ros2}.items() if on]
        supervisor = Supervisor(config, ticks, hmi, shadow, interfaces)
        report(supervisor.active.said)
        if supervisor.wanted.shadow:
            report("in shadow: nothing is sent")
        with supervisor:
            for line in who_may_write(supervisor):
                typer.echo(line)
            show_page(supervisor)
            try:
                found = supervisor.run(show)
            except KeyboardInterrupt:
                stopped = True
                found = _ended(supervisor, show)
    _show(found)
    figures_file.write(json, {**found, "interrupted": stopped})


def _ended(supervisor: "Supervisor", show: Callable[["Counts"], None]) -> dict[str, Any]:
    """End the run; what its cycles came to. KeyboardInterrupt where there was none yet."""
    from runtime.supervisor import NotBegunError

    try:
        return supervisor.run(show, stop=lambda: True)
    except NotBegunError:
        raise KeyboardInterrupt from None


def who_may_write(supervisor: "Supervisor") -> list[str]:
    """On which ports and networks it can be reached, and who may write there."""
    from runtime.modbus.roles import WRITERS

    wanted, lines = supervisor.wanted, []
    if wanted.modbus:
        where = networks(wanted.modbus.host)
        plain = f"Modbus: port {wanted.modbus.port} of {where}; "
        lines.append(plain + "whoever is on this computer may write, everybody else who reaches it may read")
        if wanted.modbus.tls:
            roles = " or ".join(f"'{role}'" for role in WRITERS)
            lines.append(
                f"Modbus over TLS: port {wanted.modbus.tls.port} of {where}; certificates of "
                f"{wanted.modbus.tls.authority} may read, those with the role {roles} may write"
            )
    if wanted.hmi:
        far = "over TLS from anywhere" if wanted.hmi.tls else "from this computer only"
        lines.append(
            f"page: port {wanted.hmi.port} of {networks(wanted.hmi.host)}; everybody who reaches it may "
            f"look, whoever has a token of {wanted.hmi.tokens} may change something, {far}"
        )
    if wanted.foxglove:
        where = f"ws://{wanted.foxglove.host}:{wanted.foxglove.port}"
        lines.append(f"Foxglove: {where} of this computer only; whoever is on it may look, nobody may write")
    if wanted.opcua:
        who = "everybody may read; nobody may command without [opcua.security]"
        if wanted.opcua.security:
            who = (
                f"certificates of {wanted.opcua.security.authority} with the role 'Planner' may command, "
                "those with 'Operator' may acknowledge alarms"
            )
        lines.append(f"OPC UA: port {wanted.opcua.port} of {networks(wanted.opcua.host)}; {who}")
    if wanted.ros2:
        where = f"domain {wanted.ros2.domain} of this computer only"
        lines.append(f"ROS 2: {where}; whoever is on it {_over_ros2(wanted.ros2)}")
    if wanted.canopen:
        where = f"{wanted.canopen.interface} {wanted.canopen.channel}"
        lines.append(f"CANopen: master on {where}; whoever is on that bus may speak as a device")
    if not wanted.modbus:
        lines.append(f"targets: from whoever sends them on CAN bus {wanted.can.channel}")
    return lines


def _over_ros2(wanted: "Ros2") -> str:
    if wanted.policy:
        who = "may send targets" if wanted.commands else "may look"
        return f"{who}, a node that is named {wanted.policy} may command arm and slew"
    return "may command" if wanted.commands else "may look, nobody may command"


def networks(host: str) -> str:
    """What an address to listen at means."""
    from ipaddress import ip_address

    try:
        address = ip_address(host)
    except ValueError:
        return host
    if address.is_unspecified:
        return f"{host}: every network of this computer"
    return (
        f"{host}: this computer only" if address.is_loopback else f"{host}: the network that has this address"
    )


def show_page(supervisor: "Supervisor") -> None:
    """Say where the operator's page is, and once the tokens that were made for it.

    Those of a machine go to a terminal only, not into a service's log.
    """
    from runtime.configuration import LOCAL_BUS

    wanted = supervisor.wanted.hmi
    if wanted is None:
        return
    typer.echo(f"operator's page: {'https' if wanted.tls else 'http'}://{wanted.host}:{wanted.port}/")
    if not supervisor.tokens:
        return
    if sys.stdout.isatty() or supervisor.wanted.can.interface == LOCAL_BUS:
        show_tokens(supervisor.tokens, wanted.tokens)
    else:
        typer.echo("its tokens are not shown in a log; others, from the next start on:")
        typer.echo(f"slewright hmi --new-tokens {wanted.tokens}")


def _show(found: dict) -> None:

    names = ("lateness_us", "policy_tick_us", "other_tick_us", "policy_step_us", "latency_us")
    columns = ("p50", "p99", "p999", "max")
    show("times in µs", ["", *columns], [(n[:-3], *_times(found[n], columns)) for n in names])
    counted = ("ticks", "overruns", "stolen_ticks", "skipped_ticks", "unrecorded_ticks")
    typer.echo(", ".join(f"{found[name]} {name.replace('_', ' ')}" for name in counted))
    for reason in found["reasons"]:
        typer.echo(f"degraded: {reason}")


def _times(found: dict, columns: tuple[str, ...]) -> list[float | str]:
    """Dashes where nothing was timed: without sensor messages there is no latency."""
    return [found[c] if found["count"] else "–" for c in columns]
