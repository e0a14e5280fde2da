"""Discrete inputs and tunable parameters with event mode: set in it only, and only when they change."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM
from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import simulate
from orchestrator.system.layout import lay_out
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from tests.orchestrator.systems import HERE, component, connection, connector, load, ssd
from tests.verification.comparison.paper import paper

STEP_S = 0.01
FLAGS = (
    'hasEventMode="true" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true" '
    'canSerializeFMUState="true"'
)
OUTPUTS = ("held", "letters", "events", "x")
VARIABLES = """
<Int32 name="n" valueReference="1" causality="input" start="0"/>
<String name="word" valueReference="2" causality="input"><Start value=""/></String>
<Float64 name="u" valueReference="3" causality="input" start="0"/>
<Float64 name="gain" valueReference="4" causality="parameter" variability="tunable" start="1"/>
<String name="said" valueReference="20" causality="output"/>
""" + "".join(
    f'<Float64 name="{n}" valueReference="{vr}" causality="output"/>' for vr, n in enumerate(OUTPUTS, 10)
)
RECORD = [*(f"{owner}.{name}" for owner in "ab" for name in OUTPUTS), "a.n"]


@pytest.fixture(scope="module")
def careful() -> Path:
    """The FMU of careful3.c."""
    folder, target = Path(tempfile.mkdtemp()), compiler.host()
    thing = folder / "careful.o"
    compiler.compile_object(HERE / "careful3.c", thing, target.name, [f"-I{SHIM}"])
    library = compiler.link_shared([thing], folder / f"careful{target.suffix}", target.name).read_bytes()
    return paper(folder, "careful", VARIABLES, 3, FLAGS, {}, library)


@pytest.fixture
def pair(tmp_path: Path, careful: Path) -> System:
    """a, driven from outside, whose words b hears."""
    ends = (
        connector("n", "input", "Integer"),
        connector("u", "input"),
        connector("said", "output", "String"),
    )
    text = ssd(
        [component("a", "careful", *ends), component("b", "careful", connector("word", "input", "String"))],
        [connection("n", "a.n"), connection("u", "a.u"), connection("a.said", "b.word")],
        [connector("n", "input", "Integer"), connector("u", "input")],
        step=str(STEP_S),
    )
    return load(tmp_path, text, {"careful": careful})


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss-seidel", "iterate", "adaptive"])
@pytest.mark.parametrize("trust", [True, False])
def test_a_change_is_an_event_and_nothing_else_is(pair: System, trust: bool, algorithm: str) -> None:
    drive = Stimuli({0: {"n": 2, "u": 1.0}, 2: {"u": 3.0}, 4: {"n": 2}, 5: {"n": 7}, 8: {"u": 0.0}})
    found = simulate(pair, 10, drive, record=RECORD, trust=trust, algorithm=algorithm)
    assert found.column("a.held").tolist() == 6 * [2] + 5 * [7]
    assert found.column("a.n").tolist() == 6 * [2] + 5 * [7]
    assert found.column("a.events").tolist() == 6 * [0] + 5 * [
        1
    ]  # the first n is told in initialisation mode
    assert np.allclose(found.column("a.x")[[2, 8, 10]], [0.02, 0.2, 0.2], atol=1e-3)


def test_a_text_is_told_when_it_changes(pair: System) -> None:
    found = simulate(pair, 9, record=RECORD, trust=True)
    assert found.column("b.letters").tolist() == [0, 0, 0, 1, 1, 2, 2, 3, 3, 4]
    assert found.column("b.events").tolist() == found.column("b.letters").tolist()


def test_a_tunable_parameter_changes_in_an_event(pair: System) -> None:
    drive = Stimuli({0: {"n": 2}})
    found = simulate(pair, 6, drive, record=RECORD, trust=True, changes={3: {"a.gain": 5.0}})
    assert found.column("a.held").tolist() == [2, 2, 2, 2, 10, 10, 10]


@pytest.mark.parametrize("algorithm", ["jacobi", "adaptive"])
def test_a_restored_run_makes_the_same_events(pair: System, algorithm: str) -> None:
    options = Options(settings=replace(pair.settings, algorithm=algorithm), trust=True)

    def values(master: Master) -> list[list[Any]]:
        master.run(8)
        return [list(i.values(list(OUTPUTS)).values()) for i in master.instances]

    def made() -> Master:
        return Master(pair, lay_out(pair), pair.start_values({}), options)

    with made() as first, made() as second:
        for master in (first, second):
            master.initialise()
            master.set_input("n", 4)
        first.run(3)
        kept = first.snapshot()
        first.set_input("n", 5)
        wanted = values(first)
        second.restore(kept)
        second.set_input("n", 5)
        assert values(second) == wanted
    assert wanted[0][0] == 5.0
    assert wanted[0][2] == 2.0
