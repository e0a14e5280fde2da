"""Slew networks to ONNX and back, and from other people's files with their own order, units and senses."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
import pytest
import torch
from onnx import helper, load, numpy_helper, save_model

from fmus.models.slew import traces
from fmus.models.slew_nn.network import CELL_AXES, HISTORY, Mlp, SlewNetwork
from fmus.models.slew_nn.untrained import PRESSURE_LAYERS, VELOCITY_LAYERS, untrained
from learning.slew import acceptance, description, importing
from learning.slew.acceptance import accept, trajectories
from learning.slew.description import PLACES
from learning.slew.exchange import from_onnx, from_state_dict, read_pair, to_onnx
from learning.slew.trajectory import of_trace
from slewright import __main__ as entry
from specs.errors import InputError

KINDS = {
    "paper": untrained(1, PRESSURE_LAYERS, VELOCITY_LAYERS),
    "ensemble": untrained(2, (24, 16), (16,), members=3, residual=True),
    "symmetric": untrained(3, (24,), (16, 8), members=2, symmetric=True),
}
CHECK = traces.FOLDER / "bump_I250.csv"
# Someone else's conventions: order of channels, unit, stored number of one SI unit, sense.
ORDER = ("inertia", "omega", "p_r", "u", "p_l")
FOREIGN = {
    "u": ('unit = "1"\nfull_scale = 850\nsign = -1', -850.0),
    "p_l": ('unit = "bar"', 1e-5),
    "p_r": ('unit = "bar"', 1e-5),
    "omega": ('unit = "deg/s"\nsign = -1', -180 / np.pi),
    "inertia": ('unit = "kg.m2"\nscale = 1000', 1e-3),
}


def states(n: int = 40) -> dict[str, np.ndarray]:
    """Histories within what the networks' statistics expect."""
    rng = np.random.default_rng(0)
    found = {key: rng.uniform(1e6, 3e7, (n, HISTORY)) for key in ("p_l", "p_r")}
    found |= {"u": rng.uniform(-1, 1, (n, HISTORY)), "omega": rng.normal(0, 0.3, (n, HISTORY))}
    return found | {"inertia": rng.uniform(2e5, 6e5, n)}


def assert_same(a: SlewNetwork, b: SlewNetwork, rtol: float) -> None:
    """Both predict the same."""
    for one, other in zip(a.predict(**states()), b.predict(**states()), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=rtol * np.abs(other).max())


@pytest.fixture(scope="module")
def fitted() -> SlewNetwork:
    """A working model without training: random features of one hidden layer, least squares on the traces."""
    found = [of_trace(t) for t in traces.load().values() if t.inertia < traces.UNPHYSICAL]
    rows: list[list[np.ndarray]] = [[], []]
    targets: list[list[np.ndarray]] = [[], []]
    for t in found:
        for k in range(HISTORY, len(t)):
            past, now = slice(k - HISTORY, k), slice(k - HISTORY + 1, k + 1)
            rows[0].append(np.hstack([t.u[now], t.p_l[past], t.p_r[past], t.omega[past], t.inertia[0]]))
            rows[1].append(np.hstack([t.u[now], t.p_l[now], t.p_r[now], t.omega[past], t.inertia[0]]))
            targets[0].append(np.array([t.p_l[k], t.p_r[k]]))
            targets[1].append(np.array([t.omega[k]]))
    nets = [_least_squares(np.array(x), np.array(y)) for x, y in zip(rows, targets, strict=True)]
    visited = np.random.default_rng(0).random(tuple(CELL_AXES.values())) > 0.5
    region = {"u": (-1.0, 1.0), "omega": (-1.0, 1.0), "inertia": (2e5, 6e5)}
    return SlewNetwork((nets[0],), (nets[1],), region=region, meta={"by": "least squares"}, visited=visited)


def _least_squares(x: np.ndarray, y: np.ndarray) -> Mlp:
    rng, mean, std = np.random.default_rng(0), np.empty(x.shape[1]), np.empty(x.shape[1])
    for channel in description.CHANNELS:
        at = [i for i, (name, _) in enumerate(PLACES) if name == channel]
        mean[at], std[at] = x[:, at].mean(), x[:, at].std()
    eye = np.eye(len(mean))
    drawn = rng.normal(0, 2 / np.sqrt(len(mean)), (300, len(mean)))
    hidden = np.vstack([eye, -eye, drawn]).astype(np.float32)  # the inputs themselves, and 300 features
    shift = np.concatenate([np.zeros(2 * len(mean)), rng.normal(0, 0.5, 300)]).astype(np.float32)
    h = np.maximum((x - mean) / std @ hidden.T + shift, 0)
    z = (y - y.mean(axis=0)) / y.std(axis=0)
    w = np.linalg.solve(h.T @ h + 10 * np.eye(h.shape[1]), h.T @ z).T.astype(np.float32)
    layers = (hidden, w), (shift, np.zeros(len(w), np.float32))
    return Mlp(*layers, mean, std, y.mean(axis=0), y.std(axis=0))


# ---- ONNX out, and back ----


def by_onnxruntime(path: Path, given: dict[str, np.ndarray]) -> list[np.ndarray]:
    """All outputs of a graph."""
    return [np.asarray(value) for value in ort.InferenceSession(str(path)).run(None, given)]


@pytest.mark.parametrize("kind", KINDS)
def test_onnxruntime_computes_what_the_network_does(kind: str, tmp_path: Path) -> None:
    network, given = KINDS[kind], states()
    to_onnx(network, tmp_path)
    found = by_onnxruntime(tmp_path / "step.onnx", given | {"inertia": given["inertia"][:, None]})
    for one, wanted in zip(found, network.predict(**given), strict=True):
        np.testing.assert_allclose(one[:, 0], wanted, rtol=1e-6)
    if not network.symmetric:
        x = np.hstack([given[key] for key in ("u", "p_l", "p_r", "omega")] + [given["inertia"][:, None]])
        (pressures,) = by_onnxruntime(tmp_path / "pressure.onnx", {"inputs": x})
        np.testing.assert_allclose(pressures.T, network.predict(**given)[:2], rtol=1e-6)


@pytest.mark.parametrize("kind", [*KINDS, "fitted"])
def test_an_export_comes_back_whole(kind: str, fitted: SlewNetwork, tmp_path: Path) -> None:
    network = (KINDS | {"fitted": fitted})[kind]
    to_onnx(network, tmp_path)
    back = read_pair(*(tmp_path / n for n in ("pressure.onnx", "velocity.onnx", "slew.toml")))
    assert_same(back, network, 1e-12)
    assert [n.sizes for n in back.pressure] == [n.sizes for n in network.pressure]
    assert (back.symmetric, back.region) == (network.symmetric, network.region)
    if network.visited is not None:
        np.testing.assert_array_equal(back.visited, network.visited)


def test_the_same_network_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = (to_onnx(KINDS["ensemble"], tmp_path / name) for name in "ab")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]


def _drop_a_relu(model: Any) -> None:
    relu = next(n for n in model.graph.node if n.op_type == "Relu")
    relu.op_type = "Identity"


def _other_activation(model: Any) -> None:
    next(n for n in model.graph.node if n.op_type == "Relu").op_type = "Tanh"


def _other_means(model: Any) -> None:
    mean = next(t for t in model.graph.initializer if t.dims == [41])
    mean.CopyFrom(numpy_helper.from_array(2 * numpy_helper.to_array(mean), mean.name))


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (_drop_a_relu, "two linear layers without a Relu"),
        (_other_activation, "Tanh"),
        (_other_means, "mean_in in the graph is not what the description says"),
    ],
)
def test_graphs_that_are_no_such_network_are_refused(
    damage: Callable[[Any], None], said: str, tmp_path: Path
) -> None:
    files = to_onnx(KINDS["paper"], tmp_path)
    model = load(files[0])
    damage(model)
    files[0].write_bytes(model.SerializeToString())
    with pytest.raises(InputError, match=said):
        from_onnx(files[0], files[1], files[3])


# ---- other people's networks ----


def foreign(
    network: SlewNetwork, name: str, newest_first: bool, by_time: bool
) -> tuple[list[Any], list[Any], dict[str, Any]]:
    """Layers and statistics of a network as someone with FOREIGN conventions would have them."""
    (net,) = getattr(network, name)
    rows = range(HISTORY)[::-1] if newest_first else range(HISTORY)
    if by_time:
        places = [("inertia", 0)] + [(c, row) for row in rows for c in ORDER[1:]]
    else:
        places = [(c, row) for c in ORDER for row in ([0] if c == "inertia" else rows)]
    at = [PLACES.index(place) for place in places]
    factor = np.array([FOREIGN[c][1] for c, _ in places])
    outputs = ("p_r", "p_l") if name == "pressure" else ("omega",)
    turn = [description.OUTPUTS[name].index(c) for c in outputs]
    out_factor = np.array([FOREIGN[c][1] for c in outputs])
    weights, biases = [w.astype(float) for w in net.weights], [b.astype(float) for b in net.biases]
    weights[0] = weights[0][:, at] * np.sign(factor)
    weights[-1] = weights[-1][turn] * np.sign(out_factor)[:, None]
    biases[-1] = biases[-1][turn] * np.sign(out_factor)
    statistics = {
        "mean_in": net.mean_in[at] * factor,
        "std_in": net.std_in[at] * np.abs(factor),
        "mean_out": net.mean_out[turn] * out_factor,
        "std_out": net.std_out[turn] * np.abs(out_factor),
    }
    return weights, biases, {"inputs": ORDER, "outputs": outputs, "residual": net.residual, **statistics}


def write_foreign(
    network: SlewNetwork,
    folder: Path,
    newest_first: bool = False,
    by_time: bool = False,
    changes: dict[str, str] | None = None,
) -> tuple[Path, Path, Path]:
    """State dicts and description in FOREIGN conventions; `changes` replaces the text of channels."""
    lines = []
    for channel, (text, _) in FOREIGN.items():
        lines += [f"[channels.{channel}]", (changes or {}).get(channel, text)]
    for name in ("pressure", "velocity"):
        weights, biases, told = foreign(network, name, newest_first, by_time)
        layers = {}
        for i, (w, b) in enumerate(zip(weights, biases, strict=True)):
            layers |= {f"net.{2 * i}.weight": torch.tensor(w), f"net.{2 * i}.bias": torch.tensor(b)}
        torch.save(layers, folder / f"{name}.pt")
        lines += [f"[{name}]", *(f"{key} = {json.dumps(_plain(value))}" for key, value in told.items())]
        lines += ['order = "new_to_old"'] * newest_first + ['layout = "by_time"'] * by_time
    (folder / "net.toml").write_text("\n".join(lines))
    return folder / "pressure.pt", folder / "velocity.pt", folder / "net.toml"


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


@pytest.mark.parametrize(("newest_first", "by_time"), [(False, False), (True, False), (True, True)])
def test_order_sense_and_units_of_a_state_dict_do_not_matter(
    newest_first: bool, by_time: bool, tmp_path: Path
) -> None:
    for residual in (False, True):
        network = untrained(7, (24, 16), (16,), residual=residual)
        files = write_foreign(network, tmp_path, newest_first, by_time)
        assert_same(from_state_dict(*files), network, 1e-6)


def test_the_published_networks_have_their_description(tmp_path: Path) -> None:
    """Other weights in their layers, under their names of layers, go the same way."""
    told = description.read(Path(description.__file__).with_name("published.toml"))
    assert told.pressure.places()[:2] == [("u", HISTORY - 1), ("u", HISTORY - 2)]
    network = untrained(9, PRESSURE_LAYERS, VELOCITY_LAYERS)
    for name in ("pressure", "velocity"):
        (net,) = getattr(network, name)
        layers = {}
        for i, (w, b) in enumerate(zip(net.weights, net.biases, strict=True)):
            layers |= {f"layers.{2 * i}.weight": torch.tensor(w), f"layers.{2 * i}.bias": torch.tensor(b)}
        torch.save(layers, tmp_path / f"{name}.pth")
    files = tmp_path / "pressure.pth", tmp_path / "velocity.pth"
    found = read_pair(*files, Path(description.__file__).with_name("published.toml"))
    x = {key: values[:1] for key, values in states().items()}
    theirs = np.concatenate([
        (-850 * x["u"][0, ::-1]) / 410.256637,
        (x["p_l"][0, ::-1] / 1e5 - 77.8003071) / 97.7388791,
        (x["p_r"][0, ::-1] / 1e5 - 77.8003071) / 97.7388791,
        x["omega"][0, ::-1] / 0.345157123,
        (0.82 * x["inertia"] - 55.5e3 - 403212.056) / 150740.475,  # their inertia number
    ])  # fmt: skip
    p = network.pressure[0]
    plain = Mlp(p.weights, p.biases, np.zeros(41), np.ones(41), np.zeros(2), np.ones(2))
    wanted = 1e5 * (77.8003071 + 97.7388791 * plain(theirs[None])[0])
    np.testing.assert_allclose([v[0] for v in found.predict(**x)[:2]], wanted, rtol=1e-6)


def test_statistics_may_come_one_a_channel(tmp_path: Path, fitted: SlewNetwork) -> None:
    files = to_onnx(fitted, tmp_path)
    (net,) = fitted.pressure
    table = {c: net.mean_in[[p[0] for p in PLACES].index(c)] for c in description.CHANNELS}
    text = files[3].read_text()
    first = next(line for line in text.splitlines() if line.startswith("mean_in"))
    told = "mean_in = { " + ", ".join(f"{c} = {float(v)!r}" for c, v in table.items()) + " }"
    files[3].write_text(text.replace(first, told))
    assert_same(from_onnx(files[0], files[1], files[3]), fitted, 1e-12)


def test_matmul_and_add_are_layers_too(tmp_path: Path) -> None:
    """As other exporters write them: weights [in, out], the bias added by a node of its own, float32."""
    network = untrained(8, (16,), (16,))
    files = to_onnx(network, tmp_path)
    text = files[3].read_text().replace('"inside"', '"outside"')
    files[3].write_text(text)
    for path, (net,) in zip(files, (network.pressure, network.velocity), strict=False):
        nodes, constants, x = [], [], "x"
        for i, (w, b) in enumerate(zip(net.weights, net.biases, strict=True)):
            constants += [numpy_helper.from_array(w.T.copy(), f"w{i}"), numpy_helper.from_array(b, f"b{i}")]
            nodes += [helper.make_node("MatMul", [x, f"w{i}"], [f"m{i}"])]
            nodes += [helper.make_node("Add", [f"b{i}", f"m{i}"], [f"a{i}"])]
            x = f"a{i}"
            if i + 1 < len(net.weights):
                nodes += [helper.make_node("Relu", [x], [f"r{i}"])]
                x = f"r{i}"
        ends = [[helper.make_tensor_value_info(n, 1, ["n", size])] for n, size in (("x", 41), (x, len(b)))]
        graph = helper.make_graph(nodes, "other", *ends, initializer=constants)
        path.write_bytes(helper.make_model(graph).SerializeToString())
    assert_same(from_onnx(files[0], files[1], files[3]), network, 1e-6)


def with_shapes(model: Any) -> None:
    """The input as [n, 1, 41], brought to [n, 41] by a squeeze and a reshape to a computed shape."""
    first = model.graph.node[0]
    name = model.graph.input[0].name
    at = list(first.input).index(name)
    axes = numpy_helper.from_array(np.array([1]), "axes")
    sizes = numpy_helper.from_array(np.array([1, 1]), "sizes")
    model.graph.initializer.extend([axes, sizes])
    nodes = [
        helper.make_node("Squeeze", [name, "axes"], ["flat"]),
        helper.make_node("Shape", ["flat"], ["shape"]),
        helper.make_node("Mul", ["shape", "sizes"], ["wanted"]),
        helper.make_node("Reshape", ["flat", "wanted"], ["reshaped"]),
    ]
    first.input[at] = "reshaped"
    kept = [*nodes, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(kept)
    model.graph.input[0].type.tensor_type.shape.dim.insert(
        1, model.graph.input[0].type.tensor_type.shape.dim[1]
    )
    model.graph.input[0].type.tensor_type.shape.dim[1].dim_value = 1


def test_an_input_of_another_shape_with_the_same_numbers_is_read(fitted: SlewNetwork, tmp_path: Path) -> None:
    files = to_onnx(replace(fitted, visited=None), tmp_path)
    for path in files[:2]:
        model = load(path)
        with_shapes(model)
        path.write_bytes(model.SerializeToString())
        session = ort.InferenceSession(path, providers=["CPUExecutionProvider"])
        assert len(session.get_inputs()[0].shape) == 3
    assert_same(from_onnx(files[0], files[1], files[3]), fitted, 1e-12)


def test_weights_in_a_file_of_their_own_are_read_and_missed(fitted: SlewNetwork, tmp_path: Path) -> None:
    files = to_onnx(fitted, tmp_path)
    save_model(load(files[0]), files[0], save_as_external_data=True, location="weights.bin", size_threshold=0)
    assert_same(from_onnx(files[0], files[1], files[3]), fitted, 1e-12)
    content = (tmp_path / "weights.bin").read_bytes()
    (tmp_path / "weights.bin").write_bytes(content[:100])
    with pytest.raises(InputError, match=r"pressure\.onnx: not a readable ONNX file"):
        from_onnx(files[0], files[1], files[3])
    (tmp_path / "weights.bin").unlink()
    with pytest.raises(InputError, match=r"pressure\.onnx: its weights lie in a file .*weights\.bin"):
        from_onnx(files[0], files[1], files[3])
    with pytest.raises(InputError, match="there is no ONNX file at"):
        from_onnx(tmp_path / "missing.onnx", files[1], files[3])


def _without(key: str) -> Callable[[dict[str, Any]], None]:
    return lambda stored: stored.pop(key)


def _set(key: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda stored: stored.update({key: value})


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (_without("net.0.bias"), r"net.0.weight \[24×41\] is no linear layer with a bias"),
        (_without("net.2.weight"), "net.2.bias|layers"),
        (_set("net.1.running_mean", torch.zeros(3)), "net.1.running_mean"),
        (_set("net.0.weight", torch.zeros(24, 40)), "layers 40→24→16→2; expected 41→…→2"),
        (_set("net.2.weight", torch.zeros(16, 23)), r"\[24×41\], \[16×23\], \[2×16\]; expected 41→…→2"),
        (_set("net.2.weight", torch.full((16, 24), torch.nan)), "layer 2 .* not finite"),
    ],
)
def test_state_dicts_of_other_shapes_are_refused(
    damage: Callable[[dict[str, Any]], None], said: str, tmp_path: Path
) -> None:
    files = write_foreign(untrained(7, (24, 16), (16,)), tmp_path)
    stored = torch.load(files[0], weights_only=True)
    damage(stored)
    torch.save(stored, files[0])
    with pytest.raises(InputError, match=said):
        from_state_dict(*files)


def test_swapped_files_strangers_and_code_are_refused(tmp_path: Path) -> None:
    pressure, velocity, told = write_foreign(untrained(7, (24, 16), (16,)), tmp_path)
    with pytest.raises(InputError, match="pressure network with layers 41→16→1; expected 41→…→2"):
        from_state_dict(velocity, pressure, told)
    torch.save(torch.nn.Linear(41, 2), tmp_path / "whole.pt")  # a pickled module could run code
    (tmp_path / "noise.pt").write_bytes(b"no network")
    torch.jit.script(torch.nn.Linear(41, 2)).save(tmp_path / "script.pt")
    stored = {"net": {}, "mean": torch.zeros(41), "epoch": 3}
    torch.save(stored, tmp_path / "other.pt")
    for name, said in {
        "whole.pt": "whole.pt",
        "noise.pt": "noise.pt",
        "script.pt": "script.pt",
        "missing.pt": "there is no state dict at .*missing.pt",
        "other.pt": "other.pt: net, epoch: no tensor; valid: a state dict, also as state_dict",
    }.items():
        with pytest.raises(InputError, match=said):
            from_state_dict(tmp_path / name, velocity, told)
    with pytest.raises(InputError, match=r"pair of \.onnx"):
        read_pair(pressure, tmp_path / "velocity.onnx", told)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"omega", "p_r"', '"omega", "p"', "inputs: inertia, omega, p, u, p_l; needed"),
        ('"u", "p_l"]', '"u"]', "pressure.inputs: p_l missing; of what a network does not use"),
        ('unit = "bar"', 'unit = "deg"', "'deg' is no unit like Pa"),
        ('unit = "bar"', 'unit = "psi"', "psi"),
        ("full_scale = 850", "full_scale = 0", "above 0"),
        ("[pressure]", "[pressure]\nlayers = [41, 24, 2]", "expected 41→24→2"),
        ("[channels.u]", "history = 5\n[channels.u]", "history of 5 values every 0.1 s"),
        ("[channels.u]", "history = 5\n[channels.u]", "zeros in the first layer"),
        ("[channels.u]", "spacing_s = 0.05\n[channels.u]", "every 0.05 s"),
        ("[channels.u]", 'activation = "tanh"\n[channels.u]', "activation"),
        ("[channels.u]", "[channels.spool]", "no channel 'spool'"),
        ("sign = -1", "sense = -1", "unknown key"),
    ],
)
def test_descriptions_that_say_something_else_are_refused(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    files = write_foreign(untrained(7, (24, 16), (16,)), tmp_path)
    files[2].write_text(files[2].read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        from_state_dict(*files)


@pytest.mark.parametrize(
    ("said_so", "answer"),
    [
        (
            "mean_out = 0.0",
            r"velocity.mean_out is 0.0; write one number in brackets, such as \[0.0\], or a table .*omega",
        ),
        (
            'mean_in = "theirs"',
            "velocity.mean_in is 'theirs'; write 41 numbers in brackets, or a table .*inertia = …",
        ),
        ('std_out = ["1"]', "velocity.std_out.0: '1' is no number"),
        (
            "mean_in = { u = 0, p_l = 0, p_r = 0, omega = true, inertia = 0 }",
            "mean_in.omega: True is no number",
        ),
        ("std_out = [1.0, 2.0]", "std_out has 2 numbers; 1 are needed"),
    ],
)
def test_statistics_in_another_form_are_refused_in_plain_words(
    said_so: str, answer: str, tmp_path: Path
) -> None:
    files = write_foreign(untrained(7, (24, 16), (16,)), tmp_path)
    before, part, after = files[2].read_text().partition("[velocity]")
    key = said_so.split(" ")[0]
    lines = [line for line in after.splitlines() if not line.startswith(f"{key} =")]
    files[2].write_text(f"{before}{part}\n{said_so}\n" + "\n".join(lines))
    with pytest.raises(InputError, match=answer) as found:
        from_state_dict(*files)
    assert "dict[" not in str(found.value)


# ---- does it fit a recording ----


def test_a_network_that_fits_is_accepted_with_its_errors(fitted: SlewNetwork) -> None:
    found = accept(fitted, trajectories(CHECK))
    assert found.network.velocity_mae < 0.3 * found.held.velocity_mae
    assert found.network.position_mae > 0
    assert found.outside is not None
    assert 0 < found.outside < 1


@pytest.mark.parametrize(
    ("channel", "text", "said"),
    [
        ("p_l", 'unit = "Pa"', "channel p_l of the pressure network: .* beyond 6 deviations"),
        ("p_l", 'unit = "MPa"', "channel p_l of the pressure network: .*wrong unit"),
        ("omega", 'unit = "rad/s"\nsign = -1', "channel omega of the pressure network: .*wrong unit"),
        ("inertia", 'unit = "kg.m2"', "channel inertia of the pressure network"),
        ("u", 'unit = "1"\nsign = -1', "channel u of the pressure network"),
        ("u", 'unit = "1"\nfull_scale = 850', "deviations with channel u turned round"),
        ("omega", 'unit = "deg/s"', "deviations with channel omega turned round"),
    ],
)
def test_wrong_units_and_senses_are_named(
    channel: str, text: str, said: str, fitted: SlewNetwork, tmp_path: Path
) -> None:
    files = write_foreign(fitted, tmp_path, changes={channel: text})
    with pytest.raises(InputError, match=said):
        accept(from_state_dict(*files), trajectories(CHECK))


def test_exchanged_chambers_are_named(fitted: SlewNetwork, tmp_path: Path) -> None:
    files = write_foreign(fitted, tmp_path)
    text = files[2].read_text()
    for a, b in (("p_l", "p_?"), ("p_r", "p_l"), ("p_?", "p_r")):
        text = text.replace(f'"{a}"', f'"{b}"')
    files[2].write_text(text)
    with pytest.raises(InputError, match="deviations with channels p_l and p_r exchanged"):
        accept(from_state_dict(*files), trajectories(CHECK))


def test_outputs_of_another_size_are_named(fitted: SlewNetwork, tmp_path: Path) -> None:
    files = write_foreign(fitted, tmp_path)
    text = files[2].read_text()
    line = next(line for line in text.splitlines() if line.startswith("mean_out"))
    files[2].write_text(text.replace(line, "mean_out = [6e6, 6e6]"))
    with pytest.raises(InputError, match="output p_l: predicts"):
        accept(from_state_dict(*files), trajectories(CHECK))


# ---- the command ----


def test_the_command_checks_then_writes(fitted: SlewNetwork, tmp_path: Path, capsys: Any) -> None:
    pressure, velocity, told = write_foreign(fitted, tmp_path, newest_first=True)
    given = ["--pressure", pressure, "--velocity", velocity, "--description", told, "--check", CHECK]
    ends = ["--out", tmp_path / "out", "--fmu", tmp_path / "own.fmu", "--json", tmp_path / "figures.json"]
    assert entry.run(["import", "slew", *map(str, [*given, *ends])]) == 0
    assert "10 s open loop" in capsys.readouterr().out
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["velocity_mae"] == pytest.approx(accept(fitted, trajectories(CHECK)).network.velocity_mae)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "pressure.onnx", "slew.toml", "step.onnx", "velocity.onnx", "weights.npz",
    ]  # fmt: skip
    assert_same(SlewNetwork.load(tmp_path / "out" / "weights.npz"), fitted, 1e-6)
    assert (tmp_path / "own.fmu").stat().st_size > 1000


def test_what_a_region_leaves_out_comes_from_the_statistics(fitted: SlewNetwork, tmp_path: Path) -> None:
    pressure, velocity, told = write_foreign(fitted, tmp_path)
    told.write_text(f"{told.read_text()}\n[region]\nomega = [-0.5, 0.4]\n")
    given = ["--pressure", pressure, "--velocity", velocity, "--description", told, "--check", CHECK]
    ends = ["--out", tmp_path / "net.npz", "--json", tmp_path / "figures.json"]
    assert entry.run(["import", "slew", *map(str, [*given, *ends])]) == 0
    region = json.loads((tmp_path / "figures.json").read_text())["region"]
    assert (region["omega"], region["u"]) == ([-0.5, 0.4], [-1.0, 1.0])
    mean, std = fitted.velocity[0].mean_in[-1], fitted.velocity[0].std_in[-1]
    assert region["inertia"] == pytest.approx([mean - 2 * std, mean + 2 * std])


def test_a_trace_that_is_missed_or_a_folder_that_cannot_be_is_said(
    fitted: SlewNetwork, tmp_path: Path, capsys: Any
) -> None:
    pressure, velocity, told = write_foreign(fitted, tmp_path)
    given = ["--pressure", pressure, "--velocity", velocity, "--description", told, "--check", CHECK]
    limit = accept(fitted, trajectories(CHECK)).network.velocity_mae - 1e-3
    for wrong, said in (
        (["--out", tmp_path / "net.npz", "--most-error", limit], "miss its speed by"),
        (["--out", told / "folder"], "the folder cannot be made"),
    ):
        assert entry.run(["import", "slew", *map(str, [*given, *wrong])]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "net.npz").exists()


def test_a_miss_is_laid_to_the_recording_where_the_networks_have_no_data_of_it(
    fitted: SlewNetwork, tmp_path: Path, capsys: Any
) -> None:
    pressure, velocity, told = write_foreign(fitted, tmp_path)
    ends = ["--check", CHECK, "--out", tmp_path / "net.npz", "--most-error", 1e-3]
    given = ["--pressure", pressure, "--velocity", velocity, "--description", told, *ends]
    described = told.read_text()
    for region, said in (("[8e5, 9e5]", "no training data were"), ("[1e4, 9e5]", "wrong order, residual")):
        told.write_text(f"{described}\n[region]\ninertia = {region}\n")
        assert entry.run(["import", "slew", *map(str, given)]) == 2
        assert said in capsys.readouterr().err


def test_networks_that_run_away_are_not_given_an_error(
    fitted: SlewNetwork, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """10^18 deg/s would say nothing."""
    monkeypatch.setattr(importing, "RUNS_AWAY", 1e-3)
    pressure, velocity, told = write_foreign(fitted, tmp_path)
    ends = ["--check", CHECK, "--out", tmp_path / "net.npz", "--most-error", 1e-3]
    given = ["--pressure", pressure, "--velocity", velocity, "--description", told, *ends]
    assert entry.run(["import", "slew", *map(str, given)]) == 2
    assert "run away from its speed over 10 s" in capsys.readouterr().err


def test_what_is_refused_leaves_nothing(fitted: SlewNetwork, tmp_path: Path, capsys: Any) -> None:
    pressure, velocity, told = write_foreign(fitted, tmp_path, changes={"p_r": 'unit = "Pa"'})
    given = ["--pressure", pressure, "--velocity", velocity, "--description", told, "--check", CHECK]
    before = sorted(tmp_path.iterdir())
    ends = ["--out", tmp_path / "net.npz", "--fmu", tmp_path / "own.fmu"]
    assert entry.run(["import", "slew", *map(str, [*given, *ends])]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len([line for line in said if line.startswith("slewright:")]) == 1
    assert "channel p_r" in said[-1]
    for wrong in (["--out", tmp_path / "net.npz", "--fmu", tmp_path / "my net.fmu"], ["--out", told]):
        assert entry.run(["import", "slew", *map(str, [*given, *wrong])]) == 2
    assert sorted(tmp_path.iterdir()) == before


def test_a_network_that_is_no_better_than_a_held_speed_says_so(fitted: SlewNetwork) -> None:
    found = accept(fitted, trajectories(CHECK))
    assert not found.worthless
    assert acceptance.Acceptance(found.held, found.network, None).worthless
