"""Parameters of machine, models and controllers, one table a parameter.

Those of machine and models are in `specs/parameters/NAME.toml`, a controller's own in its folder,
`baselines/NAME/parameters.toml`.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from specs.errors import InputError, nearest
from specs.schema import STRICT, read_toml, shown_path, validate
from specs.units import unit as find_unit

FOLDER = Path(__file__).parent
CONTROLLERS = FOLDER.parents[1] / "baselines"
Status = Literal["datasheet", "measured", "identified", "assumed"]
FIRST_VR, LAST_VR = 1000, 2999  # signals have 1–999


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One constant in SI `unit`, between `min` and `max`, with its `source` and how sure it is (`status`)."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    value: float
    unit: str
    description: str
    source: str
    status: Status
    vr: int
    min: float | None = None
    max: float | None = None
    nominal: float | None = None

    def __post_init__(self) -> None:
        find_unit(self.unit)
        self.check(self.value)
        for key in ("description", "source"):
            if not getattr(self, key).strip():
                raise InputError(f"empty {key}")
        if not FIRST_VR <= self.vr <= LAST_VR:
            raise InputError(f"vr {self.vr} outside {FIRST_VR}–{LAST_VR}")

    def check(self, value: float) -> float:
        """Return `value` if it lies in this parameter's bounds; raises InputError otherwise."""
        low = self.min if self.min is not None else float("-inf")
        high = self.max if self.max is not None else float("inf")
        if not low <= value <= high:
            raise InputError(f"parameter {self.name} = {value:g} {self.unit} outside {low:g} … {high:g}")
        return value


def files() -> list[str]:
    """Names of the parameter files: of those in this folder without their ending, else of the controllers."""
    return sorted(_paths())


def _paths() -> dict[str, Path]:
    own = {path.stem: path for path in FOLDER.glob("*.toml")}
    return own | {path.parent.name: path for path in CONTROLLERS.glob("*/parameters.toml")}


def path_of(name: str) -> Path:
    """The parameter file of this name; InputError names the valid ones."""
    known = _paths()
    if name not in known:
        raise InputError(f"no parameter file '{name}'; valid: {', '.join(sorted(known))}")
    return known[name]


def load(*names: str) -> dict[str, Parameter]:
    """Merge the parameters of the named files, in file order.

    Raises InputError for an unknown file, and naming file and key for a missing unit, source or status,
    a value out of its bounds, an unknown unit, or a name or value reference used twice.
    """
    merged: dict[str, Parameter] = {}
    owners: dict[int, str] = {}
    for name in names:
        path = path_of(name)
        for parameter in _read(path):
            _claim(merged, owners, parameter, f"{shown_path(path)}: {parameter.name}")
            merged[parameter.name] = parameter
    return merged


def check() -> dict[str, Parameter]:
    """Load every file together: names and value references are used once over all of them."""
    return load(*files())


@cache
def _read(path: Path) -> tuple[Parameter, ...]:
    return tuple(_parameter(path, name, entry) for name, entry in read_toml(path).items())


def _parameter(path: Path, name: str, entry: Any) -> Parameter:
    where = f"{shown_path(path)}: {name}"
    if not isinstance(entry, dict):
        raise InputError(f"{where}: expected a table with value, unit, source and status")
    return validate(Parameter, {"name": name, **entry}, where)


def _claim(known: dict[str, Parameter], owners: dict[int, str], new: Parameter, where: str) -> None:
    if new.name in known:
        raise InputError(f"{where}: name used twice")
    if new.vr in owners:
        raise InputError(f"{where}: vr {new.vr} already belongs to {owners[new.vr]}")
    owners[new.vr] = new.name


def parameter(name: str, *names: str) -> Parameter:
    """One parameter by name out of the named files (all files if none is named)."""
    known = load(*(names or files()))
    if name not in known:
        raise InputError(f"no parameter '{name}'; {nearest(name, known)}")
    return known[name]
