"""Whether an FMU's shared library can be loaded and has what its description promises; nothing is run."""

import functools
import os
from collections.abc import Iterator
from pathlib import Path

from fmus.toolchain.compiler import host
from orchestrator.fmi.library_file import ELF, MACHO, PE, PLATFORM, LibraryFile, NotALibrary, read_library
from orchestrator.fmi.model_description import ModelDescription
from specs.errors import listed

FORMATS = {".so": ELF, ".dll": PE, ".dylib": MACHO}
LIFE = ("FreeInstance", "EnterInitializationMode", "ExitInitializationMode")
REQUIRED = {
    2: ("Instantiate", "SetupExperiment", *LIFE, "DoStep"),
    3: ("InstantiateCoSimulation", *LIFE, "DoStep"),
}
EXCHANGE = {
    2: ("Instantiate", "SetupExperiment", *LIFE, "NewDiscreteStates", "SetTime"),
    3: ("InstantiateModelExchange", *LIFE, "UpdateDiscreteStates", "SetTime"),
}
SCHEDULED = ("InstantiateScheduledExecution", *LIFE, "ActivateModelPartition")
INTERVALS = ("Decimal", "Fraction")
STATES = {
    2: ("GetContinuousStates", "SetContinuousStates", "GetDerivatives"),
    3: ("GetContinuousStates", "SetContinuousStates", "GetContinuousStateDerivatives"),
}
EVENTS = ("EnterEventMode", "UpdateDiscreteStates", "EnterStepMode")
MAX_LIBRARIES = 200
FOLDERS = ("/lib", "/usr/lib", "/lib64", "/usr/lib64", "/usr/local/lib")
CONFIGURATION = Path("/etc/ld.so.conf")


def unloadable(library: Path) -> str:
    """Why no system, or not this one, could load the file; "" where nothing is known against it."""
    target = host()
    try:
        found = read_library(library)
    except NotALibrary as error:
        return str(error)
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    if found.format != FORMATS[target.suffix]:
        return f"is a library of {PLATFORM[found.format]} ({found.format}) in the folder of this platform"
    processor = target.name.partition("-")[0]
    if processor not in found.machines:
        return f"is for the processor {', '.join(found.machines)}; this computer has {processor}"
    return ""


def broken_promises(library: Path, model: ModelDescription) -> Iterator[str]:
    """What it lacks so that it could not be loaded or stepped: sentences, the most important one first."""
    found = read_library(library)
    if found.functions is None:
        return
    prefix = f"fmi{model.fmi_version}"
    required = (*REQUIRED[model.fmi_version], *(EVENTS if model.has_event_mode else ()))
    if model.scheduled:
        required = SCHEDULED
    if model.exchange is not None:
        required = (
            *EXCHANGE[model.fmi_version],
            *(STATES[model.fmi_version] if model.exchange.derivatives else ()),
        )
    required = (*required, *_clock_functions(model))
    missing = [f"{prefix}{name}" for name in required if f"{prefix}{name}" not in found.functions]
    if missing:
        yield f"lacks the functions {listed(missing)}"
    if found.version and not found.version.startswith(f"{model.fmi_version}."):
        yield f"says it is of FMI {found.version}, its description {model.version_text}"
    yield from _lacking_libraries(library, found)


def _clock_functions(model: ModelDescription) -> Iterator[str]:
    """What the times of clocks are asked with that the description does not state."""
    for variable in model.variables.values():
        clock = variable.clock
        if clock is None or variable.causality != "input" or not clock.time_based:
            continue
        form = INTERVALS[clock.supports_fraction]
        if clock.interval_s is None:
            yield f"GetInterval{form}"
            if clock.periodic:
                yield f"GetShift{form}"


def lacking_abilities(library: Path, model: ModelDescription) -> Iterator[str]:
    """Functions that are missing though the description promises what they do; a plain run works without."""
    functions = read_library(library).functions
    state, de = ("FMUstate", "DeSerialize") if model.fmi_version == 2 else ("FMUState", "Deserialize")
    promises = {
        f"canGetAndSet{state}": (
            model.can_get_set_state,
            [f"{verb}{state}" for verb in ("Get", "Set", "Free")],
        ),
        f"canSerialize{state}": (
            model.can_serialize_state,
            [f"Serialized{state}Size", f"Serialize{state}", f"{de}{state}"],
        ),
        "providesDirectionalDerivative": (model.provides_directional, ["GetDirectionalDerivative"]),
    }
    for promise, (given, names) in promises.items():
        missing = [f"fmi{model.fmi_version}{name}" for name in names]
        missing = [name for name in missing if functions is not None and name not in functions]
        if given and missing:
            yield f"promises {promise}, but its library lacks {listed(missing)}"


# ---- libraries that it needs ----


def _lacking_libraries(library: Path, found: LibraryFile) -> Iterator[str]:
    given: set[str] = set()
    todo = [(library.parent, found)]
    seen: set[str] = set()
    while todo and len(seen) < MAX_LIBRARIES:
        folder, at = todo.pop()
        for name in at.needed:
            if name in seen:
                continue
            seen.add(name)
            path = _find(name, folder, at)
            if path is None:
                yield f"needs {name}, which the loader finds in none of its folders{_beside(library, name)}"
                return
            if (needed := _read(path)) is None:
                return
            given |= needed.functions or frozenset()
            todo.append((path.parent, needed))
    if not todo and (lost := sorted(found.wanted - given)):
        yield f"uses {listed(lost)}, which no library that it needs has"


def _beside(library: Path, name: str) -> str:
    if not (library.parent / name).is_file():
        return ""
    return "; it lies beside the library, where an rpath of $ORIGIN or LD_LIBRARY_PATH would find it"


@functools.cache
def _read(path: Path) -> LibraryFile | None:
    try:
        return read_library(path)
    except (NotALibrary, OSError):
        return None


def _find(name: str, folder: Path, owner: LibraryFile) -> Path | None:
    if "/" in name:
        return Path(name) if Path(name).is_file() else None
    own = [text.replace("${ORIGIN}", "$ORIGIN").replace("$ORIGIN", str(folder)) for text in owner.search]
    told = os.environ.get("LD_LIBRARY_PATH", "").split(":")
    paths = (Path(place, name) for place in (*own, *told, *_folders()) if place)
    return next((path for path in paths if path.is_file()), None) or _mapped().get(name)


@functools.cache
def _folders() -> tuple[str, ...]:
    """Where the loader looks by itself, with those of its configuration."""
    triple = f"{host().name}-gnu"
    known = [f"{place}/{triple}" for place in ("/lib", "/usr/lib")]
    return (*_configured(CONFIGURATION), *known, *FOLDERS)


def _configured(file: Path, depth: int = 3) -> Iterator[str]:
    try:
        lines = file.read_text(errors="replace").splitlines()
    except OSError:
        return
    for line in (text.partition("#")[0].strip() for text in lines):
        if line.startswith("include ") and depth:
            pattern = Path(line.removeprefix("include ").strip())
            folder = pattern.parent if pattern.is_absolute() else file.parent / pattern.parent
            for other in sorted(folder.glob(pattern.name)):
                yield from _configured(other, depth - 1)
        elif line.startswith("/"):
            yield line


@functools.cache
def _mapped() -> dict[str, Path]:
    """Libraries that this process has loaded: their folders may be known to nobody else."""
    try:
        lines = Path("/proc/self/maps").read_text(errors="replace").splitlines()
    except OSError:
        return {}
    paths = {Path(line[line.index("/") :]) for line in lines if "/" in line and ".so" in line}
    return {path.name: path for path in paths}
