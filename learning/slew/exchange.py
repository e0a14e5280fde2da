"""Slew networks to and from other tools: ONNX both ways, PyTorch state dicts in.

Networks trained elsewhere come as a pair of files and a small description of their channels (description.py):
any order, sense and unit of the channels, newest or oldest first, values or changes.  They become a
SlewNetwork in SI: scales and turned channels go into means, deviations and weights.
"""

import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fmus.models.slew_nn.network import HISTORY, INPUTS, PERIOD_S, Mlp, SlewNetwork
from learning.slew import description as described
from learning.slew.description import CHANNELS, OUTPUTS, PLACES, SI, Description, Inertia, Part
from records.figures_file import make_folder
from specs.errors import InputError, listed

WRAPPERS = ("state_dict", "model_state_dict", "model")  # under which training scripts put a state dict


@dataclass(frozen=True)
class Raw:
    """A network as its author stored it: y = mean_out + std_out * net((x - mean_in) / std_in) (+ x[last])."""

    weights: Sequence[np.ndarray]
    biases: Sequence[np.ndarray]
    mean_in: np.ndarray
    std_in: np.ndarray
    mean_out: np.ndarray
    std_out: np.ndarray
    last: list[int] | None = None


def read_pair(pressure: Path, velocity: Path, description: Path) -> SlewNetwork:
    """from_onnx or from_state_dict, by the files' endings; raises InputError for others."""
    suffixes = {pressure.suffix, velocity.suffix}
    if suffixes == {".onnx"}:
        return from_onnx(pressure, velocity, description)
    if suffixes <= {".pt", ".pth"}:
        return from_state_dict(pressure, velocity, description)
    raise InputError(f"{pressure}, {velocity}: valid is a pair of .onnx files, or of .pt or .pth files")


def from_onnx(pressure: Path, velocity: Path, description: Path) -> SlewNetwork:
    """A SlewNetwork from two ONNX chains of linear layers and Relu, or means of several such chains."""
    from learning.slew.onnx_read import Reader

    told = described.read(description)
    parts = {}
    for name, path in (("pressure", pressure), ("velocity", velocity)):
        chains = Reader(path).members()
        raw = [Raw(c.weights, c.biases, c.mean_in, c.std_in, c.mean_out, c.std_out, c.last) for c in chains]
        parts[name] = tuple(_in_si(one, name, told, path) for one in raw)
    return _network(parts, told, (pressure, velocity))


def from_state_dict(pressure: Path, velocity: Path, description: Path) -> SlewNetwork:
    """A SlewNetwork from two state dicts of torch.nn.Linear layers in order, with ReLU between them."""
    told = described.read(description)
    if told.normalisation == "inside":
        raise InputError(f"{description}: normalisation = 'inside', but a state dict holds layers alone")
    parts = {}
    for name, path in (("pressure", pressure), ("velocity", velocity)):
        layers = _layers(path)
        one, none = np.ones(1), np.zeros(1)
        raw = Raw([w for w, _ in layers], [b for _, b in layers], none, one, none, one)
        parts[name] = (_in_si(raw, name, told, path),)
    return _network(parts, told, (pressure, velocity))


def to_onnx(network: SlewNetwork, folder: Path) -> list[Path]:
    """Write pressure.onnx, velocity.onnx, step.onnx and slew.toml into `folder`; returns their paths.

    Raw SI values in and out, normalisation inside, float64.  The first two are the networks as they are; the
    mirror image of a symmetric network is only in step.onnx, which is SlewNetwork.predict.
    """
    from learning.slew.onnx_write import part_model, step_model

    network.check_whole()
    content = {
        "pressure.onnx": part_model(network.pressure, "pressure").SerializeToString(deterministic=True),
        "velocity.onnx": part_model(network.velocity, "velocity").SerializeToString(deterministic=True),
        "step.onnx": step_model(network).SerializeToString(deterministic=True),
        "slew.toml": _description(network).encode(),
    }
    make_folder(folder)
    for name, data in content.items():
        part = folder / f".{name}.part"
        part.write_bytes(data)
        part.replace(folder / name)
    return [folder / name for name in content]


# ---- state dicts ----


def _layers(path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    """(weight, bias) of each layer, in stored order."""
    stored = _stored(path)
    known = {key for key in stored if key.rpartition(".")[2] in ("weight", "bias")}
    if unknown := [str(key) for key in stored if key not in known]:
        raise InputError(
            f"{path}: holds {', '.join(unknown[:3])}; only linear layers (weight, bias) are known; means and "
            "deviations belong in the description"
        )
    layers = []
    for key in (key for key in stored if key.endswith("weight")):
        partner = key[: -len("weight")] + "bias"
        if partner not in stored or stored[key].ndim != 2 or stored[partner].ndim != 1:
            raise InputError(
                f"{path}: {key} {_shape(stored[key])} is no linear layer with a bias ({partner})"
            )
        layers.append((stored[key], stored[partner]))
    if not layers:
        raise InputError(f"{path}: holds no linear layer")
    return layers


def _stored(path: Path) -> dict[str, np.ndarray]:
    import torch

    if not path.is_file():
        raise InputError(f"there is no state dict at {path}")
    try:
        with warnings.catch_warnings(action="ignore"):  # torch tells its users how to load TorchScript
            found = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # a stranger's file: torch, zip and pickle errors of many kinds
        raise InputError(
            f"{path}: no readable state dict ({type(error).__name__}); "
            "write it with torch.save(model.state_dict(), file)"
        ) from error
    if isinstance(found, Mapping):
        found = next((found[key] for key in WRAPPERS if isinstance(found.get(key), Mapping)), found)
    if not isinstance(found, Mapping):
        raise InputError(f"{path}: holds a {type(found).__name__}, not a state dict of tensors")
    if other := [str(key) for key, value in found.items() if not isinstance(value, torch.Tensor)]:
        raise InputError(
            f"{path}: {listed(other, 3)}: no tensor; valid: a state dict, also as "
            f"{' or '.join(WRAPPERS)} of a checkpoint"
        )
    return {str(key): value.to(torch.float64).numpy() for key, value in found.items()}


# ---- into SI ----


def _network(parts: dict[str, tuple[Mlp, ...]], told: Description, files: tuple[Path, Path]) -> SlewNetwork:
    meta = {**told.meta, "imported": [path.name for path in files]}
    made = SlewNetwork(
        parts["pressure"], parts["velocity"], told.symmetric, told.region, meta, told.cells_visited()
    )
    return made if told.inertia is None else _on_our_inertia(made, told.inertia)


def _on_our_inertia(network: SlewNetwork, told: Inertia) -> SlewNetwork:
    """The network for the project's inertia number; one that takes it already only has it written down."""
    if not told.applied:
        return network.told_in_our_inertia(*told.line)
    known = {"inertia": {"scale": told.scale, "offset": told.offset}}
    return replace(network, meta={**network.meta, **known})


def _in_si(raw: Raw, name: str, told: Description, path: Path) -> Mlp:
    """The network with our order of inputs and outputs, SI units and our senses."""
    part = told.part(name)
    _check_layers(raw, name, part, path)
    _check_statistics_inside(raw, part, told, path)
    mean, std = _input_statistics(raw, part, told)
    mean_out, std_out = _output_statistics(raw, part, told)
    residual = _is_residual(raw, part, told, path)
    if not residual:
        mean_out = mean_out + [told.unit_of(c).zero for c in part.outputs]

    turned = np.where(std < 0, -1.0, 1.0), np.where(std_out < 0, -1.0, 1.0)
    weights, biases = [w.copy() for w in raw.weights], [b.copy() for b in raw.biases]
    weights[0] *= turned[0]
    weights[-1] *= turned[1][:, None]
    biases[-1] *= turned[1]

    places = part.places()
    inputs = [places.index(place) for place in PLACES]
    outputs = [part.outputs.index(channel) for channel in OUTPUTS[name]]
    weights[0] = weights[0][:, inputs]
    weights[-1], biases[-1] = weights[-1][outputs], biases[-1][outputs]
    return Mlp(
        tuple(np.ascontiguousarray(w, np.float32) for w in weights),
        tuple(b.astype(np.float32) for b in biases),
        mean[inputs],
        np.abs(std)[inputs],
        mean_out[outputs],
        np.abs(std_out)[outputs],
        residual,
    )


def _input_statistics(raw: Raw, part: Part, told: Description) -> tuple[np.ndarray, np.ndarray]:
    """Mean and signed deviation of each input in SI, in the author's order."""
    mean, std = raw.mean_in, raw.std_in
    if told.normalisation == "outside":
        mean, std = (
            part.inputs_of("mean_in") + part.inputs_of("std_in") * mean,
            part.inputs_of("std_in") * std,
        )
    units = [told.unit_of(channel) for channel, _ in part.places()]
    step, zero = np.array([u.sign * u.step for u in units]), np.array([u.zero for u in units])
    return zero + step * mean, step * std


def _output_statistics(raw: Raw, part: Part, told: Description) -> tuple[np.ndarray, np.ndarray]:
    """Mean and signed deviation of each output in SI (a unit's offset apart), in the author's order."""
    mean, std = raw.mean_out, raw.std_out
    if told.normalisation == "outside":
        mean, std = (
            part.outputs_of("mean_out") + part.outputs_of("std_out") * mean,
            part.outputs_of("std_out") * std,
        )
    step = np.array([told.unit_of(c).sign * told.unit_of(c).step for c in part.outputs])
    return step * mean, step * std


def _is_residual(raw: Raw, part: Part, told: Description, path: Path) -> bool:
    """Whether outputs are changes: the description says so, or the graph adds the last values itself."""
    if raw.last is None:
        return part.residual
    places = part.places()
    if raw.last != [places.index((channel, HISTORY - 1)) for channel in part.outputs]:
        raise InputError(f"{path}: adds the inputs {raw.last}, which are not the last known {part.outputs}")
    if told.normalisation == "outside" and (part.mean_out is not None or part.std_out is not None):
        raise InputError(f"{path}: adds last known values that the description scales: say what it means")
    return True


def _check_layers(raw: Raw, name: str, part: Part, path: Path) -> None:
    """Sizes join up, begin with 41 and end with the outputs; all numbers are finite."""
    outputs = len(OUTPUTS[name])
    wanted = part.layers or [INPUTS, "…", outputs]
    joined = all(len(a) == b.shape[1] for a, b in zip(raw.weights, raw.weights[1:], strict=False))
    joined = joined and all(len(w) == len(b) for w, b in zip(raw.weights, raw.biases, strict=True))
    sizes = [raw.weights[0].shape[1], *(len(w) for w in raw.weights)]
    fits = joined and sizes[0] == INPUTS and sizes[-1] == outputs and part.layers in (None, sizes)
    if not fits:
        found = ", ".join(_shape(w) for w in raw.weights) if not joined else _arrows(sizes)
        raise InputError(f"{path}: {name} network with layers {found}; expected {_arrows(wanted)}")
    for number, (w, b) in enumerate(zip(raw.weights, raw.biases, strict=True), start=1):
        if not (np.isfinite(w).all() and np.isfinite(b).all()):
            raise InputError(f"{path}: layer {number} {_shape(w)} has weights that are not finite numbers")


def _check_statistics_inside(raw: Raw, part: Part, told: Description, path: Path) -> None:
    """A graph with its own normalisation and a description that repeats it must say the same."""
    if told.normalisation == "outside":
        return
    pairs = {"mean_in": (raw.mean_in, part.inputs_of), "std_in": (raw.std_in, part.inputs_of)}
    pairs |= {"mean_out": (raw.mean_out, part.outputs_of), "std_out": (raw.std_out, part.outputs_of)}
    for key, (inside, said) in pairs.items():
        if getattr(part, key) is not None and not np.allclose(inside, said(key), rtol=1e-6, atol=0):
            raise InputError(f"{path}: {key} in the graph is not what the description says")


def _shape(values: np.ndarray) -> str:
    return "[" + "×".join(str(n) for n in values.shape) + "]"


def _arrows(sizes: Sequence[Any]) -> str:
    return "→".join(str(n) for n in sizes)


# ---- the description of an export ----


def _description(network: SlewNetwork) -> str:
    lines = [
        "# Slew networks as ONNX: raw SI in and out, normalisation inside (learning/slew/description.py).",
        *("format = 1", f"spacing_s = {PERIOD_S}", f"history = {HISTORY}", 'normalisation = "inside"'),
        f"symmetric = {_toml(network.symmetric)}",
    ]
    if network.visited is not None:
        lines += [f"visited = {_toml(np.packbits(network.visited).tobytes().hex())}"]
    for channel in CHANNELS:
        lines += ["", f"[channels.{channel}]", f'unit = "{SI[channel]}"', "sign = 1"]
    for name, outputs in OUTPUTS.items():
        members: Sequence[Mlp] = getattr(network, name)
        lines += ["", f"[{name}]", f"inputs = {_toml(CHANNELS)}", f"outputs = {_toml(outputs)}"]
        keys = {"layers": "sizes"} | {key: key for key in ("mean_in", "std_in", "mean_out", "std_out")}
        for key, attribute in keys.items():  # what all members share
            first, *others = [np.asarray(getattr(net, attribute)) for net in members]
            if all(np.array_equal(first, other) for other in others):
                lines += [f"{key} = {_toml(first)}"]
    if (inertia := network.inertia_map) is not None:
        lines += ["", "[inertia]", f"scale = {inertia[0]!r}", f"offset = {inertia[1]!r}", "applied = true"]
    for name in ("region", "meta"):
        lines += [
            "",
            f"[{name}]",
            *(f"{json.dumps(k)} = {_toml(v)}" for k, v in getattr(network, name).items()),
        ]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """A value of JSON's kinds as TOML."""
    value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if isinstance(value, Mapping):
        return (
            "{ "
            + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items() if v is not None)
            + " }"
        )
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(v) for v in value if v is not None) + "]"
    return json.dumps(value)
