"""`slewright commission`: the procedure on a machine, or its rehearsal with the wiring faults after it."""

import getpass
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from deployment.bundling.default import ready
from deployment.commissioning import matrix, points, wiring
from deployment.commissioning.bench import Check
from deployment.commissioning.matrix import Case
from deployment.commissioning.operator import Operator, Person
from deployment.commissioning.points import Point
from deployment.commissioning.procedure import NAMES, STEPS, Outcome, check_before, find, perform
from deployment.commissioning.rig import RealTime, Rig
from deployment.commissioning.session import HEAD, PASSED, Session
from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
from deployment.commissioning.wiring import Fault
from records.report.markers import around
from runtime import configuration, realtime
from runtime.archive import start
from runtime.bundle import load
from runtime.can.port import frame_source, open_bus
from runtime.policy import open_core
from specs import draws
from specs.errors import InputError
from specs.progress import Report
from specs.version import VERSION

OUT = Path("out/commission")
SHOWN = 8  # failed checks on the terminal
BUS_TICKS = 50  # in which the bus is heard before anybody is asked


@dataclass(frozen=True)
class Request:
    """Folder of the records (None: OUT), whether to go on in it, the only step to do, if any, and the file of
    known points (None: the operator is asked for them).
    """

    out: Path | None = None
    resume: bool = False
    step: str | None = None
    points: Path | None = None

    def __post_init__(self) -> None:
        """InputError for wrong points and for a step that is none or cannot be the first, before a folder is
        begun or cleared.
        """
        self.known()
        if self.step and find(self.step) is not STEPS[0] and not self.resume:
            raise InputError(
                f"step {self.step} refuses to start: step {STEPS[0].name} comes first, in new records; "
                "--resume goes on in those of --out"
            )

    def known(self) -> tuple[Point, ...]:
        """The points of the file."""
        return points.read(self.points) if self.points else ()


@dataclass(frozen=True)
class Rehearsal:
    """The simulated machine and its wiring: faults one after the other (`wiring`), or one from the start."""

    bundle: Path | None = None
    machine: str = draws.NOMINAL
    seed: int = 1
    wiring: str = "all"  # all, none, or a text in the faults' names
    inject: str | None = None
    workers: int = 1
    markdown: Path | None = None

    def faults(self) -> list[Fault]:
        """The wiring faults to inject after a rehearsal that passed; InputError where none is called so."""
        if self.wiring == "none" or self.inject:
            return []
        chosen = wiring.cases() if self.wiring == "all" else wiring.find(self.wiring)
        if not chosen:
            raise InputError(
                f"--wiring {self.wiring}: no fault has that in its name; e.g. p_boom_a, swapped, valve: sign"
            )
        return chosen


def on_machine(config: Path, request: Request, who: str | None, yes: bool) -> tuple[list[Outcome], Session]:
    """Commission the machine of a configuration with a person at the terminal."""
    wanted = configuration.read(config)
    configuration.check_surroundings(wanted)
    loaded = start.chosen(wanted, config).bundle
    name = who or getpass.getuser()
    machine = f"{wanted.can.interface} {wanted.can.channel}"
    session = _session(request, {"machine": machine, "bundle": loaded.digest, "who": name})
    opened = open_bus(wanted.can.interface, wanted.can.channel, wanted.can.bit_rate)
    try:
        rig = Rig(open_core(loaded), frame_source(opened), RealTime())
        # As the controller itself: the machine's watchdog ends a motion whose commands come 0.1 s late.
        wish = wanted.realtime
        realtime.pin(wish.core)
        for reason in realtime.acquire(wish.fifo, wish.lock, wish.priority).reasons:
            typer.echo(f"slewright: degraded: {reason}", err=True)
        return _perform(session, rig, Person(name, yes), request), session
    finally:
        realtime.release()
        opened.shutdown()


def rehearse(request: Request, on: Rehearsal, report: Report) -> tuple[list[Outcome], Session, list[Case]]:
    """Commission the simulated machine; where all steps pass, inject the wiring faults."""
    draws.named(on.machine)
    faults = on.faults()
    injected = (wiring.named(on.inject),) if on.inject else ()
    if on.markdown:
        around(on.markdown, "wiring")
    bundle = ready(on.bundle, report)
    outcomes, session = _simulated(bundle, request, on, injected)
    cases = []
    if faults and all(o.verdict == PASSED for o in outcomes):
        cases = matrix.run(bundle, faults, session.folder, report, on.seed, on.machine, on.workers)
    if on.markdown and cases:
        matrix.markdown(on.markdown, cases, on.seed, VERSION)
    return outcomes, session, cases


def _simulated(
    bundle: Path, request: Request, on: Rehearsal, injected: tuple[Fault, ...]
) -> tuple[list[Outcome], Session]:
    loaded = load(bundle)
    if request.out is None and not request.resume:
        _clear(OUT)
    machine = f"simulated reference machine ({on.machine}, seed {on.seed})"
    identity = {"machine": machine, "bundle": loaded.digest, "injected": on.inject or ""}
    session = _session(request, {**identity, "who": SimulatedOperator.name})
    with SimulatedMachine(injected, on.seed, on.machine) as plant:
        rig = Rig(open_core(loaded), plant, plant, simulated=True)
        return _perform(session, rig, SimulatedOperator(plant), request), session


def _clear(folder: Path) -> None:
    """Remove an earlier rehearsal from the default folder; a machine's records stay."""
    head = folder / HEAD
    if head.is_file() and "simulated" in json.loads(head.read_text()).get("machine", ""):
        shutil.rmtree(folder)


def _session(request: Request, identity: dict[str, Any]) -> Session:
    out = request.out or OUT
    out.parent.mkdir(parents=True, exist_ok=True)
    return Session.open(out, NAMES, identity, request.resume)


def _perform(session: Session, rig: Rig, operator: Operator, request: Request) -> list[Outcome]:
    """The steps that have not passed, or the only one asked for, until one fails; each is shown."""
    only, known = request.step, request.known()
    todo = [find(only)] if only else [s for s in STEPS if not session.passed(s.name)]
    if only:
        check_before(session, todo[0])
    for s in STEPS:
        if not only and s not in todo:
            typer.echo(f"{s.name}: passed before, {(session.record(s.name) or {})['ended']}")
    if not rig.simulated:
        rig.step(BUS_TICKS)
    outcomes = []
    for s in todo:
        outcome = perform(s, rig, operator, session, known)
        _show(outcome, session.path(s.name))
        outcomes.append(outcome)
        if outcome.verdict != PASSED:
            break
    return outcomes


def _show(outcome: Outcome, path: Path) -> None:
    n = len(outcome.checks)
    typer.echo(f"{outcome.step.name}: {outcome.verdict}, {n} checks, {outcome.seconds:.0f} s")
    for check in outcome.failures[:SHOWN]:
        typer.echo(f"slewright: step {outcome.step.name}: {check}", err=True)
    if len(outcome.failures) > SHOWN:
        typer.echo(f"slewright: and {len(outcome.failures) - SHOWN} more, in the record", err=True)
    if outcome.failures:
        typer.echo(f"slewright: later steps do not start; record: {path}", err=True)


def figures(session: Session) -> dict[str, Any]:
    """All steps that have a record, also those of an earlier call that was gone on with."""
    records = {name: record for name in session.steps if (record := session.record(name))}
    checks = {name: [Check(**c) for c in record["checks"]] for name, record in records.items()}
    return {
        name: {
            "passed": session.passed(name),
            "checks": len(checks[name]),
            "seconds": record.get("seconds"),
            "failed": [str(c) for c in checks[name] if not c.passed],
            "found": record["found"],
        }
        for name, record in records.items()
    }
