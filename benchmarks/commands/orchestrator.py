"""`python -m benchmarks orchestrator`: the orchestrator against a hand-written loop and other masters."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.orchestrator.blocks import Spread
from benchmarks.orchestrator.comparison import MASTERS, VERSIONS, Result, run
from benchmarks.orchestrator.document import page
from records.figures_file import check_target, write, write_text
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show


def orchestrator(
    blocks: Annotated[
        int, typer.Option(min=1, help="Blocks of interleaved runs: more are surer and slower.")
    ] = 60,
    json: JsonOption = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=check_target, help="Write the figures as a page here."),
    ] = None,
) -> None:
    """Compare the orchestrator with a hand-written loop and other masters, on one chain of three FMUs."""
    with progress("bench orchestrator") as report:
        result = run(blocks, report)
    _show(result)
    write(json, result.figures())
    if markdown:
        write_text(markdown, page(result))
    exit_if_missed(must for must in result.musts() if must.missed)


def _show(result: Result) -> None:
    columns = ["", *(f"FMI {version}" for version in VERSIONS)]
    masters = [
        (key[:-3], *(_figure(m.figure(key), m.reasons.get(key)) for m in result.chain.values()))
        for key in MASTERS
    ]
    show(
        "three trivial FMUs in a chain, four signals logged: µs a step, median (quartiles)", columns, masters
    )
    figures = result.figures()
    ratios = {name: figures[name] for name in ("ratio_to_floor", "ratio_to_fmucontainer", "nominal_overhead")}
    ratios |= {name: figures[name] for name in figures if name.startswith("recording_ratio")}
    ratios["isolated FMU, µs a step"] = figures["isolated_fmu_us"]
    show("ratios", columns, [(name, *map(_number, by.values())) for name, by in ratios.items()])
    rows = {name: [_rate(r) for r in by.values()] for name, by in figures["recording"].items()}
    show(
        "all variables recorded: rows a second",
        columns,
        [(n, *r) for n, r in rows.items()],
    )


def _figure(spread: Spread | None, reason: str | None) -> str:
    if spread is None:
        return "—" if reason is None else f"— ({reason.partition(':')[0]})"
    return f"{spread.median:.4g} ({spread.low:.4g} … {spread.high:.4g})"


def _number(value: float | None) -> str:
    return "—" if value is None else f"{value:.3g}"


def _rate(figures: dict[str, float] | None) -> str:
    return "—" if figures is None else f"{figures['rows_per_s']:,.0f}"
