"""Every status of every function, and every time that an FMU may tell: one rule each, here and apart."""

import functools
import math
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings, strategies as st

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM, pack
from orchestrator.run.simulate import simulate
from orchestrator.ssp.description import Settings
from orchestrator.system.single_fmu import system_of_fmu
from orchestrator.system.system import System
from records.record import read
from specs.errors import RunError
from tests.orchestrator.systems import HERE

OK, WARNING, DISCARD, ERROR, FATAL, PENDING, UNKNOWN = 0, 1, 2, 3, 4, 5, 77
STATUSES = (OK, WARNING, DISCARD, ERROR, FATAL, PENDING, UNKNOWN)
PLAIN = ("nothing", "set", "get", "step", "terminate", "enter", "leave")
FUNCTIONS = (*PLAIN, "enter event", "update", "enter step")
STATES = ("get state", "set state")
ALL = (*FUNCTIONS, *STATES)
UNTOLD, TOLD, TOLD_NAN, TOLD_INF = range(4)
STEP_S, TICKS = 0.02, 10

WHOLE = {"function": 10, "status": 11, "kind": 12, "early": 13, "always": 14}
REAL2 = '<ScalarVariable name="{}" valueReference="{}" causality="{}"{}><Real{}/></ScalarVariable>'
MOODY2 = f"""<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="moody" guid="moody">
<CoSimulation modelIdentifier="moody" canHandleVariableCommunicationStepSize="true"
 canGetAndSetFMUstate="true"/><ModelVariables>
{REAL2.format("u", 1, "input", "", ' start="1"')}{REAL2.format("y", 2, "output", "", "")}
{REAL2.format("least", 3, "output", "", "")}
{REAL2.format("offset", 4, "parameter", ' variability="fixed"', ' start="0"')}
{
    "".join(
        f'<ScalarVariable name="{n}" valueReference="{v}" causality="parameter" variability="fixed">'
        f'<Integer start="0"/></ScalarVariable>'
        for n, v in WHOLE.items()
    )
}
</ModelVariables><ModelStructure/></fmiModelDescription>"""
MOODY3 = f"""<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="moody" instantiationToken="moody">
<CoSimulation modelIdentifier="moody" canHandleVariableCommunicationStepSize="true"
 canGetAndSetFMUState="true" MORE/><ModelVariables>
<Float64 name="u" valueReference="1" causality="input" start="1"/>
<Float64 name="y" valueReference="2" causality="output"/>
<Float64 name="least" valueReference="3" causality="output"/>
<Float64 name="offset" valueReference="4" causality="parameter" variability="fixed" start="0"/>
{
    "".join(
        f'<Int32 name="{n}" valueReference="{v}" causality="parameter" variability="fixed" start="0"/>'
        for n, v in WHOLE.items()
    )
}
</ModelVariables><ModelStructure/></fmiModelDescription>"""
KINDS = {"2": "", "3": "", "3 early": 'mightReturnEarlyFromDoStep="true"', "3 events": 'hasEventMode="true"'}


@functools.cache
def moody(kind: str) -> System:
    """The FMU alone, with a step of 20 ms."""
    target, version = compiler.host(), int(kind[0])
    folder = target.fmi2_folder if version == 2 else target.name
    description = MOODY2 if version == 2 else MOODY3.replace("MORE", KINDS[kind])
    with tempfile.TemporaryDirectory() as scratch:
        thing, library = Path(scratch) / "moody.o", Path(scratch) / f"moody{target.suffix}"
        flags = [f"-I{SHIM}", "-fvisibility=default"]
        compiler.compile_object(HERE / f"moody{version}.c", thing, target.name, flags)
        compiler.link_shared([thing], library, target.name)
        path = Path(scratch) / "moody.fmu"
        entries = {"modelDescription.xml": description.encode()}
        path.write_bytes(pack(entries | {f"binaries/{folder}/moody{target.suffix}": library.read_bytes()}))
        return system_of_fmu(path, STEP_S)


def outcome(which: str, trust: bool, algorithm: str = "jacobi", **parameters: float) -> tuple[str, Any, Any]:
    """The error, the rows and the counts of a run."""
    given = {f"moody.{name}": value for name, value in parameters.items()}
    counts: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        path, error = Path(folder) / "r.parquet", ""
        try:
            simulate(
                moody(which),
                TICKS,
                parameters=given,
                record_path=path,
                settings=Settings(algorithm),
                statistics=counts,
                trust=trust,
            )
        except RunError as caught:
            error = str(caught)
        rows = read(path).table.to_pydict() if path.exists() else None
    return error, rows, counts.get("components")


def both(which: str, algorithm: str = "jacobi", **parameters: float) -> tuple[str, Any, Any]:
    """The same here and apart."""
    here, apart = (outcome(which, trust, algorithm, **parameters) for trust in (True, False))
    assert here == apart
    return here


def functions_of(kind: str) -> tuple[str, ...]:
    return FUNCTIONS if kind == "3 events" else PLAIN


@pytest.mark.parametrize("kind", KINDS)
def test_every_status_of_every_function(kind: str) -> None:
    plain = both(kind)
    assert plain[0] == ""
    assert plain[1]["y"] == pytest.approx([STEP_S * k for k in range(TICKS + 1)])
    for function in functions_of(kind)[1:]:
        for status in STATUSES:
            error, rows, counts = both(kind, function=ALL.index(function), status=status)
            shown = f"{function} {status}: {error}"
            goes_on = status in (OK, WARNING) or (status == DISCARD and function == "step")
            assert (error == "") == goes_on, shown
            if goes_on:
                assert rows["y"] == pytest.approx(plain[1]["y"]), shown
                assert counts["moody"]["discards"] == (status == DISCARD), shown
            elif status == DISCARD and function in ("set", "get"):
                assert "returned discard" in error, shown
            ended = {"set": 3, "get": 3, "step": 3, "terminate": TICKS + 1, "enter": 0, "leave": 0}.get(
                function
            )
            if not goes_on and ended is not None:
                assert len(rows["y"]) in (ended, ended + 1), shown


@pytest.mark.parametrize("kind", ["2", "3"])
def test_every_status_of_states(kind: str) -> None:
    for function in STATES:
        for status in STATUSES:
            given = {"function": ALL.index(function), "status": status, "always": 1}
            error, _, _ = both(kind, "adaptive", **given)
            assert (error == "") == (status in (OK, WARNING)), f"{function} {status}: {error}"


def test_a_step_that_is_always_discarded() -> None:
    error, rows, counts = both("2", function=ALL.index("step"), status=DISCARD, always=1)
    assert "returned discard" in error
    assert len(rows["y"]) == 4
    assert counts["moody"]["discards"] == 20


offsets = st.floats(-1e3, 1e3) | st.sampled_from((0.0, 0.5, 1.0, 1.0 + 1e-9, 2.0, -1e-9, -1.0, 1e300))


@given(
    st.sampled_from(("2", "3", "3 early")),
    st.sampled_from((OK, DISCARD)),
    st.sampled_from((TOLD, TOLD_NAN, TOLD_INF, UNTOLD)),
    st.booleans(),
    offsets,
)
@example("2", DISCARD, TOLD, False, 2.0)  # a time beyond the step
@example("2", DISCARD, TOLD, False, -50.0)
@example("2", DISCARD, TOLD_NAN, False, 0.0)
@example("3", OK, TOLD, False, 0.5)  # not early, and yet not at the end
@example("3 early", OK, TOLD, True, 0.5)
@settings(max_examples=100, deadline=None)
def test_every_time_told(kind: str, status: int, told: int, early: bool, offset: float) -> None:
    """A time inside of the step goes on from there, every other one ends the run and is named."""
    early = early and kind == "3 early"
    part = early or status == DISCARD
    tells = told != UNTOLD and (kind != "2" or status == DISCARD)
    at = {TOLD: offset, TOLD_NAN: math.nan, TOLD_INF: math.inf}.get(told, 0.0)
    slack = 1e-4
    inside = not tells or (0.0 if part else 1.0) <= at <= 1.0
    unclear = tells and min(abs(at), abs(at - 1.0)) < slack  # as good as at an end
    given = {"function": ALL.index("step"), "status": status, "kind": told, "offset": offset, "early": early}
    error, rows, _ = both(kind, **given)
    if unclear:
        inside = error == ""
    if inside:
        assert error == ""
        assert rows["y"] == pytest.approx([STEP_S * k for k in range(TICKS + 1)], abs=STEP_S * slack)
        assert min(rows["least"][1:]) > 0.0
    else:
        assert "it says that it reached t = " in error
        assert "from 0.06 s to 0.08 s" in error
