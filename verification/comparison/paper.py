"""The paper's results, as reference lines: measured on its machine, which is not ours.

Source: Spinelli et al., *Reinforcement Learning Control for Autonomous Hydraulic Material Handling Machines
with Underactuated Tools*, tables "RL Performance for Slew-only Control", "with Load Estimation vs. Human
Driver" and "without Load Estimation".  speed, tool in deg/s, overshoot in deg; error in deg (slew), m (full).
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One row; `load` as our loads are called, "" where the paper does not say."""

    task: str
    label: str
    load: str
    speed: float
    overshoot: float
    error: float
    tool: float | None


ROWS = (
    Row("slew", "paper: PI", "", 14.04, 38.10, 12.38, None),
    Row("slew", "paper: policy without history", "", 11.75, 6.42, 0.46, 36.50),
    Row("slew", "paper: policy with history", "", 14.44, 2.98, 1.43, 25.44),
    Row("full", "paper: driver", "empty", 11.12, 0.57, 0.593, 20.23),
    Row("full", "paper: inexperienced driver", "empty", 11.46, 1.49, 1.145, 21.83),
    Row("full", "paper: policy", "empty", 11.17, 7.68, 1.078, 10.49),
    Row("full", "paper: driver", "2t", 11.12, 1.55, 0.470, 12.26),
    Row("full", "paper: policy", "2t", 10.77, 8.88, 1.677, 6.47),
    Row("full", "paper: policy, load not told", "empty", 12.43, 7.79, 0.843, 11.06),
    Row("full", "paper: policy, load not told", "unknown", 11.06, 6.02, 0.727, 13.29),
)


def rows(task: str, load: str) -> list[Row]:
    """The paper's rows of a task that go beside ours with this load."""
    return [r for r in ROWS if r.task == task and r.load in ("", load)]
