"""`slewright commission`: guided commissioning of a machine, or its rehearsal on the simulated one."""

import getpass
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from records import figures_file
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError
from specs.version import VERSION

if TYPE_CHECKING:
    from deployment.commissioning.matrix import Case
    from deployment.commissioning.procedure import Outcome
    from deployment.commissioning.session import Session

OUT = Path("out/commission")
SHOWN = 8  # failed checks on the terminal


def commission(
    config: Annotated[
        Path | None,
        typer.Option(
            "--config",
            metavar="FILE.toml",
            help="The machine: its bundle and bus (docs/reference/runtime.md).",
        ),
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Rehearse on the simulated machine, then inject wiring faults.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help=f"Folder of the records (default: {OUT}).")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on in a folder that was begun.")] = False,
    step: Annotated[
        str | None,
        typer.Option("--step", metavar="NAME", help="Do this step only (again); earlier ones passed."),
    ] = None,
    who: Annotated[
        str | None, typer.Option("--who", metavar="NAME", help="Who commissions; for the records.")
    ] = None,
    yes: Annotated[
        bool,
        typer.Option("--yes", help="Begin each step without asking; what is done and seen is still asked."),
    ] = False,
    wiring: Annotated[
        str,
        typer.Option(
            "--wiring", metavar="TEXT", help="With --simulate: only faults with TEXT in them; all; none."
        ),
    ] = "all",
    inject: Annotated[
        str | None,
        typer.Option("--inject", metavar="FAULT", help="With --simulate: rehearse on a machine with it."),
    ] = None,
    bundle: Annotated[
        Path | None, typer.Option(metavar="DIR", help="With --simulate: the bundle (default: one of pd).")
    ] = None,
    machine: Annotated[
        str, typer.Option(metavar="M", help="With --simulate: nominal, tuning:K or validation:K.")
    ] = "nominal",
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated sensors' noise.")] = 1,
    workers: Annotated[int, typer.Option(metavar="N", min=1, help="Processes for the wiring faults.")] = 1,
    markdown: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Put the wiring faults' table into this document.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Commission a machine step by step, from its bus to its first motion (docs/how-to/commissioning.md)."""
    if simulate == bool(config):
        raise InputError(
            "slewright commission takes --config FILE.toml for a machine, or --simulate, and not both"
        )
    if not simulate and (inject or bundle or wiring != "all" or markdown or machine != "nominal"):
        raise InputError("--inject, --bundle, --wiring, --machine and --markdown are of --simulate")
    if simulate and (who or yes):
        raise InputError("--who and --yes are of --config: a rehearsal has a simulated operator")
    if config:
        outcomes, session = _machine(config, out or OUT, resume, step, who, yes)
        cases: list[Case] = []
    else:
        outcomes, session, cases = _rehearse(
            out, resume, step, bundle, machine, seed, wiring, inject, workers, markdown
        )
    content = {"simulated": simulate, "steps": _steps(session)}
    if simulate:
        from deployment.commissioning.matrix import by_group

        content["wiring_faults"] = by_group(cases)
        content["wiring_cases"] = [vars(c) for c in cases]
    figures_file.write(json, content, seed if simulate else None)
    if any(o.verdict != "passed" for o in outcomes) or any(not c.found for c in cases):
        raise typer.Exit(1)


def _machine(
    config: Path, out: Path, resume: bool, step: str | None, who: str | None, yes: bool
) -> "tuple[list[Outcome], Session]":
    from deployment.commissioning.operator import Person
    from deployment.commissioning.rig import RealTime, Rig
    from runtime import configuration, realtime
    from runtime.archive import start
    from runtime.can.port import frame_source, open_bus
    from runtime.policy import open_core

    wanted = configuration.read(config)
    configuration.check_surroundings(wanted)
    loaded = start.chosen(wanted, config).bundle
    name = who or getpass.getuser()
    identity = {
        "machine": f"{wanted.can.interface} {wanted.can.channel}",
        "bundle": loaded.digest,
        "who": name,
    }
    session = _session(out, identity, resume)
    opened = open_bus(wanted.can.interface, wanted.can.channel, wanted.can.bit_rate)
    try:
        rig = Rig(open_core(loaded), frame_source(opened), RealTime())
        # As the controller itself: the machine's watchdog ends a motion whose commands come 0.1 s late.
        wish = wanted.realtime
        realtime.pin(wish.core)
        for reason in realtime.acquire(wish.fifo, wish.lock, wish.priority).reasons:
            typer.echo(f"slewright: degraded: {reason}", err=True)
        return _steps_of(session, rig, Person(name, yes), step), session
    finally:
        realtime.release()
        opened.shutdown()


def _rehearse(
    out: Path | None,
    resume: bool,
    step: str | None,
    bundle: Path | None,
    machine: str,
    seed: int,
    wiring: str,
    inject: str | None,
    workers: int,
    markdown: Path | None,
) -> "tuple[list[Outcome], Session, list[Case]]":
    from deployment.bundling.default import ready
    from deployment.commissioning import matrix, wiring as faults
    from records.report.markers import around
    from specs import draws

    draws.named(machine)
    chosen = [] if wiring == "none" or inject else faults.cases() if wiring == "all" else faults.find(wiring)
    if wiring not in ("all", "none") and not chosen:
        raise InputError(
            f"--wiring {wiring}: no fault has that in its name; e.g. p_boom_a, swapped, valve: sign"
        )
    injected = (faults.named(inject),) if inject else ()
    if markdown:
        around(markdown, "wiring")
    with progress("commission") as report:
        folder = ready(bundle, report)
        outcomes, session = _simulated(folder, out, resume, step, machine, seed, injected, inject or "")
        cases = []
        if chosen and all(o.verdict == "passed" for o in outcomes):
            cases = matrix.run(folder, chosen, session.folder, report, seed, machine, workers)
    if cases:
        _show_cases(cases)
    if markdown and cases:
        matrix.markdown(markdown, cases, seed, VERSION)
    return outcomes, session, cases


def _simulated(
    folder: Path,
    out: Path | None,
    resume: bool,
    step: str | None,
    machine: str,
    seed: int,
    injected: Any,
    what: str,
) -> "tuple[list[Outcome], Session]":
    from deployment.commissioning.rig import Rig
    from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
    from runtime.bundle import load
    from runtime.policy import open_core

    loaded = load(folder)
    identity = {"machine": f"simulated reference machine ({machine}, seed {seed})", "bundle": loaded.digest}
    identity |= {"injected": what, "who": SimulatedOperator.name}
    if out is None and not resume:
        _clear(OUT)
    session = _session(out or OUT, identity, resume)
    with SimulatedMachine(injected, seed, machine) as plant:
        rig = Rig(open_core(loaded), plant, plant, simulated=True)
        return _steps_of(session, rig, SimulatedOperator(plant), step), session


def _clear(folder: Path) -> None:
    """Remove an earlier rehearsal from the default folder; a machine's records stay."""

    head = folder / "session.json"
    if head.is_file() and "simulated" in json.loads(head.read_text()).get("machine", ""):
        shutil.rmtree(folder)


def _session(out: Path, identity: dict[str, Any], resume: bool) -> "Session":
    from deployment.commissioning.procedure import NAMES
    from deployment.commissioning.session import Session

    out.parent.mkdir(parents=True, exist_ok=True)
    return Session.open(out, NAMES, identity, resume)


def _steps_of(session: Any, rig: Any, operator: Any, step: str | None) -> "list[Outcome]":
    from deployment.commissioning.procedure import STEPS, check_before, find, perform

    todo = [find(step)] if step else [s for s in STEPS if not session.passed(s.name)]
    if step:
        check_before(session, todo[0])
    for s in STEPS:
        if not step and s not in todo:
            typer.echo(f"{s.name}: passed before, {session.record(s.name)['ended']}")
    if not rig.simulated:
        rig.step(50)  # the bus is heard before anybody is asked
    outcomes = []
    for s in todo:
        outcome = perform(s, rig, operator, session)
        _show(outcome, session.path(s.name))
        outcomes.append(outcome)
        if outcome.verdict != "passed":
            break
    return outcomes


def _show(outcome: "Outcome", path: Path) -> None:
    n = len(outcome.checks)
    typer.echo(f"{outcome.step.name}: {outcome.verdict}, {n} checks, {outcome.seconds:.0f} s")
    for check in outcome.failures[:SHOWN]:
        typer.echo(f"slewright: step {outcome.step.name}: {check}", err=True)
    if len(outcome.failures) > SHOWN:
        typer.echo(f"slewright: and {len(outcome.failures) - SHOWN} more, in the record", err=True)
    if outcome.failures:
        typer.echo(f"slewright: later steps do not start; record: {path}", err=True)


def _show_cases(cases: "list[Case]") -> None:
    from deployment.commissioning.matrix import by_group, steps_of

    rows = [(g, row["injected"], row["found"], steps_of(row)) for g, row in by_group(cases).items()]
    show("wiring faults (simulated reference machine)", ["wired wrong", "injected", "found", "by step"], rows)
    for case in cases:
        if not case.found:
            typer.echo(f"slewright: not found: {case.name}", err=True)


def _steps(session: "Session") -> dict[str, Any]:
    """All steps that have a record, also those of an earlier call that was gone on with."""
    from deployment.commissioning.bench import Check

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
