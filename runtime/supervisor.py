"""Starts the runtime's processes, watches them and starts helpers again; has no part in the cycle.

The order is fixed: shared memory, helpers, and only when these work the control process, so that nothing is
started by a process that already has real-time priority.  A helper that ends is started again, and its
absence shows in the status register meanwhile.  The control process is not: a machine must not go on by
itself after a failure nobody looked at; its valves go neutral by the plant's own timeout.
"""

import fcntl
import json
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from types import TracebackType
from typing import IO, Any, Self

from runtime import bundle, configuration
from runtime.archive import start
from runtime.can.native import check as check_frames
from runtime.can.port import AGAIN
from runtime.canopen.cells import create as create_canopen
from runtime.canopen.port import check as check_devices
from runtime.canopen.start import identities, zeros
from runtime.child import USED, left_by_older, remove_unused, use
from runtime.helpers import Helper
from runtime.hmi import tokens
from runtime.hmi.cells import create as create_hmi
from runtime.image import OUTPUT, TICK_S
from runtime.interfaces.outside import create as create_outside
from runtime.interfaces.publish import create as create_image
from runtime.interfaces.seats import create as create_seats
from runtime.modbus.cells import create
from runtime.notify import Notifier
from runtime.policy import open_core
from runtime.publisher import COUNTS, COUNTS_HOLD
from runtime.recorder.replay import identity
from runtime.recorder.seen import SHADOW, SHADOWED
from runtime.retain.copies import Folder, Retained
from runtime.ring import Ring
from runtime.scan_layout import check as check_cycle
from runtime.shared import Cell, private_folder
from specs.errors import InputError, RunError
from specs.version import VERSION

RECORDER_BYTES = 4 << 20  # more than a minute of ticks
RETAIN_BYTES = 1 << 13
WATCH_S = 0.1
PROVEN_TICKS = 500  # 10 s: loading, all processes and a hundred policy ticks are behind it
PATIENCE_S = 90.0  # for a helper's first sign of life, on a machine that does other things too
RESTART_S = 1.0  # between starts of a helper that does not stay
LOCK = ".in-use"
TICKS = "ticks"  # retained beside the signals: ticks over all runs


@dataclass(frozen=True)
class Counts:
    """What the control process publishes once a second."""

    ticks: int = 0
    overruns: int = 0
    stolen: int = 0
    skipped: int = 0
    flags_seen: int = 0
    mode: int = 0
    fault: int = 0
    tick: int = 0
    bus_off: int = 0


class NotBegunError(RunError):
    """A run was ended before its first cycle."""


class Supervisor:
    """The runtime of one configuration file; a context, which ends all processes."""

    def __init__(
        self,
        path: Path,
        ticks: int | None = None,
        hmi: bool = False,
        shadow: bool = False,
        interfaces: Sequence[str] = (),
    ) -> None:
        """Check everything; InputError for the first thing that does not fit, before anything runs.

        `hmi`: with the operator's page, `shadow`: in shadow mode, `interfaces`: with these, also where the
        configuration does not ask for it.
        """
        self.path, self.ticks = path, ticks
        self.wanted = configuration.read(path)
        if hmi:
            self.wanted = configuration.with_hmi(self.wanted, path.parent)
        for name in interfaces:
            self.wanted = configuration.with_interface(self.wanted, name, path.parent)
        if shadow:
            self.wanted = configuration.in_shadow(self.wanted)
        self.active = start.chosen(self.wanted, path)
        self.bundle = self.active.bundle
        _check_outside(self.wanted, self.bundle)
        library = open_core(self.bundle).library  # loaded once here: what is wrong with it is said now
        check_frames(library)
        if sys.platform == "linux":
            check_cycle(library)
        if self.wanted.canopen:
            check_devices(library)
        self._proving: Thread | None = None
        self.retained = self._retained()
        configuration.check_surroundings(self.wanted)
        self._locks = [lock(part.folder) for part in (self.wanted.recorder, self.wanted.retain) if part]
        self.folder = private_folder()
        for left in self.folder.parent.glob(f"slewright-*/{USED}"):  # by runs that were killed
            remove_unused(left.parent)
        self._used = use(self.folder)
        for left in _left_by_older(self.folder):
            said = f"{left} was left by an older version's run; no process here uses it: remove it by hand"
            sys.stderr.write(f"slewright: {said}\n")
        self._ports, self._hmi_port = self.folder / "ports", self.folder / "hmi.port"
        self._ready: list[Path] = []  # of the interfaces: each is there once its process serves
        self.tokens: dict[str, str] = {}  # by role, where they were made now: to be shown once
        self.helpers: list[Helper] = []
        self.rings: list[Ring] = []
        self.counts = Cell.create(self.folder / "counts.cell", COUNTS.size, COUNTS_HOLD)
        which = {"bundle": str(self.bundle.folder.resolve()), "digest": self.bundle.digest}
        told = {"config": str(path.absolute()), "folder": str(self.folder), "ticks": ticks, **which}
        told["hmi"], told["images"] = self.wanted.hmi is not None, bool(self.wanted.interfaces)
        told["seats"] = self.wanted.seats
        told["retained"], told["shadow"] = self.retained, self.wanted.shadow
        self.control = self._helper("control", "runtime.control_process", told)
        self._started: dict[str, float] = {}
        self._notifier = Notifier.of()
        self._bus_off = False

    def __enter__(self) -> Self:
        try:
            self._prepare()
            for helper in self.helpers:
                self._start(helper)
            self._await_life()
            self._start(self.control)
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self.close()

    def watch(self) -> int | None:
        """Start again what has ended; the control process's exit code, None while it runs."""
        for helper in self.helpers:
            code = helper.ended()
            if code is not None and time.monotonic() - self._started[helper.name] > RESTART_S:
                sys.stderr.write(f"slewright: {helper.name} ended ({code}), started again\n")
                self._start(helper)
        return self.control.ended()

    def run(
        self, report: Callable[[Counts], None], stop: Callable[[], bool] = lambda: False
    ) -> dict[str, Any]:
        """Watch until the control process ends or `stop()`; its statistics. RunError if it failed.

        NotBegunError if it was stopped before its first cycle.
        """
        while (code := self.watch()) is None and not stop():
            report(now := self.now())
            self._say_bus(bool(now.bus_off))
            self._notifier.ticked(now.ticks, self._status(now))
            if now.ticks >= PROVEN_TICKS and not self.wanted.shadow:
                self._prove()
            time.sleep(WATCH_S)
        self._notifier.ending()
        if code is None:
            code = self.control.end()
            if code == -signal.SIGTERM:
                raise NotBegunError("the run was ended before its first cycle: there is nothing to show")
        for helper in self.helpers:  # files are whole when this returns
            helper.end()
        return self._ended(code)

    def _say_bus(self, off: bool) -> None:
        """On the console: that the bus is gone, and that it is back."""
        if off != self._bus_off:
            self._bus_off = off
            said = f"gone or off; {AGAIN[self.wanted.can.interface]}" if off else "back"
            sys.stderr.write(f"slewright: the CAN bus {self.wanted.can.channel} is {said}\n")

    def now(self) -> Counts:
        """The counts published last."""
        found = self.counts.read()
        return Counts(*COUNTS.unpack(found[1])) if found else Counts()

    def close(self) -> None:
        """End the control process, then the helpers, and remove the shared memory."""
        for process in (self.control, *self.helpers):
            process.end()
        for ring in self.rings:
            ring.close()
        self.counts.close()
        self._notifier.close()
        for held in self._locks:
            held.close()
        self._used.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _ended(self, code: int) -> dict[str, Any]:
        found = self.folder / "statistics"
        if code == 2:
            raise InputError("the control process refused to start (its reason is above)")
        if code != 0 or not found.is_file():
            raise RunError(
                f"the control process ended with {code}; the valves are neutral by the plant's timeout"
            )
        return {**json.loads(found.read_text()), "restarts": {h.name: h.starts - 1 for h in self.helpers}}

    def _status(self, now: Counts) -> str:
        modes = OUTPUT.signals[OUTPUT.at("control_mode")].values
        return f"{modes.get(now.mode, now.mode)}, fault {now.fault}, {now.ticks} ticks; {self.active.said}"

    def _prove(self) -> None:
        """The bundle has run long enough to be one to go back to.

        Kept in mind by a thread: a busy disk can take minutes for a sync, and the watch goes on.
        """
        if self._proving is None:
            self._proving = Thread(target=self._keep_proof, daemon=True)
            self._proving.start()

    def _keep_proof(self) -> None:
        """Write it down; a store that is in use is asked again."""
        try:
            while not self.active.prove():
                time.sleep(RESTART_S)
        except (OSError, InputError) as error:
            sys.stderr.write(f"slewright: the store cannot keep in mind that its bundle ran: {error}\n")

    def _retained(self) -> dict[str, float]:
        wanted = self.wanted.retain
        if wanted is None:
            return {}
        kept = Retained(Folder(wanted.folder), retained_layout(wanted.signals))
        values = kept.load()
        wrong = {**dict.fromkeys(kept.damaged, "damaged"), **dict.fromkeys(kept.missing, "missing")}
        for name, how in wrong.items():  # it may have been the newer one
            said = f"retained values in {wanted.folder}: {name} is {how}, those of the other copy are used"
            sys.stderr.write(f"slewright: {said}\n")
        return values

    def _prepare(self) -> None:
        if self.wanted.hmi:
            self._prepare_hmi(self.wanted.hmi)
        if self.wanted.modbus:
            self._prepare_modbus(self.wanted.modbus)
        elif self.wanted.interfaces:
            create_image(self.folder).close()
        if self.wanted.outside:
            create_outside(self.folder).close()
        if self.wanted.seats:
            create_seats(self.folder, self.wanted.seats)
        interfaces = {
            "opcua": self._prepare_opcua,
            "ros2": self._prepare_ros2,
            "canopen": self._prepare_canopen,
            "foxglove": self._prepare_foxglove,
        }
        for name, prepare in interfaces.items():
            if part := getattr(self.wanted, name):
                prepare(part)
        if self.wanted.recorder:
            self._prepare_recorder(self.wanted.recorder)
        if self.wanted.retain:
            self._prepare_retain(self.wanted.retain)

    def _prepare_modbus(self, wanted: configuration.Modbus) -> None:
        for cell in create(self.folder):
            cell.close()
        tls = wanted.tls and {
            "port": wanted.tls.port,
            "certificate": str(wanted.tls.certificate.resolve()),
            "key": str(wanted.tls.key.resolve()),
            "authority": str(wanted.tls.authority.resolve()),
        }
        told = {"folder": str(self.folder), "host": wanted.host, "port": wanted.port, "tls": tls}
        self.helpers.append(
            self._helper("modbus", "runtime.modbus.process", {**told, "ports": str(self._ports)})
        )

    def _prepare_foxglove(self, wanted: configuration.Foxglove) -> None:
        told = {"host": wanted.host, "port": wanted.port, "name": f"slewright: {self.path.stem}"}
        self._interface("foxglove", {**told, "bundle": str(self.bundle.folder.resolve())})

    def _prepare_opcua(self, wanted: configuration.Opcua) -> None:
        files = wanted.security
        security = files and {
            name: str(getattr(files, name).resolve()) for name in ("certificate", "key", "authority")
        }
        told = {"host": wanted.host, "port": wanted.port, "closed": wanted.closed, "security": security}
        self._interface("opcua", told)

    def _prepare_ros2(self, wanted: configuration.Ros2) -> None:
        simulated = self.wanted.can.interface == configuration.LOCAL_BUS
        told = {"domain": wanted.domain, "commands": wanted.commands, "simulated": simulated}
        told["policy"], told["bundle"] = wanted.policy, str(self.bundle.folder.resolve())
        told["about"] = {"controller": self.bundle.controller, "bundle": self.bundle.digest}
        told["about"] |= {"shadow": self.wanted.shadow, "use_sim_time": False, "version": VERSION}
        self._interface("ros2", told)

    def _prepare_canopen(self, wanted: configuration.Canopen) -> None:
        create_canopen(self.folder)
        who = identities(wanted.eds)
        told: dict[str, Any] = {"interface": wanted.interface, "channel": wanted.channel}
        told["identities"] = {name: list(found.named().values()) for name, found in who.items()}
        told["zeros"] = zeros(self.bundle.folder)
        self._interface("canopen", told)

    def _interface(self, name: str, told: dict[str, Any]) -> None:
        """A process of an interface, which writes the file `ready` once it serves."""
        self._ready.append(self.folder / f"{name}.ready")
        told |= {"folder": str(self.folder), "ready": str(self._ready[-1])}
        self.helpers.append(self._helper(name, f"runtime.{name}.process", told))

    def _prepare_hmi(self, wanted: configuration.Hmi) -> None:
        if not wanted.tokens.exists():
            self.tokens = tokens.make(wanted.tokens)
        tokens.read(wanted.tokens)
        for cell in create_hmi(self.folder):
            cell.close()
        simulated = self.wanted.can.interface == configuration.LOCAL_BUS
        told = {
            "folder": str(self.folder),
            "host": wanted.host,
            "port": wanted.port,
            "port_file": str(self._hmi_port),
            "names": wanted.names,
            "tokens": str(wanted.tokens.resolve()),
            "audit": str(wanted.audit.resolve()),
            "tls": wanted.tls and {k: str(getattr(wanted.tls, k).resolve()) for k in ("certificate", "key")},
            "bundle": str(self.bundle.folder.resolve()),
            "bus_again": AGAIN[self.wanted.can.interface],
            "about": {
                "machine": ("simulated machine" if simulated else self.path.stem)
                + SHADOW * self.wanted.shadow,
                "controller": self.bundle.controller,
                "bundle": self.bundle.digest[:12],
            },
        }
        self.helpers.append(self._helper("hmi", "runtime.hmi.process", told))

    def _prepare_recorder(self, wanted: configuration.Recording) -> None:
        ring = self._ring("recorder.ring", RECORDER_BYTES)
        who = {**identity(self.bundle.identity, VERSION), "bundle": self.bundle.digest}
        who["bundle_folder"] = str(self.bundle.folder.resolve())
        who["signed_by"] = self.active.signer
        who["mode"] = SHADOWED if self.wanted.shadow else "control"
        told = {
            "ring": str(ring.path),
            "folder": str(wanted.folder.resolve()),
            "limit": round(wanted.limit_mb * 1e6),
            "segment_ticks": round(wanted.segment_s / TICK_S),
            "metadata": {**who, "controller": self.bundle.controller, "platform": bundle.host()},
        }
        self.helpers.append(self._helper("recorder", "runtime.recorder", told))

    def _prepare_retain(self, wanted: configuration.Retaining) -> None:
        ring = self._ring("retain.ring", RETAIN_BYTES)
        told = {
            "ring": str(ring.path),
            "folder": str(wanted.folder.resolve()),
            "layout": retained_layout(wanted.signals),
            "names": [TICKS, *wanted.signals],
            "base": {TICKS: self.retained.get(TICKS, 0.0)},
            "every_s": wanted.every_s,
        }
        self.helpers.append(self._helper("retain", "runtime.retain.process", told))

    def _helper(self, name: str, module: str, told: dict[str, Any]) -> Helper:
        return Helper(name, module, told, self.folder)

    def _ring(self, name: str, size: int) -> Ring:
        self.rings.append(Ring.create(self.folder / name, size))
        return self.rings[-1]

    def _start(self, helper: Helper) -> None:
        helper.start()
        self._started[helper.name] = time.monotonic()

    def _await_life(self) -> None:
        end = time.monotonic() + PATIENCE_S
        while not self._alive():
            dead = [h for h in self.helpers if h.ended() is not None]
            if dead or time.monotonic() > end:
                who = ", ".join(h.name for h in dead) or "a helper"
                raise RunError(f"{who} did not start")
            time.sleep(0.01)

    def _alive(self) -> bool:
        files = [self._ports] * bool(self.wanted.modbus) + [self._hmi_port] * bool(self.wanted.hmi)
        files += self._ready
        return all(ring.beat for ring in self.rings) and all(f.is_file() for f in files)


def _check_outside(wanted: configuration.Configuration, found: bundle.Bundle) -> None:
    """InputError unless both or none of configuration and bundle say that a policy outside commands."""
    if found.engine == bundle.OUTSIDE and not wanted.outside:
        raise InputError(
            f"bundle {found.folder}: its controller is a policy outside, and no node has its role: "
            'policy = "/name" in [ros2] (docs/how-to/ros2.md)'
        )
    if wanted.outside and found.engine != bundle.OUTSIDE:
        raise InputError(
            f"[ros2] policy: bundle {found.folder} has a controller of its own, {found.controller}; "
            "valid: one of `slewright bundle outside`"
        )


def _left_by_older(folder: Path) -> list[Path]:
    """Our folders beside `folder` with cells in them, as runs of older versions left them."""
    cells = folder.parent.glob("slewright-*/counts.cell")
    return [c.parent for c in cells if left_by_older(c.parent)]


def lock(folder: Path) -> IO[str]:
    """Keep a folder to this run until the file is closed; InputError if another run has it.

    Two recorders in one folder would mend, and so take away, each other's open files.
    """
    held = (folder / LOCK).open("w")
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        held.close()
        raise InputError(f"{folder} is in use by another run; give each its own folder") from None
    return held


def retained_layout(names: tuple[str, ...]) -> str:
    """What the retained values mean, in 16 characters."""
    return bundle.digest(",".join(names).encode())[:16]
