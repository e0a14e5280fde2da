"""Controllers on plants, many targets each: what `evaluate --plant` and `compare --plants` show."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from baselines import registry
from baselines.registry import Controller
from specs.errors import InputError, RunError
from specs.progress import Report
from verification.evaluation import policies
from verification.evaluation.policies import SHIPPED
from verification.plants import plant as plants, trial
from verification.plants.plant import Plant
from verification.plants.trial import MOST_OUTSIDE, Job, Trial

ALL = "all"
COLUMNS = (
    "missed %", "overshoot °", "largest °", "error", "speed °/s", "tool °/s", "rest °", "signs 1/s", "note",
)  # fmt: skip
MOST = {  # that a controller may do on a plant: (limit, what it is, form)
    "missed_share": (0.01, "targets missed", "{:.0%}"),
    "overshoot": (2.0, "mean overshoot", "{:.1f}°"),
}
FLAG = "out of the trained region"


def find_plants(texts: Sequence[str], our_inertia: bool = False, every: str = ALL) -> list[Plant]:
    """The plants of these names or files, each once; `every` stands for those with a name."""
    wanted = [name for text in texts for name in (plants.names() if text == every else [text])]
    found = [plants.find(text, our_inertia, [every]) for text in dict.fromkeys(wanted)]
    names = [plant.name for plant in found]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"two plants called '{twice[0]}'; give one file or folder another name")
    return found


def find_controllers(texts: Sequence[str]) -> list[Controller]:
    """Controllers by their names in baselines/, else policies by their files."""
    files = [Path(text) for text in texts if Path(text).exists() and text not in registry.names()]
    found = policies.controllers(files)
    return [found[Path(text)] if Path(text) in found else registry.find(text) for text in texts]


def everyone() -> list[Controller]:
    """Every controller there is and the policy that ships."""
    return [*registry.select(), *policies.controllers([SHIPPED]).values()]


def task_of(texts: Sequence[str]) -> str:
    """The task of the policies among these, `full` without one; InputError where they have several."""
    files = [Path(text) for text in texts if text.endswith(".onnx")]
    return policies.task_of(files) if files else "full"


def study(
    controllers: Sequence[Controller], on: Sequence[Plant], asked: Trial, workers: int, report: Report
) -> dict[str, Any]:
    """plant -> controller -> figures."""
    jobs: dict[tuple[str, str], list[Job]] = {}
    scenarios = list(asked.scenarios())
    for plant in on:
        for c in controllers:
            report(f"building {c.name} on {plant.name}")
            ssp = plant.pack(c.models, c.name)
            made = [Job(ssp, plant, s, seed, asked.pace, c.parameters) for seed, s in scenarios]
            jobs[plant.name, c.name] = made
    ran = trial.run([j for made in jobs.values() for j in made], workers, report)
    found: dict[str, Any] = {plant.name: {} for plant in on}
    for (plant_name, controller), made in jobs.items():
        try:
            done = [next(ran) for _ in made]
        except RunError as error:
            raise RunError(f"{controller} on {plant_name}: {error}") from error
        found[plant_name][controller] = trial.figures(done, asked.task)
    return found


def worst(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> dict[str, Any]:
    """For each controller the largest share missed, overshoot, error, tool … over the plants."""
    keys = ("missed_share", "overshoot", "error", "tool", "rest_peak_to_peak", "sign_changes")
    names = {c for by_controller in found.values() for c in by_controller}
    return {
        c: {k: max(by[c][k] for by in found.values()) for k in keys}
        | {"speed": min(by[c]["speed"] for by in found.values())}
        for c in sorted(names)
    }


def rows(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Iterator[list[str]]:
    """(controller, plant, COLUMNS) of the table."""
    for c in next(iter(found.values())):
        for plant, by_controller in found.items():
            cell = by_controller[c]
            names = ("overshoot", "overshoot_max", "error", "speed", "tool", "rest_peak_to_peak")
            values = [f"{cell[n]:.2f}" for n in (*names, "sign_changes")]
            note = flag(cell) if cell["flagged"] else ""
            yield [c, plant, f"{100 * cell['missed_share']:.0f}", *values, note]


def flag(cell: Mapping[str, Any]) -> str:
    """What is said of figures that are flagged."""
    return f"{100 * cell['outside_max']:.0f} % of a run {FLAG}"


def failures(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[str]:
    """A sentence for each plant on which a controller does what it may not, or whose figures say nothing."""
    said = []
    for plant, cells in found.items():
        for controller, cell in cells.items():
            where = f"{controller} on {plant}"
            said += [
                f"{where}: {what} {form.format(cell[key])}, at most {form.format(most)}"
                for key, (most, what, form) in MOST.items()
                if cell[key] > most
            ]
            said += [f"{where}: {flag(cell)}, at most {MOST_OUTSIDE:.0%}"] if cell["flagged"] else []
    return said
