"""`slewright scenes`: controllers in scenes with obstacles, on the simulated reference machine."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import check_suffix, make_folder, write
from records.report import markers
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.sealed import chosen_set, purpose
from slewright.tables import show
from slewright.typed import command
from specs.errors import InputError
from specs.scene import Scene

FOLLOWERS = ("nmpc", "shaped", "floor")
COLUMNS = (
    "controller", "scenes", "runs", "contacts", "keep-out", "clearance m", "beside p95 m", "cycle s",
    "over optimum", "speed °/s", "tool °/s", "missed", "plan p95 s",
)  # fmt: skip
GUARD_COLUMNS = (
    "behind", "runs", "contacts without", "contacts with", "runs stepped in", "times", "share of time",
    "speed kept", "cycle longer", "missed without", "missed with", "starts too near", "targets too near",
)  # fmt: skip


def scenes(
    scene: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENE...",
            help="Scenes by name (truck), files (.toml), drawn ones (FAMILY:SET:K) or a whole set (tuning).",
        ),
    ] = None,
    controller: Annotated[
        list[str] | None,
        typer.Option(
            "--controller", metavar="NAME",
            help="nmpc, shaped, floor (all three without the option); a controller or a policy's file, blind "
            "or led: pd@path (repeatable).",
        ),
    ] = None,
    machines: Annotated[
        int, typer.Option("--machines", min=0, help="Drawn machines of the set (0: the nominal one).")
    ] = 0,
    draw_set: Annotated[
        str, typer.Option("--draws", metavar="SET", help="Machines: tuning or validation.")
    ] = "validation",
    sealed: Annotated[
        str | None,
        typer.Option(
            "--sealed", metavar="PURPOSE", callback=purpose,
            help="Sealed scenes on sealed machines; it is logged.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of planning, loads and noise.")] = 1,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Local worker processes.")] = 1,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of results; a second call goes on there.")
    ] = Path("out/scenes"),
    records: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Each run's record (.parquet) and film for Foxglove (.mcap), in this folder."
        ),
    ] = None,
    guard: Annotated[
        bool, typer.Option("--guard", help="Each controller also with the control core's guard behind it.")
    ] = False,
    optimum: Annotated[
        bool,
        typer.Option(
            "--optimum",
            help="Cycle times also over the best that optimal control finds (a minute for each target).",
        ),
    ] = False,
    page: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            callback=lambda page: check_suffix(page, ".html", ".md"),
            help="FILE.html: one run of each scene, drawn; FILE.md: the tables, between its markers.",
        ),
    ] = None,
    json: JsonOption = None,
) -> None:  # fmt: skip
    """Drive controllers through scenes: contacts, clearance, cross-track error, cycle time, speeds."""
    from deployment.guard.alone import Alone
    from specs import draws, scene_families
    from verification.scenes import kept, study

    controllers = list(dict.fromkeys(controller or FOLLOWERS))
    if bool(scene) == bool(sealed):
        raise InputError(
            "name scenes (truck, tuning, gap:validation:0, a .toml file) or open the --sealed ones"
        )
    which = chosen_set(draw_set, sealed, machines)
    study.check_controllers(controllers)
    if records is not None:
        kept.check()
        make_folder(records)
    mark = ("guarded " if guard else "") + ("sealed" if sealed else (scene or [""])[0].split(":")[0])
    if page is not None and page.suffix == ".md":
        markers.around(page, mark)
    opened = draws.open_test_set(f"scenes: {sealed}") if sealed else None
    chosen = scene_families.sealed(opened) if opened else scene_families.find(scene or [])
    guarding = Alone if guard else None
    study.check_scenes(chosen, guarding)
    drawn: dict[str, Any] = {draws.NOMINAL: {}}
    if machines:
        drawn = {f"{which}:{k}": draws.draw(which, k, opened) for k in range(machines)}
    with progress("scenes") as report:
        found = study.study(chosen, controllers, drawn, seed, jobs, out, report, guarding, records, optimum)
    rows = [_row(c, f) for c, f in found["controllers"].items()]
    show("Scenes, simulated reference machine", COLUMNS, rows)
    if guard:
        show("The guard", GUARD_COLUMNS, [_guard_row(c, found["controllers"][c]) for c in controllers])
    for name, figures in found["controllers"].items():
        for which, reason in figures["without_plan"].items():
            typer.echo(f"no plan: {name} in {which}: {reason}")
        for text in _stops(name, figures["stopped"]):
            typer.echo(text)
    _write_pages(page, mark, chosen, found, controllers, guard)
    if records is not None:
        typer.echo(f"written: records and films in {records}")
    figures = found["controllers"]
    first = {name: value for name, value in figures[controllers[0]].items() if name != "families"}
    write(json, {**first, **figures, **found}, seed=seed)


def _stops(name: str, stopped: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A sentence for each run that stopped because the way to its next target was no longer free."""
    for run in stopped:
        yield (
            f"stopped: {name} in {run['scene']}, machine {run['machine']}, {run['stopped_s']:.1f} s after "
            f"its start: the way on is no longer free; {run['reason']}"
        )


def _write_pages(
    page: Path | None,
    mark: str,
    scenes: Sequence[Scene],
    found: dict[str, Any],
    controllers: list[str],
    guard: bool,
) -> None:
    """The page, if one is asked for; what it draws is taken out of the figures."""
    from verification.scenes import page as pages

    pictures, figures = found.pop("picture"), found["controllers"]
    if page is None:
        return
    if page.suffix == ".md":
        pages.fill(page, mark, command(), *_tables(figures, controllers, guard))
    else:
        pages.write(page, scenes, pictures, (COLUMNS, [_row(c, f) for c, f in figures.items()]))
    typer.echo(f"written: {page}")


def _tables(
    figures: dict[str, Any], controllers: list[str], guard: bool
) -> Iterator[tuple[tuple[str, ...], list[list[str]]]]:
    """By controller, and where there are several families by them: of what the guard did, or all figures."""
    columns, row = (GUARD_COLUMNS, _guard_row) if guard else (COLUMNS, _row)
    yield columns, [row(name, figures[name]) for name in controllers]
    families = {name: figures[name]["families"] for name in controllers}
    if any(len(of) > 1 for of in families.values()):
        rows = [[family, *row(name, f)] for name, of in families.items() for family, f in of.items()]
        yield ("family", *columns), rows


def _row(name: str, f: dict[str, Any]) -> list[str]:
    forms = {
        "keep_outs": "{}", "clearance_min": "{:.2f}", "cross_track_p95": "{:.2f}", "cycle": "{:.1f}",
        "cycle_ratio": "{:.2f}", "speed": "{:.1f}", "tool": "{:.1f}", "missed": "{}", "plan_p95_s": "{:.2f}",
    }  # fmt: skip
    texts = [_text(f, key, form) for key, form in forms.items()]
    return [name, str(f["scenes"]), str(f["runs"]), _contacts(f), *texts]


def _text(f: dict[str, Any], key: str, form: str) -> str:
    return "–" if f.get(key) is None else form.format(f[key])


def _guard_row(name: str, f: dict[str, Any]) -> list[str]:
    """What the guard did behind a controller."""
    if "guarded" not in f:
        return [name, *["–"] * (len(GUARD_COLUMNS) - 1)]
    with_it = f["guarded"]
    return [
        name, str(with_it["runs"]), _contacts(f), _contacts(with_it), str(with_it["runs_stepped_in"]),
        str(f["interventions"]), f"{100 * with_it['guarded_share']:.0f} %",
        _text(f, "speed_guarded", "{:.3f}"), _text(f, "cycle_guarded", "{:.3f}"),
        _missed(f), _missed(with_it), str(with_it["start_too_near"]), str(with_it["targets_too_near"]),
    ]  # fmt: skip


def _missed(f: dict[str, Any]) -> str:
    return f"{f['missed']} of {f['targets']}"


def _contacts(f: dict[str, Any]) -> str:
    """Runs with a contact, and the upper end of the interval of their share."""
    if "contacts" not in f:
        return "–"
    return f"{f['contacts']} (≤ {100 * f['contact_share_ci95'][1]:.1f} %)"
