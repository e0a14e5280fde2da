"""Tunes the slew controller on a trained slew model: many candidates at once, from states the machine was in.

The cross-entropy method: candidates from a normal distribution, first over all of the gains' ranges, then
over where the ELITE best of the round before lie.  The cost of a candidate is, in mean over targets and
inertias, the time to enter and stay within BAND_RAD of the target (the whole time if it does not), plus
PER_RAD for each rad of overshoot.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import radians

import numpy as np

from fmus.models.slew_nn.network import HISTORY, PERIOD_S, SlewNetwork
from learning.collection.draws import Draws
from learning.collection.slew_control import RANGES, Gains, joystick
from learning.slew.trajectory import Trajectory
from records.metrics import BAND_DEG
from specs.errors import InputError
from specs.parameters import parameter
from specs.progress import Report

BAND_RAD = radians(BAND_DEG)
PER_RAD = 20.0  # s/rad: a degree of overshoot costs 0.35 s
TRAVEL_DEG = (45.0, 90.0, 135.0)
SECONDS = 12.0
STEPS = round(SECONDS / PERIOD_S)
STARTS = 5  # states at rest, of different inertia
ROUNDS, CANDIDATES, ELITE = 5, 72, 10
REST = 0.01  # rad/s
FIGURES = 3  # significant ones of the gains: what is kept does not hang on the last bits of the training


@dataclass(frozen=True)
class Tuned:
    """The gains with what they reached on the model."""

    gains: Gains
    settling_s: float
    overshoot_deg: float
    reached: float  # share of targets


@dataclass(frozen=True)
class Starts:
    """Histories at rest [n, HISTORY] and inertias [n] from which roll-outs begin."""

    p_l: np.ndarray
    p_r: np.ndarray
    inertia: np.ndarray


def tune(
    network: SlewNetwork, trajectories: Iterable[Trajectory], seed: int, report: Report | None = None
) -> Tuned:
    """The gains of least cost; the same for the same network, trajectories and seed.

    Raises InputError when the machine never stands still for a second in the trajectories.
    """
    starts = resting(list(trajectories))
    draws = Draws("collection", seed, "gains")
    low, high = np.array(list(RANGES.values())).T
    noise = _noise(draws, len(TRAVEL_DEG) * 2 * len(starts.inertia))
    best, mean, spread = (low + high) / 2, (low + high) / 2, (high - low) / 2
    for number in range(ROUNDS):
        if report:
            report("tuning the slew controller", number, ROUNDS)
        drawn = np.array([[draws.normal() for _ in low] for _ in range(CANDIDATES)])
        tried = np.clip(np.vstack([best, mean, mean + spread * drawn]), low, high)
        elite = tried[np.argsort(_cost(*evaluate(network, starts, tried, noise)), kind="stable")[:ELITE]]
        best, mean, spread = elite[0], elite.mean(axis=0), elite.std(axis=0)
    best = np.array([float(f"{value:.{FIGURES}g}") for value in best])
    settling, overshoot = evaluate(network, starts, best[None], noise)
    reached = float((settling < SECONDS).mean())
    gains = Gains(*map(float, best))
    return Tuned(gains, float(settling.mean()), float(np.degrees(overshoot).mean()), reached)


def resting(trajectories: Sequence[Trajectory]) -> Starts:
    """STARTS histories at rest with the joystick in neutral, from light to heavy."""
    found = []
    for t in trajectories:
        still = (np.abs(t.omega) < REST) & (t.u == 0.0)
        run = np.convolve(still, np.ones(HISTORY), "valid") == HISTORY
        if run.any():
            rows = slice(int(np.argmax(run)), int(np.argmax(run)) + HISTORY)
            found.append((t.inertia[rows.stop - 1], t.p_l[rows], t.p_r[rows]))
    if not found:
        raise InputError("no recording stands still for a second: nowhere to begin a roll-out")
    found.sort(key=lambda start: start[0])
    chosen = [found[round(i)] for i in np.linspace(0, len(found) - 1, STARTS)]
    inertia, p_l, p_r = (np.array(column) for column in zip(*chosen, strict=True))
    return Starts(p_l, p_r, inertia)


def evaluate(
    network: SlewNetwork, starts: Starts, gains: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(settling time in s, overshoot in rad) [candidates, trials] of gains [candidates, 6].

    `noise` [steps, trials] is added to the speed that the controller sees, rad/s.
    """
    target = np.radians([s * d for d in TRAVEL_DEG for s in (1.0, -1.0)])
    trials = len(target) * len(starts.inertia)
    goal = np.tile(np.repeat(target, len(starts.inertia)), len(gains))
    heard = np.tile(noise, len(gains))
    angle = _roll_out(network, starts, np.repeat(gains, trials, axis=0), goal, heard)
    error = (angle - goal) * np.sign(goal)
    outside = np.abs(error) > BAND_RAD
    last = np.where(outside.any(axis=0), len(error) - np.argmax(outside[::-1], axis=0), 0)
    settling, overshoot = last * PERIOD_S, np.maximum(error.max(axis=0), 0.0)
    return settling.reshape(len(gains), trials), overshoot.reshape(len(gains), trials)


def _cost(settling: np.ndarray, overshoot: np.ndarray) -> np.ndarray:
    return (settling + PER_RAD * overshoot).mean(axis=1)


def _noise(draws: Draws, trials: int) -> np.ndarray:
    """Encoder noise of every step and trial, rad/s."""
    sd = parameter("encoder_velocity_noise", "machine").value
    return sd * np.array([[draws.normal() for _ in range(trials)] for _ in range(STEPS)])


def _roll_out(
    network: SlewNetwork, starts: Starts, gains: np.ndarray, goal: np.ndarray, noise: np.ndarray
) -> np.ndarray:
    """Angles [steps, n].  The network's speed is as late as the encoder's, and so is its sum, the angle.

    The machine's own angle is not: there the speed is older by `delay` than the angle it is used with, which
    the lead makes up for here.
    """
    delay = parameter("encoder_velocity_delay", "machine").value
    gains = gains + delay * np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    n, repeat = len(goal), len(goal) // len(starts.inertia)
    p_l, p_r = (np.tile(p, (repeat, 1)) for p in (starts.p_l, starts.p_r))
    inertia = np.tile(starts.inertia, repeat)
    u, omega = np.zeros((n, HISTORY)), np.zeros((n, HISTORY))
    q, angles = np.zeros(n), []
    for heard in noise:
        now = joystick(gains, goal, q, omega[:, -1] + heard, inertia, 1.0)
        u = np.hstack([u[:, 1:], now[:, None]])
        left, right, speed = network.predict(u, p_l, p_r, omega, inertia)
        p_l, p_r, omega = (
            np.hstack([old[:, 1:], new[:, None]]) for old, new in ((p_l, left), (p_r, right), (omega, speed))
        )
        q = q + PERIOD_S * speed
        angles.append(q)
    return np.array(angles)
