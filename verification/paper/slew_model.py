"""Tables I to III: the data that the slew model is trained on, its networks, and what each input gives.

A stored training (`slew_ablation.json`) stands in the place of one where nothing is trained.  It is the item
that `slewright reproduce slew_ablation --json FILE` writes.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.models.slew_nn.network import SlewNetwork
from learning.collection import manifest
from learning.slew import ablation
from learning.slew.data import Data
from learning.slew.description import PLACES
from learning.slew.score import predictor, score
from records.paper import DATA, DATA_MINUTES, FEATURES, LAYERS, TRUSTED_S
from verification.dossier.markdown import table
from verification.paper.asked import HERE, WHERE, Asked
from verification.paper.drives import data, recordings
from verification.paper.made import COLUMNS, Made, filled, plus_minus
from verification.plants.plant import MODELS

PERIODIC, DRIVING, CLOSED_LOOP = DATA
KINDS = {
    PERIODIC: ("steps", "sines", "trapezoids", "random_references"),
    DRIVING: ("driving",),
    CLOSED_LOOP: ("closed_loop",),
}
STORED = HERE / "slew_ablation.json"
SHIPPED = {"as shipped": "slew_nn", "the authors' networks": "slew_published"}  # row -> model with weights
SCALES = {"u": (1.0, "joystick, 1"), "p_l": (1e-5, "chamber pressure, bar"),
          "omega": (180.0 / np.pi, "slew speed, °/s"), "inertia": (1e-3, "slew inertia, t m²")}  # fmt: skip
KEYS = ("velocity_mae", "position_mae")
NOTE = (
    "Mean absolute errors of 10 s on held-out recordings, means of {} seeds; ±: half of the 95 % interval, "
    "recordings and seeds drawn again; in brackets over *proposed*."
)


def split(asked: Asked) -> Made:
    """Table I: minutes of each kind, and mean and deviation of what was recorded."""
    _, entries = manifest.read(recordings(asked, "reference"))
    train = [entry for _, entry in entries if entry["split"] == "train"]
    minutes = {
        part: sum(e["seconds"] for e in train if e["kind"] in kinds) / 60 for part, kinds in KINDS.items()
    }
    total = sum(minutes.values())
    ours = {part: {"percent": 100 * m / total, "minutes": m} for part, m in minutes.items()}
    paper = {part: {"percent": p, "minutes": m} for part, (p, m) in DATA.items()}
    reference = {"parts": ours, "minutes": total, "statistics": _of_data(data(asked, "reference"))}
    published = {"statistics": _of_network(SlewNetwork.load(MODELS / "slew_published" / "weights.npz"))}
    return Made(
        {"parts": paper, "minutes": DATA_MINUTES}, None, published, reference,
        text=f"{_parts(paper, ours, total)}\n\n{_statistics(published, reference)}",
    )  # fmt: skip


def _parts(paper: Mapping[str, Any], ours: Mapping[str, Any], total: float) -> str:
    rows = [
        [
            part,
            f"{p['percent']}",
            f"{p['minutes']}",
            f"{ours[part]['percent']:.0f}",
            f"{ours[part]['minutes']:.0f}",
        ]
        for part, p in paper.items()
    ]
    rows.append(["total", "100", str(DATA_MINUTES), "100", f"{total:.0f}"])
    return table(("data", "paper %", "paper min", "ours %", "ours min"), rows)


def _statistics(published: Mapping[str, Any], reference: Mapping[str, Any]) -> str:
    rows = [
        [
            label,
            *(
                f"{found['statistics'][name][k]:.2f}"
                for found in (published, reference)
                for k in ("mean", "std")
            ),
        ]
        for name, (_, label) in SCALES.items()
    ]
    head = ("training data", "authors' mean", "deviation", "ours, mean", "deviation")
    return table(head, rows)


def _of_network(network: SlewNetwork) -> dict[str, dict[str, float]]:
    """Mean and deviation of the data that a network was trained on, as its inputs are scaled."""
    net, found = network.pressure[0], {}
    for name, (scale, _) in SCALES.items():
        at = [i for i, (channel, _) in enumerate(PLACES) if channel == name]
        found[name] = {
            "mean": scale * float(net.mean_in[at].mean()),
            "std": scale * float(net.std_in[at].mean()),
        }
    return found


def _of_data(of: Data) -> dict[str, dict[str, float]]:
    """The same of recordings, each also mirrored, as they are trained on."""
    found = {}
    for name, (scale, _) in SCALES.items():
        both = [getattr(m, name) for t in of.train for m in (t, t.mirrored())]
        values = scale * np.concatenate(both)
        found[name] = {"mean": float(values.mean()), "std": float(values.std())}
    return found


def networks(asked: Asked) -> Made:
    """Table II: layers, of the paper, of the networks that its authors published, and of ours."""
    found = {}
    for column, model in (("nominal", "slew_nn"), ("published", "slew_published")):
        network = SlewNetwork.load(MODELS / model / "weights.npz")
        pair = {"pressure": network.pressure[0].sizes, "velocity": network.velocity[0].sizes}
        found[column] = {"layers": pair, "members": len(network.velocity)}
    rows = []
    for name, layers in LAYERS.items():
        ours = [found[column]["layers"][name] for column in ("published", "nominal")]
        rows.append([name, *("→".join(map(str, sizes)) for sizes in (layers, *ours))])
    head = ("network", "paper", "the authors' published networks", "ours (`slew_nn`)")
    return Made({"layers": LAYERS}, **found, text=table(head, rows, right=()))


def features(asked: Asked) -> Made:
    """Table III: what pressures and inertia give, 10 s open loop; trained here, or as stored."""
    found = _trained(asked) if asked.effort.training else json.loads(STORED.read_text(encoding="utf-8"))
    found = {column: dict(found[column]) for column in COLUMNS}
    judged = ablation.held_out(data(asked, "reference"), "test")
    for name, model in SHIPPED.items():
        network = SlewNetwork.load(MODELS / model / "weights.npz")
        scored = score(predictor(network), judged)
        found["reference"][name] = {key: getattr(scored, key) for key in KEYS}
    return Made({"horizon_s": TRUSTED_S, **FEATURES}, **found, text=_features(found))


def _trained(asked: Asked) -> dict[str, dict[str, Any]]:
    """column -> variant -> figures; a training that was ended goes on."""
    found, tiny = {}, asked.effort.training == "tiny"
    for column in COLUMNS:
        of, seeds = data(asked, column), range(1, asked.effort.seeds + 1)
        kept = asked.out / "train" / f"slew-{column}-{of.sha256[:12]}-{asked.effort.training}"
        outcomes = []
        for outcome in ablation.run(of, tuple(FEATURES), tuple(seeds), asked.workers, kept, tiny):
            outcomes.append(outcome)
            asked.report(f"training slew models on {column}", len(outcomes), len(FEATURES) * len(seeds))
        order = sorted(outcomes, key=lambda o: (tuple(FEATURES).index(o.variant), o.seed))
        found[column] = ablation.table(order, of)
    return found


def _features(found: Mapping[str, Mapping[str, Any]]) -> str:
    rows, columns = [], {"paper": FEATURES, **{WHERE[column]: found[column] for column in COLUMNS}}
    for name in (*FEATURES, *SHIPPED):
        cells = [_cell(column, name, key) for column in columns.values() for key in KEYS]
        rows.append([name.replace("_", " "), *cells])
    head = [f"{what} {unit}" for what in columns for unit in ("°/s", "°")]
    seeds = min(cell["seeds"] for cell in found["reference"].values() if "seeds" in cell)
    return f"{filled(NOTE.format(seeds))}\n\n{table(['features', *head], rows)}"


def _cell(column: Mapping[str, Any], name: str, key: str) -> str:
    """The error, half of its interval where it has one, and its ratio to that of the proposed features."""
    if name not in column:
        return "–"
    value, proposed = column[name][key], column["proposed"][key]
    ratio = "" if name == "proposed" or name in SHIPPED else f" (×{value / proposed:.2f})"
    ends = column[name].get("ci95", {}).get(key)
    return f"{value:.2f}{plus_minus(ends and (ends[1] - ends[0]) / 2)}{ratio}"
