"""`slewright train slew`: recordings in, weights with their provenance, figures and a page out."""

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fmus.models.slew_nn.network import SlewNetwork
from learning.collection.collect import collect
from learning.collection.plan import load_plan
from learning.slew import ablation, disagreement, page
from learning.slew.ablation import REFERENCES, Outcome
from learning.slew.data import Data, load, of_traces
from learning.slew.recipe import ENSEMBLE, MEMBERS, PROPOSED, RECIPES, exportable, whole
from learning.slew.region import share_outside
from learning.slew.trajectory import GROUPS
from records.paper import FEATURES
from specs.errors import InputError, nearest
from specs.progress import Report
from specs.version import VERSION

BUDGETS = ("full", "tiny")
PLAN = {"full": "paper", "tiny": "tiny"}
FIRST_ORDER = "first_order"
KEYS = ("velocity_mae", "position_mae")
ACCEPTED_RATIO = 0.7  # of the first-order reference's errors


@dataclass(frozen=True)
class Options:
    """What to train on which recordings, and where to put it."""

    data: tuple[Path, ...] = ()
    recipe: str = PROPOSED.name
    ablation: bool = False
    traces: bool = False
    machine: str = "nominal"
    jobs: int = 2
    seeds: tuple[int, ...] = (1, 2, 3)
    budget: str = "full"
    out: Path = Path("out/train-slew")

    @property
    def tiny(self) -> bool:
        """Seconds in place of minutes, to see that all of it runs."""
        return self.budget == "tiny"

    def variants(self, data: Data) -> tuple[str, ...]:
        """What is trained and fitted on `data`: less, if the recordings lack channels."""
        if data.lacking:
            return (self.recipe, FIRST_ORDER)
        if self.ablation:
            return (*RECIPES, ENSEMBLE, *REFERENCES)
        wanted = (MEMBERS, ENSEMBLE) if self.recipe == ENSEMBLE else (self.recipe,)
        return tuple(dict.fromkeys((PROPOSED.name, *wanted, *REFERENCES)))

    @property
    def without(self) -> tuple[str, ...]:
        """What the recordings may lack for this recipe."""
        alone = not self.ablation and self.recipe in RECIPES
        return tuple(group for group in GROUPS if alone and not getattr(RECIPES[self.recipe], group))

    @property
    def marker(self) -> str:
        """The name of its table in a document: of the ablation, the traces, or the machine."""
        machine = "ablation" if self.machine == "nominal" else self.machine.replace(":", "-")
        return f"slew-{'traces' if self.traces else machine}"

    @property
    def command(self) -> str:
        """What makes it again."""
        where = " --traces" if self.traces else "".join(f" {p}" for p in self.data)
        what = " --ablation" if self.ablation else f" --recipe {self.recipe}"
        machine = (
            "" if self.data or self.traces or self.machine == "nominal" else f" --machine {self.machine}"
        )
        tiny = " --budget tiny" if self.tiny else ""
        seeds = f" --seeds {len(self.seeds)} --seed {self.seeds[0]}"
        return f"slewright train slew{where}{what}{machine}{tiny}{seeds}"


def run(options: Options, report: Report) -> dict[str, Any]:
    """Train, judge, write OUT/NAME.npz and OUT/report.html; returns the figures.

    Raises InputError for unknown names or recordings that cannot be learned from, before anything is trained.
    """
    _check(options)
    data = _data(options, report)
    outcomes = _outcomes(data, options, report)
    figures = ablation.table(outcomes, data)
    chosen = _chosen(figures, outcomes, options)
    networks = {o.variant: _with_meta(o, figures, data, options) for o in _best(outcomes)}
    network = networks[chosen.variant]
    doubt = _doubt(network, data)
    paths = _write(networks, chosen.variant, figures, data, options)
    shutil.rmtree(_kept(data, options))
    accepted, notes = _judged(figures, chosen, network, data, paths, doubt)
    return {
        "source": data.source,
        "data_sha256": data.sha256,
        "minutes": {split: round(data.minutes(split), 2) for split in ("train", "validation", "test")},
        "command": options.command,
        "seeds": list(options.seeds),
        "chosen": {"variant": chosen.variant, "seed": chosen.seed, "weights": str(paths[0])},
        "paper": FEATURES,
        "disagreement": doubt,
        "variants": figures,
        "accepted": accepted,
        "notes": notes,
    }


def reproduce(path: Path, options: Options, report: Report) -> dict[str, Any]:
    """Train the model at `path` again as it says it was made, and compare its figures within their noise."""
    meta = SlewNetwork.load(path).meta
    for key in ("recipe", "seeds", "source", "data_sha256", "figures", "noise", "machine", "budget"):
        if key not in meta:
            raise InputError(f"{path} does not say how it was made: no '{key}'")
    if not (options.data or meta.get("traces") or page.SIMULATED in meta["source"]):
        raise InputError(
            f"{path} was trained on {meta['source']}: name these recordings after --reproduce FILE"
        )
    again = replace(
        options, recipe=meta["recipe"], seeds=tuple(meta["seeds"]), machine=meta["machine"],
        budget=meta["budget"], traces=bool(meta.get("traces")), ablation=False,
    )  # fmt: skip
    found = run(again, report)
    lines, good = [], True
    if found["data_sha256"] != meta["data_sha256"]:  # closed-loop gains may differ by the processor
        lines.append(
            f"other recordings: SHA-256 {meta['data_sha256'][:12]}… then, {found['data_sha256'][:12]}… now"
        )
    for key, old in meta["figures"].items():
        new = found["variants"][meta["recipe"]][key]
        inside = abs(new - old) <= meta["noise"][key]
        good &= inside
        verdict = "the same" if inside else "DIFFERENT"
        lines.append(f"{key}: {old:.3f} then, {new:.3f} now, noise {meta['noise'][key]:.3f}: {verdict}")
    return {**found, "accepted": good, "notes": lines, "reproduced": good}


def _check(options: Options) -> None:
    if options.recipe not in (*RECIPES, ENSEMBLE):
        raise InputError(f"no recipe '{options.recipe}'; {nearest(options.recipe, (*RECIPES, ENSEMBLE))}")
    if options.budget not in BUDGETS:
        raise InputError(f"no budget '{options.budget}'; {nearest(options.budget, BUDGETS)}")
    if not options.ablation and options.recipe in RECIPES and not exportable(RECIPES[options.recipe]):
        raise InputError(
            f"recipe {options.recipe} has another interface than the paper's networks: only --ablation "
            "shows it"
        )
    if options.traces and options.data:
        raise InputError("--traces and DATA exclude each other")
    _check_folder(options.out)


def _check_folder(out: Path) -> None:
    """InputError for a folder that could not be made or written to, before minutes of training."""
    there = next(p for p in (out, *out.absolute().parents) if p.exists())
    if not there.is_dir():
        raise InputError(f"--out {out}: {there} is no folder")
    if not os.access(there, os.W_OK):
        raise InputError(f"--out {out}: the folder {there} cannot be written to")


def _data(options: Options, report: Report) -> Data:
    if options.traces:
        return of_traces()
    if options.data:
        return load(options.data, options.without)
    plan = load_plan(Path(PLAN[options.budget]))
    folder = Path("out/collect") / f"{plan.name}-{options.machine.replace(':', '-')}"
    collect(plan, folder, options.machine, (), report)
    return load([folder])


def _outcomes(data: Data, options: Options, report: Report) -> list[Outcome]:
    variants = options.variants(data)
    names = ablation.trained(variants)
    total = sum(1 if v in REFERENCES else len(options.seeds) for v in names) + (ENSEMBLE in variants)
    found: list[Outcome] = []
    report("training", 0, total)
    for outcome in ablation.run(
        data, variants, options.seeds, options.jobs, _kept(data, options), options.tiny
    ):
        found.append(outcome)
        report("training", len(found), total)
    order = {name: i for i, name in enumerate(variants)}
    return sorted(found, key=lambda o: (order[o.variant], o.seed))


def _kept(data: Data, options: Options) -> Path:
    """Where the outcomes of an unfinished training on these recordings are."""
    return options.out / f".unfinished-{data.sha256[:16]}-{options.budget}-{VERSION}"


def _chosen(figures: Mapping[str, Any], outcomes: Sequence[Outcome], options: Options) -> Outcome:
    """The best variant on validation (or the one asked for), of it the best seed on validation."""
    able = {o.variant: o for o in _best(outcomes)}
    fit = [name for name in able if name == ENSEMBLE or whole(RECIPES[name])]
    name = ablation.winner(figures, fit) if options.ablation else options.recipe
    return able[name]


def _best(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Of each variant that can be plain weights, the best seed on validation."""

    def cost(outcome: Outcome) -> float:
        kept = outcome.scores["validation"]
        return kept.velocity_mae * kept.position_mae

    able = [o for o in outcomes if o.network is not None]
    return [
        min((o for o in able if o.variant == v), key=cost) for v in dict.fromkeys(o.variant for o in able)
    ]


def _with_meta(chosen: Outcome, figures: Mapping[str, Any], data: Data, options: Options) -> SlewNetwork:
    if chosen.network is None:
        raise RuntimeError("no weights")
    entry = figures[chosen.variant]
    own = {k: getattr(chosen.scores["test"], k) for k in KEYS}
    meta = {
        "recipe": chosen.variant, "seed": chosen.seed, "seeds": list(options.seeds), "budget": options.budget,
        "machine": options.machine, "traces": options.traces, "version": VERSION,
        "command": replace(options, recipe=chosen.variant, ablation=False).command,
        "source": data.source, "data_sha256": data.sha256, "figures": {k: entry[k] for k in KEYS},
        "own_figures": own, "noise": {k: entry["noise"][k] for k in KEYS},
    }  # fmt: skip
    if len(chosen.network.velocity) > 1:
        meta["disagreement_limit"] = disagreement.limit(chosen.network, ablation.held_out(data, "validation"))
    return replace(chosen.network, meta=meta)


def _doubt(network: SlewNetwork, data: Data) -> dict[str, float]:
    """What an ensemble's disagreement says of the held-out windows; nothing for a single pair."""
    above = network.meta.get("disagreement_limit")
    if above is None:
        return {}
    return disagreement.figures(network, ablation.held_out(data, "test"), above) | {"limit": above}


def _in_words(doubt: Mapping[str, float]) -> list[str]:
    if not doubt:
        return []
    return [
        f"members disagree by more than {doubt['limit']:.2f} °/s in {100 * doubt['share_warned']:.0f} % of "
        f"the windows: error there {doubt['error_warned']:.2f} °/s, elsewhere {doubt['error_others']:.2f} °/s"
    ]


def _write(
    networks: Mapping[str, SlewNetwork], name: str, figures: Mapping[str, Any], data: Data, options: Options
) -> list[Path]:
    options.out.mkdir(parents=True, exist_ok=True)
    for variant, network in networks.items():
        network.save(options.out / f"{variant}.npz")
    facts = [
        ("Trained on", f"{data.minutes('train'):.0f} min"), ("Held out", f"{data.minutes('test'):.0f} min"),
        ("From", data.source), ("Chosen", name), ("Command", options.command),
    ]  # fmt: skip
    shown = page.Shown(figures, data, name, networks[name], facts)
    return [options.out / f"{name}.npz", page.write_page(options.out / "report.html", shown)]


def _judged(
    figures: Mapping[str, Any],
    chosen: Outcome,
    network: SlewNetwork,
    data: Data,
    paths: Sequence[Path],
    doubt: Mapping[str, float],
) -> tuple[bool, list[str]]:
    """Whether the paper's networks are as much better than the plain reference as they should be."""
    name = PROPOSED.name if PROPOSED.name in figures else chosen.variant
    reference, own = figures[FIRST_ORDER], figures[name]
    ratios = [own[k] / reference[k] for k in KEYS]
    outside = share_outside(network, ablation.held_out(data, "test"))
    notes = [
        f"{name} / first_order: velocity {ratios[0]:.2f}, position {ratios[1]:.2f} (limit {ACCEPTED_RATIO})",
        f"chosen on validation: {chosen.variant}, seed {chosen.seed}; "
        f"{100 * outside:.1f} % of held-out time outside its training data",
        *_in_words(doubt),
        *(f"written: {path}" for path in paths),
    ]
    return bool(np.max(ratios) <= ACCEPTED_RATIO), notes


def markdown(figures: Mapping[str, Any]) -> str:
    """The variants' figures as a Markdown table with the command that makes it."""
    lines = [
        f"`{figures['command']}` makes this table, from: {figures['source']}.",
        "",
        "| variant | velocity [°/s] | 95 % | position [°] | 95 % | ratio | ratio | seeds |",
        "|---|--:|---|--:|---|---|---|--:|",
    ]
    for name, entry in figures["variants"].items():
        cells = [name]
        for key in KEYS:
            low, high = entry["ci95"][key]
            cells += [f"{entry[key]:.2f}", f"{low:.2f} … {high:.2f}"]
        ratios = entry.get("ratio_to_proposed", {})
        for one in (ratios.get(key) for key in KEYS):
            cells.append(f"{one['ratio']:.2f} ({one['ci95'][0]:.2f} … {one['ci95'][1]:.2f})" if one else "")
        lines.append(f"| {' | '.join([*cells, str(entry['seeds'])])} |")
    return "\n".join([*lines, "", *(f"- {note}" for note in figures["notes"] if "written" not in note), ""])
