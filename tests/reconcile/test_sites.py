"""Ports of hydraulic drives, pendulums and groups: what attaches where, equations against their definitions.

The extended models' FMUs are held to the simulation that a fit uses.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.models.tool.model import MODEL as TOOL
from fmus.toolchain.build import build_fmu
from reconcile.catalogue import ALL
from reconcile.equations.extended import Extended
from reconcile.equations.model import candidates, read_folder
from reconcile.equations.ports import find_ports
from reconcile.recordings.data import Run, Signal
from specs.errors import InputError
from tests.fmus.importer import Imported

PERIOD = 0.02
EFFECTS = {e.key: e for e in ALL}


def everything(name: str) -> set[str]:
    folder = read_folder(name)
    variables = (*folder.model.inputs, *folder.model.outputs)
    return {a.key for a in candidates(folder, [v.name for v in variables])}


@pytest.mark.parametrize(
    ("model", "keys"),
    {
        "slew": {
            "supply_pressure_sag@oil", "shared_pump_flow@oil", "relief_limit.a@oil", "compressibility@oil",
            "temperature_dependent_viscosity@oil", "counterbalance_drop@oil", "brake_engagement@oil",
            "slope_torque@slew", "payload_mass.at_reach@slew", "sensor_delay@encoder",
            "sensor_lag.together@encoder",
        },
        "arm": {"gravity_load.any_angle@stick", "sensor_delay@boom_encoder", "load_dependent_friction@boom"},
        "tool": {
            "coriolis_coupling@pendulum", "centrifugal_coupling@pendulum", "euler_coupling@pendulum",
            "wind_load@pendulum", "pendulum_length_change@pendulum", "input_delay@motion",
            "input_lag.together@motion", "input_offset@qd_slew", "sensor_delay@roll_sensor",
            "cross_axis_misalignment.turned@tool_sensor", "sensor_lag.together@roll_sensor",
            "sensor_lag.together@all outputs",
        },
    }.items(),
)  # fmt: skip
def test_what_a_model_has_ports_for_attaches(model: str, keys: set[str]) -> None:
    assert keys - everything(model) == set()


@pytest.mark.parametrize(
    ("model", "keys"),
    {
        "slew": {"internal_leakage@oil", "input_dead_zone@u_slew", "stiffness@slew", "gravity_load@slew"},
        "arm": {"input_delay@qd_boom_ref", "slope_torque@boom"},
        "tool": {
            "viscous_friction@roll",
            "input_dead_zone@qd_slew",
            "input_delay@radius",
            "gravity_load@pitch",
        },
    }.items(),
)
def test_what_a_model_has_itself_or_cannot_have_does_not(model: str, keys: set[str]) -> None:
    assert keys & everything(model) == set()


def recorded(inputs: dict[str, np.ndarray], outputs: list[str]) -> Run:
    n = len(next(iter(inputs.values())))
    time = PERIOD * np.arange(n)
    made = {k: Signal(time, v) for k, v in inputs.items()}
    return Run("run", 0.0, float(time[-1]), made, {k: Signal(time, np.zeros(n)) for k in outputs})


FINER = 40  # steps of a PERIOD


class Simulated:
    """A base model with effects by the equations of its extended model, from its own start (RK4)."""

    def __init__(self, name: str, effects: dict[tuple[str, str], dict[str, float]], run: Run):
        folder = read_folder(name)
        by_key = {a.key: a for a in candidates(folder, [*run.inputs, *run.outputs])}
        self.attached = [by_key[f"{key}@{port}"] for key, port in effects]
        self.extended, self.run = Extended(folder, self.attached), run
        self.values = self.extended.base_start()
        for a, own in zip(self.attached, effects.values(), strict=True):
            self.values |= {a.name(k): v for k, v in own.items()}
            self.values |= {a.name("gate"): 1.0} if a.effect.gated else {}

    def outputs(self) -> dict[str, np.ndarray]:
        """Outputs at every PERIOD."""
        model, (f, h, first) = self.extended.model, self.extended.functions
        p = [self.values[n] for n in self.extended.parameter_names]
        m = [v.start for v in model.modes]
        forces = [0.0] * len(self.extended.folder.ports.axes)
        base = np.asarray(model.x0(model.start_parameters())).ravel()
        rows, x = [], np.concatenate([base, np.zeros(len(self.extended.state_names) - len(base))])
        columns = [
            self.run.inputs[v.name].values if v.name in self.run.inputs else None for v in model.inputs
        ]
        for k in range(len(next(iter(self.run.inputs.values())).values)):
            given = [v.start if c is None else c[k] for v, c in zip(model.inputs, columns, strict=True)]
            u = [*given, PERIOD * k + (0.5 * model.step if model.kind == "discrete" else 0.0), *forces]
            if k == 0:
                x[len(base) :] = np.asarray(first(x, u, m, p)).ravel()
            rows.append(np.asarray(h(x, u, m, p)).ravel())
            x = self._after(f, x, u, m, p)
        return dict(zip([v.name for v in model.outputs], np.array(rows).T, strict=True))

    def _after(self, f, x, u, m, p) -> np.ndarray:
        """States a PERIOD later, inputs held."""
        model = self.extended.model
        if model.kind == "discrete":
            for _ in range(round(PERIOD / model.step)):
                x = np.asarray(f(x, u, m, p)).ravel()
            return x
        step = PERIOD / FINER
        for _ in range(FINER):
            k1 = np.asarray(f(x, u, m, p)).ravel()
            k2 = np.asarray(f(x + 0.5 * step * k1, u, m, p)).ravel()
            k3 = np.asarray(f(x + 0.5 * step * k2, u, m, p)).ravel()
            k4 = np.asarray(f(x + step * k3, u, m, p)).ravel()
            x = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return x


def extended_folder(tmp_path: Path, base: str, effects: dict[tuple[str, str], dict[str, float]]) -> Path:
    entries = [(key, port, None, values) for (key, port), values in effects.items()]
    source = f"from reconcile.extend import extend\n\nMODEL = extend({base!r}, {entries!r}, {{}})\n"
    (tmp_path / "model.py").write_text(source)
    return tmp_path


def stepped(fmu_path: Path, run: Run, names: list[str]) -> dict[str, np.ndarray]:
    """Outputs of an FMU at every PERIOD under the run's inputs."""
    start = {k: float(s.values[0]) for k, s in run.inputs.items()}
    rows = []
    with Imported(fmu_path, None, **start) as fmu:
        rows.append(fmu.get(*names))
        for k in range(len(next(iter(run.inputs.values())).values) - 1):
            fmu.set(**{n: float(s.values[k]) for n, s in run.inputs.items()})
            fmu.step()
            rows.append(fmu.get(*names))
    return dict(zip(names, np.array(rows).T, strict=True))


def swinging(seconds: float = 6.0) -> dict[str, np.ndarray]:
    t = PERIOD * np.arange(round(seconds / PERIOD))
    rate, luff = 0.3 * np.sin(1.1 * t), 0.4 * np.sin(0.7 * t)
    start = {v.name: v.start for v in TOOL.inputs}
    return {
        "q_slew": PERIOD * np.cumsum(rate),
        "qd_slew": rate,
        "radius": start["radius"] + PERIOD * np.cumsum(luff),
        "radius_rate": luff,
        "height": np.full(len(t), start["height"]),
    }


PENDULUM = {
    ("coriolis_coupling", "pendulum"): {"factor": 1.0},
    ("pendulum_length_change", "pendulum"): {"rate": 0.03},
    ("input_lag.together", "motion"): {"time": 0.1},
    ("sensor_lag.together", "roll_sensor"): {"time": 0.05},
    ("cross_axis_misalignment.turned", "tool_sensor"): {"angle": 0.1},
}


def test_the_fmu_of_an_extended_pendulum_is_what_the_fit_simulates(tmp_path: Path) -> None:
    names = ["q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y"]
    run = recorded(swinging(), names)
    wanted = Simulated("tool", PENDULUM, run).outputs()
    got = stepped(build_fmu(extended_folder(tmp_path, "tool", PENDULUM), 2, out=tmp_path), run, names)
    plain = Simulated("tool", {}, run).outputs()
    for n in names:
        assert (
            np.max(np.abs(got[n] - wanted[n][: len(got[n])])) < 1e-7
        )  # steps see inputs as means, to rounding
        assert np.max(np.abs(plain[n] - wanted[n])) > 0.01


HYDRAULIC = {
    ("relief_limit.a", "oil"): {"flow": 0.002, "limit": 1.5e7},
    ("temperature_dependent_viscosity", "oil"): {"fall": 0.8, "time": 2.0},
}


def test_coupling_terms_are_those_of_a_point_in_a_turning_frame() -> None:
    """With the plain terms they are the projected acceleration of the point, by differences of it."""
    length, h = 2.0, 1e-4
    q_y, q_x, w_y, w_x = 0.2, -0.15, 0.3, 0.4
    slew_rate, slew_acceleration, radius, radius_rate = 0.35, 0.2, 10.0, 0.6

    def place(t: float) -> np.ndarray:
        """The tool's point in the world, angles moving evenly."""
        turn = slew_rate * t + 0.5 * slew_acceleration * t * t
        x = radius + radius_rate * t - length * np.sin(q_y + w_y * t)
        y = length * np.sin(q_x + w_x * t)
        c, s = np.cos(turn), np.sin(turn)
        return np.array([c * x - s * y, s * x + c * y])

    inertial = (place(h) - 2.0 * place(0.0) + place(-h)) / h**2
    # what even motion of the angles has by itself, and what the plain pendulums have
    own = np.array([length * np.sin(q_y) * w_y**2, -length * np.sin(q_x) * w_x**2])
    r_y = radius - length * np.sin(q_y)
    plain = np.array([-(slew_rate**2) * r_y, slew_rate * radius_rate + slew_acceleration * radius])
    missing = inertial - own - plain
    c = SimpleNamespace(
        pitch=SimpleNamespace(q=q_y, v=w_y), roll=SimpleNamespace(q=q_x, v=w_x), pitch_length=length,
        roll_length=length, slew_rate=slew_rate, slew_acceleration=slew_acceleration,
        radius_rate=radius_rate,
    )  # fmt: skip
    found = np.zeros(2)
    for name in ("coriolis", "centrifugal", "euler"):
        build = EFFECTS[f"{name}_coupling"].build
        assert build is not None
        at = build(c, SimpleNamespace(factor=1.0), None).at
        found += [float(at["pitch"]) / np.cos(q_y), float(at["roll"]) / np.cos(q_x)]
    assert found == pytest.approx([missing[0], -missing[1]], rel=1e-4)


def test_a_port_that_names_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="no kind 'hydraulics'"):
        find_ports(TOOL, {"oil": {"kind": "hydraulics"}})
    with pytest.raises(InputError, match="unknown key 'presure'"):
        find_ports(TOOL, {"oil": {"kind": "hydraulic", "presure": ("a", "b")}})
    with pytest.raises(InputError, match="no 'lenght_y'"):
        find_ports(TOOL, {"swing": {"kind": "pendulum", "pitch_length": "lenght_y"}})
    with pytest.raises(InputError, match="no input 'radious'"):
        find_ports(TOOL, {"motion": {"kind": "inputs", "inputs": ("radious",)}})


def test_effects_at_these_ports_are_absent_at_their_start() -> None:
    """With all amplitudes and gates at zero the extended equations are the model's own."""
    for name in ("slew", "tool"):
        folder = read_folder(name)
        chosen = [
            a
            for a in candidates(folder, [v.name for v in (*folder.model.inputs, *folder.model.outputs)])
            if a.effect.port
        ]
        assert chosen
        extended = Extended(folder, chosen)
        rng, model = np.random.default_rng(1), folder.model
        x, u, m, _ = extended.symbols
        values = extended.base_start()
        for a in chosen:
            shape = {a.name(k): v for k, v in a.effect.start(_scales(), 0).items()}
            values |= {
                k: v for k, v in shape.items() if k not in {a.name(q.name) for q in a.effect.amplitudes}
            }
        parameters = [values[n] for n in extended.parameter_names]
        for _ in range(5):
            states = np.concatenate(
                [_near(rng, model.states), rng.uniform(-1, 1, x.numel() - len(model.states))]
            )
            inputs = np.concatenate([_near(rng, model.inputs), np.zeros(u.numel() - len(model.inputs))])
            modes = np.ones(m.numel())
            got = np.asarray(extended.functions[0](states, inputs, modes, parameters)).ravel()
            own = model.f(
                states[: len(model.states)], inputs[: len(model.inputs)], modes, model.start_parameters()
            )
            assert got[: len(model.states)] == pytest.approx(np.asarray(own).ravel(), rel=1e-9, abs=1e-9)


def _near(rng: np.random.Generator, group) -> np.ndarray:
    return np.array([(v.nominal or abs(v.start) or 1.0) * rng.uniform(0.2, 0.8) for v in group])


def _scales():
    from reconcile.catalogue import Scales

    return Scales()


@pytest.mark.parametrize(
    ("port", "state"), [("boom", {"boom": 1.2}), ("stick", {"boom": 1.2, "stick": -0.8})]
)
def test_the_weight_of_a_link_is_that_of_its_elevation(port: str, state: dict[str, float]) -> None:
    folder = read_folder("arm")
    names = [v.name for v in (*folder.model.inputs, *folder.model.outputs)]
    (load,) = [a for a in candidates(folder, names) if a.key == f"gravity_load@{port}"]
    extended = Extended(folder, [load])
    x, u, m, _ = (np.zeros(a.shape[0]) for a in extended.symbols)
    for name, angle in state.items():
        x[folder.model.index("states", name)] = angle

    def rate(torque: float) -> float:
        p = list((extended.base_start() | {load.name("torque"): torque}).values())
        return float(extended.functions[0](x, u, m, p)[folder.model.index("states", f"{port}_rate")])

    (joint,) = [a for a in folder.ports.axes if a.name == port]
    by_torque = -0.02 * np.cos(sum(state.values())) / extended.inertia(joint)
    assert rate(1e4) - rate(0.0) == pytest.approx(1e4 * by_torque, rel=1e-6)
