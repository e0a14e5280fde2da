"""The paper's numbers, each once, with their place in it: measured on its machine, which is not ours.

Source: Spinelli et al., *Reinforcement Learning Control for Autonomous Hydraulic Material Handling Machines
with Underactuated Tools*.  Tables and figures are numbered in the order of the text.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A controller in Tables IV to VI; deg/s (speed, tool), deg (overshoot), deg or m (error: slew, full).

    `name` is the paper's, `label` says it in words; `load` as our loads are called, "" where the paper does
    not say.
    """

    place: str
    name: str
    label: str
    task: str
    load: str
    speed: float
    overshoot: float
    error: float
    tool: float | None

    @property
    def metrics(self) -> dict[str, float | None]:
        """The four metrics by name."""
        return {key: getattr(self, key) for key in ("speed", "overshoot", "error", "tool")}

    @property
    def told(self) -> str:
        """The row in words: "driver, 2t"."""
        return ", ".join(filter(None, (self.label, self.load)))

    @property
    def error_unit(self) -> str:
        """The unit of `error`."""
        return "°" if self.task == "slew" else "m"


SLEW_ONLY, WITH_ESTIMATE, WITHOUT_ESTIMATE = "Table IV", "Table V", "Table VI"
ROWS = (
    Row(SLEW_ONLY, "PI control", "PI", "slew", "", 14.04, 38.10, 12.38, None),
    Row(SLEW_ONLY, "No History", "policy without history", "slew", "", 11.75, 6.42, 0.46, 36.50),
    Row(SLEW_ONLY, "History", "policy with history", "slew", "", 14.44, 2.98, 1.43, 25.44),
    Row(WITH_ESTIMATE, "Driver", "driver", "full", "empty", 11.12, 0.57, 0.593, 20.23),
    Row(WITH_ESTIMATE, "Drv. Inex.", "inexperienced driver", "full", "empty", 11.46, 1.49, 1.145, 21.83),
    Row(WITH_ESTIMATE, "Controller", "policy", "full", "empty", 11.17, 7.68, 1.078, 10.49),
    Row(WITH_ESTIMATE, "Drv. Load", "driver", "full", "2t", 11.12, 1.55, 0.470, 12.26),
    Row(WITH_ESTIMATE, "Ctrl. Load", "policy", "full", "2t", 10.77, 8.88, 1.677, 6.47),
    Row(WITHOUT_ESTIMATE, "Empty", "policy, load not told", "full", "empty", 12.43, 7.79, 0.843, 11.06),
    Row(WITHOUT_ESTIMATE, "Robust", "policy, load not told", "full", "unknown", 11.06, 6.02, 0.727, 13.29),
)

# Table I, "Characteristics of the Training Set": part -> (share %, minutes); and all of it.
DATA = {"periodic and random references": (70, 56), "driving": (9, 7), "closed loop": (21, 16)}
DATA_MINUTES = 79

# Table II, "Neural Network Design Hyperparameters": network -> sizes from input to output.
LAYERS = {"pressure": (41, 128, 128, 128, 128, 32, 2), "velocity": (41, 128, 128, 128, 32, 1)}

# Table III, "Actuator Model Feature Crafting": 10 s open loop, mean absolute errors in deg/s and deg.
FEATURES = {
    "proposed": {"velocity_mae": 1.616, "position_mae": 5.707},
    "no_pressure": {"velocity_mae": 1.805, "position_mae": 6.509},
    "no_inertia": {"velocity_mae": 2.080, "position_mae": 7.517},
}

OPEN_LOOP_S = 40.0  # Fig. 2, a trapezoidal reference
TRUSTED_S = 10.0  # "a good trade-off between sufficiently long and precise"


def rows(place: str) -> list[Row]:
    """The rows of a table."""
    return [row for row in ROWS if row.place == place]


def beside(task: str, load: str) -> list[Row]:
    """The rows of a task that go beside ours with this load."""
    return [row for row in ROWS if row.task == task and row.load in ("", load)]
