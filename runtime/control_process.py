"""The control process: `python -m runtime.control_process JSON`, one thread, started last, ended first.

Everything that takes time or can fail is done before the first cycle: files are read, shared memory is
mapped, the core loaded, the bus opened; then memory is locked, the collector frozen and the priority taken.
"""

import json
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import can

from runtime import configuration, helpers, realtime
from runtime.bundle import load
from runtime.can.engine import EngineSpeed
from runtime.can.joystick import Joystick
from runtime.can.native import NativePort
from runtime.can.port import open_bus
from runtime.canopen.cells import join as join_devices
from runtime.canopen.port import CanopenPort
from runtime.control import ControlCore
from runtime.hmi.cells import join as join_hmi
from runtime.hmi.port import HmiPort
from runtime.interfaces import outside, seats
from runtime.interfaces.outside import OutsidePort
from runtime.interfaces.port import Asked, SeatsPort
from runtime.interfaces.publish import ImagePort
from runtime.modbus.cells import HOLDS_IMAGE, IMAGE, IMAGE_FILE, join
from runtime.modbus.port import ModbusPort
from runtime.native_scan import NativeScan, serves
from runtime.policy import open_core
from runtime.protocols import Port
from runtime.publisher import COUNTS, COUNTS_HOLD, Publisher
from runtime.recorder.feed import Feed
from runtime.rehearsal import Rehearsal
from runtime.ring import Ring
from runtime.scan import Scan
from runtime.shadow import Overheard, StandIn, silent
from runtime.shared import Cell
from runtime.statistics import Statistics
from specs import canopen

LISTEN_S = 0.2  # twice the cycle of the slowest message that a controller sends


def main(text: str) -> None:
    """Run cycles until SIGTERM or for `ticks`; statistics go to `statistics` as JSON at the end."""
    told = json.loads(text)
    helpers.end_with(signal.SIGTERM)
    wanted = configuration.read(Path(told["config"]))
    if quiet := bool(told.get("shadow")):
        wanted = configuration.in_shadow(wanted)
    core = open_core(load(Path(told["bundle"]), told["digest"]))
    core.restart(told["retained"])
    place = wanted.can.interface, wanted.can.channel, wanted.can.bit_rate
    # left properly, too, where another controller is heard
    with ExitStack() as buses:
        bus = buses.enter_context(open_bus(*place, listen_only=quiet))
        devices = buses.enter_context(_devices_bus(wanted.canopen)) if wanted.canopen else None
        _control(told, wanted, core, bus, devices)


def _devices_bus(wanted: configuration.Canopen) -> can.BusABC:
    return open_bus(wanted.interface, wanted.channel, canopen.definition().bus.bit_rate)


def _control(
    told: Mapping[str, Any],
    wanted: configuration.Configuration,
    core: ControlCore,
    bus: can.BusABC,
    devices: can.BusABC | None,
) -> None:
    """All cycles, and their statistics."""
    folder, quiet, found = Path(told["folder"]), bool(told.get("shadow")), Statistics()
    joystick = Joystick(wanted.can.joystick) if wanted.can.joystick else None
    engine = EngineSpeed(wanted.can.engine) if wanted.can.engine else None
    overheard = Overheard() if quiet else None
    ports: list[Port] = [
        wires := NativePort(bus, core.library, joystick, engine, overheard),
        *_others(wanted, folder, found, bool(told.get("images"))),
    ]
    if devices:
        ports.insert(1, CanopenPort(devices, core.library, join_devices(folder)))
    feed = Feed(Ring.attach(folder / "recorder.ring")) if wanted.recorder else None
    commands = _seats(ports, folder, told.get("seats", ()), core)
    if commands:
        ports.insert(len(ports) - 1, commands)
    if told.get("hmi"):
        page = _hmi(ports, folder, found, feed, core)
        ports.insert(len(ports) - 1, page)
        if commands:
            commands.page = page.commands
    if overheard:
        ports = silent(ports, (ModbusPort, ImagePort), NativePort, StandIn(overheard, feed))
    native = type(core) is ControlCore and not quiet
    twin = Rehearsal(core, ports, folder / "twin", feed is not None) if native else None
    realtime.pin(wanted.realtime.core)
    rights = realtime.acquire(wanted.realtime.fifo, wanted.realtime.lock, wanted.realtime.priority)
    for reason in rights.reasons:
        sys.stderr.write(f"slewright: {reason}\n")
    kind = NativeScan if serves(core, ports) else Scan
    scan = kind(core, ports, rights, feed, statistics=found)
    if twin:
        scan.before, twin.real = twin, scan
    if not quiet:
        wires.listen(LISTEN_S)
    scan.run(stop=helpers.told_to_end, ticks=told.get("ticks"))
    realtime.release()
    if twin:
        twin.close()
    found.unrecorded = feed.ring.lost if feed else 0
    figures = {**found.figures(), "reasons": list(rights.reasons)}
    figures["rehearsal_us"] = twin.figures() if twin else None
    (folder / "statistics").write_text(json.dumps(figures))


def _hmi(ports: list[Port], folder: Path, found: Statistics, feed: Feed | None, core: ControlCore) -> HmiPort:
    """After all that bring targets or sensors: it decides what of them counts."""
    others = [p.claimed for p in ports if isinstance(p, ModbusPort | SeatsPort)]
    ring = feed.ring if feed else None
    wires = next(p for p in ports if isinstance(p, NativePort))
    return HmiPort(
        join_hmi(folder),
        core.library,
        found,
        lambda: any(f() for f in others),
        lambda: ring.lost if ring else 0,
        wires.refused(),
        core.ladder,
    )


def _seats(ports: list[Port], folder: Path, names: Sequence[str], core: ControlCore) -> SeatsPort | None:
    """Who commands over OPC UA or ROS 2, if one of them is configured."""
    granted = seats.join_granted(folder)
    if granted is None:
        return None
    modbus = [p.claimed for p in ports if isinstance(p, ModbusPort)]
    asked = [Asked(seats.NAMES.index(name) + 1, seats.join(folder, name)) for name in names]
    return SeatsPort(asked, granted, core.library, lambda: any(f() for f in modbus))


def _others(wanted: configuration.Configuration, folder: Path, found: Statistics, images: bool) -> list[Port]:
    """Modbus, or the images alone where only interfaces want them, a policy outside, what is published."""
    counts = Cell.open(folder / "counts.cell", COUNTS.size, COUNTS_HOLD)
    retain = Ring.attach(folder / "retain.ring") if wanted.retain else None
    found_ports: list[Port] = [ModbusPort(*join(folder))] if wanted.modbus else []
    if images and not wanted.modbus:
        found_ports = [ImagePort(Cell.open(folder / IMAGE_FILE, IMAGE.itemsize, HOLDS_IMAGE))]
    if wanted.outside:
        found_ports.append(OutsidePort(outside.join(folder)))
    return [*found_ports, Publisher(counts, found, retain, wanted.retain.signals if wanted.retain else ())]


if __name__ == "__main__":
    helpers.run(main)
