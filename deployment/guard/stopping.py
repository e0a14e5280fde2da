"""What the machine needs to stop, against what the guard foresees: over drawn machines, loads and motions.

An episode moves the machine at random and lets go at a drawn moment.  From there the true machine must stay
in what the guard foresaw then, for neutral commands and (a tick before) for those that were sent last.  A
share is how much of a bound was used: of a joint's way to rest, of the tool's swing; 1 is the bound itself.
"""

import math
from dataclasses import dataclass

import numpy as np

from deployment.guard import draw
from deployment.guard.stand import Drive, Stand
from runtime.control import AXES
from specs.progress import Report

MOVES_S, RESTS_S = (1.0, 7.0), 7.0
TICK_S = 0.02


@dataclass(frozen=True)
class Stop:
    """One episode: what was foreseen when it was let go, and what came."""

    number: int
    measured: np.ndarray  # angles of the joints when it was let go
    foreseen: np.ndarray  # ControlCore.foreseen
    drive: Drive
    at: int  # tick

    def shares(self) -> dict[str, float]:
        """Used of each bound."""
        after = self.drive.angles[self.at :]
        found = {}
        for axis, name in enumerate(AXES):
            low, high = (
                self.measured[axis] - self.foreseen[axis],
                self.foreseen[3 + axis] - self.measured[axis],
            )
            up, down = after[:, axis].max() - self.measured[axis], self.measured[axis] - after[:, axis].min()
            found[name] = float(max(up / high, down / low))
        swing = 2.0 * np.sin(0.5 * swung(after))
        found["swing"] = float(np.max(swing) / self.foreseen[6])
        return found


def swung(angles: np.ndarray) -> np.ndarray:
    """Angle of the tool from the vertical, rad."""
    return np.arccos(np.clip(np.cos(angles[:, 3]) * np.cos(angles[:, 4]), -1.0, 1.0))


def stop(stand: Stand, number: int, seed: int, before: int = 0) -> Stop:
    """Episode `number`; foreseen `before` ticks before it is let go."""
    random = np.random.default_rng([seed, number])
    start = draw.start(random)
    at = round(random.uniform(*MOVES_S) / TICK_S)
    kind = draw.LETS_GO[number % len(draw.LETS_GO)]
    joystick, held = draw.JOYSTICKS[kind](random, at + 1), list[np.ndarray]()

    def drive(tick: int, _: Stand) -> np.ndarray:
        wanted = joystick(tick, stand) if tick < at else np.zeros(3)
        if tick == at - before:
            held.append(stand.foreseen(wanted))
            held.append(stand.image["value"][stand.joints].copy())
        return wanted

    driven = stand.drive(start, drive, at + round(RESTS_S / TICK_S), seed + number)
    return Stop(number, held[1], held[0], driven, at - before)


def study(stand: Stand, episodes: int, seed: int, report: Report) -> dict[str, object]:
    """Largest shares over the episodes, and in which of them."""
    worst: dict[str, tuple[float, int]] = {}
    for number in range(episodes):
        found = stop(stand, number, seed, before=number // 2 % 2).shares()
        for name, share in found.items():
            if not math.isnan(share):
                worst[name] = max(worst.get(name, (-1.0, 0)), (share, number))
        if number % 20 == 19:
            report("stopping", number + 1, episodes)
    return {
        "episodes": episodes,
        "seed": seed,
        "largest_share": {name: share for name, (share, _) in worst.items()},
        "in_episode": {name: number for name, (_, number) in worst.items()},
    }
