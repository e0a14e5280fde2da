"""Small models and recordings for tests of the filter, made in place."""

from collections.abc import Mapping
from pathlib import Path

import casadi as ca
import numpy as np

from fmus.definition import Model, Variable
from reconcile.equations.model import Folder
from reconcile.equations.ports import find_ports
from reconcile.filter.kalman import NOISE, SIGMA, TAU, WHITE, Kalman
from reconcile.filter.record import Record, records
from reconcile.recordings.data import Block, Run, Signal


def folder(model: Model, ports: Mapping | None = None) -> Folder:
    """A folder of a model that lies nowhere."""
    return Folder(model, find_ports(model, ports), Path(model.name))


def spring(mass: float = 2.0, drag: float = 1.5, stiffness: float = 8.0) -> Folder:
    """A carriage on a spring: linear, two states."""
    return folder(
        Model(
            name="spring",
            description="Carriage on a spring",
            kind="continuous",
            step=0.005,
            states=(Variable("x", "m", "Position"), Variable("v", "m/s", "Velocity")),
            inputs=(Variable("force", "N", "Force", min=-20.0, max=20.0),),
            outputs=(Variable("position", "m", "Position"), Variable("velocity", "m/s", "Velocity")),
            parameters=(
                Variable("mass", "kg", "Mass", start=mass, min=0.1, max=10.0),
                Variable("drag", "N.s/m", "Viscous friction", start=drag, min=0.0, max=20.0),
                Variable("stiffness", "N/m", "Spring", start=stiffness, min=0.0, max=100.0),
            ),
            rhs=lambda x, u, m, p: {
                "x": x.v,
                "v": (u.force - p.drag * x.v - p.stiffness * x.x) / p.mass,
            },
            out=lambda x, u, m, p: {"position": x.x, "velocity": x.v},
        ),
        {"v": {"velocity": "v", "position": "x", "unit": "N", "inertia": "mass", "drive": "force"}},
    )


def cooling(driven: bool = True) -> Folder:
    """A body that cools: one state, with or without a heater."""
    heater = (Variable("heat", "W", "Heater", min=0.0, max=100.0),)
    return folder(
        Model(
            name="cooling" if driven else "cooling_alone",
            description="A body that cools",
            kind="continuous",
            step=0.1,
            states=(Variable("excess", "K", "Above its surroundings", start=20.0),),
            inputs=heater if driven else (),
            outputs=(Variable("temperature", "K", "Above its surroundings"),),
            parameters=(
                Variable("time", "s", "Time constant", start=30.0, min=1.0, max=1000.0),
                *((Variable("gain", "K/W", "Gain", start=0.5, min=0.01, max=10.0),) if driven else ()),
            ),
            rhs=lambda x, u, m, p: {"excess": ((p.gain * u.heat if driven else 0.0) - x.excess) / p.time},
            out=lambda x, u, m, p: {"temperature": x.excess},
        )
    )


def tank() -> Folder:
    """A tank that a pump fills, with a hole: from empty on its outflow has a slope without end."""
    return folder(
        Model(
            name="tank",
            description="A tank with a hole",
            kind="continuous",
            step=0.1,
            states=(Variable("h", "m", "Level"),),
            inputs=(Variable("flow", "m/s", "Pump", min=0.0, max=1.0),),
            outputs=(Variable("level", "m", "Level"),),
            parameters=(Variable("outflow", "m(1/2)/s", "Hole", start=0.05, min=0.001, max=1.0),),
            rhs=lambda x, u, m, p: {"h": u.flow - p.outflow * ca.sqrt(ca.fmax(x.h, 0.0))},
            out=lambda x, u, m, p: {"level": x.h},
        )
    )


def falling() -> Folder:
    """What falls freely: gravity is known, and nothing else acts."""
    return folder(
        Model(
            name="falling",
            description="A free fall",
            kind="continuous",
            step=0.05,
            states=(Variable("z", "m", "Height"), Variable("v", "m/s", "Speed")),
            inputs=(),
            outputs=(Variable("height", "m", "Height"),),
            parameters=(Variable("g", "m/s2", "Gravity", start=9.81, min=9.7, max=9.9, tolerance=0.002),),
            rhs=lambda x, u, m, p: {"z": x.v, "v": -p.g},
            out=lambda x, u, m, p: {"height": x.z},
        )
    )


def stepped(step: float = 0.02, pull: float = 0.4) -> Folder:
    """A joint that follows its speed command, in steps."""
    return folder(
        Model(
            name="stepped",
            description="A joint in steps",
            kind="discrete",
            step=step,
            states=(Variable("q", "rad", "Angle"), Variable("v", "rad/s", "Speed")),
            inputs=(Variable("wanted", "rad/s", "Speed", min=-2.0, max=2.0),),
            outputs=(Variable("angle", "rad", "Angle"), Variable("rate", "rad/s", "Speed")),
            parameters=(Variable("pull", "1", "Share of the way in a step", start=pull, min=0.05, max=1.0),),
            rhs=lambda x, u, m, p: {
                "v": x.v + p.pull * (u.wanted - x.v),
                "q": x.q + step * (x.v + p.pull * (u.wanted - x.v)),
            },
            out=lambda x, u, m, p: {"angle": x.q, "rate": x.v},
        ),
        {"v": {"velocity": "v", "position": "q", "unit": "N.m", "inertia": 1.0, "drive": "wanted"}},
    )


def chain(links: int = 3) -> Folder:
    """Masses on springs in a row, with a spring that hardens: two states for each."""
    names = [str(i) for i in range(links)]

    def rhs(x, u, m, p):
        q = [0.0, *(getattr(x, f"x{n}") for n in names)]
        pull = [p.stiffness * (q[i + 1] - q[i]) + 5.0 * (q[i + 1] - q[i]) ** 3 for i in range(links)] + [
            -u.force
        ]
        rates = {f"x{n}": getattr(x, f"v{n}") for n in names}
        return rates | {
            f"v{n}": pull[i + 1] - pull[i] - 0.3 * getattr(x, f"v{n}") for i, n in enumerate(names)
        }

    states = [v for n in names for v in (Variable(f"x{n}", "m", "x"), Variable(f"v{n}", "m/s", "v"))]
    return folder(
        Model(
            name=f"chain{links}",
            description="Masses in a row",
            kind="continuous",
            step=0.01,
            states=tuple(states),
            inputs=(Variable("force", "N", "Force"),),
            outputs=tuple(Variable(f"y{n}", "m", "y") for n in names),
            parameters=(Variable("stiffness", "N/m", "Spring", start=3.0, min=0.1, max=50.0),),
            rhs=rhs,
            out=lambda x, u, m, p: {f"y{n}": getattr(x, f"x{n}") for n in names},
        )
    )


def pendulum() -> Folder:
    """A pendulum that swings far: nonlinear, nothing drives it."""
    return folder(
        Model(
            name="swing",
            description="A pendulum",
            kind="continuous",
            step=0.01,
            states=(Variable("q", "rad", "Angle"), Variable("w", "rad/s", "Rate")),
            inputs=(),
            outputs=(Variable("angle", "rad", "Angle"), Variable("rate", "rad/s", "Rate")),
            parameters=(Variable("pull", "1/s2", "g/l", start=9.0, min=1.0, max=100.0),),
            rhs=lambda x, u, m, p: {"q": x.w, "w": -p.pull * ca.sin(x.q)},
            out=lambda x, u, m, p: {"angle": x.q, "rate": x.w},
        )
    )


def run(
    inputs: Mapping[str, tuple[np.ndarray, np.ndarray]], outputs: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> Run:
    """A run of (time, values) by name."""
    felt, shown = (
        {n: Signal(np.asarray(t), np.asarray(v)) for n, (t, v) in own.items()} for own in (inputs, outputs)
    )
    times = np.concatenate([s.time for s in shown.values()])
    return Run("run", float(times.min()), float(times.max()), felt, shown)


def recorded(one: Run) -> list[Record]:
    """All of a run to fit."""
    return records(
        [one], {"fit": [Block(one, one.start_s, one.end_s + 1.0)], "confirm": [], "holdout": []}, 10**9
    )


def noise(
    kalman: Kalman, sigma: float = 0.5, tau: float = 0.3, white: float = 0.0, out: float = 0.01
) -> dict:
    """Values of a model's own parameters, effects absent, and of its noise."""
    found = kalman.whole.base_start()
    for place in kalman.places:
        found |= {SIGMA + place: sigma, TAU + place: tau, WHITE + place: white}
    return found | {NOISE + n: out for n in kalman.outputs}
