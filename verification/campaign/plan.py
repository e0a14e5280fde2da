"""A campaign's plan (TOML) and the runs that it stands for.

The cross product of what `[runs]` lists, on the material handler's systems; and every `[[files]]`, a system
of one's own, once for each seed and fault set.  docs/how-to/campaigns.md shows both.
"""

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

from fmus.toolchain.loader import load_model, model_folders
from specs import draws, scenario as scenarios_spec, systems as systems_spec
from specs.errors import InputError, nearest
from specs.faults import read_faults
from specs.schema import STRICT, read_toml, validate

OPTIONAL = ("step_s", "start_s", "tell_stop", "tell_tolerance")  # of a file: they count where they are given
KEEP = ("none", "failed", "worst", "all")
NOMINAL = "nominal"  # the machine as its parameter files describe it
NO_FAULT = "no-fault"
DEFAULT_CONTROLLER = "pi"


@dataclass(frozen=True, kw_only=True)
class Runs:
    """The cross product; `draws` are "nominal", "validation-3" or "validation" (all of the set)."""

    __pydantic_config__: ClassVar[Any] = STRICT

    scenarios: tuple[str, ...]
    systems: tuple[str, ...] = ("reference",)
    controllers: tuple[str, ...] = (DEFAULT_CONTROLLER,)
    draws: tuple[str, ...] = (NOMINAL,)
    faults: tuple[str, ...] = (NO_FAULT,)
    seeds: tuple[int, ...] = (1,)
    parameters: dict[str, float] = field(default_factory=dict)
    stop_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class File:
    """A system of one's own: its figures are min, max, mean and end of what is recorded."""

    __pydantic_config__: ClassVar[Any] = STRICT

    path: str
    stop_s: float
    name: str = ""
    seeds: tuple[int, ...] = (1,)
    record: tuple[str, ...] = ()
    parameters: dict[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = (NO_FAULT,)
    trust: bool = False
    step_s: float | None = None
    start_s: float | None = None
    tell_stop: bool = False
    tell_tolerance: float | None = None

    def __post_init__(self) -> None:
        if not self.stop_s > (self.start_s or 0.0):
            raise InputError(f"stop_s = {self.stop_s:g}: must be above {self.start_s or 0:g}")
        for name in ("step_s", "tell_tolerance"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise InputError(f"{name} = {value:g}: must be above 0")


@dataclass(frozen=True)
class Run:
    """One run: `key` names it for ever, `spec` is all that its result depends on beside the FMUs."""

    key: str
    spec: dict[str, Any]

    @property
    def group(self) -> dict[str, Any]:
        """What results are grouped by."""
        return {k: v for k, v in self.spec.items() if isinstance(v, str | int) and k != "path"}


@dataclass(frozen=True)
class Plan:
    """A checked plan."""

    path: Path
    name: str
    description: str
    keep: str
    runs: tuple[Run, ...]
    controllers: Mapping[str, Path]

    @property
    def systems(self) -> list[tuple[str, str]]:
        """(system, controller) of the material handler that have to be packed."""
        return sorted({(r.spec["system"], r.spec["controller"]) for r in self.runs if "scenario" in r.spec})


def load_plan(path: Path, open_test_set: str = "") -> Plan:
    """Read and check a plan; `open_test_set`: the purpose for which sealed draws may be used (it is logged).

    Raises InputError naming file and key of every mistake.
    """
    data = read_toml(path)
    unknown = sorted(set(data) - {"name", "description", "keep", "runs", "files", "faults"})
    if unknown:
        known = ("name", "description", "keep", "runs", "files", "faults")
        raise InputError(f"{path}: unknown key {unknown[0]}; {nearest(unknown[0], known)}")
    keep = data.get("keep", "none")
    if keep not in KEEP:
        raise InputError(f"{path}: keep = {keep!r}; valid: {', '.join(KEEP)}")
    faults = _faults(data.get("faults", {}), path)
    found: list[Run] = []
    controllers: dict[str, Path] = {}
    if "runs" in data:
        runs = validate(Runs, data["runs"], f"{path}: runs")
        controllers = _controllers(runs.controllers, path)
        found += _product(runs, faults, controllers, path, open_test_set)
    for number, entry in enumerate(data.get("files", []), 1):
        file = validate(File, entry, f"{path}: files.{number}")
        found += _of_file(file, faults, path, f"files.{number}")
    if not found:
        raise InputError(f"{path}: a plan needs [runs] or [[files]]")
    _check_unique(found, path)
    return Plan(
        path, data.get("name", path.stem), data.get("description", ""), keep, tuple(found), controllers
    )


def content(place: str, scenario: str) -> str:
    """What the `scenario` in a file says; without one, the SHA-256 of the file."""
    if not scenario:
        return _hash(Path(place).read_bytes())
    return repr(next(s for s in scenarios_spec.find(place) if s.name == scenario))


def digest(run: Run, fmus: Mapping[str, str], said: Callable[[str, str], str] = content) -> str:
    """SHA-256 of all that the result of a run depends on: its specification and the FMUs' own hashes.

    Of a scenario or system file the content counts, not where it lies; `said` is `content`, or remembers it.
    """
    spec = {k: v for k, v in run.spec.items() if k not in ("source", "path")}
    place = run.spec.get("source") or run.spec["path"]
    told = said(place, run.spec.get("scenario", ""))
    return _hash(json.dumps([run.key, spec, told, dict(fmus)], sort_keys=True).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _faults(entries: Any, path: Path) -> dict[str, list[dict[str, Any]]]:
    if not isinstance(entries, dict):
        raise InputError(f"{path}: faults: must be named lists, each headed [[faults.NAME]]")
    found = {NO_FAULT: []}
    for name, items in entries.items():
        found[name] = [f.as_dict() for f in read_faults(items, f"{path}: faults.{name}")]
    return found


def _named_faults(names: Sequence[str], faults: Mapping[str, Any], where: str) -> None:
    for name in names:
        if name not in faults:
            raise InputError(f"{where}: faults: no set '{name}'; {nearest(name, faults)}")


def _controllers(texts: Sequence[str], path: Path) -> dict[str, Path]:
    """Controllers by name: model folders, or names of the project's own."""
    known, found = model_folders(), {}
    for text in texts:
        folder = known.get(text, Path(text))
        if not (folder / "model.py").is_file():
            raise InputError(
                f"{path}: runs: no controller '{text}'; a folder with model.py, or one of the project"
            )
        found[load_model(folder).name if text not in known else text] = folder
    return found


def _product(
    runs: Runs,
    faults: Mapping[str, Any],
    controllers: Mapping[str, Path],
    path: Path,
    open_test_set: str,
) -> Iterator[Run]:
    _named_faults(runs.faults, faults, f"{path}: runs")
    for name in runs.systems:
        if name not in systems_spec.names():
            raise InputError(f"{path}: runs: no system '{name}'; {nearest(name, systems_spec.names())}")
    chosen = [s for text in runs.scenarios for s in scenarios_spec.find(_beside(text, path))]
    machines = dict(m for text in runs.draws for m in _draws(text, path, open_test_set))
    sources = {s.name: text for text in runs.scenarios for s in scenarios_spec.find(_beside(text, path))}
    for s, system, draw, fault, controller, seed in product(
        chosen, runs.systems, machines, runs.faults, controllers, runs.seeds
    ):
        if draw != NOMINAL and system != "reference":
            continue  # draws are of the machine; the nominal system stays as it is
        spec = {
            "scenario": s.name,
            "source": _beside(sources[s.name], path),
            "system": system,
            "draw": draw,
            "fault": fault,
            "controller": controller,
            "seed": seed,
            "faults": faults[fault],
            "machine": machines[draw],
            "parameters": runs.parameters,
            "stop_s": runs.stop_s,
        }
        yield Run("/".join(map(str, (s.name, system, draw, fault, controller, seed))), spec)


def _beside(text: str, path: Path) -> str:
    """A target file is looked up beside the plan."""
    if not text.endswith(".toml") or Path(text).is_absolute():
        return text
    return str((path.parent / text).resolve())


def _draws(text: str, path: Path, open_test_set: str) -> Iterator[tuple[str, dict[str, float]]]:
    if text == NOMINAL:
        yield NOMINAL, {}
        return
    name, dash, number = text.rpartition("-")
    if not dash:
        name = text
    sizes = draws.sets()
    if name not in sizes:
        raise InputError(f"{path}: runs: unknown set of draws '{name}'; {nearest(name, [NOMINAL, *sizes])}")
    if dash and not number.isdigit():
        raise InputError(f"{path}: runs: draw '{text}' is not of the form {name}-NUMBER")
    opened = draws.open_test_set(open_test_set) if open_test_set and name == draws.SEALED else None
    for index in [int(number)] if dash else range(sizes[name]):
        yield f"{name}-{index}", draws.draw(name, index, opened)


def _of_file(file: File, faults: Mapping[str, Any], path: Path, where: str) -> Iterator[Run]:
    _named_faults(file.faults, faults, f"{path}: {where}")
    system = (path.parent / file.path).resolve()
    if not system.is_file():
        raise InputError(f"{path}: {where}: there is no file {file.path}")
    name = file.name or system.stem
    for fault, seed in product(file.faults, file.seeds):
        spec = asdict(file) | {"path": str(system), "name": name, "seed": seed, "fault": fault}
        spec = {k: v for k, v in spec.items() if k != "seeds" and not (k in OPTIONAL and not v)} | {
            "faults": faults[fault]
        }
        yield Run(f"{name}/{fault}/{seed}", spec)


def _given(value: object) -> bool:
    return value is not None and value is not False


def _check_unique(runs: Sequence[Run], path: Path) -> None:
    seen: set[str] = set()
    for run in runs:
        if run.key in seen:
            raise InputError(f"{path}: two runs have the key {run.key}; give files names of their own")
        seen.add(run.key)
