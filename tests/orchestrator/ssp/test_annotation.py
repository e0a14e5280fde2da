"""Steps, algorithms, faults and clocks that a description asks for: honoured, or refused with their line."""

from pathlib import Path

import pytest

from orchestrator.files import xml_file
from orchestrator.ssp.annotation import read_simulation
from orchestrator.ssp.description import Settings
from orchestrator.ssp.text import Text
from orchestrator.system.system import System
from specs.errors import InputError
from specs.faults import Fault
from tests.conftest import ROOT
from tests.orchestrator.systems import NAMESPACES, component, connection, connector, load, refused, ssd
from tests.verification.comparison.paper import paper, scalar

STATE = 'canGetAndSetFMUState="true" canHandleVariableCommunicationStepSize="true"'
REAL = scalar("u", 1, "input", '<Real start="0"/>') + scalar("y", 2, "output", "<Real/>")
TWO = [component(n, n, connector("u", "input"), connector("y", "output")) for n in ("a", "b")]
LINKS = [connection("a.y", "b.u"), connection("b.y", "a.u")]
PLAIN = ssd(TWO, LINKS, step="0.02")
ELEMENT = '<slw:Simulation xmlns:slw="urn:slewright:simulation" stepSize="0.02"'


def text(attributes: str = "", inner: str = "") -> str:
    new = f"{ELEMENT} {attributes}>{inner}</slw:Simulation>"
    return PLAIN.replace(f"{ELEMENT}/>", new, 1)


def fmus(folder: Path, flags: str = STATE, version: int = 2) -> dict[str, Path]:
    flags = flags.replace("State", "state") if version == 2 else flags
    return {"a": paper(folder, "a", REAL, 2, flags), "b": paper(folder, "b", REAL, 2, flags)}


def loaded(folder: Path, *arguments: str) -> System:
    return load(folder, text(*arguments), fmus(folder))


def line(part: str, whole: str) -> str:
    return f"SystemStructure.ssd line {1 + whole[: whole.index(part)].count(chr(10))}: "


def test_settings_are_read(tmp_path: Path) -> None:
    assert loaded(tmp_path).settings == Settings()
    found = loaded(tmp_path, 'algorithm="adaptive" tolerance="1e-4" maxIterations="7" maxHalvings="3"')
    assert found.settings == Settings("adaptive", 1e-4, 7, 3)


def test_steps_of_components_are_multiples(tmp_path: Path) -> None:
    found = loaded(tmp_path, "", '<slw:Component name="b" stepSize="0.1"/>')
    assert [c.multiple for c in found.components.values()] == [1, 5]


def test_faults_are_kept(tmp_path: Path) -> None:
    found = loaded(tmp_path, "", '<slw:Fault target="a.u" kind="bias" start_s="1" value="0.5"/>')
    assert found.faults == (Fault(target="a.u", kind="bias", start_s=1.0, value=0.5),)


@pytest.mark.parametrize(
    ("attributes", "inner", "words"),
    [
        ('algorithm="jacoby"', "", "unknown algorithm 'jacoby'; did you mean jacobi"),
        ('tolerance="0"', "", "tolerance must be positive, not 0"),
        ('maxIterations="0"', "", "maxIterations = 0; valid: 1 … 100000"),
        ('maxHalvings="41"', "", "maxHalvings = 41; valid: 0 … 40"),
        ('step="1"', "", "attribute 'step' of <Simulation>; did you mean stepSize"),
        ("", '<slw:Componet name="a"/>', "<Componet> inside <Simulation>; did you mean Component"),
        ("", '<slw:Component name="a"/>', "<Component> has no 'stepSize'"),
        ("", '<slw:Component name="c" stepSize="0.1"/>', "no component 'c'; valid: a, b"),
        ("", '<slw:Component name="a" stepSize="0.03"/>',
         "stepSize 0.03 of component 'a' is not a whole multiple of the system's, 0.02 s"),
        ("", '<slw:Component name="a" stepSize="0.01"/>', "stepSize 0.01 of component 'a' is not a"),
        ("", '<slw:Component name="a" stepSize="0.1"/>' * 2, "second <Component> named 'a'"),
        ("", '<slw:Fault target="a.y" kind="bias" value="1"/>',
         "fault 'bias' on a.y: no connected input and no connector; did you mean"),
        ("", '<slw:Fault target="a.u" kind="bias" value="1" start_s="0.03"/>', "start_s = 0.03: not a"),
        ("", '<slw:Fault target="a.u" kind="bios"/>', "no fault 'bios'"),
        ("", '<slw:Fault target="a.u" kind="bias" valeu="1"/>', "no attribute 'valeu'; did you mean value"),
    ],
)  # fmt: skip
def test_what_the_annotation_may_not_say(tmp_path: Path, attributes: str, inner: str, words: str) -> None:
    whole = text(attributes, inner)
    message = refused(tmp_path, whole, fmus(tmp_path))
    assert words in message
    assert message.startswith(line(ELEMENT, whole))


def test_algorithms_that_take_steps_back_need_fmus_that_can(tmp_path: Path) -> None:
    for algorithm in ("iterate", "adaptive"):
        whole = text(f'algorithm="{algorithm}"')
        message = refused(tmp_path, whole, fmus(tmp_path, ""))
        assert (
            f"component a: algorithm '{algorithm}' takes steps back, but its FMU cannot get and set"
            in message
        )
        assert message.startswith(line('<ssd:Component name="a"', whole))
    fixed = fmus(tmp_path, STATE.split()[0])
    assert "algorithm 'adaptive' changes the step" in refused(tmp_path, text('algorithm="adaptive"'), fixed)
    load(tmp_path, text('algorithm="iterate"'), fixed)
    plain = load(tmp_path, text(), fmus(tmp_path, ""))
    plain.check_algorithm("gauss-seidel")
    with pytest.raises(InputError, match="unknown algorithm 'euler'"):
        plain.check_algorithm("euler")


def test_our_annotation_elsewhere_is_warned_of(tmp_path: Path) -> None:
    inner = '<ssd:Annotations><ssc:Annotation type="slewright.simulation"/></ssd:Annotations>'
    whole = PLAIN.replace("</ssd:Connections>", f"</ssd:Connections>{inner}", 1)
    assert any(
        "is read on <SystemStructureDescription> only" in w
        for w in load(tmp_path, whole, fmus(tmp_path)).warnings
    )


# ---- clocks ----


def clock(name: str, vr: int, causality: str, variability: str, more: str = "") -> str:
    return (
        f'<Clock name="{name}" valueReference="{vr}" causality="{causality}" variability="discrete" '
        f'intervalVariability="{variability}" {more}/>'
    )


def clocked(folder: Path, *clocks: str, flags: str = 'hasEventMode="true"', step: str = "0.02") -> System:
    fmu = paper(folder, "c", "".join(clocks), 3, flags)
    return load(folder, ssd([component("c", "c")], step=step, version="2.0"), {"c": fmu})


def test_periodic_clocks_tick_at_whole_steps(tmp_path: Path) -> None:
    found = clocked(
        tmp_path,
        clock("one", 1, "input", "constant", 'intervalDecimal="0.1" shiftDecimal="0.04"'),
        clock("two", 2, "input", "tunable", 'intervalDecimal="0.02"'),
        clock("three", 3, "input", "fixed", 'resolution="50" intervalCounter="3"'),
        clock("out", 4, "output", "triggered"),
    )
    assert found.components["c"].clocks == {"one": (2, 5), "two": (0, 1), "three": (0, 3)}


@pytest.mark.parametrize(
    ("variability", "more", "flags", "words"),
    [
        ("constant", 'intervalDecimal="0.03"', 'hasEventMode="true"',
         "component c: clock k ticks every 0.03 s from 0 s on: no whole multiples of its step, 0.02 s"),
        ("constant", 'intervalDecimal="0.04" shiftDecimal="0.01"', 'hasEventMode="true"', "every 0.04 s"),
        ("constant", 'intervalDecimal="0.04"', "", "its FMU has clock k, but no event mode"),
        ("countdown", "", "", "its FMU has clock k, but no event mode"),
    ],
)  # fmt: skip
def test_clocks_that_are_not_supported(
    tmp_path: Path, variability: str, more: str, flags: str, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        clocked(tmp_path, clock("k", 1, "input", variability, more), flags=flags)
    assert words in str(caught.value)
    assert str(caught.value).startswith("SystemStructure.ssd line 6: component c")


def test_triggered_clocks_that_nobody_ticks_are_warned_of(tmp_path: Path) -> None:
    found = clocked(tmp_path, clock("k", 1, "input", "triggered"))
    assert any("triggered clock k is not connected and never ticks" in w for w in found.warnings)


def test_clocks_that_cannot_be_connected_are_refused_and_circles_named(tmp_path: Path) -> None:
    clocks = [clock("i", 1, "input", "triggered"), clock("o", 2, "output", "triggered")]
    clocks.append(clock("k", 3, "input", "constant", 'intervalDecimal="0.04"'))
    ends = [connector(n, kind, "Clock") for n, kind in (("i", "input"), ("o", "output"), ("k", "input"))]
    parts = [component(n, "c", *ends) for n in "ab"]
    there, back = connection("a.o", "b.i"), connection("b.o", "a.i")

    def given(*connections: str, flags: str = 'hasEventMode="true"', structure: str = "") -> tuple[str, Path]:
        fmu = paper(tmp_path, "c", "".join(clocks), 3, flags, structure=structure)
        return ssd(parts, connections, version="2.0"), fmu

    text, fmu = given(there, back)
    assert [str(e.target) for e in load(tmp_path, text, {"c": fmu}).clock_links] == ["b.i", "a.i"]
    text, fmu = given(there, back, structure='<Output valueReference="2" dependencies="1"/>')
    message = refused(tmp_path, text, {"c": fmu})
    assert message.startswith("SystemStructure.ssd line 1")
    assert "clock circle: a.o → b.i → b.o → a.i → a.o" in message
    text, fmu = given(there, flags="")
    assert "component a: its FMU has clock k, but no event mode" in refused(tmp_path, text, {"c": fmu})
    text, fmu = given(there)
    slower = '"0.01"><slw:Component name="b" stepSize="0.02"/></slw:Simulation>'
    message = refused(tmp_path, text.replace('"0.01"/>', slower), {"c": fmu})
    assert "component b: clock i is connected, but the component does not step with the system" in message
    text, fmu = given(connection("a.o", "b.k"))
    assert "k is a constant input clock; valid: a triggered input" in refused(tmp_path, text, {"c": fmu})


def test_the_fixed_internal_step_is_respected(tmp_path: Path) -> None:
    variables = '<Float64 name="y" valueReference="1" causality="output"/>'
    flags = 'fixedInternalStepSize="0.015"'
    fmus = {"c": paper(tmp_path, "c", variables, 3, flags)}
    message = refused(tmp_path, ssd([component("c", "c")], step="0.02"), fmus)
    assert (
        "component c steps 0.02 s, which is not a whole multiple of its fixedInternalStepSize, 0.015"
        in message
    )
    load(tmp_path, ssd([component("c", "c")], step="0.03"), fmus)


@pytest.mark.parametrize(
    ("step", "halvings"), [("0.04", 1), ("0.02", 0), ("0.06", 0), ("0.01", None), ("0.03", None)]
)
def test_adaptive_keeps_to_multiples_of_the_fixed_internal_step(
    tmp_path: Path, step: str, halvings: int | None
) -> None:
    variables = '<Float64 name="y" valueReference="1" causality="output"/>'
    able = 'canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true"'
    fmus = {"c": paper(tmp_path, "c", variables, 3, f'fixedInternalStepSize="0.01" {able}')}
    system = load(tmp_path, ssd([component("c", "c")], step=step), fmus)
    if halvings is None:
        with pytest.raises(
            InputError, match=f"halves the step of {step} s, but its FMU steps whole multiples of 0.01"
        ):
            system.check_algorithm("adaptive")
    else:
        system.check_algorithm("adaptive")
        assert system.halvings(16) == halvings


def test_the_documented_annotation_is_read() -> None:
    text = (ROOT / "docs" / "reference" / "ssp.md").read_text()
    example = text.split("```xml\n")[1].split("```")[0]
    root = xml_file.parse(f"<r {NAMESPACES}>{example}</r>".encode(), "docs/reference/ssp.md")
    found = read_simulation(Text("docs/reference/ssp.md", "2.0", []), root)
    assert (found.step_s, found.settings) == (0.02, Settings("iterate", 1e-6, 50, 16))
    assert found.steps["plant.valve"][0] == 0.1
    assert [str(fault) for fault, _ in found.faults] == ["bias on plant.valve.u, 10 s to the end: value 0.05"]
