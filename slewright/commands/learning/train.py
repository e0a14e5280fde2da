"""`slewright train`: models from recordings."""

import os
from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.plants import OurInertiaOption, check_inertia
from slewright.progress import progress
from slewright.tables import show

app = typer.Typer(help="Train models on recordings.", no_args_is_help=True)


@app.callback()
def train() -> None:
    """Train models on recordings."""


@app.command()
def slew(
    data: Annotated[
        list[Path] | None,
        typer.Argument(metavar="DATA", help="A collection's folder, or recordings; none: the plan paper's."),
    ] = None,
    recipe: Annotated[str, typer.Option(metavar="NAME", help="What to train; see --ablation.")] = "ensemble",
    ablation: Annotated[bool, typer.Option("--ablation", help="Train and compare all variants.")] = False,
    traces: Annotated[bool, typer.Option("--traces", help="Train on the slew traces' steps.")] = False,
    reproduce: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Train this model (.npz) again and compare its figures."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds a variant is trained on.")] = 3,
    first_seed: Annotated[int, typer.Option("--seed", help="The first of them.")] = 1,
    machine: Annotated[
        str, typer.Option(metavar="M", help="Whose recordings to make if DATA is not given.")
    ] = "nominal",
    jobs: Annotated[int, typer.Option(min=1, help="Processes, one thread each.")] = 2,
    budget: Annotated[str, typer.Option(help="full, or tiny to see that all of it runs.")] = "full",
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for weights and page.")] = Path(
        "out/train-slew"
    ),
    doc: Annotated[
        Path | None,
        typer.Option("--doc", metavar="FILE.md", exists=True, help="Write the table between its markers."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Train the paper's slew networks, or all variants of them, and judge them on held-out recordings."""
    from learning.slew import session
    from records.report import markers

    options = session.Options(
        data=tuple(data or ()), recipe=recipe, ablation=ablation, traces=traces, machine=machine, jobs=jobs,
        seeds=tuple(range(first_seed, first_seed + seeds)), budget=budget, out=out,
    )  # fmt: skip
    if doc is not None:
        markers.around(doc, options.marker)  # refused now, not after the training
    with progress("train slew") as report:
        figures = session.reproduce(reproduce, options, report) if reproduce else session.run(options, report)
    rows = [
        (name, entry["velocity_mae"], entry["position_mae"], *_interval(entry))
        for name, entry in figures["variants"].items()
    ]
    columns = ["variant", "velocity °/s", "position °", "95 % velocity", "95 % position"]
    show(f"10 s open loop on held-out recordings: {figures['source']}", columns, rows)
    for line in figures["notes"]:
        typer.echo(line)
    if doc is not None:
        markers.fill(doc, options.marker, session.markdown(figures))
    write(json, {**figures, **figures["variants"]}, first_seed)
    if not figures["accepted"]:
        raise typer.Exit(1)


@app.command()
def policy(
    task: Annotated[str, typer.Option(metavar="TASK", help="full, or slew (the slew alone).")] = "full",
    recipe: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="full, slew, family, robust, slew_robust, path, path_field; PPO: ppo, ppo_slew, "
            "path_field_ppo, single_ppo, paper, paper_slew. Else the task's.",
        ),
    ] = "",
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Of weights, machines and noise.")] = 1,
    budget: Annotated[
        str, typer.Option(help="full, short (a fifth), or tiny to see that it runs; --set stays.")
    ] = "full",
    networks: Annotated[
        list[Path] | None,
        typer.Option(
            "--networks", metavar="FILE", help="Slew networks (repeatable); none: those of slew_nn."
        ),
    ] = None,
    plant: Annotated[
        str,
        typer.Option(
            metavar="PLANT",
            help="Slew drive to train on: networks (ours), published (the authors'), or a .npz or folder.",
        ),
    ] = "",
    our_inertia: OurInertiaOption = False,
    change: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="A field of the recipe, or weights.TERM (repeatable)."
        ),
    ] = None,
    device: Annotated[
        str, typer.Option(metavar="NAME", help="auto (a GPU for PPO, where there is one), cpu or cuda.")
    ] = "auto",
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Checkpoints, curve and policy; a second call goes on there.")
    ] = Path("out/train-policy"),
    json: JsonOption = None,
) -> None:
    """Train a policy in the mixed simulation and write it as ONNX; one thread, goes on where it was ended."""

    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from learning.policy import session

    check_inertia(our_inertia, plant or networks, "--plant or --networks")
    options = session.Options(
        task=task, recipe=recipe, seed=seed, budget=budget, networks=tuple(networks or ()), out=out,
        changed=session.changes(change or ()), device=device, plant=plant, our_inertia=our_inertia,
    )  # fmt: skip
    with progress("train policy") as report:
        figures = session.run(options, report)
    last = {k: v for k, v in figures["last"].items() if isinstance(v, float)}
    show(f"{figures['recipe']}, {figures['iterations']} iterations", ("figure", "value"), last.items())
    if not figures["policy"]:
        typer.echo("no policy is written: a teacher (privileged) is for its students")
    typer.echo(f"written: {figures['policy'] or figures['checkpoint']}")
    write(json, figures, seed)


def _interval(entry: dict) -> tuple[str, str]:
    low, high = zip(*(entry["ci95"][f"{what}_mae"] for what in ("velocity", "position")), strict=True)
    return tuple(f"{a:.2f} … {b:.2f}" for a, b in zip(low, high, strict=True))  # type: ignore[return-value]
