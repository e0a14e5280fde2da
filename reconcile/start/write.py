"""`--init DIR`: a first model.py and map.toml from a recording and a template."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from reconcile.reporting import target
from reconcile.start import templates, values
from reconcile.start.columns import WANTED, Column, columns_of, currents_out
from reconcile.start.headings import ENDINGS, is_of
from reconcile.start.notes import names_table, notes_on
from reconcile.start.templates import MOVES, TURNS, Draft, Motion
from reconcile.start.values import Drive, si
from records.formats import read_measurement
from records.formats.text.clock import UNTIMED
from specs.errors import InputError
from specs.units import known

TO_AND_FRO = 4  # times that what swings freely crosses its middle
FAR_OFF = 2.0  # of its own spread, from which the middle of a command is no accident
NEAR_NOTHING = 0.1  # of that middle: a command as small is none


def start(recording: Path, out: Path, template: str | None = None, dof: int | None = None) -> list[str]:
    """Write DIR/model.py and DIR/map.toml; returns what was chosen and why, in sentences."""
    if template is not None and template not in templates.TEMPLATES:
        raise InputError(f"--template {template}: valid: {', '.join(templates.TEMPLATES)}")
    if dof is not None and (template not in (None, "chain") or dof < 1):
        raise InputError("--dof N goes with --template chain, N from 1 on")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} is there and not empty; name a new folder for --init")
    measured = read_measurement(recording)
    columns = columns_of(measured, recording)
    usable = [c for c in columns if not c.constant]
    if not usable:
        raise InputError(f"{recording}: every column keeps one value, so there is nothing to model")
    said = []
    if template is None:
        template, why = ("chain", f"--dof {dof}") if dof else _pick(usable, recording)
        said.append(f"template {template}: {why}")
    draft, used = _draft(template, dof, usable, recording)
    notes = notes_on(columns, used, template)
    step = _step(usable)
    name = re.sub(r"\W+", "_", out.name.lower()).strip("_") or "rig"
    name = name if name[0].isalpha() else "rig_" + name
    model = templates.text(draft, name, step, notes, "{:.6g}".format)
    with target.staged(out) as part:
        (part / "model.py").write_text(model, encoding="utf-8")
        (part / "map.toml").write_text(names_table(used), encoding="utf-8")
    if UNTIMED in measured.repairs:
        said.append(
            f"time: the file states no unit; taken as s, it has a sample every {step:g} s; "
            "--clock 'NAME [ms]' says that it is another"
        )
    said += [f"{ours}: column {c.name} ({c.reason or 'as the only one left'})" for ours, c in used.items()]
    return said + [n for n in notes if "not used" in n]


def _pick(usable: Sequence[Column], recording: Path) -> tuple[str, str]:
    """The template that the columns make plain; InputError with the valid ones where they do not."""
    moving = [c for c in usable if c.role in ("position", "velocity") and c.unit not in ("", "1")]
    turning, straight = [c for c in moving if c.turns], [c for c in moving if not c.turns]
    per_role = max((sum(c.role == r for c in moving) for r in ("position", "velocity")), default=0)
    driven = any(c.role in ("input", "setpoint") for c in usable)
    if turning and per_role == 1 and not straight and not driven and (c := _swinging(turning)):
        return "pendulum", f"column {c.name} is in {c.unit}, swings to and fro, and no column drives it"
    if per_role == 1 and bool(turning) != bool(straight):
        kind = "rotary" if turning else "linear"
        return kind, f"column {moving[0].name} is in {moving[0].unit}, and there is one axis"
    if per_role > 1 and bool(turning) != bool(straight):
        return "chain", f"there are {per_role} axes ({', '.join(c.name for c in moving)})"
    others = [c for c in usable if c.role in ("other", "output")]
    others = others or [c for c in usable if driven and not c.role]
    if not moving and len(others) == 1:
        unit = f", in {others[0].unit}" if others[0].unit else ""
        return "first-order", f"{others[0].name} is the one output{unit}"
    listed = ", ".join(f"{c.name} [{c.unit or 'no unit'}]" for c in usable[:8])
    raise InputError(
        f"{recording}: the columns {listed} do not tell which template fits; "
        f"say --template {' | '.join(templates.TEMPLATES)}; {ENDINGS}"
    )


def _swinging(turning: Sequence[Column]) -> Column | None:
    """The angle that goes to and fro about one place twice at least, by more than a tenth of the way."""
    for c in turning:
        away = c.values - np.median(c.values)
        far = away[np.abs(away) > 0.1 * np.max(np.abs(away))]
        if c.role == "position" and np.count_nonzero(np.diff(np.sign(far))) >= TO_AND_FRO:
            return c
    return None


def _draft(
    template: str, dof: int | None, usable: Sequence[Column], recording: Path
) -> tuple[Draft, dict[str, Column]]:
    if template in ("rotary", "linear", "pendulum"):
        return _axis(template, usable, recording)
    if template == "chain":
        return _chain(dof, usable, recording)
    return _other(template, usable, recording)


def _first(usable: Sequence[Column], role: str, kind: Motion, joint: int | None = None) -> Column | None:
    wanted = {"position": kind.position, "velocity": kind.velocity}.get(role)
    for c in usable:
        fits = wanted is None or not c.unit or c.turns == (kind is TURNS)
        if c.role == role and fits and (joint is None or c.joint == joint):
            return c
    return None


def _axis(template: str, usable: Sequence[Column], recording: Path) -> tuple[Draft, dict[str, Column]]:
    kind = MOVES if template == "linear" else TURNS
    usable = [_swung(c) for c in usable] if template == "pendulum" else usable
    found = {r: c for r in ("position", "velocity") if (c := _first(usable, r, kind))}
    if not found:
        listed = ", ".join(f"{c.name} [{c.unit or 'no unit'}]" for c in usable[:8])
        raise InputError(
            f"{recording} has no position or speed in {kind.position} or the like; it has {listed}; "
            "put the unit into the heading, as in 'angle [deg]', or name another --template"
        )
    used = dict(found)
    drive = _first(usable, "input", kind) or _left(usable, found, kind)
    follows = drive is not None and _follows(drive, found, kind)
    unit = kind.position if follows else None if drive is None else _drive_unit(drive, kind)
    if drive is not None:
        used[kind.noun if unit == kind.force else "command"] = drive
    titles = {"rotary": "A drive that turns", "linear": "A drive along a line", "pendulum": "A pendulum"}
    draft = Draft(titles[template])
    driven = None if drive is None or unit is None else _drive(drive, unit, kind, follows)
    offset = "x.q" if follows else "p.neutral" if driven is not None and driven.middle is not None else ""
    templates.axis(draft, kind, list(found), unit, template == "pendulum", offset)
    draft.parameters = values.axis(template, kind, found, driven)
    return draft, used


def _swung(column: Column) -> Column:
    """A column without a unit that swings by more than a turn if it is in rad: it is in degrees."""
    if column.unit or not np.ptp(column.values) > 2.0 * np.pi or not _swinging([column]):
        return column
    return replace(column, unit="deg", reason="guessed: in rad it would swing by more than a turn")


def _left(usable: Sequence[Column], found: Mapping[str, Column], kind: Motion) -> Column | None:
    """The only column left, where it measures another kind of motion: a beam's angle moves a ball."""
    rest = [c for c in usable if all(c is not f for f in found.values()) and c.role != "setpoint"]
    if len(rest) != 1 or rest[0].role not in ("position", "velocity") or rest[0].turns == (kind is TURNS):
        return None
    text = "guessed: nothing else is left that could drive it"
    return replace(rest[0], role="input", reason=text)


def _follows(drive: Column, found: Mapping[str, Column], kind: Motion) -> bool:
    """Whether it is a wanted value of the position that is recorded: what drives is how far that is off."""
    position = found.get("position")
    if position is None or drive.reason != WANTED:
        return False
    return is_of(drive.unit, kind.position) or (not drive.unit and not position.unit)


def _drive(drive: Column, unit: str, kind: Motion, follows: bool) -> Drive:
    """The column as what drives an axis, with the command at which it does nothing."""
    return Drive(drive, unit, None if follows else _middle(drive, unit, kind), follows)


def _middle(drive: Column, unit: str, kind: Motion) -> float | None:
    """Median of a command that moves about a value far from nothing; None of others and of forces.

    Where it comes near to nothing as well, as a step does, the machine rests there.
    """
    commands = si(drive, unit)
    middle = float(np.median(commands))
    rests = float(np.min(np.abs(commands))) < NEAR_NOTHING * abs(middle)
    far = abs(middle) > FAR_OFF * float(np.std(commands)) and not rests
    return middle if unit != kind.force and far else None


def _drive_unit(drive: Column, kind: Motion) -> str:
    """Unit of the input in the model: a force where its unit or name is one."""
    name = drive.name.lower()
    words = ("torque", "tau", "moment", "nm") if kind is TURNS else ("force", "kraft")
    if drive.unit in ("N", "kN", "N.m") or (not drive.unit and any(w in name for w in words)):
        return kind.force
    return _model_unit(drive.unit)


def _model_unit(unit: str) -> str:
    """A unit in which models of other quantities are written: no percent, no zero but the natural one."""
    for wanted in ("rad", "rad/s", "m", "m/s", "N", "N.m", "Pa", "V", "A", "K", "1"):
        if is_of(unit, wanted):
            return wanted
    return unit if known(unit) else "1"


def _chain(dof: int | None, usable: Sequence[Column], recording: Path) -> tuple[Draft, dict[str, Column]]:
    moving = [c for c in usable if c.role in ("position", "velocity")]
    kind = TURNS if any(c.turns for c in moving) or not any(c.unit for c in moving) else MOVES
    by_role = {r: [c for c in usable if c.role == r] for r in ("position", "velocity", "input")}
    count = max(len(by_role["position"]), len(by_role["velocity"]))
    n = dof or count
    if n < 1 or count < 1 or n < count:
        raise InputError(
            f"{recording} has {count} positions or speeds, and a chain of {n} needs 1 to {n}; state --dof N"
        )
    numbered = sorted({c.joint for c in moving if c.joint is not None})
    inputs = by_role["input"]
    told = any(c.joint is not None for c in inputs)
    if numbered and not told:
        text = f"guessed: it has no number; {'it acts' if len(inputs) == 1 else 'they act'} from joint 1 on"
        inputs = [replace(c, reason=text) for c in inputs]
    used: dict[str, Column] = {}
    recorded, driven = [], []
    for i in range(1, n + 1):
        joint = numbered[i - 1] if len(numbered) == count and i <= count else None
        has = []
        for role in ("position", "velocity"):
            c = _of_joint(by_role[role], i, joint)
            if c is not None:
                used[f"{role}{i}"], _ = c, has.append(role)
        force = _of_joint(inputs, i, joint if told else None)
        if force is not None:
            used[f"{kind.noun}{i}"] = force
        recorded.append(has)
        driven.append(force is not None)
    draft = Draft(f"{n} inertias in a row, joined by springs and dampers")
    templates.chain(draft, kind, recorded, driven)
    draft.parameters = values.chain(n, kind, used)
    return draft, used


def _of_joint(columns: Sequence[Column], i: int, joint: int | None) -> Column | None:
    if joint is not None:
        return next((c for c in columns if c.joint == joint), None)
    return columns[i - 1] if i <= len(columns) else None


def _other(template: str, usable: Sequence[Column], recording: Path) -> tuple[Draft, dict[str, Column]]:
    if len(usable) == 1:  # whatever it is called
        usable = [replace(usable[0], role="output", reason="")]
    usable = currents_out(usable)
    inputs = [c for c in usable if c.role == "input"]
    outputs = [c for c in usable if c.role not in ("input", "setpoint")]
    if template == "first-order":
        outputs, inputs = _one_of_each(outputs, inputs)
    if not outputs:
        raise InputError(
            f"{recording}: no column is left as an output beside "
            f"{', '.join(c.name for c in usable if c.role in ('input', 'setpoint'))}; {ENDINGS}"
        )
    ours = {_identifier(c.name): c for c in (*outputs, *inputs)}
    names = [(n, _model_unit(c.unit), c) for n, c in ours.items()]
    ins = [(n, u) for n, u, c in names if c in inputs]
    outs = [(n, u) for n, u, c in names if c in outputs]
    draft = Draft("A plant of first order" if template == "first-order" else "Put in the equations you know")
    length = float(np.ptp(usable[0].time))
    if template == "first-order":
        templates.first_order(draft, outs[0], ins[0] if ins else None)
        draft.parameters = values.first_order(outs[0], ins[0] if ins else None, ours, length)
    else:
        templates.free(draft, outs, ins)
        draft.parameters = values.free(outs, ins, ours)
    return draft, ours


def _one_of_each(outputs: Sequence[Column], inputs: Sequence[Column]) -> tuple[list[Column], list[Column]]:
    """An output, one that its unit or name says if there is one, and what drives it, or the only one left."""
    first = sorted(outputs, key=lambda c: (not c.role, bool(c.unit) and c.role == "position"))[:1]
    left = [c for c in outputs if c not in first and not c.role]
    if not inputs and len(left) == 1:
        inputs = [replace(left[0], role="input", reason="guessed: nothing else is left that could drive it")]
    return first, list(inputs[:1])


def _identifier(name: str) -> str:
    text = re.sub(r"\W+", "_", name).strip("_").lower()
    return text if text and text[0].isalpha() else "c_" + text


def _step(usable: Sequence[Column]) -> float:
    """A step of integration: a sample, or half of one where they are rare."""
    return float(f"{min(float(np.median(np.diff(c.time))) for c in usable):.2g}")
