"""A policy as a model like every other controller: weights as tables, built into an FMU, run at 10 Hz.

Every fifth tick of 0.02 s the sensors enter the history and the network answers; in between its commands are
held.  Commands are states: they appear one tick after the sensors they answer (as with all controllers).  The
history starts filled with the first sensors and commands of 0 (specs/policy.py, `History`).
"""

import hashlib
import tempfile
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.toolchain.build import build_fmu
from learning.policy import attention, export
from learning.policy.export import Policy
from learning.policy.features import commands, features, limited
from specs.policy import (
    ACTIONS,
    CHANNELS,
    SENSORS,
    SLEW_ERROR,
    SPACING_S,
    TARGETS,
    TICK_S,
    check_signals,
)
from specs.signals import signal

TICKS = round(SPACING_S / TICK_S)
FILE = "policy.onnx"
SPLIT = 2.0**29 + 1.0  # of 53 bits, 29 are rounded off
UNUSED = ("qd_slew",)  # connected to every controller; the gyro tells the same, and is not late
SOURCES = (
    "attention.py",
    "controller.py",
    "export.py",
    "features.py",
)  # beside the file, what its model is made by
CODE = '''"""A policy; written by learning/policy/controller.py.

SHA-256 of policy.onnx and of what makes the model of it: {digest}
"""

from pathlib import Path

from learning.policy.controller import of_policy
from learning.policy.export import read

MODEL = of_policy(read(Path(__file__).with_name("policy.onnx")), "{name}")
'''
README = """# {name}: a policy

The network `policy.onnx` at {rate:g} Hz, its observation and commands as specs/policy.py defines them.
Written by learning/policy/controller.py; how it was made is in the file's metadata.
"""


def of_policy(policy: Policy, name: str = "policy") -> Model:
    """The model with this policy; connectors as every controller's.

    Raises InputError for one that sees more than they tell.
    """
    check_signals(policy.contract, name)
    length = policy.contract.history
    kept = [f"{channel}_{i}" for channel in _kept() for i in range(length)]
    tick = _tick(policy)
    return Model(
        name=name,
        description=f"Learned policy ({policy.contract.task}) at 10 Hz",
        kind="discrete",
        step=TICK_S,
        states=(
            Variable("phase", "1", "Ticks since the last answer, 0 to 4"),
            Variable("started", "1", "1 after the first answer"),
            *(Variable(n, signal(n.rpartition("_")[0]).unit, "Of the history, oldest first") for n in kept),
        ),
        inputs=from_signals(*TARGETS, *SENSORS, *UNUSED),
        outputs=from_signals(*ACTIONS),
        parameters=(),
        rhs=lambda x, u, m, p: _next_state(tick, length, x, u),
        out=lambda x, u, m, p: {a: getattr(x, f"{a}_{length - 1}") for a in ACTIONS},
        symbolic="MX",
    )


def _kept() -> tuple[str, ...]:
    """Channels of the history as they are stored: the slew angle itself in the place of its error."""
    return tuple("q_slew" if name == SLEW_ERROR else name for name in CHANNELS)


def _next_state(tick: ca.Function, length: int, x: Namespace, u: Namespace) -> dict[str, Any]:
    rows = [getattr(x, f"{channel}_{i}") for channel in _kept() for i in range(length)]
    sensors = [getattr(u, name) for name in SENSORS]
    told = [getattr(u, name) for name in TARGETS]
    after = tick(x.phase < 0.5, x.started, ca.vertcat(*rows), ca.vertcat(*sensors), ca.vertcat(*told))
    names = [f"{channel}_{i}" for channel in _kept() for i in range(length)]
    return {
        "phase": ca.if_else(x.phase > TICKS - 1.5, 0.0, x.phase + 1.0),
        "started": 1.0,
        **{name: after[i] for i, name in enumerate(names)},
    }


def _tick(policy: Policy) -> ca.Function:
    """(due, started, history, sensors, targets) -> history; its newest commands are those that are held.

    Between answers the newest row of commands is the one that is held; the sensors' newest row is the one
    that it answered.  At the next answer that row of commands becomes the one before.
    """
    length = policy.contract.history
    history = ca.MX.sym("history", len(CHANNELS) * length)
    sensors, told = ca.MX.sym("sensors", len(SENSORS)), ca.MX.sym("told", len(TARGETS))
    started = ca.MX.sym("started")
    arguments = [started, history, sensors, told]
    rows = {c: history[k * length : (k + 1) * length] for k, c in enumerate(_kept())}
    for k, name in enumerate(SENSORS):
        first = ca.repmat(sensors[k], length - 1, 1)
        rows[name] = ca.vertcat(ca.if_else(started > 0.5, _older(rows[name]), first), sensors[k])
    # a stored row of commands runs one period ahead of the sensors: the newest is held from now on
    observation = ca.vertcat(*_observed(rows, told, length))
    answer = _answer(policy, observation)
    for k, name in enumerate(ACTIONS):
        rows[name] = ca.vertcat(_older(rows[name]), answer[k])
    due = ca.Function("due", arguments, [ca.vertcat(*(rows[c] for c in _kept()))])
    waiting = ca.Function("waiting", arguments, [history])
    return ca.Function.if_else("tick", due, waiting)


def _older(row: ca.MX) -> ca.MX:
    """All but the oldest value [n - 1, 1], which is also right for a history of one value."""
    return row[1:] if row.numel() > 1 else ca.MX(0, 1)


def _observed(rows: dict[str, ca.MX], told: ca.MX, length: int) -> list[ca.MX]:
    """The entries of the observation, as specs/policy.py orders them."""
    x, y, z, load, pace = (told[k] for k in range(len(TARGETS)))
    angles = rows["q_slew"]
    ahead = angles[-1] - ca.atan2(y, x)
    error = ca.atan2(ca.sin(ahead), ca.cos(ahead))
    channels = [error + (angles - angles[-1]) if c == "q_slew" else rows[c] for c in _kept()]
    return [single(v) for v in (*channels, ca.sqrt(x * x + y * y), z, load, pace)]


def single(x: ca.MX) -> ca.MX:
    """Numbers rounded to single precision's 24 bits, as ONNX takes and gives them (Veltkamp, Dekker 1971)."""
    c = SPLIT * x
    return c - (c - x)


def _answer(policy: Policy, observation: ca.MX) -> ca.MX:
    c = policy.contract
    y = features(c.task, c.history)(observation)
    y = attention.answer(policy.weights, y) if c.network else _dense(policy, y)
    return single(limited()(commands(c.task, c.history, c.prior, c.change)(y, observation)))


def _dense(policy: Policy, y: ca.MX) -> ca.MX:
    for number, (w, b) in enumerate(policy.weights):
        y = ca.mtimes(ca.MX(ca.DM(w.astype(np.float64))), y) + ca.MX(ca.DM(b.astype(np.float64)))
        y = ca.tanh(y) if number + 1 < len(policy.weights) else y
    return y


def write_folder(policy: Policy, name: str, parent: Path) -> Path:
    """Write a model folder `parent`/`name` (model.py, policy.onnx, README.md) and return it."""
    folder = parent / name
    folder.mkdir(parents=True, exist_ok=True)
    export.write(policy, folder / FILE)
    code = CODE.format(name=name, digest=_digest(folder / FILE))
    (folder / "model.py").write_text(code, encoding="utf-8")
    text = README.format(name=name, rate=policy.contract.rate_hz)
    (folder / "README.md").write_text(text, encoding="utf-8")
    return folder


def _digest(path: Path) -> str:
    """An FMU is built anew when its folder's code changes: so the code says which policy it reads."""
    here = Path(__file__).parent
    parts = [path.read_bytes(), *((here / name).read_bytes() for name in SOURCES)]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def build(policy: Policy, name: str, out: Path, fmi_version: int = 2) -> Path:
    """Build `out`/`name`.fmu of a policy; returns its path."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        folder = write_folder(policy, name, Path(scratch) / "models")
        built = build_fmu(folder, fmi_version, out=Path(scratch) / "fmus")
        part = out / f".{name}.fmu.part"
        part.write_bytes(built.read_bytes())
    return part.replace(out / f"{name}.fmu")
