"""Where the traces can be trusted: their asymmetry and their trend with inertia, over joystick and speed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from fmus.models.slew import evidence, features, fit, traces
from fmus.models.slew.traces import PERIOD, Trace
from records.report.picture import Panel
from specs import parameters as parameter_specs
from specs.progress import Report
from verification.dossier import svg
from verification.dossier.markdown import chapter, number, picture, table
from verification.dossier.section import Section

INERTIAS = (250e3, 400e3, 550e3, 700e3)  # kg m2
COMMANDS = (0.2, 0.35, 0.5, 0.7, 1.0)
# Half the mirror difference of the settled speed beyond which a step says little: absolute or of the speed.
DOUBT_DEG_S, DOUBT_SHARE = 1.0, 0.1
SPEED_BINS = (0.0, 5.0, 10.0, 20.0, 30.0, 40.0, 55.0)  # °/s
COMMAND_BINS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 1.01)
INERTIA_CAPTION = (
    "Left: speed before the release over inertia, traces (dots; bars: the two directions) and model (lines). "
    "Right: friction torque of the traces at that speed, D Δp − I ω̇; one curve would be expected."
)
MAP_CAPTION = (
    "Half the mirror difference of the slew speed [°/s]. Left: steps before the release. Right: all traces "
    "up to 550 t m²; in brackets: error of the model, both directions averaged; empty: too few samples."
)
FEW = 20  # samples in a cell below which nothing is said about it


@dataclass(frozen=True)
class Settled:
    """A pair of mirrored steps in the second before the release."""

    inertia: float  # kg m2
    command: float
    speed_deg_s: tuple[float, float]  # positive and negative command, both turned positive
    torque_knm: float  # motor torque less what accelerates the carriage, mean of both
    model_deg_s: float

    @property
    def speed(self) -> float:
        """Mean of both directions, °/s."""
        return sum(self.speed_deg_s) / 2

    @property
    def half(self) -> float:
        """Half the difference of the directions, °/s."""
        return abs(self.speed_deg_s[0] - self.speed_deg_s[1]) / 2

    @property
    def doubtful(self) -> bool:
        """Whether the directions differ too much to say what the speed is."""
        return self.half > max(DOUBT_DEG_S, DOUBT_SHARE * self.speed)


def section(report: Report) -> Section:
    """Maps of the mirror difference, and the settled speed over the inertia."""
    report("where the traces can be trusted")
    known = traces.load()
    steps = settled(known)
    cells = speed_map(known)
    figures = {
        "settled": [_as_dict(s) for s in steps],
        "command_falls": falling(steps),
        "speed_map": cells,
        "asymmetry": evidence.asymmetry(known),
    }
    pictures = {"trust-inertia.svg": _inertia_picture(steps), "trust-map.svg": _map_picture(steps, cells)}
    title = "Where the traces cannot be trusted"
    return Section("trust", title, _text(steps, figures), figures, pictures)


def settled(known: Mapping[str, Trace]) -> list[Settled]:
    """All pairs of steps, by inertia and command."""
    drive = parameter_specs.parameter("slew_displacement", "slew").value
    found = []
    for inertia in INERTIAS:
        for command in COMMANDS:
            name = f"step_{round(100 * command):03d}_I{round(inertia / 1e3)}"
            pair = [known[name], known[name + traces.MIRROR]]
            runs = fit.simulate(pair)
            model = [features.features(t.time[t.first :], runs[t.name].qd, runs[t.name].q) for t in pair]
            ends = [_end(t, drive) for t in pair]
            speeds = (ends[0][0], ends[1][0])
            torque = (ends[0][1] + ends[1][1]) / 2
            found.append(Settled(inertia, command, speeds, torque, features.mean(model).speed_deg_s))
    return found


def _end(trace: Trace, displacement: float) -> tuple[float, float]:
    """Speed (°/s) and friction torque (kN m) of a step in its last second, turned positive."""
    rows = (trace.time > features.RELEASE_AT - 1 + 1e-6) & (trace.time < features.RELEASE_AT + 1e-6)
    sign = np.sign(trace.u_slew[rows][0])
    gain = np.gradient(trace.qd, PERIOD)[rows].mean()
    torque = displacement * (trace.p_a - trace.p_b)[rows].mean() - trace.inertia * gain
    return float(np.degrees(sign * trace.qd[rows].mean())), float(sign * torque / 1e3)


def falling(steps: Sequence[Settled]) -> list[dict[str, float]]:
    """Where more joystick gives less speed."""
    found = []
    for one, more in pairwise(steps):
        if one.inertia == more.inertia and more.speed < one.speed:
            found.append(
                {
                    "inertia_kg_m2": one.inertia,
                    "command": more.command,
                    "less_by_deg_s": one.speed - more.speed,
                }
            )
    return found


def speed_map(known: Mapping[str, Trace]) -> list[dict[str, Any]]:
    """Half mirror difference and model error of the speed by |joystick| and |speed|, up to 550 t m2."""
    pairs = [
        (t, known[t.partner]) for t in known.values() if t.partner > t.name and t.inertia < traces.UNPHYSICAL
    ]
    runs = fit.simulate([t for pair in pairs for t in pair])
    rows = [_samples(one, other, runs) for one, other in pairs]
    command, speed, half, error = (np.concatenate(c) for c in zip(*rows, strict=True))
    cells = []
    for u in pairwise(COMMAND_BINS):
        for w in pairwise(SPEED_BINS):
            here = (command >= u[0]) & (command < u[1]) & (speed >= w[0]) & (speed < w[1])
            cells.append(_cell(u, w, half[here], error[here]))
    return cells


def _samples(one: Trace, other: Trace, runs: Mapping[str, Any]) -> tuple[np.ndarray, ...]:
    rest = slice(one.first + 1, None)
    mean = (one.qd - other.qd)[rest] / 2  # the mirrored trace has the other sign
    half = np.abs(one.qd + other.qd)[rest] / 2
    errors = (runs[one.name].qd - runs[other.name].qd)[1:] / 2 - mean
    return np.abs(one.u_slew[rest]), *(np.degrees(np.abs(v)) for v in (mean, half, errors))


def _cell(u: svg.Span, w: svg.Span, half: np.ndarray, error: np.ndarray) -> dict[str, Any]:
    known = len(half) >= FEW
    return {
        "command": list(u),
        "speed_deg_s": list(w),
        "samples": len(half),
        "half_difference_deg_s": float(half.mean()) if known else None,
        "model_mae_deg_s": float(error.mean()) if known else None,
    }


def _as_dict(s: Settled) -> dict[str, Any]:
    return {
        "inertia_kg_m2": s.inertia,
        "command": s.command,
        "speed_deg_s": s.speed,
        "half_difference_deg_s": s.half,
        "doubtful": s.doubtful,
        "friction_torque_knm": s.torque_knm,
        "model_speed_deg_s": s.model_deg_s,
    }


def _text(steps: Sequence[Settled], figures: Mapping[str, Any]) -> str:
    full = [s for s in steps if s.command == max(COMMANDS)]
    cells = figures["speed_map"]
    known = [c for c in cells if c["half_difference_deg_s"] is not None]
    worst = max(known, key=lambda c: c["half_difference_deg_s"])
    columns = ("speed [°/s]", *(f"u = {u:g}" for u in COMMANDS))
    return chapter(
        "trust",
        doubt_deg_s=f"{DOUBT_DEG_S:g}",
        doubt_share=f"{100 * DOUBT_SHARE:.0f} %",
        settled=table(columns, _speed_rows(steps)),
        doubtful=", ".join(f"{s.command:g} at {s.inertia / 1e3:.0f} t m²" for s in steps if s.doubtful)
        or "none",
        speed_first=number(full[0].speed, 1),
        torque_first=number(full[0].torque_knm, 0),
        speed_last=number(full[-1].speed, 1),
        torque_last=number(full[-1].torque_knm, 0),
        falls=_falls_text(figures["command_falls"]),
        inertia_picture=picture("trust-inertia.svg", INERTIA_CAPTION),
        empty=len(cells) - len(known),
        cells=len(cells),
        few=FEW,
        worst_command=f"{worst['command'][0]:g}–{min(worst['command'][1], 1.0):g}",
        worst_speed=f"{worst['speed_deg_s'][0]:g}–{worst['speed_deg_s'][1]:g}",
        worst_half=number(worst["half_difference_deg_s"], 1),
        map_picture=picture("trust-map.svg", MAP_CAPTION),
    )


def _falls_text(falls: Sequence[Mapping[str, float]]) -> str:
    if not falls:
        return "More joystick never gives less speed."
    where = (
        f"u = {f['command']:g} at {f['inertia_kg_m2'] / 1e3:.0f} t m² "
        f"({number(f['less_by_deg_s'], 1)} °/s slower)"
        for f in falls
    )
    return f"More joystick even gives *less* speed: {', '.join(where)}."


def _speed_rows(steps: Sequence[Settled]) -> list[list[str]]:
    rows = []
    for inertia in INERTIAS:
        here = [s for s in steps if s.inertia == inertia]
        cells = [
            f"{number(s.speed, 1)} ± {number(s.half, 1)}{' (doubtful)' if s.doubtful else ''}" for s in here
        ]
        rows.append([f"{inertia / 1e3:.0f} t m²", *cells])
    return rows


def _inertia_picture(steps: Sequence[Settled]) -> str:
    left = Panel(60, 56, 400, 270, (200.0, 750.0), (0.0, 55.0))
    right = Panel(530, 56, 400, 270, (0.0, 55.0), (0.0, 110.0))
    parts = [svg.axes(left, "Speed before the release", "inertia [t m²]", "slew speed [°/s]")]
    parts.append(svg.axes(right, "Friction torque at that speed", "slew speed [°/s]", "torque [kN m]"))
    commands = list(zip(COMMANDS, svg.COLORS, strict=True))
    for command, color in commands:
        here = [s for s in steps if s.command == command]
        xs = [s.inertia / 1e3 for s in here]
        parts.append(svg.line(left, xs, [s.model_deg_s for s in here], color))
        parts.append(svg.dots(left, xs, [s.speed for s in here], color))
        parts += [
            svg.whisker(left, x, min(s.speed_deg_s), max(s.speed_deg_s), color)
            for x, s in zip(xs, here, strict=True)
        ]
    shades = ("#8fb3d1", "#4f86b5", svg.BLUE, svg.RED)
    for inertia, color in zip(INERTIAS, shades, strict=True):
        here = [s for s in steps if s.inertia == inertia]
        parts.append(
            svg.line(right, [s.speed for s in here], [s.torque_knm for s in here], color, 1.2, "3 3")
        )
        parts.append(svg.dots(right, [s.speed for s in here], [s.torque_knm for s in here], color, 3.5))
    parts.append(svg.legend(60, 24, [(c, f"u = {u:g}") for u, c in commands]))
    parts.append(
        svg.legend(530, 24, [(c, f"{i / 1e3:.0f} t m²") for i, c in zip(INERTIAS, shades, strict=True)])
    )
    return svg.document(960, 375, "Settled speed and friction over inertia", parts)


def _map_picture(steps: Sequence[Settled], cells: Sequence[Mapping[str, Any]]) -> str:
    left = Panel(80, 46, 330, 240, (0.0, float(len(INERTIAS))), (0.0, float(len(COMMANDS))))
    right = Panel(500, 46, 430, 240, (0.0, len(SPEED_BINS) - 1.0), (0.0, len(COMMAND_BINS) - 1.0))
    inertias = {i + 0.5: f"{v / 1e3:.0f}" for i, v in enumerate(INERTIAS)}
    commands = {i + 0.5: f"{v:g}" for i, v in enumerate(COMMANDS)}
    parts = [svg.axes(left, "Steps, last second", "inertia [t m²]", "|joystick|", inertias, commands)]
    speeds = {float(i): f"{v:g}" for i, v in enumerate(SPEED_BINS)}
    bins = {float(i): f"{min(v, 1.0):g}" for i, v in enumerate(COMMAND_BINS)}
    parts.append(
        svg.axes(right, "All traces up to 550 t m²", "|slew speed| [°/s]", "|joystick|", speeds, bins)
    )
    for s in steps:
        i, k = INERTIAS.index(s.inertia), COMMANDS.index(s.command)
        parts.append(_tile(left, i, k, s.half, None))
    for n, c in enumerate(cells):
        k, i = divmod(n, len(SPEED_BINS) - 1)
        if c["half_difference_deg_s"] is not None:
            parts.append(_tile(right, i, k, c["half_difference_deg_s"], c["model_mae_deg_s"]))
    return svg.document(960, 335, "Asymmetry of the traces", parts)


def _tile(panel: Panel, i: int, k: int, value: float, below: float | None) -> str:
    """One coloured cell with its number, and a second one below in brackets."""
    drawn = svg.box(panel, (i + 0.02, i + 0.98), (k + 0.03, k + 0.97), svg.shade(value / 5.0))
    x, y = panel.at_x(i + 0.5), panel.at_y(k + 0.5)
    ink = "#fff" if value > 3.0 else "#1d2730"
    if below is None:
        return drawn + svg.text(x, y + 4, number(value, 1), anchor="middle", fill=ink)
    drawn += svg.text(x, y - 1, number(value, 1), anchor="middle", fill=ink)
    return drawn + svg.text(x, y + 13, f"({number(below, 1)})", anchor="middle", fill=ink, size=10)
