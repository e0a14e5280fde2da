"""`python -m benchmarks orchestrator`: all measurements in one go, as figures, a table and verdicts."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.orchestrator import chain
from benchmarks.orchestrator.blocks import Measured, Spread, measure, spread
from benchmarks.orchestrator.registry import MASTERS, RECORDERS
from specs.progress import Report

VERSIONS = {2: "fmi2", 3: "fmi3"}
BLOCKS = 60
OURS = "slewright_us"
# Most that the parts may take, each for FMI 2 and FMI 3; their blocks are a share of those of the chain.
BUDGETS_S = {"chain": 15.0, "recording": 8.0, "nominal": 3.0, "isolated": 3.0}
SHARES = {"chain": 1, "recording": 10, "nominal": 3, "isolated": 6}
LEAST_BLOCKS = 3


@dataclass(frozen=True)
class Must:
    """A figure and the limit that it must keep; `figure` None: not measured."""

    name: str
    figure: float | None
    limit: float
    at_least: bool = False

    @property
    def missed(self) -> bool:
        if self.figure is None:
            return False
        return self.figure < self.limit if self.at_least else self.figure > self.limit

    def __str__(self) -> str:
        sign = "at least" if self.at_least else "at most"
        figure = "not measured" if self.figure is None else f"{self.figure:.3g}"
        return f"{self.name} = {figure}, must be {sign} {self.limit:g}"


@dataclass
class Result:
    """What was measured, by FMI version."""

    chain: dict[int, Measured] = field(default_factory=dict)
    recording: dict[int, Measured] = field(default_factory=dict)
    nominal: dict[int, Measured] = field(default_factory=dict)
    isolated: dict[int, Measured] = field(default_factory=dict)

    # ---- figures ----

    def figures(self) -> dict[str, Any]:
        """For --json: medians; null where there is none, with the reason under "reasons"."""
        found: dict[str, Any] = {key: self._by_version(_us(key), self.chain) for key in MASTERS}
        found["ratio_to_floor"] = self._by_version(_ratio("floor_us"), self.chain)
        found["ratio_to_fmucontainer"] = self._by_version(_ratio("fmucontainer_us"), self.chain)
        found["isolated_us"] = self._by_version(_us("isolated_us"), self.isolated)
        found["isolated_fmu_us"] = self._by_version(isolated_fmu, self.isolated)
        found["nominal_overhead"] = self._by_version(overhead, self.nominal)
        found["recording"] = {key: self._by_version(_recording(key), self.recording) for key in RECORDERS}
        for key in RECORDERS[1:]:
            found[f"recording_ratio_to_{key}"] = self._by_version(_times_faster(key), self.recording)
        found["spread"] = self._spreads()
        found["reasons"] = self._reasons()
        found["musts"] = [{"must": str(must), "missed": must.missed} for must in self.musts()]
        return found

    def _by_version(self, figure: Callable[[Measured], Any], of: Mapping[int, Measured]) -> dict[str, Any]:
        return {name: _median(figure(of[v])) if v in of else None for v, name in VERSIONS.items()}

    def _spreads(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for version, measured in self.chain.items():
            figures = {key: measured.figure(key) for key in MASTERS}
            figures |= {
                f"ratio_to_{k[:-3]}": measured.ratio(OURS, k) for k in ("floor_us", "fmucontainer_us")
            }
            found[VERSIONS[version]] = {k: s.as_dict() for k, s in figures.items() if s}
        return found

    def _reasons(self) -> dict[str, dict[str, str]]:
        reasons: dict[str, dict[str, str]] = {}
        for part in (self.chain, self.recording, self.nominal, self.isolated):
            for version, measured in part.items():
                for key, why in measured.reasons.items():
                    reasons.setdefault(key, {})[VERSIONS[version]] = why
        return reasons

    # ---- verdicts ----

    def musts(self) -> list[Must]:
        """All that must hold."""
        return [
            *self._musts("ratio to the floor", _ratio("floor_us"), self.chain, 2.0),
            *self._musts("ratio to fmucontainer", _ratio("fmucontainer_us"), self.chain, 1.0),
            *(
                must
                for key in RECORDERS[1:]
                for must in self._musts(
                    f"recording, times faster than {key}", _times_faster(key), self.recording, 5
                )
            ),
            *self._musts("orchestration of the nominal system", overhead, self.nominal, 0.1),
        ]

    def _musts(
        self, name: str, figure: Callable[[Measured], Spread | None], of: Mapping[int, Measured], limit: float
    ) -> Iterator[Must]:
        for version, measured in of.items():
            faster = "faster" in name
            yield Must(f"{name} (FMI {version})", _median(figure(measured)), limit, at_least=faster)


def run(blocks: int = BLOCKS, report: Report | None = None) -> Result:
    """Measure everything: about a minute; fewer `blocks` are faster and less sure."""
    result = Result()
    parts = {
        "chain": (result.chain, MASTERS),
        "recording": (result.recording, RECORDERS),
        "nominal": (result.nominal, ("nominal",)),
        "isolated": (result.isolated, (OURS, "isolated_us")),
    }
    for version in VERSIONS:
        chain.build(version)
        for name, (measured, keys) in parts.items():
            if report:
                report(f"{name}, FMI {version}")
            n = max(min(LEAST_BLOCKS, blocks), blocks // SHARES[name])
            measured[version] = measure(keys, version, n, BUDGETS_S[name])
    return result


# ---- figures of one measurement ----


def overhead(measured: Measured) -> Spread | None:
    """Time outside the FMUs' functions over the time inside."""
    runs = measured.runs.get("nominal")
    return spread(np.array([(r.seconds - r.inside) / r.inside for r in runs])) if runs else None


def isolated_fmu(measured: Measured) -> Spread | None:
    """µs that a step of one FMU costs more in a process of its own."""
    if OURS not in measured.runs or "isolated_us" not in measured.runs:
        return None
    return spread((measured.us("isolated_us") - measured.us(OURS)) / len(chain.NAMES))


def _us(key: str) -> Callable[[Measured], Spread | None]:
    return lambda measured: measured.figure(key)


def _ratio(to: str) -> Callable[[Measured], Spread | None]:
    return lambda measured: measured.ratio(OURS, to)


def _times_faster(key: str) -> Callable[[Measured], Spread | None]:
    return lambda measured: measured.ratio(key, "slewright")


def _recording(key: str) -> Callable[[Measured], dict[str, float] | None]:
    def figures(measured: Measured) -> dict[str, float] | None:
        runs = measured.runs.get(key)
        if not runs:
            return None
        seconds = float(np.median([r.seconds for r in runs]))
        rows, columns = runs[0].steps, chain.COLUMNS
        return {
            "rows_per_s": rows / seconds,
            "bytes_per_s": rows * columns * 8 / seconds,  # of the values, before compression
            "file_bytes_per_row": runs[0].bytes / rows,
        }

    return figures


def _median(figure: Any) -> Any:
    return figure.median if isinstance(figure, Spread) else figure
