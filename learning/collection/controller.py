"""The closed loop's controller: trains a slew model from the recordings made so far and tunes gains on it.

    OUT/controller.json    the gains, what they reach on the model, and which recordings they come from

It is made again only when those recordings change.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from learning.collection.plan import Plan, Recording
from learning.collection.slew_control import Gains
from learning.collection.tuning import tune
from learning.slew.recipe import recipe
from learning.slew.trajectory import of_measurement
from records.formats import read_measurement
from records.record import read
from specs.errors import InputError
from specs.progress import Report

if TYPE_CHECKING:
    from learning.slew.recipe import Recipe

FILE = "controller.json"
EPOCHS, UNROLL, UNROLL_EPOCHS = 8, 10, 2  # about 20 s: enough for tuning, not for anything else


def learned_from(plan: Plan) -> list[Recording]:
    """The training recordings that the model is trained on: all that are made before the closed loop."""
    return [r for r in plan.recordings if r.split == "train" and r.kind != "closed_loop"]


def find(plan: Plan, out: Path, report: Report | None = None) -> dict[str, Any]:
    """The controller of `plan`'s closed loop, as its entry in the manifest; "gains" holds its gains.

    The plan's own gains if it states any; else those of OUT/controller.json if it comes from the recordings
    that are there; else they are tuned.  Raises InputError when recordings to learn from are missing.
    """
    if plan.gains:
        return {"gains": Gains.of(plan.gains).as_dict(), "from": "the plan"}
    wanted = learned_from(plan)
    missing = [r for r in wanted if not (out / f"{r.name}.parquet").is_file()]
    if missing or not wanted:
        parts = sorted({r.part for r in missing}) or ["training recordings of another kind"]
        raise InputError(f"the closed loop is tuned on a model; record first: {', '.join(parts)}")
    hashes = [read(out / f"{r.name}.parquet").run_hash for r in wanted]
    budget = [EPOCHS, UNROLL, UNROLL_EPOCHS, plan.seed]
    key = hashlib.sha256(json.dumps([hashes, budget]).encode()).hexdigest()
    before = known(out / FILE)
    if before.get("digest") == key:
        return before
    found = {"digest": key, **_tuned(plan, wanted, out, report)}
    (out / FILE).write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return found


def known(path: Path) -> dict[str, Any]:
    """What an OUT/controller.json says; empty when there is none that can be read."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) and "gains" in found else {}


def _tuned(plan: Plan, wanted: Sequence[Recording], out: Path, report: Report | None) -> dict[str, Any]:
    trajectories = [
        t for r in wanted for t in of_measurement(read_measurement(out / f"{r.name}.parquet"), r.name)
    ]
    try:
        import torch

        from learning.slew.training import train
    except ModuleNotFoundError as error:
        raise InputError(
            f"the closed loop's model needs {error.name}: install .[learning], or state [gains] in the plan"
        ) from None
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # with more, sums and so the gains could differ from run to run
    try:
        network = train(trajectories, _recipe(), plan.seed, report).network()
    finally:
        torch.set_num_threads(threads)
    found = tune(network, trajectories, plan.seed, report)
    return {
        "gains": found.gains.as_dict(),
        "from": f"tuned on a model of {len(wanted)} recordings",
        "on_the_model": {
            "settling_s": round(found.settling_s, 3),
            "overshoot_deg": round(found.overshoot_deg, 3),
            "reached": round(found.reached, 4),
        },
    }


def _recipe() -> "Recipe":
    return replace(recipe("unrolled"), epochs=EPOCHS, unroll=UNROLL, unroll_epochs=UNROLL_EPOCHS)
