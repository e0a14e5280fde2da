"""The paper's trajectory figures for a policy: four targets, and five with their circles, as SVG."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from records.metrics import compute
from records.record import read
from records.report.picture import write_picture
from specs.schema import ROOT
from verification.campaign.plan import NOMINAL, Run
from verification.campaign.run import record_path, run_campaign
from verification.comparison.plan import make_plan
from verification.evaluation.policies import question

SCENARIOS = ("four_targets", "five_targets")
LOAD = "unknown"


def draw(path: Path, out: Path, pace: float, folder: Path, report: Any = None) -> list[Path]:
    """Run both scenarios on the reference machine, load not told; `folder`/policy-SCENARIO.svg."""
    asked, _ = question(path, "validation", 1, (1.0,), (LOAD,))
    plan = make_plan(replace(asked, singles=True))
    here = next(r for r in plan.runs if r.spec["system"] == "reference" and r.spec["draw"] == NOMINAL)
    runs = tuple(_run(here, name, pace) for name in SCENARIOS)
    run_campaign(replace(plan, runs=runs, keep="all"), out, 1, None, progress=report)
    found = []
    for name, run in zip(SCENARIOS, runs, strict=True):
        record = read(record_path(out, run.key))
        m = compute(record)
        title = f"{path.name}, pace {pace:g}: {m.within_1m} and {m.within_2m} of {m.targets} in 1 and 2 m"
        picture = folder / f"policy-{name.replace('_', '-')}.svg"
        found.append(write_picture(picture, {"reference": record}, title, height=True))
    return found


def _run(like: Run, scenario: str, pace: float) -> Run:
    source = str(ROOT / "scenarios" / f"{scenario}.toml")
    spec = {**like.spec, "scenario": f"{scenario}_{LOAD}", "source": source, "pace": pace}
    return Run(f"{spec['controller']}/figure/{scenario}/{pace:g}", spec)
