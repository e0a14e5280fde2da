"""What commands that try controllers on plants share: `--plant` and its like, the trial and its table."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from json import dumps
from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import plain, write
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError

ADMISSION_TARGETS = 20
HELP = "nominal, networks, networks-forward, published, published-mirror, machine; or a .npz, FMU or folder"
PlantOption = Annotated[  # a list, so that a second one is seen; one_plant() refuses it
    list[str] | None, typer.Option("--plant", metavar="PLANT", help=f"One plant: {HELP}.")
]
OurInertiaOption = Annotated[
    bool,
    typer.Option("--our-inertia", help="A plant that does not state its inertia number takes the project's."),
]
TargetsOption = Annotated[
    int, typer.Option("--targets", metavar="N", min=1, max=10000, help="Targets on a plant, each 15 s.")
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Seed of the targets, loads and noise.")]


@dataclass(frozen=True)
class Asked:
    """What the options say of a trial."""

    targets: int
    seed: int
    load: str
    pace: float | None
    jobs: int


def check_excluded(
    given: Mapping[str, object], single: Mapping[str, Sequence[object] | None], option: str = "--plant"
) -> None:
    """Refuse options that say something about drawn machines, and several values where one is meant."""
    if wrong := [name for name, value in given.items() if value]:
        raise InputError(f"{option} excludes {', '.join(wrong)}")
    for name, values in single.items():
        if values and len(values) > 1:
            raise InputError(f"{name} {', '.join(map(str, values))}: one {name[2:]} with {option}")


def one_plant(texts: Sequence[str] | None) -> str | None:
    """The plant of --plant; InputError where several are asked for."""
    if texts and (len(texts) > 1 or texts[0] == "all"):
        raise InputError(
            f"--plant {', '.join(texts)}: one plant at a time; slewright compare --plants PLANT takes several"
        )
    return texts[0] if texts else None


def check_inertia(our_inertia: bool, plant: object, option: str = "--plant") -> None:
    """Refuse --our-inertia where there is no plant that it could be of."""
    if our_inertia and not plant:
        raise InputError(f"--our-inertia needs {option}: it is of a plant's networks")


def on_plant(texts: Sequence[str], plant: str, our_inertia: bool, asked: Asked, json: Path | None) -> None:
    """Try policies or controllers on one plant, show the table, write the figures."""
    from verification.plants import study
    from verification.plants.plant import find

    on = [find(plant, our_inertia)]
    task = study.task_of(texts)
    warn_of_ranges(texts, asked)
    found = tried(study.find_controllers(texts), on, task, asked)
    by_controller = {c: cell for cells in found.values() for c, cell in cells.items()}
    first = next(iter(by_controller.values()))
    own = first if len(by_controller) == 1 else {"controllers": by_controller}
    more = {"plant": plant, "load": asked.load, "task": task, "policy": list(texts)}
    write(json, {**own, **more}, asked.seed)


def warn_of_ranges(texts: Sequence[str], asked: Asked) -> None:
    """Say what of the trial lies outside the trained ranges of the policies among these controllers."""
    from verification.evaluation import training_range
    from verification.plants.trial import load_of

    pace, load = 1.0 if asked.pace is None else asked.pace, load_of(asked.load)
    for text in texts:
        for said in training_range.on_plants(Path(text), pace, load) if text.endswith(".onnx") else ():
            typer.echo(f"slewright: warning: {said}", err=True)


def tried(controllers: Sequence[Any], on: Sequence[Any], task: str, asked: Asked) -> Any:
    """plant -> controller -> figures, shown as a table."""
    from verification.plants import study
    from verification.plants.trial import Trial

    trial = Trial(asked.targets, asked.seed, asked.load, task, 1.0 if asked.pace is None else asked.pace)
    with progress("plants") as report:
        found = study.study(controllers, on, trial, asked.jobs, report)
    unit = "°" if task == "slew" else "m"
    columns = [f"error {unit}" if c == "error" else c for c in study.COLUMNS]
    title = f"{asked.targets} targets, {asked.load}, seed {asked.seed}"
    show(title, ("controller", "plant", *columns), study.rows(found))
    for plant, cells in found.items():
        for c, cell in cells.items():
            if cell["flagged"]:
                said = f"slewright: warning: {c} on {plant}: {study.flag(cell)}: no physics"
                typer.echo(said, err=True)
    return found


def admission(
    controller: str, plants: Sequence[str], our_inertia: bool = False
) -> tuple[dict[str, bytes], list[str]]:
    """({file of a bundle: content}, where the controller fails): a table over plants, unknown load."""
    from baselines.margins.coverage import TABLE
    from verification.plants import drives, study

    on = study.find_plants(plants, our_inertia)
    asked = Asked(ADMISSION_TARGETS, 1, "unknown", None, os.cpu_count() or 1)
    task = study.task_of([controller])
    found = tried(study.find_controllers([controller]), on, task, asked)
    failures = {plant: study.failures({plant: cells}) for plant, cells in found.items()}
    with progress("drives") as report:
        known = drives.drives(on, report)
    said = [text for texts in failures.values() for text in texts]
    content = {
        "plants": found, "task": task, "load": asked.load, "seed": asked.seed, "failures": said,
        "passed": [plant for plant, texts in failures.items() if not texts],
        "drives": {plant: drive.as_dict() for plant, drive in known.items()},
    }  # fmt: skip
    return {TABLE: (dumps(plain(content), indent=1) + "\n").encode()}, said
