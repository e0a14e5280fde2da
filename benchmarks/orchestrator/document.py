"""docs/results/benchmarks.md: what was measured, how, and the figures, all written by the benchmark."""

import os
from collections.abc import Iterable, Sequence
from importlib import metadata
from typing import Any

from benchmarks.orchestrator.blocks import Spread
from benchmarks.orchestrator.comparison import MASTERS, OURS, VERSIONS, Result
from benchmarks.orchestrator.registry import RECORDERS
from fmus.toolchain import compiler

NAMES = {
    "floor_us": "hand-written C loop: the floor",
    "slewright_us": "**Slewright**",
    "fmucontainer_us": "fmucontainer of fmu-manipulation-toolbox, driven by a C loop",
    "ecos_us": "Ecos (ecospy), its own loop",
    "fmpy_ssp_us": "FMPy `simulate_ssp`",
    "libcosim_us": "libcosim (libcosimpy), many steps a call",
}
PACKAGES = ("fmu-manipulation-toolbox", "ecospy", "fmpy", "libcosimpy")
RECORDER_NAMES = {
    "slewright": "**Slewright**, Parquet",
    "fmpy": "FMPy, `simulate_ssp` and `write_csv`",
    "libcosim": "libcosim, CSV",
}
PAGE = """\
<!-- Written by `python -m benchmarks orchestrator --markdown FILE`; do not edit. -->
# Benchmarks

Measured on a machine with {cores} cores under whatever load it had, FMUs and core compiled by
{compiler};
{packages}.
Single figures are worth little elsewhere, ratios of one run more.

## Cost of a step

Three trivial FMUs in a chain (`benchmarks/orchestrator/c/link.h`: a van der Pol oscillator driven by its
predecessor), four signals logged into memory, all FMUs in the process of the master. µs a step: median and
quartiles over {blocks} blocks. In a block every master runs for about 2 ms, one after the other; a run during
which others had the processor is repeated. All first show the same values after the same steps.
Slewright checks every status and that every output is finite; the floor checks nothing; Ecos and libcosim
log nothing.

{steps}

Ratios of the same block:

{ratios}

A foreign FMU runs in a process of its own by default. A step of it then costs, beyond what it costs in the
process of the master: {isolated}.

## Recording

Every variable of the chain recorded, from loading to the closed file.

{recording}

## The material handler

Time outside the FMUs' own functions over the time inside, in the nominal system with its default record
in memory: {overhead}.

## What must hold

{musts}
"""


def page(result: Result) -> str:
    """The page as Markdown."""
    figures = result.figures()
    some = next(iter(result.chain.values()))
    return PAGE.format(
        cores=os.cpu_count(),
        compiler=compiler.identity(compiler.host().name),
        packages=", ".join(_versions()),
        blocks=max((len(runs) for runs in some.runs.values()), default=0),
        steps=_steps(result),
        ratios=_ratios(result),
        isolated=_both(figures["isolated_fmu_us"], "{:.1f} µs"),
        recording=_recording(figures),
        overhead=_both(figures["nominal_overhead"], "{:.1%}"),
        musts="\n".join(f"- {must}{': **missed**' if must.missed else ''}" for must in result.musts()),
    )


def _steps(result: Result) -> str:
    rows = [
        (NAMES[key], *(_spread(m.figure(key), m.reasons.get(key)) for m in result.chain.values()))
        for key in MASTERS
    ]
    return _table(("master", *_versions_named()), rows)


def _ratios(result: Result) -> str:
    rows = [
        (f"Slewright / {name}", *(_spread(m.ratio(OURS, key), None) for m in result.chain.values()))
        for name, key in (("floor", "floor_us"), ("fmucontainer", "fmucontainer_us"))
    ]
    return _table(("ratio", *_versions_named()), rows)


def _recording(figures: dict[str, Any]) -> str:
    rows = []
    for key in RECORDERS:
        found = figures["recording"][key]["fmi2"]
        if found:
            rate, size = f"{found['rows_per_s']:,.0f}", f"{found['bytes_per_s'] / 1e6:.1f}"
            rows.append((RECORDER_NAMES[key], rate, size, f"{found['file_bytes_per_row']:.0f}"))
    return _table(("FMI 2", "rows/s", "MB of values/s", "bytes a row in the file"), rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [" | ".join(head), "---|" + "--:|" * (len(head) - 1), *(" | ".join(row) for row in rows)]
    return "\n".join(f"| {line} |" if i != 1 else f"|{line}" for i, line in enumerate(lines))


def _versions_named() -> list[str]:
    return [f"FMI {version}" for version in VERSIONS]


def _versions() -> Iterable[str]:
    for package in PACKAGES:
        try:
            yield f"{package} {metadata.version(package)}"
        except metadata.PackageNotFoundError:
            continue


def _spread(spread: Spread | None, reason: str | None) -> str:
    if spread is None:
        return "—" if reason is None else f"— ({reason.partition(':')[0]})"
    return f"{spread.median:.3g} ({spread.low:.3g} … {spread.high:.3g})"


def _both(figures: dict[str, float | None], form: str) -> str:
    known = {name: value for name, value in figures.items() if value is not None}
    words = [f"{form.format(value)} (FMI {name[-1]})" for name, value in known.items()]
    return ", ".join(words) or "not measured"
