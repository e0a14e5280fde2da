"""Equations that are played give the bits of compiled ones: every operation, models and sets of effects."""

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from fmus.definition import Model, Variable
from reconcile.catalogue import ALL
from reconcile.equations.model import Attached, Folder, candidates
from reconcile.filter import library, tape
from reconcile.filter.kalman import Kalman
from tests.reconcile import models

SHAFT = {"k": 500.0, "c": 5.0, "share": 0.5}
X, Y = ca.SX.sym("x"), ca.SX.sym("y")
TERMS = {
    "arithmetic": (X + Y) * (X - Y) / (2.0 + Y * Y) - 0.1 * X,
    "powers": ca.sqrt(1.0 + X * X) * (1.0 + Y * Y) ** 1.3 * (1.0 + X * X) ** (0.1 * Y) + 1.0 / (3.0 + X),
    "angles": ca.sin(X) * ca.cos(Y) + ca.tan(0.3 * X) + ca.atan(Y) + ca.atan2(X, 2.0 + Y) + ca.hypot(X, Y),
    "inverse": ca.asin(0.2 * X) + ca.acos(0.2 * Y) + ca.asinh(X) + ca.acosh(9.0 + Y) + ca.atanh(0.2 * X),
    "growth": ca.exp(-X * X) + ca.log(4.0 + Y) + ca.log1p(X * X) + ca.expm1(0.1 * Y) + ca.erf(X),
    "hyperbolic": ca.tanh(X) + 0.01 * (ca.sinh(Y) + ca.cosh(X)),
    "steps": ca.floor(X) + ca.ceil(Y) + ca.sign(X) + ca.fabs(Y) + ca.fmod(X, 0.7) + ca.copysign(X, Y),
    "choices": ca.fmin(X, Y) + ca.fmax(X, 0.2) + ca.if_else(X < Y, X, 2.0 * Y) + ca.if_else(X <= 0.1, 1.0, Y),
    "logic": ca.if_else(ca.logic_or(ca.logic_not(X), ca.logic_and(X != Y, Y)), 0.3, X) + (X == Y),
}


def of_terms(term: ca.SX) -> Folder:
    """A model of one state that a term moves."""
    f = ca.Function("term", [X, Y], [term])
    return models.folder(
        Model(
            name="term",
            description="A term",
            kind="continuous",
            step=0.01,
            states=(Variable("q", "1", "State"),),
            inputs=(Variable("u", "1", "Input"),),
            outputs=(Variable("y", "1", "State"),),
            parameters=(Variable("gain", "1", "Gain", start=0.3, min=0.0, max=1.0),),
            rhs=lambda x, u, m, p: {"q": p.gain * f(x.q, u.u) - x.q},
            out=lambda x, u, m, p: {"y": x.q + 0.01 * f(u.u, x.q)},
        )
    )


def driven(folder: Folder, keys: list[str]) -> tuple[Kalman, list[Attached]]:
    """A filter over a made recording of a model, all of which moves, with candidates of the catalogue."""
    time, rng = 0.02 * np.arange(80), np.random.default_rng(4)
    moved = {
        v.name: (time, np.cumsum(rng.standard_normal(80)) * 0.1)
        for v in (*folder.model.inputs, *folder.model.outputs)
    }
    inputs = {v.name: moved[v.name] for v in folder.model.inputs}
    one = models.run(inputs, {v.name: moved[v.name] for v in folder.model.outputs})
    ports = [v.name for v in (*folder.model.inputs, *folder.model.outputs)]
    found = [a for a in candidates(folder, ports, ALL) if a.key in keys]
    kalman = Kalman(folder, found, models.recorded(one), [v.name for v in folder.model.outputs])
    kalman.substeps = 2 if folder.model.kind == "continuous" else 1
    return kalman, found


def bits(kalman: Kalman, present: list[Attached]) -> list[bytes]:
    """All that a run of the filter says."""
    held = models.noise(kalman)
    for a in present:
        held |= {a.name(q.name): SHAFT.get(q.name, 0.1) for q in a.effect.parameters}
        held |= {n: 1.0 for n in (a.name("gate"), a.name("width")) if n in held}
    windows = [np.r_[0, np.ones(len(r.time) - 1, int)] for r in kalman.records]
    runs = kalman.run(held, present, windows=windows, states=True)
    assert runs is not None
    return [a.tobytes() for r in runs for a in (r.e, r.s, r.free, r.z, r.v)]


def both(folder: Folder, keys: list[str], monkeypatch) -> None:
    """Played and compiled runs are the same; nothing is compiled for the first."""
    found = []
    for pays in (np.inf, 0.0):
        monkeypatch.setattr(library, "PAYS", pays)
        kalman, present = driven(folder, keys)
        assert sorted(a.key for a in present) == sorted(keys)
        found.append(bits(kalman, present))
        (part,) = kalman._parts.values()
        assert (part.library._compiled is None) == bool(pays)
    assert found[0] == found[1]


@pytest.mark.parametrize("name", TERMS)
def test_every_operation_gives_the_bits_of_compiled_code(name: str, monkeypatch):
    both(of_terms(TERMS[name]), [], monkeypatch)


def test_all_operations_are_tried():
    tried = set()
    for term in TERMS.values():
        f = ca.Function("f", [X, Y], [term])
        tried |= {f.instruction_id(k) for k in range(f.n_instructions())}
    rest = {ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_ASSIGN}
    assert tape.KNOWN.keys() | rest == tried | rest


@pytest.mark.parametrize(
    ("folder", "keys"),
    [
        (models.spring(), ["coulomb_friction@v", "sensor_lag@velocity", "input_lag@force"]),
        (models.spring(), ["structural_compliance@v", "input_backlash@force"]),
        (models.stepped(), ["coulomb_friction@v", "input_dead_zone@wanted", "sensor_lag@rate"]),
        (models.cooling(), ["sensor_delay@temperature"]),
        (models.pendulum(), []),
        (models.chain(3), []),
    ],
    ids=lambda v: v.model.name if isinstance(v, Folder) else "+".join(v) or "alone",
)
def test_a_model_with_effects_gives_the_bits_of_compiled_code(folder: Folder, keys: list[str], monkeypatch):
    both(folder, keys, monkeypatch)


def test_a_run_does_not_depend_on_that_of_another_model_before():
    kalman, present = driven(models.spring(), ["sensor_lag@velocity"])
    first = bits(kalman, present)
    bits(*driven(models.chain(4), ["sensor_lag@y0"]))  # its rows are longer
    assert bits(kalman, present) == first


def test_what_a_tape_has_no_room_for_is_compiled(monkeypatch):
    monkeypatch.setattr(library.tape, "playable", lambda functions, sizes: False)
    kalman, _ = driven(models.cooling(), [])
    assert bits(kalman, [])
    (part,) = kalman._parts.values()
    assert part.library._compiled is not None
    monkeypatch.undo()
    functions: dict[str, Any] = part.library.stepped.functions
    assert tape.playable(functions, part.library.stepped.sizes)
    assert not tape.playable(functions, part.library.stepped.sizes | {"NX": tape.MOST["NX"] + 1})
    wide = SimpleNamespace(sz_w=lambda: tape.MOST["W"], nnz_in=lambda: 0, nnz_out=lambda: 0)
    assert not tape.playable({"kf_f": wide}, part.library.stepped.sizes)  # type: ignore[dict-item]


def test_a_model_that_is_run_much_is_compiled(monkeypatch):
    kalman, _ = driven(models.cooling(), [])
    bits(kalman, [])
    (part,) = kalman._parts.values()
    once = library.PAYS - part.library._left  # steps, their substeps, operations of one
    assert once == 80 * 2 * part.library._played.operations
    part.library._left = 2.5 * once
    ways = []
    for _ in range(4):
        bits(kalman, [])
        ways.append(part.library._compiled is not None)
    assert ways == [False, False, True, True]
