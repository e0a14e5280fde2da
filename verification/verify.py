"""Verification: scenarios on the nominal system and the reference machine, limits checked, report written.

DIR/records/SCENARIO-SYSTEM.parquet, DIR/metrics.json and DIR/report.html; what a controller is compared with
has its records in DIR/NAME/records.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.system.pack import SYSTEMS, pack_system
from records import compared, results
from records.metrics import Verdict, check_limits
from records.record import Record, read
from records.report.page import Context, write_report
from specs import scenario as scenarios_spec
from specs.errors import InputError
from specs.progress import Report
from specs.scenario import Scenario
from specs.version import VERSION
from verification.plants.plant import Plant
from verification.plants.trial import MOST_OUTSIDE, outside
from verification.runs import SLOT, Job, check_interventions, check_reach, replacement, run_all

SHIPPED = "policy"  # every controller is held to the limits of the one that ships
MIN_SIMULATED_RATE = 1e-9


@dataclass(frozen=True)
class Controller:
    """What drives the machine, and on what.

    models    model folders that take the place of the systems' own; without one for the controller it is a PI
    settings  values of parameters: "component.parameter" -> value
    packages  systems that are packed already, by name
    plant     what it drives in the place of the nominal system's own machine
    """

    name: str = SLOT
    models: Sequence[Path] = ()
    settings: Mapping[str, float] = field(default_factory=dict)
    packages: Mapping[str, Path] = field(default_factory=dict)
    plant: Plant | None = None


PI = Controller()


@dataclass(frozen=True)
class Verification:
    """What came of one controller: records by scenario and system, verdicts, simulated s per elapsed s."""

    controller: str
    runs: Mapping[str, Mapping[str, Record]]
    verdicts: Sequence[Verdict]
    realtime_factor: Mapping[str, float]

    @property
    def accepted(self) -> bool:
        return results.accepted(self.verdicts)

    @property
    def totals(self) -> compared.Totals:
        """Its metrics over all runs."""
        return compared.totals(results.evaluate(self.runs))

    def on(self, system: str) -> compared.Totals:
        """Its metrics over all runs on one system."""
        return compared.totals({s: {system: m[system]} for s, m in results.evaluate(self.runs).items()})

    @property
    def figures(self) -> dict[str, Any]:
        """Metrics by scenario and system, limits, and whether all are met."""
        return results.figures(results.evaluate(self.runs), self.verdicts, self.realtime_factor)


@dataclass(frozen=True)
class Outcome:
    """A controller's verification, those of the controllers beside it, where the report is, and the plant."""

    own: Verification
    beside: Sequence[Verification]
    report: Path
    plant: Plant | None = None

    @property
    def figures(self) -> dict[str, Any]:
        """What `--json` writes; only the verified controller decides whether it is accepted."""
        found = {v.controller: v.figures for v in (self.own, *self.beside)}
        figures = {"accepted": self.own.accepted, "comparison": self.comparison, "controllers": found}
        return figures | ({"plant": self.plant.name, "outside": self.outside} if self.plant else {})

    @property
    def comparison(self) -> list[str]:
        """A sentence for each controller beside it: which is better, and by how much."""
        name, mine = self.own.controller, self.own.totals
        return [compared.sentence(name, mine, v.controller, v.totals) for v in self.beside]

    @property
    def outside(self) -> dict[str, float | None]:
        """Scenario -> share of its run out of the region that the plant was trained on, if that is known."""
        if self.plant is None:
            return {}
        return {s: outside(self.plant.network, runs[self.plant.system]) for s, runs in self.own.runs.items()}

    @property
    def warnings(self) -> list[str]:
        """A sentence for each run whose figures are no physics."""
        return [
            f"{name}: {100 * share:.0f} % out of the region that {self.plant.name} was trained on: no physics"
            for name, share in self.outside.items()
            if self.plant and share is not None and share > MOST_OUTSIDE
        ]


def verify(
    scenarios: Sequence[str] | None = None,
    systems: Sequence[str] = ("nominal", "reference"),
    seed: int = 1,
    out: Path = Path("out/verify"),
    controller: Controller = PI,
    beside: Sequence[Controller] = (),
    jobs: int = 2,
    progress: Report | None = None,
) -> Outcome:
    """Run `scenarios` on `systems` and write records, metrics.json and report.html to `out`.

    `scenarios` are names, or paths of target files in the form of specs/scenarios (default: all names).
    `controller` is verified; those `beside` it run the same and are held to the same limits, for comparison.
    Raises InputError before anything runs; RunError, naming every run that failed, after the others were
    recorded.
    """
    report = progress or (lambda *said: None)
    chosen = [s for text in (scenarios or scenarios_spec.names()) for s in scenarios_spec.find(text)]
    for s in chosen:
        check_reach(s)
    folders = {c.name: out if c is controller else out / c.name for c in (controller, *beside)}
    planned = {
        c.name: list(_jobs(c, chosen, systems, seed, folders[c.name], report)) for c in (controller, *beside)
    }
    rates = run_all([job for made in planned.values() for job in made], jobs, report)
    report("writing the report")
    found = [_verified(name, made, rates) for name, made in planned.items()]
    words = [f" --plant {controller.plant.name}"] if controller.plant else []
    words += [f" --seed {seed}"] if seed != 1 else []
    return write(found, seed, out, "slewright verify" + "".join(words), controller.plant)


def _jobs(
    controller: Controller,
    chosen: Sequence[Scenario],
    systems: Sequence[str],
    seed: int,
    out: Path,
    report: Report,
) -> Iterator[Job]:
    """The runs of a controller; its systems are packed and checked first."""
    replaced = {name: path for m in controller.models for name, path in replacement(m, systems).items()}
    replaced |= controller.plant.models if controller.plant else {}
    _make_folder(out / "records")
    for system in systems:
        report(f"building {system}")
        folder = out / "systems" if replaced else SYSTEMS
        ssp = controller.packages.get(system) or pack_system(system, out=folder, models=replaced)
        check_interventions(chosen, ssp)
        for s in chosen:
            record = out / "records" / f"{s.name}-{system}.parquet"
            yield Job(s, system, seed, ssp, controller.name, record, controller.settings)


def _make_folder(path: Path) -> None:
    """Make the folder `path` before anything is spent on what goes into it; InputError if that cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"folder {path} cannot be made: {error.strerror}") from None
    if not os.access(path, os.W_OK):
        raise InputError(f"folder {path} cannot be written to")


def _verified(name: str, jobs: Sequence[Job], rates: Mapping[Path, float]) -> Verification:
    """The records of a controller's runs, held to the limits."""
    runs: dict[str, dict[str, Record]] = {}
    for job in jobs:
        runs.setdefault(job.scenario.name, {})[job.system] = read(job.record)
    by_system: dict[str, list[float]] = {}
    for job in jobs:
        by_system.setdefault(job.system, []).append(rates[job.record])
    # The mean rate over equal stretches of simulated time is the harmonic one.
    factors = {
        system: len(found) / sum(1.0 / max(rate, MIN_SIMULATED_RATE) for rate in found)
        for system, found in sorted(by_system.items())
    }
    return judge(name, runs, [job.scenario for job in jobs], factors)


def judge(
    name: str,
    runs: Mapping[str, Mapping[str, Record]],
    chosen: Sequence[Scenario],
    factors: Mapping[str, float],
) -> Verification:
    """Hold the records `runs` (scenario -> system) of a controller to the limits of their scenarios."""
    metrics = results.evaluate(runs)
    verdicts = [
        verdict
        for s in {s.name: s for s in chosen}.values()
        for system, found in metrics[s.name].items()
        for verdict in check_limits(found, s.limits(SHIPPED, system), s.name, system)
    ]
    return Verification(name, runs, verdicts, factors)


def write(
    found: Sequence[Verification], seed: int, out: Path, command: str, plant: Plant | None = None
) -> Outcome:
    """Write report.html and metrics.json of the first controller, with the others beside it.

    `command` is what the report says it was made by.
    """
    own, *beside = found
    outcome = Outcome(own, beside, out / "report.html", plant)
    versions = {"slewright": VERSION}
    context = Context(
        controller=own.controller,
        plant=plant.name if plant else "",
        command=command,
        seed=seed,
        realtime_factor=own.realtime_factor,
        versions=versions,
        beside={v.controller: (results.evaluate(v.runs), v.verdicts) for v in beside},
        comparison=outcome.comparison,
        notes=outcome.warnings,
    )
    write_report(outcome.report, own.runs, own.verdicts, context)
    results.write_figures(out / "metrics.json", {**outcome.figures, "seed": seed, "versions": versions})
    return outcome


def show(outcome: Outcome) -> None:
    """Print a table for each controller, the verified one last, the comparison and where the report is."""
    where = f", plant {outcome.plant.name}" if outcome.plant else ""
    for v in outcome.beside:
        title = f"{v.controller} (for comparison){where}"
        results.print_table(
            results.evaluate(v.runs), v.verdicts, v.realtime_factor, title=title, misses=False
        )
    own = outcome.own
    title = f"{own.controller} (verified){where}"
    results.print_table(results.evaluate(own.runs), own.verdicts, own.realtime_factor, title=title)
    for sentence in outcome.comparison:
        print(sentence)
    print(f"Report: {outcome.report}")
