"""Model exchange against references that FMUs carry: of higher order, and closed forms with events."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.conftest import Command
from tests.orchestrator.exchange import BALL, LAG, OSCILLATOR, STAIR, exchange
from verification.reference import compare, experiments

FOLDER = "extra/org.fmi-standard.fmi-ls-ref/"
MANIFEST = (
    '<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" '
    'fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1">'
    '<Related role="experiment" source="e.xml"/></fmiReferences>'
)
KIND = (
    '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" '
    'name="k"><ssv:Parameters><ssv:Parameter name="kind"><ssv:Integer value="{}"/></ssv:Parameter>'
    "</ssv:Parameters></ssv:ParameterSet>"
)
G, KEEPS = 9.81, 0.7  # of the ball in exchange.h
TIME = np.linspace(0.0, 20.0, 201)


def oscillator() -> dict[str, np.ndarray]:
    solved = solve_ivp(
        lambda _, y: [y[1], (1 - y[0] ** 2) * y[1] - y[0]],
        (0, 20),
        [2, 0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        t_eval=TIME,
    )
    return {"x": solved.y[0], "v": solved.y[1]}


def ball() -> dict[str, np.ndarray]:
    """Flights between bounces, each 0.7 times as long as the one before."""
    found, begin, speed = np.zeros(len(TIME)), 0.0, 0.0
    end = float(np.sqrt(2.0 / G))
    height = 1.0
    while end - begin > 1e-3:
        flying = (begin <= TIME) & (end > TIME)
        t = TIME[flying] - begin
        found[flying] = height + speed * t - 0.5 * G * t**2
        speed = KEEPS * (G * (end - begin) - speed if height else speed)
        if speed < 0.1:
            break
        begin, end, height = end, end + 2.0 * speed / G, 0.0
    return {"x": found}


def stair() -> dict[str, np.ndarray]:
    """The count of whole seconds, and its integral."""
    count = np.floor(TIME + 1e-9)
    return {"x": count * (count - 1.0) / 2.0 + count * (TIME - count), "count": count}


def lag() -> dict[str, np.ndarray]:
    """After a step of the input at 1 s."""
    return {"x": np.where(TIME < 1.0, 0.0, 1.0 - np.exp(-(TIME - 1.0)))}


CASES = {
    "oscillator": (OSCILLATOR, oscillator, ""),
    "ball": (BALL, ball, ""),
    "stair": (STAIR, stair, ""),
    "lag": (LAG, lag, "time,u\n0,0\n1,0\n1,1\n20,1\n"),
}


def carrying(folder: Path, version: int, name: str, change: float = 0.0) -> Path:
    """The FMU with its reference, of which the last value of `x` is off by `change`."""
    kind, solution, inputs = CASES[name]
    columns = solution()
    columns["x"] = columns["x"] + change * np.equal(TIME, TIME[-1])
    rows = ["time," + ",".join(columns)]
    rows += [",".join(f"{x:.12g}" for x in row) for row in zip(TIME, *columns.values(), strict=True)]
    stimuli = '<Stimuli source="i.csv"/>' if inputs else ""
    text = (
        '<Experiments><Experiment name="e" startTime="0" stopTime="20" stepSize="0.1" tolerance="1e-6">'
        f'<Parameters source="p.ssv"/>{stimuli}<References source="r.csv"/></Experiment></Experiments>'
    )
    path = exchange(version, folder, kind)
    files = {"fmi-ls-manifest.xml": MANIFEST, "e.xml": text, "i.csv": inputs, "r.csv": "\n".join(rows) + "\n"}
    files["p.ssv"] = KIND.format(kind)
    with zipfile.ZipFile(path, "a") as archive:
        for file, content in files.items():
            archive.writestr(FOLDER + file, content)
    return path


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("version", [2, 3])
def test_model_exchange_agrees_with_its_reference(tmp_path: Path, version: int, name: str) -> None:
    path = carrying(tmp_path, version, name)
    (experiment,) = experiments.read(path)
    signals, notes = compare.run(path, experiment, "ModelExchange", None)
    assert notes == []
    assert {s.name for s in signals} == CASES[name][1]().keys()
    assert [(s.name, s.difference, s.time_s) for s in signals if not s.agrees] == []


def test_a_difference_is_found(slewright_here: Command, tmp_path: Path) -> None:
    path = carrying(tmp_path, 3, "oscillator", 0.01)
    done = slewright_here("check", path, "--reference", "--implementation", "ModelExchange")
    assert done.returncode == 1, done.stderr
    assert "differs" in done.stdout
