"""What recordings carry besides the machine: sensor noise, quanta, disturbance, jitter, noise on inputs."""

from dataclasses import dataclass

import numpy as np

from blindtest.systems.system import STEP, Signal

FACTOR = {"low": 1.0, "high": 10.0}  # times the datasheets' noise
JITTER = 5e-5  # s at low noise: standard deviation of the sampling instants
DISTURBANCE = 1e-3  # of the full drive at low noise


@dataclass(frozen=True)
class Surroundings:
    """Noise of a case.  `disturbance`: standard deviation in N.m and correlation time in s."""

    outputs: np.ndarray  # standard deviation of each output's noise
    quanta: np.ndarray
    inputs: np.ndarray  # of the noise on recorded inputs
    jitter: float  # s
    disturbance: tuple[float, float]

    def output_deviation(self, rates: np.ndarray) -> np.ndarray:
        """Deviation of each output [outputs] with quanta and jitter, given its rms rate of change."""
        return np.sqrt(self.outputs**2 + self.quanta**2 / 12.0 + (rates * self.jitter) ** 2)

    def disturb(self, samples: int, rng: np.random.Generator, count: int = 1) -> np.ndarray:
        """Coloured disturbances [samples], or [samples, count] of several, independent of each other."""
        found = [self._disturb(samples, rng) for _ in range(count)]
        return found[0] if count == 1 else np.stack(found, axis=1)

    def _disturb(self, samples: int, rng: np.random.Generator) -> np.ndarray:
        """First-order Gauss-Markov [samples]."""
        deviation, time = self.disturbance
        keep = np.exp(-STEP / time)
        white = rng.standard_normal(samples)
        found, state = np.empty(samples), white[0]
        for k in range(samples):
            state = keep * state + np.sqrt(1.0 - keep**2) * white[k]
            found[k] = state
        return deviation * found

    def disturbance_spectrum(self, samples: int, lines: int) -> np.ndarray:
        """Variance of the disturbance in each of the first orthonormal cosines of a run, [lines]."""
        deviation, time = self.disturbance
        keep = np.exp(-STEP / time)
        angle = np.pi * np.arange(lines) / samples
        return deviation**2 * (1.0 - keep**2) / (1.0 - 2.0 * keep * np.cos(angle) + keep**2)

    def measure(self, outputs: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Jitter and quanta of outputs [n, outputs] that hold their noise already."""
        rates = np.gradient(outputs, STEP, axis=0)
        moved = outputs + rates * (self.jitter * rng.standard_normal(len(outputs)))[:, None]
        quanta = np.where(self.quanta > 0, self.quanta, 1.0)
        return np.where(self.quanta > 0, np.round(moved / quanta) * quanta, moved)


def draw(
    noise: str,
    outputs: tuple[Signal, ...],
    inputs: tuple[Signal, ...],
    force: float,
    rng: np.random.Generator,
) -> Surroundings:
    """Surroundings at `noise` low or high; `force` is the full drive of the machine."""
    factor = FACTOR[noise]
    time = float(rng.uniform(0.1, 1.0))
    return Surroundings(
        outputs=np.array([factor * s.noise for s in outputs]),
        quanta=np.array([s.quantum for s in outputs]),
        inputs=np.array([factor * s.noise for s in inputs]),
        jitter=JITTER * factor,
        disturbance=(DISTURBANCE * factor * force, time),
    )
