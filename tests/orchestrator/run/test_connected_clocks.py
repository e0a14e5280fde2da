"""Clocks connected between FMUs: who ticks whom, in which order, and what moves with a tick."""

import tempfile
from pathlib import Path

import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.system import System
from specs.errors import InputError, RunError
from tests.orchestrator.system.test_terminals import terminal
from tests.orchestrator.systems import HERE, component, connection, connector, ssd, write_ssp
from tests.verification.comparison.paper import paper

STEP_S = 0.01
VARIABLES = """
<Float64 name="every" valueReference="1" causality="parameter" variability="fixed" start="0"/>
<Float64 name="echoes" valueReference="2" causality="parameter" variability="fixed" start="0"/>
<Clock name="i" valueReference="10" causality="input" intervalVariability="triggered"/>
<Float64 name="u" valueReference="11" causality="input" variability="discrete" clocks="10" start="0"/>
<Clock name="o" valueReference="12" causality="output" intervalVariability="triggered"/>
<Float64 name="y" valueReference="13" causality="output" variability="discrete" clocks="12"/>
<Float64 name="seen" valueReference="14" causality="output" variability="discrete"/>
<Float64 name="times" valueReference="15" causality="output" variability="discrete"/>
<Clock name="p" valueReference="16" causality="input" intervalVariability="constant"
 intervalDecimal="0.03" shiftDecimal="0.01"/>
<Float64 name="z" valueReference="17" causality="output" variability="discrete" clocks="16"/>
"""
ENDS = [
    *(connector(name, kind, "Clock") for name, kind in (("i", "input"), ("o", "output"))),
    *(connector(name, kind) for name, kind in (("u", "input"), ("y", "output"))),
]
THERE = [connection("a.o", "b.i"), connection("a.y", "b.u")]
BACK = [connection("b.o", "a.i"), connection("b.y", "a.u")]
RECORD = ["a.seen", "a.times", "b.seen", "b.times"]


@pytest.fixture(scope="session")
def ticker() -> Path:
    """The FMU of ticker3.c; with a terminal of a network, whose Tx clock is periodic."""
    folder, target = Path(tempfile.mkdtemp()), compiler.host()
    thing = folder / "ticker.o"
    compiler.compile_object(HERE / "ticker3.c", thing, target.name, [f"-I{SHIM}"])
    library = compiler.link_shared([thing], folder / f"ticker{target.suffix}", target.name).read_bytes()
    bus = terminal(
        "bus", "u=Rx_Data", "i=Rx_Clock", "z=Tx_Data", "p=Tx_Clock", rule="org.fmi-ls-bus.transceiver"
    )
    text = f'<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{bus}</Terminals></fmiTerminalsAndIcons>'
    files = {"terminalsAndIcons/terminalsAndIcons.xml": text}
    return paper(folder, "ticker", VARIABLES, 3, 'hasEventMode="true"', files, library)


def system(folder: Path, ticker: Path, *connections: str, annotation: str = "") -> System:
    """Two tickers, a and b."""
    parts = [component(name, "ticker", *ENDS) for name in "ab"]
    text = ssd(parts, connections, step=str(STEP_S), version="2.0")
    text = text.replace(f'stepSize="{STEP_S}"/>', f'stepSize="{STEP_S}">{annotation}</slw:Simulation>')
    return load_system(write_ssp(folder, text, {"ticker": ticker}))


@pytest.mark.parametrize("trust", [True, False])
def test_a_tick_brings_its_values_and_nothing_moves_without_one(
    tmp_path: Path, ticker: Path, trust: bool
) -> None:
    found = system(tmp_path, ticker, *THERE)
    record = simulate(found, 7, parameters={"a.every": 3}, record=RECORD, trust=trust)
    assert record.column("b.times").tolist() == [0, 0, 0, 1, 1, 1, 2, 2]
    assert record.column("b.seen").tolist() == [0, 0, 0, 100, 100, 100, 200, 200]
    assert not any(record.column("a.times"))


def test_what_an_update_ticks_belongs_to_the_same_instant(tmp_path: Path, ticker: Path) -> None:
    found = system(tmp_path, ticker, *THERE, *BACK)
    record = simulate(found, 4, parameters={"a.every": 2, "b.echoes": 1}, record=RECORD, trust=True)
    assert record.column("b.seen").tolist() == [0, 0, 100, 100, 400]  # 200 of a's second tick, and 200 it saw
    assert record.column("a.seen").tolist() == [0, 0, 200, 200, 600]  # 100 a tick of b, and what b saw
    assert record.column("a.times").tolist() == [0, 0, 1, 1, 2]


def test_ticks_without_end_are_named(tmp_path: Path, ticker: Path) -> None:
    found = system(tmp_path, ticker, *THERE, *BACK)
    with pytest.raises(RunError) as caught:
        simulate(found, 5, parameters={"a.every": 2, "a.echoes": 2, "b.echoes": 2}, trust=True)
    assert "failed in the step from t = 0.01 s" in str(caught.value)
    assert "at t = 0.02 s clock o ticks without end" in str(caught.value)


def test_a_periodic_clock_ticks_a_triggered_one_by_terminals(tmp_path: Path, ticker: Path) -> None:
    ends = 'startElement="a" startTerminal="bus" endElement="b" endTerminal="bus"'
    found = system(tmp_path, ticker, annotation=f"<slw:TerminalConnection {ends}/>")
    record = simulate(found, 8, record=RECORD, trust=True)
    for name in "ab":  # p ticks at 0.01, 0.04 and 0.07 s
        assert record.column(f"{name}.times").tolist() == [0, 1, 1, 1, 2, 2, 2, 3, 3]
        assert record.column(f"{name}.seen").tolist() == [0, 1, 1, 1, 2, 2, 2, 3, 3]


def test_an_algorithm_that_takes_steps_back_is_refused(tmp_path: Path, ticker: Path) -> None:
    found = system(tmp_path, ticker, *THERE)
    with pytest.raises(
        InputError, match="algorithm 'adaptive' takes steps back; valid: jacobi, gauss-seidel"
    ):
        found.check_algorithm("adaptive")


def test_a_fault_on_what_moves_with_a_clock_is_refused(tmp_path: Path, ticker: Path) -> None:
    fault = '<slw:Fault target="b.u" kind="bias" value="1"/>'
    with pytest.raises(InputError, match=r"b\.u moves with the clock i, and has no faults"):
        system(tmp_path, ticker, *THERE, annotation=fault)
