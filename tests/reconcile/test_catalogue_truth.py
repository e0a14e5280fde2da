"""Every entry against the generator of hidden effects: one effect, recorded without any disturbance.

Fitted from its own grid of starts, with no search, an entry must come down to the noise of the sensors and
find the generator's parameters.  That is a far sharper test than a case is: what a disturbance would hide by
a factor of a hundred and more stands out here.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.suite.parameters import TABLE, Setting
from blindtest import case as cases, folder as folders
from blindtest.effects.effect import Effect as Hidden
from blindtest.systems.kit import KITS
from blindtest.systems.system import STEP
from reconcile.catalogue import ALL
from reconcile.data import Block, Parts, runs_of
from reconcile.fit.solve import Fitted
from reconcile.model import Attached, read_folder
from reconcile.study import Study
from records.measurement import Channel, Measurement

SEED = 7030
TARGETS = (1500.0, 6000.0)  # lambda that effects are sized for
AT_FLOOR = 1.1  # mean square of what is left over that of the noise
CLOSE = 0.1  # of a parameter
CLOSE_OF = {"vs": 0.2}  # told by the few samples near standstill only
QUICK = ("coulomb_friction", "input_dead_zone")
SAMPLE = ("gravity_load", "input_lag", "sensor_bias/all", "structural_compliance")
SEEDS = {"structural_compliance": 7010}  # elsewhere the largest that is drawn is too small to be told exactly
LEFT_OUT = {
    # what the model makes up for by parameters of its own, so that it is not there to be told
    "arm": {"sensor_delay/all", "sensor_lag/all", "input_lag", "pose_dependent_inertia"},
}
# the other joint's reference comes with its own delay in the catalogue, with this joint's in the generator;
# near a joint's end stop a scaled angle starts beyond it
AT_FLOOR_OF = {"input_crosstalk": 1.6, "sensor_scale": 2.0}


def _key(e: Hidden) -> str:
    return f"{e.name}/{e.port}" if e.place == "output" else e.name


def _drawn() -> list[tuple[str, str]]:
    """Systems and effects that the generator draws there."""
    found = []
    for name in ("servo", "arm"):
        system = KITS[name].draw(np.random.default_rng(0))
        keys = [_key(e) for e in KITS[name].effects(system)]
        found += [(name, k) for k in dict.fromkeys(keys) if k not in LEFT_OUT.get(name, ())]
    return found


def _marked(system: str, key: str):
    often = [] if system == "servo" and key in QUICK else [pytest.mark.slow, pytest.mark.long]
    rare = [pytest.mark.slow, pytest.mark.soak]
    return pytest.param(system, key, id=f"{system}-{key}", marks=often if _sampled(key) else rare)


def _sampled(key: str) -> bool:
    """Whether an entry is among those that the long tests have; the soak has all others."""
    return key in QUICK or key in SAMPLE


def _case(system: str, key: str) -> cases.Case:
    def chosen(drawn) -> tuple[Hidden, ...]:
        return tuple(e for e in KITS[system].effects(drawn) if _key(e) == key)

    seed = SEEDS.get(key, SEED)
    return cases.draw(seed, "low", system, visible=1, kit=replace(KITS[system], effects=chosen))


def _recorded(case: cases.Case) -> list[Measurement]:
    """The case's runs as they would be without disturbance, jitter and noise on inputs."""
    rng = np.random.default_rng(SEED)
    found = []
    for run in case.problem.runs:
        y = run.outputs + case.surroundings.outputs * rng.standard_normal(run.outputs.shape)
        y = np.round(y / case.surroundings.quanta) * case.surroundings.quanta
        time = np.arange(len(y)) * STEP
        columns = [(s, run.drive.commands[:, i]) for i, s in enumerate(case.system.inputs)]
        columns += [(s, y[:, i]) for i, s in enumerate(case.system.outputs)]
        channels = {s.name: Channel(s.name, s.unit, time, v) for s, v in columns}
        found.append(Measurement(channels, source="run"))
    return found


def _study(case: cases.Case, scratch: Path) -> Study:
    model = folders._model(case, scratch)
    folder = read_folder(scratch / "model" if model == "model" else model.removeprefix("fmus/models/"))
    runs = [r for m in _recorded(case) for r in runs_of(m, folder, "run")]
    blocks = tuple(Block(r, r.start_s, r.end_s) for r in runs)
    own = [e for e in ALL if e.name == case.placed[0].effect.name]
    return Study(folder, Parts(blocks, blocks[-1:], blocks[-1:]), catalogue=own)


def _here(a: Attached, placed: Hidden) -> bool:
    """Whether a candidate is at the joint and the sensor that the effect is at."""
    if placed.place == "output" and placed.port != "all":
        return a.port == "_".join(part for part in (placed.port, placed.subsystem) if part)
    return not placed.subsystem or placed.subsystem in a.port.split("+")[0]


def _best(study: Study, placed: Hidden) -> tuple[Attached, Fitted]:
    """The best fit of any form of the effect, from every start coarsely and from the best two sharply."""
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    found = []
    for a in (a for a in study.candidates if _here(a, placed)):
        scales = study.port_scales(a)
        coarse = []
        for k in range(a.effect.grid(scales)):
            start = {a.name(n): v for n, v in a.effect.start(scales, k).items()}
            fitted = study.fit_set(base.point, (a,), start, coarse=True)
            coarse += [fitted] if fitted is not None else []
        for fitted in sorted(coarse, key=lambda f: f.cost)[:2]:
            sharp = study.fit_set(fitted.point, (a,), {})
            found += [(a, sharp)] if sharp is not None else []
    return min(found, key=lambda f: f[1].cost + np.log(1e4) * len(f[0].free))


@pytest.mark.parametrize(("system", "key"), [_marked(*pair) for pair in _drawn()])
def test_an_entry_fits_its_truth_to_the_noise_with_its_parameters(system, key, tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "TARGETS", TARGETS)
    case = _case(system, key)
    placed = case.placed[0]
    study = _study(case, tmp_path)
    a, fitted = _best(study, placed.effect)
    samples = sum(len(w.samples[n]) for w in study.fit_problem.windows for n in study.fit_problem.outputs)
    assert fitted.linear.cost / samples < AT_FLOOR_OF.get(placed.effect.name, AT_FLOOR)
    values = fitted.values(study.fit_problem)
    reported = {"parameters": {q.name: {"value": values[a.name(q.name)]} for q in a.effect.parameters}}
    base = {b.name: b.value for b in case.system.base}
    setting = Setting(case.scale.inertia, base, placed.effect.subsystem, reported)
    true = placed.parameters(case.scale)
    for name, value in TABLE[placed.effect.name].items():
        wanted = value(true, setting)
        if name in reported["parameters"] and wanted:
            assert values[a.name(name)] == pytest.approx(wanted, rel=CLOSE_OF.get(name, CLOSE)), name
