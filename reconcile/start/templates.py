"""Model files to start from: states, signals, parameters and equations by template, and their text."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from reconcile.start.headings import roles_named

ESTIMATED = "estimated from the recording by least squares"
SCALED = "estimated from the recording by least squares, in proportion to the inertia above, which is a guess"
GUESS = "a guess: the recording does not tell it in this way; put in what you know"
LOOSE = {ESTIMATED: 2.0, SCALED: 2.0, GUESS: 10.0}  # tolerances: the first two without the effects that lack
TEMPLATES = ("rotary", "linear", "pendulum", "first-order", "chain", "free")


@dataclass(frozen=True)
class Quantity:
    """A parameter: start value, limits, and where the value comes from; `tolerance` relative, if known."""

    name: str
    unit: str
    description: str
    start: float
    low: float | None
    high: float | None
    source: str
    tolerance: float | None = None


@dataclass
class Draft:
    """What a model.py is written from; signals are (name, unit, description)."""

    title: str
    states: list[tuple[str, str, str]] = field(default_factory=list)
    inputs: list[tuple[str, str, str]] = field(default_factory=list)
    outputs: list[tuple[str, str, str]] = field(default_factory=list)
    parameters: list[Quantity] = field(default_factory=list)
    rates: dict[str, str] = field(default_factory=dict)
    out: dict[str, str] = field(default_factory=dict)
    sine: bool = False
    moves: str = ""  # a state that is a speed, whatever its unit: a force moves it


@dataclass(frozen=True)
class Motion:
    """Units of an axis that turns or moves along a line."""

    position: str
    velocity: str
    force: str
    inertia: str
    friction: str
    stiffness: str
    noun: str
    named: str


TURNS = Motion("rad", "rad/s", "N.m", "kg.m2", "N.m.s/rad", "N.m/rad", "torque", "inertia")
MOVES = Motion("m", "m/s", "N", "kg", "N.s/m", "N/m", "force", "mass")


def per(unit: str, of: str) -> str:
    """Unit of a gain: `unit` for one `of`."""
    if of in ("", "1"):
        return unit
    numerator, _, below = unit.partition("/")
    return f"{numerator}/({below}.{of})" if below else f"{unit}/{of}"


def axis(
    draft: Draft, kind: Motion, has: Sequence[str], drive: str | None, pendulum: bool, offset: str = ""
) -> None:
    """One axis; `has`: which of position and velocity are recorded; `drive`: unit of what drives it.

    `offset`: the command at which it does nothing: a middle as of a servo's pulses, or where the axis is.
    """
    if "position" in has or pendulum:
        draft.states.append(("q", kind.position, "Position"))
        draft.rates["q"] = "x.v"
    draft.states.append(("v", kind.velocity, "Speed"))
    for name, state, unit in (("position", "q", kind.position), ("velocity", "v", kind.velocity)):
        if name in has:
            draft.outputs.append((name, unit, "Recorded " + name))
            draft.out[name] = "x." + state
    draft.sine = pendulum
    if drive == kind.force:
        draft.inputs.append((kind.noun, kind.force, f"Recorded {kind.noun}"))
        gravity = " - p.gravity_torque * sin(x.q)" if pendulum else ""
        draft.rates["v"] = f"(u.{kind.noun}{gravity} - p.friction * x.v) / p.{kind.named}"
        return
    if drive is not None:
        draft.inputs.append(("command", drive, "Recorded command"))
    command = f"(u.command - {offset})" if offset else "u.command"
    terms = [f"p.gain * {command}"] if drive is not None else []
    if pendulum:
        terms.append("-p.gravity / p.length * sin(x.q)")
    elif drive is None:
        terms.append("p.acceleration")
    draft.rates["v"] = " + ".join([*terms, "-p.damping * x.v"]).replace("+ -", "- ")


def chain(draft: Draft, kind: Motion, recorded: Sequence[Sequence[str]], driven: Sequence[bool]) -> None:
    """Inertias in a row, joined by springs and dampers; the first and the last end are free."""
    n = len(recorded)
    for i in range(1, n + 1):
        draft.states += [(f"q{i}", kind.position, f"Position {i}"), (f"v{i}", kind.velocity, f"Speed {i}")]
        for name, state in (("position", "q"), ("velocity", "v")):
            if name in recorded[i - 1]:
                unit = kind.position if state == "q" else kind.velocity
                draft.outputs.append((f"{name}{i}", unit, f"Recorded {name} {i}"))
                draft.out[f"{name}{i}"] = f"x.{state}{i}"
        if driven[i - 1]:
            draft.inputs.append((f"{kind.noun}{i}", kind.force, f"Recorded {kind.noun} {i}"))
        terms = [f"u.{kind.noun}{i}"] if driven[i - 1] else []
        terms += [f"-p.friction{i} * x.v{i}"]
        if i > 1:
            terms += [_joined(i - 1, "-")]
        if i < n:
            terms += [_joined(i, "")]
        draft.rates |= {
            f"q{i}": f"x.v{i}",
            f"v{i}": f"({' + '.join(terms).replace('+ -', '- ')}) / p.{kind.named}{i}",
        }


def _joined(i: int, sign: str) -> str:
    j = i + 1
    return f"{sign}(p.stiffness{i} * (x.q{j} - x.q{i}) + p.damping{i} * (x.v{j} - x.v{i}))"


def free(draft: Draft, outputs: Sequence[tuple[str, str]], inputs: Sequence[tuple[str, str]]) -> None:
    """One state an output, linear in itself and in the inputs: to be replaced by the equations known."""
    draft.inputs += [(n, u, "Recorded input") for n, u in inputs]
    for name, unit in outputs:
        draft.states.append(("x_" + name, unit, "State " + name))
        draft.outputs.append((name, unit, "Recorded " + name))
        draft.out[name] = f"x.x_{name}"
        terms = [f"p.pull_{name}", f"-p.decay_{name} * x.x_{name}"]
        terms += [f"p.gain_{name}_{n} * u.{n}" for n, _ in inputs]
        draft.rates["x_" + name] = " + ".join(terms).replace("+ -", "- ")


def first_order(draft: Draft, output: tuple[str, str], drive: tuple[str, str] | None) -> None:
    """T x' = gain u + offset - x; a speed in volts or counts is moved by forces as any other is."""
    name, unit = output
    state = "x_" + name
    draft.states, draft.outputs = [(state, unit, "State")], [(name, unit, "Recorded " + name)]
    draft.out[name] = f"x.{state}"
    if drive:
        draft.inputs.append((drive[0], drive[1], "Recorded input"))
    gain = f"p.gain * u.{drive[0]} + " if drive else ""
    draft.rates[state] = f"({gain}p.offset - x.{state}) / p.time_constant"
    draft.moves = state if "velocity" in roles_named(name) else ""


def text(draft: Draft, name: str, step: float, notes: Sequence[str], number: Callable[[float], str]) -> str:
    """The model.py of a draft."""
    plain = {s: re.sub(r"\b[xup]\.", "", e) for s, e in draft.rates.items()}
    equations = "\n".join(f"{s}' = {e}" for s, e in plain.items())
    lines = [f'"""{draft.title}', "", equations, '"""', ""]
    lines += [f"# {n}" for n in notes] + [""] * bool(notes)
    lines += ["from casadi import sin", ""] if draft.sine else []
    lines += ["from fmus.definition import Model, Variable", "", "", "def rates(x, u, m, p):", "    return {"]
    lines += [f'        "{s}": {e},' for s, e in draft.rates.items()] + ["    }", "", ""]
    lines += ["def outputs(x, u, m, p):", "    return {"]
    lines += [f'        "{s}": {e},' for s, e in draft.out.items()] + ["    }", "", ""]
    lines += ["MODEL = Model(", f'    name="{name}",', f'    description="{draft.title}",']
    lines += ['    kind="continuous",', f"    step={number(step)},"]
    for group in ("states", "inputs", "outputs"):
        rows = [f'        Variable("{n}", "{u}", "{d}"),' for n, u, d in getattr(draft, group)]
        lines += [f"    {group}=(", *rows, "    ),"] if rows else [f"    {group}=(),"]
    lines += [
        "    # start: what you believe; min, max: what is possible at all; tolerance: how well you know it.",
        "    # 0.02 is a relative standard deviation of 2 % about start; 10 says that it may well be eleven",
        "    # times as large or small. State a small one for what you know.",
        "    parameters=(",
    ]
    for q in draft.parameters:
        limits = "".join(f", {k}={number(v)}" for k, v in (("min", q.low), ("max", q.high)) if v is not None)
        tolerance = q.tolerance or LOOSE.get(q.source)
        known = f", tolerance={number(tolerance)}" if tolerance else ""
        lines += [f"        # {q.source}"]
        values = f"start={number(q.start)}{limits}{known}"
        lines += [f'        Variable("{q.name}", "{q.unit}", "{q.description}", {values}),']
    lines += ["    ),", "    rhs=rates,", "    out=outputs,", ")"]
    if draft.moves:
        lines += ["", "# A speed: friction and loads are looked for. Delete it where no force moves this."]
        lines += [f'PORTS = {{"axis": {{"velocity": "{draft.moves}"}}}}']
    return "\n".join([*lines, ""])
