"""`slewright calibrate arm`: response and delay of the nominal arm, from steps of the reference machine's.

The nominal model says what the arm looks like from outside its velocity controller; here it is made to look
so.  Reference steps of several sizes, both ways, empty and with 2 t; for each joint the response P and the
delay that reproduce the measured positions best (mean absolute error over two seconds, relative to the step).
"""

from typing import Any

import numpy as np

from baselines.arm_velocity.calibrate import MIDDLE
from baselines.arm_velocity.model import JOINTS
from baselines.bench import STEP_S, arm_loop
from baselines.parameter_file import update
from orchestrator.run.simulate import simulate
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs.progress import Report

STEPS = (0.05, 0.1, 0.15, -0.05, -0.1, -0.15)  # rad/s
LOADS = (0.0, 2000.0)  # kg
WAIT, LENGTH = 50, 100  # ticks before the step and of the fit
DELAYS = np.arange(5, 31)  # ticks
RESPONSES = np.arange(0.02, 1.001, 0.02)


def run(report: Report | None = None) -> dict[str, Any]:
    """Fit both joints, write specs/parameters/arm.toml; return response, delay (s), error of the fit (s)."""
    system = arm_loop()
    figures: dict[str, Any] = {}
    for number, joint in enumerate(JOINTS):
        if report:
            report(f"steps of the {joint}", number, len(JOINTS))
        responses = [step_response(system, joint, step, load) for step in STEPS for load in LOADS]
        ticks, response, error = fit(np.array(responses))
        delay = ticks * STEP_S
        found = {f"{joint}_response": response, f"{joint}_delay": delay}
        update(
            "arm", found, f"slewright calibrate arm: steps of the {joint}, reference machine, sensors only"
        )
        figures[joint] = {"response": response, "delay_s": delay, "error_s": error}
    if report:
        report("done", len(JOINTS), len(JOINTS))
    return figures | {"seed": 0}


def step_response(system: System, joint: str, step: float, load: float) -> np.ndarray:
    """Measured position [LENGTH] of `joint` after a reference step of `step` rad/s, over the step: s."""
    start = {f"machine.start_q_{j}": q for j, q in MIDDLE.items()}
    start[f"machine.start_q_{joint}"] -= 0.15 * np.sign(step)
    stimuli = Stimuli({WAIT: {f"qd_{joint}_ref": step}})
    record = simulate(system, WAIT + LENGTH, stimuli, {**start, "machine.load_mass": load})
    q = record.column(f"q_{joint}")
    return (q[WAIT + 1 :] - q[WAIT]) / step


def fit(responses: np.ndarray) -> tuple[int, float, float]:
    """(delay in ticks, response P, mean absolute error in s) of the first-order arm closest to [n, ticks]."""
    errors = {
        (delay, response): float(np.mean(np.abs(responses - model(delay, response, responses.shape[1]))))
        for delay in DELAYS.tolist()
        for response in RESPONSES.tolist()
    }
    delay, response = min(errors, key=lambda key: errors[key])
    return delay, round(response, 3), errors[delay, response]


def model(delay: int, response: float, ticks: int) -> np.ndarray:
    """Position [ticks] after a unit step of the velocity reference: closed form of fmus/models/arm, in s."""
    steps = np.maximum(0, np.arange(1, ticks + 1) - delay)
    return STEP_S * np.cumsum(1 - (1 - response) ** steps)
