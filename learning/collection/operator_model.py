"""A human operator who works from target to target with joysticks: delayed, noisy, looking ahead.

What it sees is REACTION_S old.  From that it previews, with a rough idea of the machine (its delay and how
hard it brakes, misjudged anew for each target), where the machine would come to rest if it let go now:

    rest = q + qd LOOK_AHEAD_S + |qd| qd / (2 braking)
    far from it    joystick over, as boldly as it likes, less where little is left to go
    close to it    lets go, and the machine coasts; past it: a short counter-pull; then small corrections

The hand follows with a lag and an error that grows with the deflection.  The arm is moved at the same time,
begun a little later or earlier.  At a target the operator waits a while, as when the grab is filled.
The form (reaction delay, neuromuscular lag, signal-dependent noise, preview) is that of the manual-control
literature (McRuer and Krendel, Mathematical Models of Human Pilot Behavior, AGARD AG-188, 1974); its figures
are assumed and drawn anew for each recording.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from math import copysign, exp, radians

from learning.collection.command import Command, Sample
from learning.collection.draws import Draws
from learning.collection.plan import PERIOD_S, Limits
from learning.collection.targets import Target, targets
from specs.parameters import parameter

REACTION_S = (0.15, 0.35)
LAG_S = (0.1, 0.25)  # of the hand
LOOK_AHEAD_S = 0.4  # of the reaction and the machine's own delay
BRAKING_RAD_S2 = (0.12, 0.4)  # what it believes
BOLDNESS = (0.45, 1.0)  # largest deflection for a target
SMALLEST_PULL = 0.22  # just beyond the dead band, as an operator soon finds out
FULL_PULL_RAD = radians(40.0)  # of way left for a full deflection
TOLERANCE_RAD = radians(2.5)
ARM_TOLERANCE_RAD = 0.03
STILL_RAD_S = 0.03
WAIT_S = (0.5, 3.0)
GIVE_UP_S = 15.0
TREMOR, TREMOR_SHARE, TREMOR_S = 0.01, 0.06, 0.4  # of the hand: at rest, of the deflection, how fast
ARM_GAIN = 0.8  # 1/s


@dataclass
class Intent:
    """How one target is gone for."""

    target: Target
    boldness: float
    braking: float
    arm_after_s: float
    since_s: float = 0.0
    there_s: float = 0.0


class Operator:
    """A pilot (learning/collection/command.py) that works through targets."""

    def __init__(self, draws: Draws, limits: Limits, start: tuple[float, float, float]) -> None:
        self.draws = draws
        self.targets: Iterator[Target] = targets(draws, limits, start)
        self.late: deque[Sample] = deque(maxlen=1 + round(draws.between(*REACTION_S) / PERIOD_S))
        self.keep = exp(-PERIOD_S / draws.between(*LAG_S))
        self.hand = self.tremor = 0.0
        self.arm_limit = parameter("arm_velocity_limit", "arm_velocity").value * draws.between(0.5, 1.0)
        self.intent = self._next()

    def __call__(self, period: int, seen: Sample) -> Command:
        """See `Pilot`."""
        self.late.append(seen)
        seen = self.late[0]
        self._mind(seen)
        boom, stick = self._arm(seen)
        return Command(self._move_hand(self._pull(seen)), boom, stick)

    def _next(self) -> Intent:
        draws = self.draws
        return Intent(
            next(self.targets),
            draws.between(*BOLDNESS),
            draws.between(*BRAKING_RAD_S2),
            draws.between(0.0, 3.0),
        )

    def _mind(self, seen: Sample) -> None:
        """Count the time at the target; go for the next one when it has waited there, or gives up."""
        intent = self.intent
        intent.since_s += PERIOD_S
        target = intent.target
        error = abs(target.slew - seen["q_slew"])
        arm = max(abs(target.boom - seen["q_boom"]), abs(target.stick - seen["q_stick"]))
        there = error < TOLERANCE_RAD and abs(seen["qd_slew"]) < STILL_RAD_S and arm < 2 * ARM_TOLERANCE_RAD
        if not there and intent.since_s < GIVE_UP_S:
            intent.there_s = 0.0
            return
        if intent.there_s == 0.0:
            self.wait_s = self.draws.between(*WAIT_S)
        intent.there_s += PERIOD_S
        if intent.there_s >= self.wait_s:
            self.intent = self._next()

    def _pull(self, seen: Sample) -> float:
        """Where the hand wants to be."""
        speed = seen["qd_slew"]
        way = self.intent.target.slew - seen["q_slew"]
        rest = speed * LOOK_AHEAD_S + speed * abs(speed) / (2 * self.intent.braking)
        left = way - rest
        if abs(way) < TOLERANCE_RAD and abs(left) < 2 * TOLERANCE_RAD:
            return 0.0
        if left * speed < 0.0 and abs(left) < 4 * TOLERANCE_RAD:
            return 0.0  # it coasts
        if abs(left) < TOLERANCE_RAD:
            return 0.0
        share = min(1.0, abs(left) / FULL_PULL_RAD)
        return copysign(SMALLEST_PULL + (self.intent.boldness - SMALLEST_PULL) * share, left)

    def _arm(self, seen: Sample) -> tuple[float, float]:
        target = self.intent.target
        if self.intent.since_s < self.intent.arm_after_s:
            return 0.0, 0.0
        return (
            self._reference(target.boom - seen["q_boom"]),
            self._reference(target.stick - seen["q_stick"]),
        )

    def _reference(self, error: float) -> float:
        if abs(error) < ARM_TOLERANCE_RAD:
            return 0.0
        wanted = max(-self.arm_limit, min(self.arm_limit, ARM_GAIN * error))
        return wanted * (1.0 + TREMOR_SHARE * self.draws.normal())

    def _move_hand(self, wanted: float) -> float:
        """The joystick: the hand lags behind what it wants, and is never quite still while it pulls."""
        self.hand = self.keep * self.hand + (1.0 - self.keep) * wanted
        share = exp(-PERIOD_S / TREMOR_S)
        self.tremor = share * self.tremor + (1.0 - share**2) ** 0.5 * self.draws.normal()
        if abs(self.hand) < TREMOR:
            return 0.0  # a spring holds the joystick
        return self.hand + (TREMOR + TREMOR_SHARE * abs(self.hand)) * self.tremor
