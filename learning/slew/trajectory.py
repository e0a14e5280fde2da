"""What a slew model is trained and judged on: trajectories at 0.1 s, cut from recordings or traces.

Row k holds the state at k x 0.1 s and `u`, the mean joystick over the 0.1 s before it.  Channels read:
u_slew, p_slew_a, p_slew_b, qd_slew, q_boom, q_stick and, if recorded, load_told (else no load).
"""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from fmus.equations import kinematics
from fmus.models.slew.traces import Trace
from fmus.models.slew_nn.network import PERIOD_S
from records.measurement import Measurement, Piece
from specs.errors import InputError

NEEDED = ("u_slew", "p_slew_a", "p_slew_b", "qd_slew", "q_boom", "q_stick")
GROUPS = {"pressure": ("p_slew_a", "p_slew_b"), "inertia": ("q_boom", "q_stick")}  # what a variant can lack
SAMPLE_S = 0.02
STRIDE = round(PERIOD_S / SAMPLE_S)
STATES = ("u", "p_l", "p_r", "omega")
START = 10  # rows of the history
REST, REST_U = 0.02, 0.05  # rad/s and joystick below which a machine at the start is at rest


@dataclass(frozen=True)
class Trajectory:
    """A stretch without gaps; arrays [n] at 0.1 s in SI units (fmus/models/slew_nn/network.py)."""

    name: str
    u: np.ndarray
    p_l: np.ndarray
    p_r: np.ndarray
    omega: np.ndarray
    inertia: np.ndarray

    def __len__(self) -> int:
        return len(self.u)

    def mirrored(self) -> "Trajectory":
        """The same motion the other way round."""
        return replace(self, u=-self.u, p_l=self.p_r, p_r=self.p_l, omega=-self.omega)


def of_measurement(
    measurement: Measurement, name: str, phase: int = 0, without: Collection[str] = ()
) -> list[Trajectory]:
    """Trajectories of a recording, one for each piece of more than 2 s; `phase` 0..4 shifts by 0.02 s.

    Of the GROUPS in `without`, channels may be missing: pressures are then 0, the inertia a constant.
    Raises InputError naming the channels that are missing, and what can be trained without them.
    """
    spared = [channel for group in without for channel in GROUPS[group]]
    missing = measurement.missing(NEEDED)
    wrong = [channel for channel in missing if channel not in spared]
    if wrong:
        raise InputError(f"{measurement.source or name}: no channel {', '.join(wrong)}; {_advice(wrong)}")
    names = [n for n in (*NEEDED, "load_told") if n in measurement]
    pieces = measurement.pieces(names, SAMPLE_S)
    return [_of_piece(piece, name, phase) for piece in pieces if len(piece) > 20 * STRIDE]


def _advice(missing: Collection[str]) -> str:
    for group, channels in GROUPS.items():
        if set(missing) <= set(channels):
            return f"without {group} --recipe no_{group} can still be trained"
    return (
        "nothing can be trained without it (if it has another name there: slewright convert --map, "
        "docs/reference/recordings.md)"
    )


def of_trace(trace: Trace) -> Trajectory:
    """A slew trace, from its settled row on."""
    rest = slice(trace.first, None)
    return Trajectory(
        trace.name, trace.u_slew[rest], trace.p_b[rest], trace.p_a[rest], trace.qd[rest],
        np.full(len(trace.qd[rest]), trace.inertia),
    )  # fmt: skip


def _of_piece(piece: Piece, name: str, phase: int) -> Trajectory:
    rows = slice(STRIDE + phase, None, STRIDE)
    held = np.lib.stride_tricks.sliding_window_view(piece["u_slew"], STRIDE).mean(axis=1)
    zeros = np.zeros(len(piece))
    p_a, p_b, load = (piece.columns.get(n, zeros) for n in ("p_slew_a", "p_slew_b", "load_told"))
    rest = {"p_l": p_b, "p_r": p_a, "omega": piece["qd_slew"], "inertia": _inertia(piece, load)}
    u = held[phase::STRIDE][: len(zeros[rows])]
    return Trajectory(name, u, **{k: v[rows] for k, v in rest.items()})


def _inertia(piece: Piece, load: np.ndarray) -> np.ndarray:
    g = kinematics.geometry()
    if any(channel not in piece.columns for channel in GROUPS["inertia"]):
        return np.full(len(piece), kinematics.inertia_z(g.start_q_boom, g.start_q_stick, 0.0, g))
    return kinematics.inertia_z(piece["q_boom"], piece["q_stick"], load, g)


@dataclass(frozen=True)
class Windows:
    """Cut-outs to predict: `before` rows of history [n, before], then `ahead` rows [n, ahead] of each."""

    before: int
    u: np.ndarray  # all [n, before + ahead]
    p_l: np.ndarray
    p_r: np.ndarray
    omega: np.ndarray
    inertia: np.ndarray
    owner: np.ndarray  # [n] index of the recording in `names`
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.u)


def windows(trajectories: Iterable[Trajectory], before: int, ahead: int, stride: int) -> Windows:
    """All windows of `before` + `ahead` rows every `stride` rows; shorter trajectories give none."""
    chosen = [t for t in trajectories if len(t) >= before + ahead]
    if not chosen:
        raise InputError(
            f"no recording is long enough: {(before + ahead) * PERIOD_S:g} s without a gap are needed"
        )
    names = tuple(dict.fromkeys(t.name for t in chosen))
    columns = {
        key: np.concatenate([_cut(getattr(t, key), before + ahead, stride) for t in chosen])
        for key in ("u", "p_l", "p_r", "omega", "inertia")
    }
    owner = np.concatenate([
        np.full((len(t) - before - ahead) // stride + 1, names.index(t.name)) for t in chosen
    ])  # fmt: skip
    return Windows(before, **columns, owner=owner, names=names)


def _cut(values: np.ndarray, length: int, stride: int) -> np.ndarray:
    return np.lib.stride_tricks.sliding_window_view(values, length)[::stride]


def both_ways(trajectories: Iterable[Trajectory]) -> Iterator[Trajectory]:
    """Each trajectory and its mirror image."""
    for trajectory in trajectories:
        yield trajectory
        yield trajectory.mirrored()


def zero_filled(trajectory: Trajectory) -> list[Trajectory]:
    """The beginning of a trajectory at rest after a history of zeros, as simulations start; else nothing."""
    start = slice(0, START)
    if np.abs(trajectory.omega[start]).max() > REST or np.abs(trajectory.u[start]).max() > REST_U:
        return []
    rows = {k: np.concatenate([np.zeros(START), getattr(trajectory, k)[: 2 * START]]) for k in STATES}
    inertia = np.concatenate([np.full(START, trajectory.inertia[0]), trajectory.inertia[: 2 * START]])
    return [replace(trajectory, inertia=inertia, **rows)]
