"""`python -m benchmarks reconcile-suite`: hidden-effect cases, answered without knowing the truth, scored."""

import secrets
from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.suite import page
from benchmarks.suite.ledger import Ledger, seed_of
from benchmarks.suite.plan import Settings, settle
from benchmarks.suite.run import check_packages, run_suite, there
from benchmarks.suite.summary import missed, summarise
from records.figures_file import write
from records.report import markers
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError
from verification.campaign import pool


def reconcile_suite(
    cases: Annotated[int, typer.Option(metavar="N", help="Cases to draw.")],
    seed: Annotated[int | None, typer.Option(metavar="S", help="Seed (default: a fresh one).")] = None,
    noise: Annotated[str, typer.Option(help="Noise of sensors, inputs, disturbance: low or high.")] = "low",
    system: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="One system (default: all): servo, arm, tool, slew, machine."),
    ] = None,
    visible: Annotated[
        str, typer.Option(help="Effects: drawn (1 to 3), none, outside (one that no catalogue has).")
    ] = "drawn",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the cases; one that is there goes on.")
    ] = None,
    workers: Annotated[int, typer.Option(metavar="K", help="Local worker processes.")] = 2,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers do the cases.")
    ] = None,
    baselines: Annotated[bool, typer.Option(help="Answer by plain SINDy and greedy BIC too.")] = True,
    experiments: Annotated[
        bool, typer.Option(help="Drive what ambiguous cases propose, and answer them again.")
    ] = True,
    again: Annotated[bool, typer.Option("--again", help="Answer cases that are there once more.")] = False,
    summary: Annotated[bool, typer.Option("--summary", help="Do nothing; figures of what is there.")] = False,
    results: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Keep results here, a line a case; those that are there count as done."
        ),
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Fill the results of such suites in this page.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Draw machines with hidden effects, reconcile them, and score what is named against the sealed truth."""

    if cases < 1 or workers < 1:
        raise InputError(f"--cases {cases}, --workers {workers}: both are at least 1")
    if summary and out is None and not (results and results.exists()):
        raise InputError("--summary needs --out DIR, the folder of the suite, or --results FILE, its results")
    check_packages(dask, baselines and not summary)
    if markdown:
        markers.around(markdown, page.name(noise, visible))  # said now, not after hours
    wanted = {"noise": noise, "system": system, "visible": visible}
    seed = seed_of(results, seed, **wanted)
    fresh = secrets.randbelow(2**31) if seed is None else seed
    folder = out or Path("out/reconcile-suite") / f"{noise}-{system or 'all'}-{visible}-{fresh}"
    if dask and not summary:
        pool.connected(dask).close()  # said before anything is written
    # figures of kept results need no folder
    settings = settle(folder, seed, fresh, **wanted) if out or not summary else Settings(fresh, **wanted)
    ledger = Ledger(results, settings)
    typer.echo(f"seed {settings.seed}, cases in {folder}")
    try:
        with progress("reconcile-suite") as report:
            if not summary:
                run_suite(
                    settings, cases, folder, workers, dask, baselines, again, report, experiments, ledger
                )
    finally:  # what is there counts, whatever ended it
        ledger.keep(there(folder, cases))
        found = there(folder, cases, ledger)
        figures = {"noise": noise, "visible": visible, "asked": cases, **summarise(found)}
        figures["missed"] = missed(figures, noise, visible)
        _print(figures, found)
        write(json, figures, settings.seed)
        if markdown:
            markers.fill(markdown, page.name(noise, visible), page.page(figures, settings.seed))
    for text in figures["missed"]:
        typer.echo(f"missed: {text}")
    if figures["missed"]:
        raise typer.Exit(1)


def _print(figures: dict[str, Any], results: list[dict[str, Any]]) -> None:
    columns = ["cases", "exact", "ambiguous_ok", "right", "wrong", "abstained", "seconds_median"]
    rows = [(s, *(row[c] for c in columns)) for s, row in figures["by_system"].items()]
    show("By system", ["system", *columns], [*rows, ("all", *(figures[c] for c in columns))])
    plain = [(name, *(b[c] for c in columns)) for name, b in figures["baselines"].items() if b["cases"]]
    if plain:
        show("Plain ways on the same cases", ["way", *columns], plain)
    _print_experiments(figures["experiments"])
    bad = [r for r in results if r["result"] in ("wrong", "abstained")]
    lines = [
        (
            r["key"],
            r["system"],
            r["result"],
            ", ".join(r["visible"]),
            r["verdict"],
            _sets(r),
            len(r["equivalents"]),
        )
        for r in bad
    ]
    if lines:
        show("Not met", ["case", "system", "result", "visible", "verdict", "named", "|E(T)|"], lines)


def _print_experiments(done: dict[str, Any]) -> None:
    """What became of ambiguous cases once their experiment was driven."""
    if not done["ambiguous"]:
        return
    counted = ["ambiguous", "driven", "exact", "wrong", "share_exact", "inseparable", "promised"]
    rows = [(*(done[c] for c in counted), done["share_exact_promised"])]
    show("Ambiguous cases after the proposed experiment", [*counted, "share_exact_promised"], rows)
    columns = ["cases", "promised", "exact", "predicted_median", "achieved_median"]
    pairs = [(name, *(row[c] for c in columns)) for name, row in done["pairs"].items()]
    if pairs:
        show("Pairs of alternatives", ["pair", *columns], pairs)


def _sets(result: dict[str, Any]) -> str:
    return result["workflow_failed"] or " | ".join("+".join(names) for names in result["named"])
