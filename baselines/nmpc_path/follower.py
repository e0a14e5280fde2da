"""The follower: estimate each tick, plan every fifth, send the first inputs of the plan."""

from collections.abc import Mapping
from functools import cache
from types import SimpleNamespace

import casadi as ca
import numpy as np

from baselines.following.arrival import Arrival, of_path
from baselines.nmpc import estimator, prediction, solver
from baselines.nmpc.estimator import CHANNELS, PERIOD, WAY
from baselines.nmpc_path import cost
from baselines.nmpc_path.field import Field
from baselines.nmpc_path.sensed import ACTING, BELIEVED, ESTIMATOR
from baselines.planning.path import TICK_S, Path
from fmus.equations import kinematics
from fmus.toolchain.discrete import DiscreteStepper
from specs import parameters
from specs.errors import InputError
from specs.scene import Scene

STAGE_TICKS = round(solver.STAGE_S / TICK_S)
ROWS = [prediction.STATES.index(name) for name in cost.POSE]


def pace() -> dict[str, float]:
    """Planning parameters of its own: since it damps the swing, it may start and brake harder."""
    known = parameters.load("nmpc_path")
    return {name: known[f"nmpc_{name}"].value for name in ("path_slew_share", "path_swing")}


class Predictive:
    """Follows paths by model predictive control in a scene; `gains` differ from the parameters' file."""

    def __init__(self, scene: Scene, gains: Mapping[str, float] | None = None):
        known = {name: p.value for name, p in parameters.load("nmpc_path").items()} | dict(gains or {})
        self._p = SimpleNamespace(**{name.removeprefix("nmpc_path_"): value for name, value in known.items()})
        self._field = Field(scene)
        self._stepper = DiscreteStepper(ESTIMATOR)
        self._known = [v.name for v in ESTIMATOR.inputs]
        self._sent = np.zeros((len(CHANNELS), WAY))
        self._plan = np.zeros(solver.SIZE)
        self._ahead, self._load = prediction.rest(0.0, 0.0), 0.0
        self._way = np.empty((0, 4))  # slew angle, radius and height of the arm tip, slew speed at each tick
        self._tick = self._now = 0  # since the path began; since the first step, as the scene does
        self._arrival = Arrival()

    def begin(self, path: Path) -> None:
        """Follow this path."""
        self._tick = 0
        self._arrival.begin(of_path(path))
        radius, height = kinematics.arm_tip(path.angles[:, 1], path.angles[:, 2], kinematics.geometry())
        self._way = np.stack([path.angles[:, 0], radius, height, path.rates[:, 0]], axis=1)

    def step(self, sensors: Mapping[str, float]) -> dict[str, float]:
        """Commands after one tick more."""
        if not len(self._way):
            raise InputError("a follower needs a path before its first step")
        sensed = {**sensors, **dict(zip((v.name for v in ACTING), self._sent[:, 0], strict=True))}
        for k, name in enumerate(self._known):
            self._stepper.u[k] = sensed.get(name, 0.0)
        self._stepper.advance()
        wanted = self._planned() if self._tick % PERIOD == 0 else self._sent[:, -1]
        self._tick, self._now = self._tick + 1, self._now + 1
        self._arrival.watch(sensors)
        self._sent = np.column_stack([self._sent[:, 1:], wanted])
        joystick = _tools().joystick(wanted[0], self._stepper.state("band"))
        return {"u_slew": float(joystick), "qd_boom_ref": float(wanted[1]), "qd_stick_ref": float(wanted[2])}

    @property
    def ended(self) -> bool:
        """As `Arrival` has it."""
        return self._arrival.ended

    def foreseen(self) -> np.ndarray:
        """The states (stages, 13) that the present plan leads to."""
        return np.array(_tools().rolled(self._ahead, self._plan, self._load)).T

    def _planned(self) -> np.ndarray:
        """The first inputs of a better plan; at rest where none can be made."""
        tools = _tools()
        now = np.array([self._stepper.state(v.name) for v in BELIEVED])
        self._load = self._stepper.state("load")
        self._ahead = np.array(tools.ahead(now, self._sent.ravel(), self._load)).ravel()
        self._plan = np.array(tools.shifted(self._plan)).ravel()
        plan, _, _ = tools.solve(self._ahead, self._plan, self._sent[:, -1], self._told(self.foreseen()))
        found = np.array(plan).ravel()
        self._plan = found if np.all(np.isfinite(found)) else np.zeros(solver.SIZE)
        return np.array(solver.inputs(self._plan, 0)).ravel()

    def _told(self, states: np.ndarray) -> np.ndarray:
        """What each stage is told (`cost.SIZE`, stages)."""
        p, stages = self._p, solver.STAGES
        ticks = self._arrival.tick + WAY + STAGE_TICKS * np.arange(1, stages + 1)
        way = self._way[np.minimum(ticks, len(self._way) - 1)]
        times = TICK_S * (self._now - self._arrival.tick + ticks)
        last = np.arange(stages) == stages - 1
        poses = states[:, ROWS]
        distances, slopes = self._field.planes(poses, times)
        constant = p.keep - distances + np.einsum("nkj,nj->nk", slopes, poses)
        planes = np.concatenate([constant[:, :, None], slopes], axis=2)
        return np.vstack(
            [
                np.full(stages, self._load),
                way[:, 0], way[:, 1], way[:, 2], way[:, 3],
                np.where(last, p.end_place, p.place),
                np.where(last, p.end_speed, 0.0),
                np.where(last, p.end_tool, p.tool),
                np.where(last, p.end_tool, 0.0),
                np.full(stages, p.near),
                planes.reshape(stages, -1).T,
            ]
        )  # fmt: skip


@cache
def _tools() -> SimpleNamespace:
    """CasADi functions of the plan."""
    now, sent, load = ca.MX.sym("now", estimator.NX), ca.MX.sym("sent", 3 * WAY), ca.MX.sym("load")  # type: ignore[call-arg]
    plan, opening, band = ca.MX.sym("plan", solver.SIZE), ca.MX.sym("opening"), ca.MX.sym("band")  # type: ignore[call-arg]
    stage, states, x = solver.stage(), [], now
    for k in range(solver.STAGES):
        x = stage.roll(x, solver.inputs(plan, k), load)
        states.append(x)
    ramp = SimpleNamespace(nmpc_ramp=parameters.load("nmpc")["nmpc_ramp"].value)
    return SimpleNamespace(
        ahead=ca.Function("ahead", [now, sent, load], [estimator.ahead(now, sent, load)]),
        rolled=ca.Function("rolled", [now, plan, load], [ca.horzcat(*states)]),
        shifted=ca.Function("shifted", [plan], [solver.shifted(plan)]),
        joystick=ca.Function("joystick", [opening, band], [estimator.joystick(opening, band, ramp)]),
        solve=solver.solver(cost.of_path()),
    )
