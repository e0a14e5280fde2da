"""How fast it is, against others, in the same minute on the same machine."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from records.figures_file import check_target, write, write_text
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError, nearest
from specs.version import VERSION

if TYPE_CHECKING:
    from benchmarks.orchestrator.blocks import Spread
    from benchmarks.orchestrator.comparison import Result


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
    from benchmarks.orchestrator.comparison import run
    from benchmarks.orchestrator.document import page

    with progress("bench orchestrator") as report:
        result = run(blocks, report)
    _show(result)
    write(json, result.figures())
    if markdown:
        write_text(markdown, page(result))
    missed = [must for must in result.musts() if must.missed]
    for must in missed:
        typer.echo(f"slewright: missed: {must}", err=True)
    if missed:
        raise typer.Exit(1)


def campaign(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved campaigns.")] = 5,
    runs: Annotated[int, typer.Option(min=16, help="Runs of each.")] = 200,
    json: JsonOption = None,
) -> None:
    """Compare a campaign's scaling with independent processes'; what a run costs beside stepping."""
    from benchmarks.campaign import measure, missed

    with progress("bench campaign") as report:
        figures = measure(blocks, runs, report)
    rates = figures["runs_per_second"]
    show(
        "runs a second, median",
        ["", "1 process", "2 processes", "scaling"],
        [
            (
                "campaign",
                f"{rates['campaign_1']:.1f}",
                f"{rates['campaign_2']:.1f}",
                f"{figures['scaling']:.2f}",
            ),
            (
                "independent",
                f"{rates['independent_1']:.1f}",
                f"{rates['independent_2']:.1f}",
                f"{figures['scaling_independent']:.2f}",
            ),
        ],
    )
    typer.echo(
        f"ratio of scalings {figures['scaling_ratio']:.3f}, overhead {figures['overhead_ms']:.2f} ms a run"
    )
    write(json, figures)
    for must in (found := missed(figures)):
        typer.echo(f"slewright: missed: {must}", err=True)
    if found:
        raise typer.Exit(1)


def slew_nn(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved timings.")] = 200,
    json: JsonOption = None,
) -> None:
    """Compare the step of an FMU with the paper's networks with its bare generated C, and with real time."""
    from benchmarks.slew_nn.step import CASES, missed, run

    with progress("bench slew_nn") as report:
        figures = run(blocks, report)
    columns = ["network", "doStep, µs", "bare C, µs", "ratio", "quartiles", "× real time"]
    show("a step of 0.02 s, median", columns, [_slew_nn_row(name, figures[name]) for name in CASES])
    found = missed(figures)
    write(json, {**figures, "missed": found})
    for must in found:
        typer.echo(f"slewright: missed: {must}", err=True)
    if found:
        raise typer.Exit(1)


def pendulum(
    data: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the recordings, with LICENSE and model/.")
    ] = Path("tests/data/dfki_simple_pendulum"),
    json: JsonOption = None,
    markdown: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", callback=check_target, help="Fill the part between this page's markers."
        ),
    ] = None,
) -> None:
    """Reconcile recordings of a real pendulum with a model without gravity, and predict held-out runs."""
    from reconcile.measured import limits, measure, page
    from records.report import markers

    with progress("bench pendulum") as report:
        figures = measure(data, report)
    columns = ["recording", "held out", "before, rad", "after, rad", "down"]
    rows = [
        (run, row["held_out"], p["before"], p["after"], f"{100 * p['down']:.1f} %")
        for run, row in figures["runs"].items()
        for p in [row["position"]]
    ]
    show(f"error of the position {figures['ahead_s']:g} s ahead, root mean square", columns, rows)
    typer.echo(f"{figures['verdict']}: {figures['sentence']}")
    found = limits(figures)
    if markdown:
        markers.fill(markdown, "pendulum", page(figures, VERSION))
    write(json, {**figures, "missed": found}, figures["seed"])
    for must in found:
        typer.echo(f"slewright: missed: {must}", err=True)
    if found:
        raise typer.Exit(1)


def showcases(
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="tool or slew (repeatable).")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the scenarios' sensor noise.")] = 1,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of recordings, reports and records.")
    ] = Path("out/showcases"),
    json: JsonOption = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="DIR", exists=True, file_okay=False, help="Fill the showcases' pages here."),
    ] = None,
) -> None:
    """Record the reference machine, reconcile a model that lacks something, verify the extended model."""
    from benchmarks.showcases.page import pages
    from benchmarks.showcases.showcases import SHOWCASES, measure, missed

    for name in only or ():
        if name not in SHOWCASES:
            raise InputError(f"no showcase '{name}'; {nearest(name, SHOWCASES)}")
    chosen = [s for n, s in SHOWCASES.items() if not only or n in only]
    with progress("bench showcases") as report:
        figures = {s.name: measure(s, out, seed, report) for s in chosen}
    for name, found in figures.items():
        _show_showcase(f"{name}: the model moved as the machine moves", found["isolated"])
        _show_showcase(f"{name}: the nominal system", found["whole"])
        typer.echo(f"{found['verdict']}: {found['sentence']}")
    if markdown:
        pages(markdown, chosen, figures)
    failed = [line for s in chosen for line in missed(s, figures[s.name])]
    write(json, {**figures, "missed": failed}, seed)
    for line in failed:
        typer.echo(f"slewright: missed: {line}", err=True)
    if failed:
        raise typer.Exit(1)


def _show_showcase(title: str, compared: Mapping[str, Any]) -> None:
    from benchmarks.showcases.showcases import METRIC_UNITS

    rows = [(s, *(f"{v:.2f}" for v in m.values())) for s, m in compared["mean"].items()]
    rows += [(f"{s}: off by", *(f"{v:.2f}" for v in m.values())) for s, m in compared["distance"].items()]
    closer = ["—" if v is None else f"{100 * v:.0f} %" for v in compared["closer"].values()]
    show(title, ["", *(f"{k}, {METRIC_UNITS[k]}" for k in compared["closer"])], [*rows, ("closer", *closer)])


def _slew_nn_row(name: str, f: dict[str, float]) -> list[str]:
    spread = f"{f['ratio_p25']:.2f} … {f['ratio_p75']:.2f}"
    times = (f"{f['fmu_us']:.2f}", f"{f['bare_us']:.2f}", f"{f['ratio']:.2f}")
    return [name, *times, spread, f"{f['realtime_factor']:.0f}"]


def _show(result: "Result") -> None:
    from benchmarks.orchestrator.comparison import MASTERS, VERSIONS

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


def _figure(spread: "Spread | None", reason: str | None) -> str:
    if spread is None:
        return "—" if reason is None else f"— ({reason.partition(':')[0]})"
    return f"{spread.median:.4g} ({spread.low:.4g} … {spread.high:.4g})"


def _number(value: float | None) -> str:
    return "—" if value is None else f"{value:.3g}"


def _rate(figures: dict[str, float] | None) -> str:
    return "—" if figures is None else f"{figures['rows_per_s']:,.0f}"


def nmpc(json: JsonOption = None) -> None:
    """How long a solve of the model predictive controller takes; 99 % must stay within 50 ms on one core."""
    from benchmarks.nmpc import SEED, SHARE, measure

    with progress("bench nmpc") as report:
        figures = measure(report)
    columns = ("time [ms]", "p50", "p99", "p99.9", "max")
    rows = [
        (label, *figures[key].values())
        for label, key in (("process", "process_ms"), ("elapsed", "elapsed_ms"))
    ]
    show(f"{figures['solves']} solves, {figures['fallbacks']} fallbacks", columns, rows)
    write(json, figures, SEED)
    if figures["within_limit"] < SHARE:
        typer.echo(
            f"slewright: missed: {SHARE:.0%} of the solves within {figures['limit_ms']:g} ms", err=True
        )
        raise typer.Exit(1)


def training(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved runs.")] = 15,
    json: JsonOption = None,
) -> None:
    """Compare a step of the environment with its matrix products, and PPO with rsl-rl-lib as it comes."""
    from benchmarks import training as measured

    with progress("bench training") as report:
        figures = measured.run(blocks, report)
    rows = [
        (name, f["ratio"], f"{f['ratio_p25']:.2f} … {f['ratio_p75']:.2f}", f["limit"])
        for name, f in ((n, figures[n]) for n in ("environment", "ppo"))
    ]
    show(f"{blocks} blocks, one thread, processor time", ("what", "ratio", "quartiles", "limit"), rows)
    write(json, figures)
    if wrong := measured.missed(figures):
        for text in wrong:
            typer.echo(f"slewright: missed: {text}", err=True)
        raise typer.Exit(1)
