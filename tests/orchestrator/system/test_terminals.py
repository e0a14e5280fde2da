"""Terminals: read from FMUs, written in ours, and connected by in our annotation of an SSP."""

import json
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from lxml import etree

from fmus.toolchain.build import FMI_VERSIONS, build_fmu, pack as pack_zip
from fmus.toolchain.loader import model_folders
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack
from orchestrator.system.stimuli import Stimuli
from specs import systems
from specs.errors import InputError
from specs.ssd import render
from tests.conftest import Command
from tests.orchestrator.systems import OSCILLATOR, fmu, refused, write_ssp

HEAD = '<fmiTerminalsAndIcons fmiVersion="3.0">'


def terminal(name: str, *members: str, rule: str = "plug", kind: str = "") -> str:
    """A terminal element; members are `variable=member` with an optional `:kind`, or elements."""
    inner = ""
    for member in members:
        variable, _, called = member.partition("=")
        called, _, flow = called.partition(":")
        own = f' memberName="{called}"' if called else ""
        inner += member if "<" in member else (
            f'<TerminalMemberVariable variableName="{variable}"{own} variableKind="{flow or "signal"}"/>'
        )  # fmt: skip
    return f'<Terminal name="{name}" matchingRule="{rule}" terminalKind="{kind}">{inner}</Terminal>'


def with_terminals(folder: Path, name: str, *terminals: str) -> Path:
    """One of the small models with these terminals in place of its own."""
    with zipfile.ZipFile(fmu(name)) as archive:
        files = {n: archive.read(n) for n in archive.namelist()}
    text = f"{HEAD}<Terminals>{''.join(terminals)}</Terminals></fmiTerminalsAndIcons>"
    path = folder / f"{name}.fmu"
    path.write_bytes(pack_zip({**files, "terminalsAndIcons/terminalsAndIcons.xml": text.encode()}))
    return path


def by_terminals(text: str, *connections: str) -> str:
    """A description without connections between elements, but with terminals `a.b = c.d` connected."""
    text = re.sub(r"<ssd:Connection [^>]*startElement=[^>]*endElement=[^>]*/?>(</ssd:Connection>)?", "", text)
    added = ""
    for one in connections:
        (start, mine), (end, theirs) = (side.split(".") for side in one.split(" = "))
        added += (
            f'<slw:TerminalConnection startElement="{start}" startTerminal="{mine}" '
            f'endElement="{end}" endTerminal="{theirs}"/>'
        )
    return re.sub(r"(<slw:Simulation [^>]*)/>", rf"\1>{added}</slw:Simulation>", text)


def resources(folder: Path, position: str, speed: str) -> Mapping[str, Path]:
    return {
        "position": with_terminals(folder, "position", position),
        "speed": with_terminals(folder, "speed", speed),
    }


PLUGS = (
    terminal("plug", "v=rate", "position=place"),
    terminal("plug", "speed=rate", "x=place"),
)
JOINED = by_terminals(OSCILLATOR, "position.plug = speed.plug")


@pytest.mark.parametrize(
    ("position", "speed"),
    [
        PLUGS,
        (terminal("plug", "position=place", "v=rate"), terminal("plug", "speed=rate", "x=place")),
        (terminal("plug", "v", "position", rule="sequence"), terminal("plug", "speed", "x", rule="sequence")),
        (
            terminal("plug", "v=rate", terminal("end", "position=place")),
            terminal("plug", "speed=rate", terminal("end", "x=place")),
        ),
        (
            terminal("plug", "v=rate:inflow", "position=place"),
            terminal("plug", "speed=rate:outflow", "x=place"),
        ),
    ],
    ids=["plug", "another order", "sequence", "nested", "flows"],
)
def test_a_connection_by_terminal_is_that_of_its_members(tmp_path: Path, position: str, speed: str) -> None:
    plain = simulate(load_system(write_ssp(tmp_path, OSCILLATOR, ("position", "speed"))), 100)
    found = simulate(load_system(write_ssp(tmp_path, JOINED, resources(tmp_path, position, speed))), 100)
    np.testing.assert_array_equal(found.column("place"), plain.column("place"))
    assert np.ptp(plain.column("place")) > 0.0


def test_a_bus_connects_what_both_have(tmp_path: Path) -> None:
    both = resources(
        tmp_path,
        terminal("plug", "v=rate", rule="bus"),
        terminal("plug", "speed=rate", "x=place", rule="bus"),
    )
    system = load_system(write_ssp(tmp_path, JOINED, both))
    assert [(str(link.source), str(link.target)) for link in system.links] == [("speed.speed", "position.v")]
    assert any("input speed.x is not connected" in warning for warning in system.warnings)


def test_flows_into_both_sum_to_zero(tmp_path: Path) -> None:
    """What flows into one flows out of the other: the sign turns."""
    both = resources(tmp_path, terminal("plug", "v=rate:inflow"), terminal("plug", "speed=rate:inflow"))
    (link,) = load_system(write_ssp(tmp_path, JOINED, both)).links
    assert link.conversion.affine.scale == -1.0


@pytest.mark.parametrize(
    ("position", "speed", "said"),
    [
        (terminal("plug", "v=rate"), terminal("plug", "speed=r"), "only one has r, rate"),
        (terminal("plug", "v=rate"), terminal("plug", "speed=rate", rule="bus"), "rule plug and rule bus"),
        (terminal("plug", "v=rate", kind="a"), terminal("plug", "speed=rate", kind="b"), "kind a and kind b"),
        (
            terminal("plug", "v", rule="sequence"),
            terminal("plug", "speed", "x", rule="sequence"),
            "a sequence of 1 and one of 2",
        ),
        (terminal("plug", "v=r", rule="bus"), terminal("plug", "speed=s", rule="bus"), "no member in common"),
        (terminal("plug", "v=rate"), terminal("plug", "x=rate"), "position.v is input and speed.x is input"),
        (
            terminal("plug", "v=rate:inflow"),
            terminal("plug", "speed=rate"),
            "v is inflow and speed is signal",
        ),
        (terminal("plug", "v"), terminal("plug", "speed"), "cannot be matched by name"),
        (
            terminal("plug", "v=r", rule="own"),
            terminal("plug", "speed=r", rule="own"),
            "valid: plug, bus, seq",
        ),
    ],
)
def test_terminals_that_do_not_match_are_refused(
    slewright_here: Command, tmp_path: Path, position: str, speed: str, said: str
) -> None:
    done = slewright_here("check", write_ssp(tmp_path, JOINED, resources(tmp_path, position, speed)))
    assert done.returncode == 2, done.stdout
    assert said in done.stderr
    assert "position.plug" in done.stderr
    assert "speed.plug" in done.stderr
    assert re.search(r"SystemStructure.ssd line \d+", done.stderr)


@pytest.mark.parametrize(
    ("joined", "said"),
    [
        ("position.plg = speed.plug", "component position has no terminal 'plg'; did you mean plug?"),
        ("place.plug = speed.plug", "no component 'place'"),
    ],
)
def test_unknown_ends_are_named(tmp_path: Path, joined: str, said: str) -> None:
    assert said in refused(tmp_path, by_terminals(OSCILLATOR, joined), resources(tmp_path, *PLUGS))


def test_an_input_has_one_source(tmp_path: Path) -> None:
    twice = by_terminals(OSCILLATOR, "position.plug = speed.plug", "speed.plug = position.plug")
    assert "has a second source" in refused(tmp_path, twice, resources(tmp_path, *PLUGS))


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ("<Terminals", "is not valid XML"),
        (f"<Terminals>{terminal('a', 'sped=s')}</Terminals>", "no variable 'sped'"),
        (f"<Terminals>{terminal('a')}{terminal('a')}</Terminals>", "two terminals are called 'a'"),
        (f"<Terminals>{terminal('a', 'x=s', 'speed=s')}</Terminals>", "two members are called 's'"),
        ('<Terminals><Terminal name="a"/></Terminals>', "has no 'matchingRule'"),
    ],
)
def test_a_wrong_file_is_warned_of_and_refused_where_it_is_needed(
    tmp_path: Path, inner: str, said: str
) -> None:
    with zipfile.ZipFile(fmu("speed")) as archive:
        files = {n: archive.read(n) for n in archive.namelist()}
    text = f"{HEAD}{inner}</fmiTerminalsAndIcons>"
    path = tmp_path / "speed.fmu"
    path.write_bytes(pack_zip({**files, "terminalsAndIcons/terminalsAndIcons.xml": text.encode()}))
    both = {"position": with_terminals(tmp_path, "position", PLUGS[0]), "speed": path}
    warnings = load_system(write_ssp(tmp_path, OSCILLATOR, both)).warnings
    assert any(said in warning for warning in warnings)
    assert said in refused(tmp_path, JOINED, both)


def test_the_annotation_is_held_to_its_form(tmp_path: Path) -> None:
    lacking = JOINED.replace('endTerminal="plug"', "")
    assert "has no 'endTerminal'" in refused(tmp_path, lacking, resources(tmp_path, *PLUGS))
    more = JOINED.replace('endTerminal="plug"', 'endTerminal="plug" factor="2"')
    assert "attribute 'factor' of <TerminalConnection>" in refused(
        tmp_path, more, resources(tmp_path, *PLUGS)
    )


# ---- our own FMUs ----


@pytest.mark.parametrize("version", FMI_VERSIONS)
def test_our_fmus_have_terminals_and_an_icon(slewright_here: Command, tmp_path: Path, version: int) -> None:
    done = slewright_here("check", build_fmu("machine", version), "--json", tmp_path / "c.json")
    assert done.returncode == 0, done.stderr
    (machine,) = json.loads((tmp_path / "c.json").read_text())["components"]
    found = {t["name"]: t for t in machine["terminals"]}
    assert list(found["command_in"]["members"]) == ["u_slew", "u_boom", "u_stick"]
    assert found["sensor_out"]["matching_rule"] == "bus"
    assert machine["icons"] == ["icon.png", "icon.svg"]


@pytest.mark.parametrize("name", sorted(model_folders()))
def test_our_files_suit_the_schema(name: str, schemas: Path) -> None:
    with zipfile.ZipFile(build_fmu(name, 3)) as archive:
        text = archive.read("terminalsAndIcons/terminalsAndIcons.xml")
    etree.XMLSchema(etree.parse(schemas / "fmi3TerminalsAndIcons.xsd")).assertValid(etree.fromstring(text))
    assert read_model_description(str(build_fmu(name, 3))).modelName == name


@pytest.fixture(scope="module")
def schemas() -> Path:
    import fmpy

    return Path(fmpy.__file__).parent / "schema" / "fmi3"


NOMINAL = (
    *("pi.command_out = slew.command_in", "pi.command_out = arm.command_in"),
    *("pi.sensor_in = slew.sensor_out", "pi.sensor_in = arm.sensor_out"),
    *("tool.sensor_in = slew.sensor_out", "slew.internal_in = arm.internal_out"),
    "tool.internal_in = arm.internal_out",
)


@pytest.mark.parametrize("version", [2, 3])
def test_the_nominal_system_by_terminals_is_the_nominal_system(tmp_path: Path, version: int) -> None:
    spec = systems.load("nominal")
    fmus = {f"{c.fmu}.fmu": build_fmu(c.fmu, version) for c in spec.components}
    records, links = [], []
    for text in (render(spec, version), by_terminals(render(spec, version), *NOMINAL)):  # type: ignore[arg-type]
        system = load_system(pack(text, fmus, tmp_path / "nominal.ssp"))
        links.append({(str(link.source), str(link.target)) for link in system.links})
        records.append(simulate(system, 200, Stimuli({0: {"target_x": 5.0, "target_y": 8.0}}), seed=1))
    assert links[0] == links[1]
    for name in ("q_slew", "true_tool_x", "qd_boom_ref"):
        np.testing.assert_array_equal(records[0].column(name), records[1].column(name))
    assert np.ptp(records[0].column("q_slew")) > 0.0


def test_unit_and_type_are_held_to_too(tmp_path: Path) -> None:
    """`position.v` is in m/s, `speed.x` in m."""
    both = resources(tmp_path, terminal("plug", "position=place"), terminal("plug", "x=place"))
    load_system(write_ssp(tmp_path, JOINED, both))
    wrong = resources(tmp_path, terminal("plug", "v=rate"), terminal("plug", "speed=rate"))
    with zipfile.ZipFile(wrong["speed"]) as archive:
        files = {n: archive.read(n) for n in archive.namelist()}
    text = files["modelDescription.xml"].decode().replace('unit="m/s"', 'unit="m"')
    (tmp_path / "speed.fmu").write_bytes(pack_zip({**files, "modelDescription.xml": text.encode()}))
    with pytest.raises(InputError, match=r"speed\.speed \[m\] does not fit position\.v"):
        load_system(write_ssp(tmp_path, JOINED, wrong))
