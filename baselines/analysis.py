"""Linear analysis of the loops with python-control: gain, phase and delay margins at stated operating points.

Each plant is linearised where it moves steadily (a friction-locked or dead-banded joint has no linear gain):
the continuous models by their own CasADi Jacobians after a simulated run-up, the nominal arm exactly, as the
discrete system it is.  Dead times enter the frequency response as they are, without Padé.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import control
import numpy as np

from baselines.arm_velocity.model import STEP
from fmus.definition import Model
from fmus.toolchain.loader import load_model
from fmus.toolchain.stepper import Stepper

FREQUENCIES = np.geomspace(1e-2, 60.0, 1500)  # rad/s
HOLD_S = 1.5 * STEP  # a command appears one step late and is held for one: half a step on average


@dataclass(frozen=True)
class Margins:
    """Stability margins of a loop; infinite where there is no crossing."""

    gain_db: float
    phase_deg: float
    delay_s: float
    crossover_rad_s: float

    def __str__(self) -> str:
        return (
            f"gain margin {self.gain_db:.1f} dB, phase margin {self.phase_deg:.0f} deg, "
            f"delay margin {self.delay_s:.2f} s, crossover {self.crossover_rad_s:.2f} rad/s"
        )


@dataclass(frozen=True)
class Plant:
    """A linear plant around an operating point, with `dead_s` of dead time in front of or behind it."""

    system: control.StateSpace
    dead_s: float
    point: str

    @cached_property
    def response(self) -> np.ndarray:
        """Complex frequency response at FREQUENCIES."""
        s = 1j * FREQUENCIES
        return self.system(s) * np.exp(-s * self.dead_s)


def slew_plant(inertia: float, joystick: float = 0.5, run_up_s: float = 6.0) -> Plant:
    """Joystick to slew angle of the nominal drive at `inertia` (kg m2), turning with `joystick` held."""
    model = load_model("slew")
    stepper = Stepper(model)
    stepper.set(u_slew=joystick, inertia=inertia)
    stepper.advance(round(run_up_s / stepper.step_s))
    point = f"I = {inertia / 1e3:.0f} t m2, u = {joystick:g}"
    return Plant(linearise(model, stepper, "u_slew", "q_slew"), _dead_time(model, "u_slew"), point)


def joint_plant(joint: str, joystick: float = 0.45, run_up_s: float = 1.5, load: float = 0.0) -> Plant:
    """Command to measured velocity of a joint of the reference machine, moving with `joystick` held."""
    model = load_model("machine")
    stepper = Stepper(model, {"load_mass": load})
    stepper.set(**{f"u_{joint}": joystick})
    stepper.advance(round(run_up_s / stepper.step_s))
    dead = _dead_time(model, f"u_{joint}") + _parameter(model, "encoder_velocity_delay")
    point = f"{joint}, u = {joystick:g}, load {load:g} kg"
    return Plant(linearise(model, stepper, f"u_{joint}", f"qd_{joint}"), dead, point)


def linearise(model: Model, stepper: Stepper, command: str, output: str) -> control.StateSpace:
    """State space from `command` to `output` of a continuous model at the stepper's present point."""
    x, u, m, p = model.symbols
    f, h = model.f(x, u, m, p), model.h(x, u, m, p)
    column, row = model.index("inputs", command), model.index("outputs", output)
    matrices = [ca.jacobian(f, x), ca.jacobian(f, u)[:, column], ca.jacobian(h[row], x)]
    at = ca.Function("abc", [x, u, m, p], [ca.densify(matrix) for matrix in matrices])
    a, b, c = (np.array(matrix) for matrix in at(stepper.x, stepper.u, stepper.m, stepper.p))
    return control.StateSpace(a, b, c, [[0.0]])


def pi_margins(plant: Plant, gain: float, reset_rate: float) -> Margins:
    """Margins of gain (1 + reset_rate / s) around `plant`, with the hold of a 50 Hz controller."""
    s = 1j * FREQUENCIES
    loop = gain * (1 + reset_rate / s) * plant.response * np.exp(-s * HOLD_S)
    return margins(loop, FREQUENCIES)


def arm_margins(gain: float, parameters: Mapping[str, float], joint: str) -> Margins:
    """Margins of the proportional position loop around the nominal arm, in exact discrete time.

    gain dt P z^-D / ((z - 1 + P) (z - 1)): response P, delay of D steps; the command is held for one step.
    """
    omega = np.geomspace(1e-2, 0.99 * np.pi / STEP, 1500)
    response, delay = parameters[f"{joint}_response"], round(parameters[f"{joint}_delay"] / STEP)
    denominator = [*np.polymul([1, response - 1], [1, -1]), *np.zeros(delay)]
    loop = control.TransferFunction([gain * STEP * response], denominator, STEP)
    return margins(loop(np.exp(1j * omega * STEP)), omega)


def margins(loop: np.ndarray, omega: np.ndarray) -> Margins:
    """Margins nearest to instability over all crossings of a frequency response; negative: unstable."""
    phase = np.degrees(np.unwrap(np.angle(loop)))
    gain, pm, _, _, crossover, _ = control.stability_margins((np.abs(loop), phase, omega), returnall=True)
    gain_db = [20 * np.log10(g) for g in np.atleast_1d(gain)]
    crossings = list(zip(np.atleast_1d(pm), np.atleast_1d(crossover), strict=True))
    delays = [np.radians(margin) / w for margin, w in crossings]
    phase_deg, at = min(crossings, key=lambda pair: abs(pair[0]), default=(np.inf, np.nan))
    return Margins(
        gain_db=float(min(gain_db, key=abs, default=np.inf)),
        phase_deg=float(phase_deg),
        delay_s=float(min(delays, key=abs, default=np.inf)),
        crossover_rad_s=float(at),
    )


def _dead_time(model: Model, command: str) -> float:
    return _parameter(model, model.delays[command]) if command in model.delays else 0.0


def _parameter(model: Model, name: str) -> float:
    return model.parameters[model.index("parameters", name)].start
