"""What a user can give wrongly, found before anything is computed: model, recordings, names."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from fmus.definition import Model, Variable
from fmus.toolchain.codegen import whole
from fmus.toolchain.tried import shortened
from reconcile.equations.model import Folder, read_folder
from specs.errors import InputError, nearest
from specs.schema import read_toml


def open_folder(model: str) -> Folder:
    """The model folder, its equations tried once; InputError in at most two lines if it cannot be used."""
    try:
        folder = read_folder(model)
    except InputError as error:
        raise InputError(shortened(str(error))) from error
    except SystemExit as error:
        raise InputError(f"{model}/model.py ends the program (sys.exit)") from error
    check_model(folder.model, folder.path / "model.py")
    return folder


def check_model(model: Model, where: Path) -> None:
    """Raise InputError for a model without outputs, or whose equations give no number at the start."""
    if not model.outputs:
        raise InputError(f"{where}: the model has no output, so no recording can be compared with it")
    try:
        whole(model.sample_time, model.step, "sample_time")
    except InputError as error:
        raise InputError(f"{where}: {error}; state a sample_time that is") from None
    _in_range(model.parameters, where)
    p = model.start_parameters()
    u, m = ca.DM([v.start for v in model.inputs]), ca.DM([v.start for v in model.modes])
    x = model.x0(p)
    _finite(x, model.states, f"{where}: the start of state {{}} is not a number")
    at = "at the start (states, inputs and parameters as the file gives them)"
    _finite(model.f(x, u, m, p), model.states, f"{where}: the rate of {{}} is not a number {at}")
    _finite(model.h(x, u, m, p), model.outputs, f"{where}: output {{}} is not a number {at}")


def _in_range(parameters: Sequence[Variable], where: Path) -> None:
    for v in parameters:
        low, high = (-np.inf if v.min is None else v.min), (np.inf if v.max is None else v.max)
        room = 1e-9 * abs(v.start)  # of numbers written and read again
        if not low - room <= v.start <= high + room:
            raise InputError(f"{where}: parameter {v.name} starts at {v.start:g}, not in {low:g} .. {high:g}")


def _finite(values: ca.DM, group: Sequence, sentence: str) -> None:
    wrong = np.flatnonzero(~np.isfinite(np.asarray(values).ravel()))
    if len(wrong):
        raise InputError(sentence.format(group[int(wrong[0])].name))


def check_runs(runs: Sequence[Path], confirm: Sequence[Path], holdout: Sequence[Path]) -> None:
    """Raise InputError for a recording that is given twice, be it for two purposes or as a copy."""
    seen: dict[object, tuple[Path, str]] = {}
    for purpose, paths in (("to fit", runs), ("for --confirm", confirm), ("for --holdout", holdout)):
        for path in paths:
            if not path.is_file():
                continue  # reading it says what is wrong
            for key in (path.resolve(), _digest(path)):
                other, before = seen.setdefault(key, (path, purpose))
                if (other, before) != (path, purpose) or paths.count(path) > 1:
                    copy = "" if path.resolve() == other.resolve() else f" (the same as {other})"
                    both = "twice" if before == purpose else f"{before} and {purpose}"
                    raise InputError(f"{path}{copy} is given {both}; every recording serves one purpose")


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def labels(paths: Iterable[Path]) -> dict[Path, str]:
    """A name for each recording: its file name without suffix, with as much of the path as tells it apart."""
    found = list(dict.fromkeys(paths))
    names: dict[Path, str] = {}
    for path in found:
        parts = path.with_suffix("").parts
        for n in range(1, len(parts) + 1):
            name = "/".join(parts[-n:])
            alike = [p for p in found if "/".join(p.with_suffix("").parts[-n:]) == name]
            if len(alike) == 1:
                break
        names[path] = name if len(alike) == 1 else str(path)
    return names


def read_names(path: Path | None, known: Iterable[str], beside: Sequence[str] = ()) -> dict[str, str] | None:
    """The table [names] of --map; InputError unless the model has its names; `beside`: other tables."""
    if path is None:
        return None
    found = _tables(path, ("names", *beside)).get("names", {})
    check_names(path, found, known)
    return {str(k): str(v) for k, v in found.items()}


def read_disturbances(path: Path | None) -> dict[str, dict[str, str]]:
    """The table [disturbances] of --map, for a closed FMU: input -> {role: output}."""
    found = {} if path is None else _tables(path, ("names", "disturbances")).get("disturbances", {})
    for name, roles in found.items():
        if not isinstance(roles, dict) or not all(isinstance(v, str) for v in roles.values()):
            raise InputError(f"{path}: write it as {name} = {{ velocity = 'output', position = 'output' }}")
    return found


def _tables(path: Path, valid: Sequence[str]) -> dict:
    data = read_toml(path)
    if not data or not set(data) <= set(valid) or not all(isinstance(v, dict) for v in data.values()):
        wrong = next((k for k in data if k not in valid or not isinstance(data[k], dict)), "")
        said = f"'{wrong}' is no table of it; " if wrong else ""
        raise InputError(
            f"{path}: {said}write {' and '.join(f'[{v}]' for v in valid)}, "
            "and below [names] lines 'their name' = 'our name [unit]'"
        )
    return data


def check_names(path: Path, names: Mapping[str, object], known: Iterable[str]) -> None:
    """Raise InputError for a name of ours that is no input or output of the model, nor the time."""
    from records.formats.tables import heading

    allowed = [*known, "time"]
    for theirs, ours in names.items():
        if not isinstance(ours, str):
            raise InputError(f"{path}: '{theirs}' = {ours!r} is no name; write 'our name [unit]'")
        name = heading(ours).name.removeprefix("-").strip()
        if name not in allowed:
            raise InputError(
                f"{path}: '{theirs}' = '{ours}': the model has no input or output '{name}'; "
                f"{nearest(name, allowed)}"
            )
