"""The paper's results, shown beside ours for context.

Spinelli et al., Reinforcement Learning Control for Autonomous Hydraulic Material Handling Machines with
Underactuated Tools, tables "RL Performance for Slew-only Control", "… with Load Estimation vs. Human Driver"
and "… without Load Estimation". All were measured on the real machine.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperRow:
    """One row of the paper's tables."""

    group: str
    name: str
    speed: float  # °/s
    overshoot: float  # °
    error: float
    error_unit: str  # m for the full task, ° for slew-only
    tool: float | None  # °/s


SLEW, LOAD_KNOWN, LOAD_UNKNOWN = "Slew only", "Full task, load estimated", "Full task, load not estimated"
ROWS = (
    PaperRow(SLEW, "PI control", 14.04, 38.10, 12.38, "°", None),
    PaperRow(LOAD_KNOWN, "Driver, 15 years", 11.12, 0.57, 0.593, "m", 20.23),
    PaperRow(LOAD_KNOWN, "Driver, 1–2 years", 11.46, 1.49, 1.145, "m", 21.83),
    PaperRow(LOAD_KNOWN, "Learned controller", 11.17, 7.68, 1.078, "m", 10.49),
    PaperRow(LOAD_KNOWN, "Driver, with load", 11.12, 1.55, 0.470, "m", 12.26),
    PaperRow(LOAD_KNOWN, "Learned controller, with load", 10.77, 8.88, 1.677, "m", 6.47),
    PaperRow(LOAD_UNKNOWN, "Learned controller, empty", 12.43, 7.79, 0.843, "m", 11.06),
    PaperRow(LOAD_UNKNOWN, "Learned controller, robust", 11.06, 6.02, 0.727, "m", 13.29),
)
