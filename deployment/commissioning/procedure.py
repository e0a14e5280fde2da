"""The procedure: its steps in their order, each begun only after all before it have passed.

Whatever ends a step, the machine is brought to rest and a record is written; a failed step is the end.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from deployment.commissioning import calibration
from deployment.commissioning.bench import Bench, Check, Failed
from deployment.commissioning.operator import BEGIN, Operator
from deployment.commissioning.points import Point
from deployment.commissioning.rig import STILL, Rig
from deployment.commissioning.session import FAILED, INTERRUPTED, PASSED, Session
from deployment.commissioning.steps import (
    bus,
    imus,
    margins,
    rest,
    safety,
    signs,
    stages,
    stopping,
    sway,
    tables,
    tare,
    touch,
)
from runtime.image import TICK_S
from specs.errors import InputError

REST_TICKS = 100  # of neutral commands after a step that did not pass


@dataclass(frozen=True)
class Step:
    """One step: `title` for the operator, `moves` what moves and how gently."""

    name: str
    title: str
    moves: str
    run: Callable[[Bench], None]


def _sign(axis: str) -> Step:
    run = functools.partial(signs.run, axis=axis)
    return Step(axis, f"Sign of the {axis}: valve and sensors", f"the {axis}, slowly, both ways", run)


def _stage(share: float) -> Step:
    run = functools.partial(stages.run, share=share)
    title = f"Automatic operation at {share:.0%} of speed and rate"
    return Step(
        f"authority-{share * 100:.0f}", title, f"slew, {stages.TURN_DEG[share]:g}° left and back", run
    )


STEPS = (
    Step("bus", "Bus: every message, its rate, its values", "nothing", bus.run),
    Step("safety", "Emergency stop, enabling switch, joystick, switches", "nothing", safety.run),
    Step("rest", "Sensors at rest: alive, plausible, zero", "nothing", rest.run),
    Step("imus", "IMUs turned by hand", "nothing", imus.run),
    *(_sign(axis) for axis in ("slew", "boom", "stick")),
    Step("stopping", "Enabling switch let go, and a silent controller", "the slew, slowly", stopping.run),
    Step(
        "tables",
        "Dead bands and velocity tables of the arm",
        "boom, then stick, all of their way",
        tables.run,
    ),
    Step("sway", "Period of the tool", "slew and stick, a push each", sway.run),
    Step("tare", "Load zero", "boom and stick, to four poses", tare.run),
    Step(
        "margins",
        "Dead band, gain and delay of the slew, and the controller's margins on it",
        "the slew, slowly, to and fro",
        margins.run,
    ),
    Step("touch", "Known points touched by hand", "all axes, by the operator, slowly", touch.run),
    *(_stage(share) for share in stages.TURN_DEG),
)
NAMES = tuple(step.name for step in STEPS)
WIRING = (
    "bus",
    "safety",
    "rest",
    "imus",
    "slew",
    "boom",
    "stick",
    "stopping",
)  # those that find a wrong wire


@dataclass(frozen=True)
class Outcome:
    """What a step came to."""

    step: Step
    verdict: str
    checks: list[Check]
    found: dict[str, Any]
    seconds: float  # of machine time

    @property
    def failures(self) -> list[Check]:
        """The checks that failed."""
        return [c for c in self.checks if not c.passed]


def find(name: str) -> Step:
    """A step by its name; InputError with all of them."""
    if name not in NAMES:
        raise InputError(f"no step '{name}'; valid, in this order: {', '.join(NAMES)}")
    return STEPS[NAMES.index(name)]


def check_before(session: Session, step: Step) -> None:
    """InputError unless all steps before `step` have passed."""
    for earlier in NAMES[: NAMES.index(step.name)]:
        if not session.passed(earlier):
            record = session.record(earlier)
            said = record["verdict"] if record else "not done"
            raise InputError(f"step {step.name} refuses to start: step {earlier} is {said}; it comes first")


def perform(
    step: Step, rig: Rig, operator: Operator, session: Session, points: tuple[Point, ...] = ()
) -> Outcome:
    """Do one step and record it; InputError if an earlier one has not passed.

    `points` are the known ones of step touch; without any the operator is asked for them.

    An interruption (Ctrl-C) or a failure of the rig is recorded, too, and goes on upwards.
    """
    check_before(session, step)
    session.begin(step.name)
    bench = Bench(rig, operator, session.findings(), points=points)
    verdict = INTERRUPTED
    try:
        bench.do(BEGIN, f"{step.title}. Moves: {step.moves}. Area clear? Ready?")
        step.run(bench)
        verdict = PASSED
    except Failed:
        verdict = FAILED
    finally:
        _come_to_rest(bench, verdict)
        seconds = (rig.tick - bench.begun) * TICK_S
        content = {"seconds": seconds, **bench.as_dict()}
        session.write(step.name, verdict, content, rig.since(bench.begun))
    for name, text in bench.files.items():
        session.put(name, text)
    if verdict == PASSED:
        calibration.write(session)
    return Outcome(step, verdict, bench.checks, bench.found, seconds)


def _come_to_rest(bench: Bench, verdict: str) -> None:
    """Neutral by the gate's ramp, and all authority taken away: each step that moves limits it anew."""
    bench.neutral()
    rig = bench.rig
    rig.bus.muted = False
    rig.ask_for({})
    rig.limit(STILL)
    if verdict != PASSED:
        rig.step(REST_TICKS)
