"""All cases of the pack, by subject."""

from benchmarks.testpack.case import Case
from benchmarks.testpack.cases import (
    connections,
    exchange,
    failures,
    files,
    models,
    parameters,
    refusals,
    stepping,
    structure,
    terminals,
    units,
    value_types,
)

SUBJECTS: dict[str, tuple[Case, ...]] = {
    "connections and transformations": connections.CASES,
    "units": units.CASES,
    "parameters": parameters.CASES,
    "structure": structure.CASES,
    "types and arrays": value_types.CASES,
    "stepping": stepping.CASES,
    "model exchange": exchange.CASES,
    "terminals": terminals.CASES,
    "errors: description": refusals.CASES,
    "errors: archives and files": files.CASES,
    "errors: FMUs": models.CASES,
    "errors in a run": failures.CASES,
}
CASES: tuple[Case, ...] = tuple(case for group in SUBJECTS.values() for case in group)
