"""The paper's slew model as data: pressure and velocity network, their normalisation, and where they hold.

    [p_l, p_r][k] = F_p(u[k-9..k], p_l[k-10..k-1], p_r[k-10..k-1], omega[k-10..k-1], I[k-1])
    omega[k]      = F_w(u[k-9..k], p_l[k-9..k],    p_r[k-9..k],    omega[k-10..k-1], I[k-1])

at 0.1 s; the second takes the first one's prediction.  u is the joystick -1..1 that was held from k-1 to k,
p_l and p_r the chambers (signals p_slew_b and p_slew_a; p_r drives positive omega) in Pa, omega the slew
speed as the encoder gives it in rad/s, I the slew inertia from pose and nominal masses in kg m2.  Histories
run from old to new, inputs lie in the order written.  Source: the paper (fmus/models/slew_nn/README.md).

A network from elsewhere may have been trained on another inertia number than this project's; where that is
known (`told_in_our_inertia`), it is part of the normalisation.

A model may lack an input: without `pressure` networks the speed follows from u, omega and I, and pressures
stay; a velocity network of one input less does not see I.

A network is a mean over members (an ensemble; usually one).  With `symmetric`, each member g is evaluated on
the inputs and on their mirror image (u, omega negated, chambers swapped) and the mirrored results averaged,
so that the model has no preferred direction.
"""

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from specs.errors import InputError

HISTORY = 10
PERIOD_S = 0.1
INPUTS = 4 * HISTORY + 1
FORMAT = 1
CELL_AXES = {"inertia": 8, "u": 10, "omega": 10}  # cells of the map of training data along each quantity
TOLERANCE = 0.02  # share of a range by which a value may pass it


@dataclass(frozen=True)
class Mlp:
    """Affine layers with ReLU between; raw input x [41] -> y: y = mean_out + std_out * net((x - mean) / std).

    weights [out, in] and biases [out] a layer, float32; with `residual` the outputs are changes from the
    last known values (p_l, p_r of k-1, or omega of k-1).
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    mean_in: np.ndarray
    std_in: np.ndarray
    mean_out: np.ndarray
    std_out: np.ndarray
    residual: bool = False

    @property
    def sizes(self) -> tuple[int, ...]:
        """Widths: inputs, hidden layers, outputs."""
        return (self.weights[0].shape[1], *(len(b) for b in self.biases))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Outputs [n, outputs] for raw inputs [n, inputs]; without the residual's last values."""
        y = (x - self.mean_in) / self.std_in
        for number, (w, b) in enumerate(zip(self.weights, self.biases, strict=True)):
            y = y @ w.T + b
            if number + 1 < len(self.weights):
                y = np.maximum(y, 0.0)
        return self.mean_out + self.std_out * y


@dataclass(frozen=True)
class SlewNetwork:
    """A trained slew model: members of both networks, and what it was trained from.

    `region` holds the trained range of each quantity by name ("u", "omega", "inertia", "p_l", "p_r").
    """

    pressure: tuple[Mlp, ...]
    velocity: tuple[Mlp, ...]
    symmetric: bool = False
    region: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    meta: Mapping[str, Any] = field(default_factory=dict)
    visited: np.ndarray | None = None  # bool [CELLS] over `region` of CELL_AXES: where training data was

    @property
    def sees_inertia(self) -> bool:
        """Whether the slew inertia is an input."""
        return self.velocity[0].sizes[0] % HISTORY == 1

    def check_whole(self, name: str = "the network") -> None:
        """InputError unless the networks have all inputs of the paper's: only such become an FMU or ONNX."""
        if not (self.pressure and self.sees_inertia):
            lacks = "pressure" if not self.pressure else "inertia"
            raise InputError(f"{name} was trained without {lacks}: it cannot stand in for the slew drive")
        for part in PARTS:
            for have in (net.sizes[0] for net in getattr(self, part) if net.sizes[0] != INPUTS):
                told = f"with a history of {HISTORY} it has {INPUTS}"
                raise InputError(f"{name}: a {part} network of {have} inputs; {told}")

    def check_plant(self, name: str, our_inertia: bool = False) -> None:
        """InputError, with the plant's name, unless the network can stand where the slew drive is.

        One that does not say on which inertia number it was trained needs `our_inertia`: the project's.
        """
        self.check_whole(f"plant {name}")
        if not all(np.isfinite(a).all() for a in self.numbers):
            raise InputError(f"plant {name}: weights or statistics that are not finite numbers")
        if self.inertia_map is None and not our_inertia:
            raise InputError(unknown_inertia(name))

    @property
    def numbers(self) -> list[np.ndarray]:
        """Weights and statistics of all members."""
        nets = (*self.pressure, *self.velocity)
        return [a for n in nets for a in (*n.weights, *n.biases, *(getattr(n, s) for s in NORMALISATION))]

    def outside(self, inertia: np.ndarray, u: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Which of n states lie where no training data was, bool [n]; False where that is not known.

        Beyond a range of `region`, and in cells that are not `visited`.
        """
        index, beyond = [], np.zeros(np.shape(u), dtype=bool)
        for (name, count), value in zip(CELL_AXES.items(), (inertia, u, omega), strict=True):
            if name not in self.region:
                continue
            low, high = self.region[name]
            share = (np.asarray(value, float) - low) / (high - low)
            beyond |= (share < -TOLERANCE) | (share > 1 + TOLERANCE)
            index.append(np.clip((share * count).astype(int), 0, count - 1))
        return beyond if self.visited is None else beyond | ~self.visited[tuple(index)]

    @property
    def inertia_map(self) -> tuple[float, float] | None:
        """(scale, offset) from the project's inertia to the number it was trained on; None if not known.

        The weights take the project's number.  A network that was trained here was trained on it.
        """
        if "inertia" in self.meta:
            return self.meta["inertia"]["scale"], self.meta["inertia"]["offset"]
        return None if "imported" in self.meta else (1.0, 0.0)

    @property
    def knows_region(self) -> bool:
        """Whether anything is known about where its training data lay."""
        return any(name in self.region for name in CELL_AXES)

    def told_in_our_inertia(self, scale: float, offset: float) -> "SlewNetwork":
        """This network for the project's inertia I, where it was trained on `scale` * I + `offset` [kg m2].

        The map goes into mean and deviation of the inertia input, so that it holds wherever the network runs,
        and into the region; `meta` says it.
        """
        parts = {part: tuple(_on_ours(n, scale, offset) for n in getattr(self, part)) for part in PARTS}
        region = dict(self.region)
        if "inertia" in region:
            low, high = region["inertia"]
            region["inertia"] = ((low - offset) / scale, (high - offset) / scale)
        meta = {**self.meta, "inertia": {"scale": scale, "offset": offset}}
        return replace(self, **parts, region=region, meta=meta)

    def mirrored(self) -> "SlewNetwork":
        """The network of the mirror image: joystick and speed negated, chambers exchanged."""
        parts = {part: tuple(_mirror_image(n) for n in getattr(self, part)) for part in PARTS}
        region = {EXCHANGED.get(name, name): limits for name, limits in self.region.items()}
        for name in {"u", "omega"} & {*region}:
            region[name] = (-region[name][1], -region[name][0])
        visited = None if self.visited is None else self.visited[:, ::-1, ::-1]
        meta = {**self.meta, "mirror_image": True}
        return replace(self, **parts, region=region, meta=meta, visited=visited)

    def predict(
        self, u: np.ndarray, p_l: np.ndarray, p_r: np.ndarray, omega: np.ndarray, inertia: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(p_l, p_r, omega)[k], each [n]; from u [n, 10] to k, the others [n, 10] to k-1, inertia [n]."""
        found = self._one_way(u, p_l, p_r, omega, inertia)
        if not self.symmetric:
            return found
        left, right, speed = self._one_way(-u, p_r, p_l, -omega, inertia)
        return (found[0] + right) / 2, (found[1] + left) / 2, (found[2] - speed) / 2

    def _one_way(
        self, u: np.ndarray, p_l: np.ndarray, p_r: np.ndarray, omega: np.ndarray, inertia: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        seen = [inertia[:, None]] if self.sees_inertia else []
        last, histories = np.stack([p_l[:, -1], p_r[:, -1]], axis=1), [u]
        p = last
        if self.pressure:
            known = np.hstack([u, p_l, p_r, omega, *seen])
            p = np.mean([net(known) + net.residual * last for net in self.pressure], axis=0)
            histories += [np.hstack([p_l[:, 1:], p[:, :1]]), np.hstack([p_r[:, 1:], p[:, 1:]])]
        now = np.hstack([*histories, omega, *seen])
        w = np.mean([net(now)[:, 0] + net.residual * omega[:, -1] for net in self.velocity], axis=0)
        return p[:, 0], p[:, 1], w

    def save(self, path: Path | str) -> None:
        """Write as .npz (weights float32) with the metadata inside; the same content gives the same bytes."""
        arrays: dict[str, np.ndarray] = {}
        for part in PARTS:
            for number, net in enumerate(getattr(self, part)):
                arrays |= {f"{part}.{number}.{key}": value for key, value in _arrays(net).items()}
        head = {
            "format": FORMAT,
            "members": {part: [net.residual for net in getattr(self, part)] for part in PARTS},
            "symmetric": self.symmetric,
            "region": {name: list(limits) for name, limits in self.region.items()},
            "meta": dict(self.meta),
        }
        if self.visited is not None:
            arrays["visited"] = self.visited
        text = json.dumps(head, sort_keys=True, allow_nan=False)
        arrays["head"] = np.frombuffer(text.encode(), np.uint8)
        _write_npz(Path(path), arrays)

    @classmethod
    def load(cls, path: Path | str) -> "SlewNetwork":
        """Read what `save` wrote; raises InputError naming file and what is wrong with it."""
        try:
            if Path(path).is_file() and not zipfile.is_zipfile(path):
                raise InputError(f"{path} is damaged or not a slew network: it is no whole .npz file")
            with np.load(path, allow_pickle=False) as found:
                arrays = {name: found[name] for name in found.files}
            head = json.loads(arrays["head"].tobytes())
            if head["format"] > FORMAT:
                raise InputError(f"{path} has format {head['format']}; this version reads up to {FORMAT}")
            parts = {
                part: tuple(_net(arrays, f"{part}.{i}.", r) for i, r in enumerate(head["members"][part]))
                for part in PARTS
            }
            region = {name: (low, high) for name, (low, high) in head["region"].items()}
            made = cls(
                parts["pressure"], parts["velocity"], head["symmetric"], region, head["meta"],
                arrays.get("visited"),
            )  # fmt: skip
        except FileNotFoundError:
            raise InputError(f"there is no slew network at {path}") from None
        except KeyError as error:
            raise InputError(f"{path} is damaged or not a slew network: it lacks {error}") from None
        except (OSError, EOFError, ValueError, TypeError, zipfile.BadZipFile) as error:
            raise InputError(f"{path} is damaged or not a slew network: {error}") from None
        return made


PARTS = ("pressure", "velocity")
EXCHANGED = {"p_l": "p_r", "p_r": "p_l"}  # in the mirror image
NORMALISATION = ("mean_in", "std_in", "mean_out", "std_out")


def unknown_inertia(name: str) -> str:
    """What is said of a plant that does not state its inertia number."""
    return (
        f"plant {name}: does not say on which inertia number it was trained; import it with [inertia] in its"
        " description, or take the project's number with --our-inertia"
    )


def _on_ours(net: Mlp, scale: float, offset: float) -> Mlp:
    """(scale I + offset - mean) / std = (I - (mean - offset) / scale) / (std / scale)."""
    if net.sizes[0] % HISTORY == 0:
        return net
    mean, std = net.mean_in.copy(), net.std_in.copy()
    mean[-1], std[-1] = (mean[-1] - offset) / scale, std[-1] / scale
    return replace(net, mean_in=mean, std_in=std)


def _mirror_image(net: Mlp) -> Mlp:
    """The network that answers to mirrored inputs as this one does to the inputs, mirrored back."""
    rows = net.sizes[0] // HISTORY
    at, turn = np.arange(net.sizes[0]), np.ones(net.sizes[0])
    blocks = at[: rows * HISTORY].reshape(rows, HISTORY)
    turn[[*blocks[0], *blocks[-1]]] = -1.0
    if rows == 4:
        at = np.concatenate([blocks[0], blocks[2], blocks[1], blocks[3], at[4 * HISTORY :]])
    out = [1, 0] if net.sizes[-1] == 2 else [0]
    turn_out = 1.0 if net.sizes[-1] == 2 else -1.0
    weights, biases = list(net.weights), list(net.biases)
    weights[0] = (weights[0] * turn)[:, at].astype(np.float32)
    weights[-1] = (turn_out * weights[-1])[out].astype(np.float32)
    biases[-1] = (turn_out * biases[-1])[out].astype(np.float32)
    return Mlp(
        tuple(weights), tuple(biases), (turn * net.mean_in)[at], net.std_in[at],
        (turn_out * net.mean_out)[out], net.std_out[out], net.residual,
    )  # fmt: skip


def _arrays(net: Mlp) -> dict[str, np.ndarray]:
    layers = {f"w{i}": w for i, w in enumerate(net.weights)} | {f"b{i}": b for i, b in enumerate(net.biases)}
    found = {name: np.asarray(value, np.float32) for name, value in layers.items()}
    return found | {name: np.asarray(getattr(net, name), np.float64) for name in NORMALISATION}


def _net(arrays: Mapping[str, np.ndarray], prefix: str, residual: bool) -> Mlp:
    count = sum(name.startswith(f"{prefix}w") for name in arrays)
    layers = [tuple(arrays[f"{prefix}{kind}{i}"] for i in range(count)) for kind in "wb"]
    scales = {name: arrays[prefix + name] for name in NORMALISATION}
    return Mlp(layers[0], layers[1], **scales, residual=residual)


def _write_npz(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """An .npz with a fixed time stamp, written by way of a file beside it."""
    part = path.with_name(f".{path.name}.part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(arrays):
            content = io.BytesIO()
            np.lib.format.write_array(content, np.ascontiguousarray(arrays[name]), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0)), content.getvalue())
    part.replace(path)
