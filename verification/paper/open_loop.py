"""Figures 2 and 3: 40 s of the slew model on its own predictions; arm and tool as the boom moves."""

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from fmus.models.slew_nn.network import PERIOD_S
from records.paper import OPEN_LOOP_S, TRUSTED_S
from records.record import Record
from records.report.picture import Panel
from specs.scenario import TICK_S, load as load_scenario
from verification.dossier import svg
from verification.dossier.markdown import table
from verification.paper.asked import WHERE, Asked, plant
from verification.paper.drives import assembled, driven
from verification.paper.made import COLUMNS, Made
from verification.plants import plant as plants
from verification.plants.plant import Plant

SETTLE_S = 2.0  # before time 0, at rest
SAMPLES = round(PERIOD_S / TICK_S)
JOYSTICK = 0.5
BOOM_RATE = 0.1  # rad/s
ARM_S, HELD_S = 20.0, 4.0
COLORS = {"nominal": svg.ORANGE, "published": svg.TEAL, "networks": svg.BLUE, "reference": "#1d2730"}
LABELS = {**WHERE, "networks": "our slew networks", "reference": f"{WHERE['reference']} (dashed)"}
Curves = Mapping[str, np.ndarray]
SLEW = ("true_q_slew", "true_qd_slew", "qd_slew")
ARM = ("true_qd_boom", "true_q_tool_x", "true_q_tool_y")


def trapezoid(time: np.ndarray) -> np.ndarray:
    """The reference of Fig. 2: up in 1.5 s, held 4.5 s, down in 1.5 s, 0.5 s at rest, then the other way."""
    phase = time % 8.0
    shape = np.clip(np.minimum(phase, 7.5 - phase) / 1.5, 0.0, 1.0)
    return JOYSTICK * np.where(time % 16.0 < 8.0, shape, -shape) * (time >= 0.0)


def _drive(
    chosen: Plant, u: Callable[[np.ndarray], Curves], seconds: float, columns: Iterable[str]
) -> Record:
    """A run from rest in the start pose of the scenarios, empty grab."""
    time = np.arange(round((SETTLE_S + seconds) / TICK_S)) * TICK_S - SETTLE_S
    start = load_scenario("four_targets_empty").parameters(1)
    return driven(chosen, assembled(chosen), u(time), start, tuple(columns), seed=1)


def _sampled(record: Record, column: str) -> np.ndarray:
    """A column each 0.1 s from time 0 on."""
    return record.column(column)[round(SETTLE_S / TICK_S) :: SAMPLES]


def prediction(asked: Asked) -> Made:
    """Fig. 2."""
    on = {**{column: plant(column) for column in COLUMNS}, "networks": plants.find("networks")}
    asked.report("40 s open loop")
    runs = {
        name: _drive(one, lambda t: {"u_slew": trapezoid(t)}, OPEN_LOOP_S, SLEW) for name, one in on.items()
    }
    # Networks predict the encoder's speed, which is late; the nominal drive the true one.
    late, true = (np.degrees(_sampled(runs["reference"], name)) for name in ("qd_slew", "true_qd_slew"))
    speeds = {name: np.degrees(_sampled(run, "true_qd_slew")) for name, run in runs.items()}
    errors = {name: _errors(speeds[name], true if name == "nominal" else late) for name in runs}
    errors["reference"] = errors.pop("networks")  # the model that was made of the reference machine
    found = {
        c: {**errors[c], "model": "our slew networks" if c == "reference" else WHERE[c]} for c in COLUMNS
    }
    head = ("prediction of the machine", "speed, 10 s, °/s", "angle, 10 s, °", "speed, 40 s", "angle, 40 s")
    text = table(
        head,
        [[found[c]["model"], *(f"{found[c][k]:.2f}" for k in errors["nominal"])] for c in COLUMNS[::-1]],
    )  # fmt: skip
    paper = {"seconds": OPEN_LOOP_S, "trusted_s": TRUSTED_S, "reference": "trapezoidal"}
    return Made(paper, **found, text=text, pictures={"open-loop-40-s.svg": _prediction_picture(speeds)})


def _errors(speed: np.ndarray, measured: np.ndarray) -> dict[str, float]:
    """Mean absolute errors of speed and angle (its running sum), over the trusted time and all of it."""
    off = speed - measured
    angle, rows = np.cumsum(off) * PERIOD_S, round(TRUSTED_S / PERIOD_S)
    return {
        "velocity_mae": float(np.abs(off[:rows]).mean()), "position_mae": float(np.abs(angle[:rows]).mean()),
        "velocity_mae_40": float(np.abs(off).mean()), "position_mae_40": float(np.abs(angle).mean()),
    }  # fmt: skip


def _prediction_picture(speeds: Curves) -> str:
    time = np.arange(len(speeds["reference"])) * PERIOD_S
    angles = {name: np.cumsum(speed) * PERIOD_S for name, speed in speeds.items()}
    rows = [
        ("Joystick", "1", {"joystick": trapezoid(time)}),
        ("Slew speed", "°/s", speeds),
        ("Slew angle", "°", angles),
    ]
    return _stacked("40 s open loop from rest, arm at rest, empty grab (simulated)", time, rows)


def _stacked(title: str, time: np.ndarray, rows: Iterable[tuple[str, str, Curves]]) -> str:
    """Panels over one time axis, and what the lines are."""
    rows, parts = list(rows), [svg.text(24, 24, title, weight=600, size=15)]
    names = list(dict.fromkeys(n for _, _, curves in rows for n in curves if n in LABELS))
    parts.append(svg.legend(24, 46, [(COLORS[n], LABELS[n]) for n in names]))
    for number, (what, unit, curves) in enumerate(rows):
        low, high = (f(min(v.min() for v in curves.values()), max(v.max() for v in curves.values()))
                     for f in (lambda a, b: a, lambda a, b: b))  # fmt: skip
        room = 0.06 * max(high - low, 1e-6)
        span = (float(low - room), float(high + room))
        panel = Panel(76, 84 + 190 * number, 800, 140, (0.0, float(time[-1])), span)
        parts.append(svg.axes(panel, f"{what} [{unit}]", "time [s]" if number == len(rows) - 1 else ""))
        parts += [_curve(panel, time, name, values) for name, values in curves.items()]
    return svg.document(900, 84 + 190 * len(rows) + 10, title, parts)


def _curve(panel: Panel, time: np.ndarray, name: str, values: np.ndarray) -> str:
    dash = "5 3" if name == "reference" else ""
    return svg.line(panel, time, values, COLORS.get(name, svg.GREY), dash=dash)


def arm_and_tool(asked: Asked) -> Made:
    """Fig. 3: how the boom follows its reference, and how the tool swings out after it."""
    asked.report("arm and tool")
    runs = {c: _drive(plant(c), lambda t: {"qd_boom_ref": _boom(t)}, ARM_S, ARM) for c in COLUMNS}
    boom = {c: _sampled(run, "true_qd_boom") for c, run in runs.items()}
    swing = {c: np.degrees(_swing(run)) for c, run in runs.items()}
    time = np.arange(len(boom["nominal"])) * PERIOD_S
    found = {c: _traits(runs[c]) for c in COLUMNS}
    text = table(
        ("plant", "boom at 63 % of its reference after s", "swing: period s", "share left a period later"),
        [[WHERE[c], *(f"{v:.2f}" for v in found[c].values())] for c in COLUMNS],
    )
    rows = [
        ("Boom rate, its reference grey", "rad/s", {"wanted": _boom(time), **boom}),
        ("Tool pitch from where it hangs", "°", swing),
    ]
    picture = _stacked("Boom reference of 0.1 rad/s for 4 s, empty grab (simulated)", time, rows)
    paper = {"arm": "first order with delay", "tool": "damped pendulum, decoupled x and y"}
    return Made(paper, **found, text=text, pictures={"arm-and-tool.svg": picture})


def _boom(time: np.ndarray) -> np.ndarray:
    return -BOOM_RATE * ((time >= 0.0) & (time < HELD_S))


def _swing(record: Record) -> np.ndarray:
    """Tool pitch [rad], less where it hangs in the end."""
    pitch = _sampled(record, "true_q_tool_y")
    return pitch - pitch[-round(4.0 / PERIOD_S) :].mean()


def _traits(record: Record) -> dict[str, float]:
    rows = slice(round(SETTLE_S / TICK_S), None)
    rate = record.column("true_qd_boom")[rows]
    follows = float(np.argmax(np.abs(rate) > (1 - math.exp(-1)) * BOOM_RATE)) * TICK_S
    free = _swing(record)[round((HELD_S + 1.0) / PERIOD_S) :]
    peaks = [k for k in range(1, len(free) - 1) if free[k - 1] < free[k] >= free[k + 1] and free[k] > 0]
    period = float(np.mean(np.diff(peaks))) * PERIOD_S if len(peaks) > 1 else math.nan
    left = float(free[peaks[1]] / free[peaks[0]]) if len(peaks) > 1 else math.nan
    return {"boom_63_s": follows, "period_s": period, "left": left}
