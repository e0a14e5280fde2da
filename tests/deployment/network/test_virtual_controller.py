"""The virtual controller over the bus FMU: the same records as by plain signals, or others as calculated."""

import io
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from deployment.network import nodes, reference, system
from fmus.toolchain.build import pack
from orchestrator.fmi.instance import Instance
from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.layout import lay_out
from orchestrator.system.stimuli import Stimuli
from records import record as records
from records.record import Record
from runtime.bundle import Bundle
from slewright import __main__ as entry
from specs import scenario
from specs.errors import InputError
from specs.schema import ROOT
from tests.conftest import Command
from tests.fmus.network import operations as op
from tests.runtime.bundles import built
from verification.reference import experiments, series
from verification.runs import plant_parameters

SEED, DURATION_S, CYCLE_S = 5, 8.0, 0.02
TRUE = ("true_q_slew", "true_q_boom", "true_tool_x", "p_pump")
SHOWN = ("u_slew", "u_boom", "control_mode", "fault_code")
COUNTED = ("bus.frames", "bus.errors", "bus.dropped", "controller.bus_errors", "bus.longest_wait")


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    folder = tmp_path_factory.mktemp("systems")
    return {
        "over": system.over_the_bus(built(), folder / "over.ssp"),
        "plain": system.by_plain_signals(built(), folder / "plain.ssp"),
    }


def run(path: Path, duration_s: float = DURATION_S, **parameters: float) -> Record:
    """A run with a scenario's targets; names of parameters have `__` for a point."""
    chosen, loaded = scenario.load("five_targets_2t"), load_system(path)
    ticks = round(CYCLE_S / loaded.step_s)
    changes = {k * ticks: v for k, v in chosen.stimuli().items() if k * CYCLE_S < duration_s}
    values = plant_parameters(loaded, "reference", chosen.parameters(SEED))
    values |= {name.replace("__", "."): value for name, value in parameters.items()}
    counted = COUNTED if "bus" in loaded.components else ()
    record, values = [*TRUE, *SHOWN, *counted], {**values, "controller.plain": "io" not in loaded.components}
    return simulate(
        loaded, round(duration_s / loaded.step_s), Stimuli(changes), values, seed=SEED, record=record
    )


def same(one: Record, other: Record) -> bool:
    """Whether the machine did the same, to the bit, and saw the same commands when it stepped."""
    every = round(CYCLE_S / system.STEP_S)
    return all(np.array_equal(one.column(n), other.column(n)) for n in TRUE) and all(
        np.array_equal(one.column(n)[::every], other.column(n)[::every]) for n in SHOWN
    )


def test_over_the_bus_the_records_are_those_of_plain_signals(packed: Mapping[str, Path]) -> None:
    over, plain = run(packed["over"]), run(packed["plain"])
    assert same(over, plain)
    assert set(over.column("control_mode")[500:]) == {3.0}
    assert np.ptp(over.column("true_q_slew")) > 0.5
    assert over.column("bus.longest_wait")[-1] < nodes.CYCLE_PHASE_S


def test_a_run_over_the_bus_is_repeated_bit_for_bit(packed: Mapping[str, Path]) -> None:
    faults = {"bus__error_probability": 0.02, "bus__drop_probability": 0.005}
    one, other = run(packed["over"], **faults), run(packed["over"], **faults)
    assert all(np.array_equal(one.column(n), other.column(n)) for n in one.names)
    assert one.column("bus.dropped")[-1] > 0


def test_a_core_that_does_not_wait_for_its_sensors_has_them_a_cycle_later(packed: Mapping[str, Path]) -> None:
    early, late = run(packed["over"], controller__cycle_phase=0.0), run(packed["plain"], controller__late=1)
    assert same(early, late)
    assert not same(early, run(packed["plain"]))


def test_delay_counts_only_where_it_reaches_past_the_cycle(packed: Mapping[str, Path]) -> None:
    plain = run(packed["plain"])
    assert same(run(packed["over"], bus__delay=0.003), plain)  # 9 ms on the bus and these are before 14 ms
    assert not same(run(packed["over"], bus__delay=0.008), plain)


def test_twice_the_rate_takes_half_the_time(packed: Mapping[str, Path]) -> None:
    rates = {f"{name}bit_rate": 500_000 for name in ("bus__", "controller__CAN__", "io__CAN__")}
    slow, fast = run(packed["over"], 2.0), run(packed["over"], 2.0, **rates)
    half = 0.5 * slow.column("bus.longest_wait")[-1]
    assert fast.column("bus.longest_wait")[-1] == pytest.approx(half, rel=0.01)
    assert same(slow, fast)


def test_spoiled_frames_come_later_and_are_counted(packed: Mapping[str, Path]) -> None:
    record = run(packed["over"], bus__error_probability=0.01)
    assert record.column("bus.errors")[-1] == record.column("controller.bus_errors")[-1] > 20
    assert same(record, run(packed["plain"]))


@pytest.mark.parametrize(
    ("identifier", "fault"), [(0x0CFF2081, 1.0), (0x0CFF1285, 10.0)], ids=["sensor", "operator"]
)
def test_what_nobody_receives_any_more_stops_the_machine(
    packed: Mapping[str, Path], identifier: int, fault: float
) -> None:
    lost = {"bus__drop_probability": 1.0, "bus__fault_identifier": identifier, "bus__fault_from": 4.0}
    record = run(packed["over"], 6.0, **lost)
    assert set(record.column("fault_code")[:4000]) == {0.0}
    assert record.column("fault_code")[-1] == fault
    assert record.column("u_slew")[-1] == 0.0


def test_without_commands_the_valves_go_neutral_and_the_machine_says_so(packed: Mapping[str, Path]) -> None:
    lost = {"bus__drop_probability": 1.0, "bus__fault_identifier": 0x0CFF1080, "bus__fault_from": 4.0}
    record = run(packed["over"], 6.0, **lost)
    first = np.flatnonzero(record.column("u_slew")[4000:] == 0.0)[0]
    assert 60 < first < 140  # commands of 20 ms that time out after 100 ms
    assert record.column("fault_code")[-1] == 16.0  # machine fault


def test_a_snapshot_in_the_middle_goes_on_as_before(packed: Mapping[str, Path]) -> None:
    loaded = load_system(packed["over"])
    layout = lay_out(loaded, ["u_slew", "true_tool_x", "bus.frames"])
    with Master(loaded, layout, loaded.start_values({}), Options()) as master:
        master.plan.log(4000)
        master.initialise()
        master.run(1003)
        master.take(1, 4000, 0)
        snapshot = master.snapshot()
        master.run(2000)
        first = master.take(1, 4000, 0)
        master.restore(snapshot)
        master.run(2000)
        again = master.take(1, 4000, 0)
        master.log_finish()
    assert len(first) > 900
    assert np.array_equal(first, again)


def edited(path: Path, out: Path, *changes: tuple[str, str]) -> Path:
    """The package with its description changed by regular expressions."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    text = files["SystemStructure.ssd"].decode()
    for pattern, replacement in changes:
        text, count = re.subn(pattern, replacement, text, flags=re.DOTALL)
        assert count == 1, pattern
    out.write_bytes(pack({**files, "SystemStructure.ssd": text.encode()}))
    return out


def test_a_bus_at_two_rates_is_refused(
    packed: Mapping[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = (
        '<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="2.0" '
        'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" name="rate"><ssv:Parameters>'
        '<ssv:Parameter name="CAN.bit_rate"><ssv:UInt32 value="125000"/></ssv:Parameter></ssv:Parameters>'
        "</ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    path = edited(
        packed["over"],
        tmp_path / "two.ssp",
        (r'(<ssd:Component name="controller".*?<ssd:Connectors/>)', rf"\1{wrong}"),
    )
    out = tmp_path / "record.parquet"
    for command in (["check", str(path)], ["simulate", str(path), "--out", str(out)]):
        assert entry.run(command) == 2
        assert (
            "a bus at two rates: controller.CAN with 125000 bit/s and bus.Node1 with 250000 bit/s"
            in capsys.readouterr().err
        )
    assert not out.exists()
    with pytest.raises(InputError, match=r"a bus at two rates: io\.CAN with 500000 bit/s and bus\.Node2"):
        run(packed["over"], io__CAN__bit_rate=500_000)


def test_terminals_that_lack_a_half_of_the_bus_are_refused(
    packed: Mapping[str, Path], tmp_path: Path
) -> None:
    terminal = 'startTerminal="CAN" endElement="bus" endTerminal="Node1"'
    other = terminal.replace("bus", "machine").replace("Node1", "sensor_out")
    path = edited(packed["over"], tmp_path / "half.ssp", (terminal, other))
    with pytest.raises(InputError, match=r"terminals controller\.CAN and machine\.sensor_out do not fit"):
        load_system(path)


def test_nodes_connected_without_a_bus_do_the_same(packed: Mapping[str, Path], tmp_path: Path) -> None:
    path = edited(
        packed["over"],
        tmp_path / "direct.ssp",
        (r'<ssd:Component name="bus".*?</ssd:Component>', ""),
        (r'<slw:TerminalConnection startElement="controller"[^>]*/>', ""),
        (r'endElement="bus" endTerminal="Node2"', 'endElement="controller" endTerminal="CAN"'),
    )
    assert same(run(path), run(packed["plain"]))


def foreign(content: bytes) -> bytes:
    """The same FMU as somebody else might have packed it: it runs in a process of its own."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    return pack({**files, "documentation/foreign.txt": b"packed elsewhere"})


def test_nodes_in_processes_of_their_own_do_the_same(packed: Mapping[str, Path], tmp_path: Path) -> None:
    with zipfile.ZipFile(packed["over"]) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    path = tmp_path / "foreign.ssp"
    path.write_bytes(pack({n: foreign(c) if n.endswith(".fmu") else c for n, c in files.items()}))
    alone, here = run(path, 1.0), run(packed["over"], 1.0)
    assert all(np.array_equal(alone.column(n), here.column(n)) for n in here.names)


def test_frames_are_those_of_the_dbc(tmp_path: Path) -> None:
    """By another reader of the DBC, in the order of urgency."""
    database: Any = cantools.database.load_file(ROOT / "generated" / "slewright.dbc")
    loaded = load_system(nodes.build_machine_io(tmp_path / "machine_io.fmu"))
    with Instance(next(iter(loaded.components.values()))) as node:
        node.enter_initialisation()
        node.set(q_slew=1.234567, q_boom=0.75, qd_slew=-0.123, imu_tool_rate_x=0.05, target_x=7.5)
        node.exit_initialisation()
        node.update_discrete()
        node.enter_step()
        assert node.step(0.0, 0.001).event
        node.enter_event()
        content = node.values(["CAN.Tx_Data"])["CAN.Tx_Data"]
    codes = [code for code, _ in op.read(content)]  # type: ignore[arg-type]
    sent = op.frames(content)  # type: ignore[arg-type]
    assert codes[:2] == [op.CONFIGURATION, op.CONFIGURATION]
    assert [i for i, _ in sent] == sorted(i for i, _ in sent)
    found = {}
    for identifier, data in sent:
        found |= database.decode_message(identifier, data)
    assert found["q_slew"] == pytest.approx(1.234567, abs=5.1e-7)
    assert found["qd_slew"] == pytest.approx(-0.123, abs=2.6e-5)
    assert found["target_x"] == pytest.approx(7.5, abs=5.1e-4)
    assert {database.get_message_by_frame_id(i).name for i, _ in sent} >= {"SlewPosition", "OperatorJoystick"}


def test_check_shows_the_terminals_of_the_bus(packed: Mapping[str, Path], tmp_path: Path) -> None:
    assert entry.run(["check", str(packed["over"]), "--json", str(tmp_path / "figures.json")]) == 0
    components = {c["name"]: c for c in json.loads((tmp_path / "figures.json").read_text())["components"]}
    (can,) = components["controller"]["terminals"]
    assert (can["name"], can["matching_rule"]) == ("CAN", "org.fmi-ls-bus.transceiver")
    assert set(can["members"]) == {"Rx_Data", "Tx_Data", "Rx_Clock", "Tx_Clock"}
    assert can["terminals"][0]["members"]["bit_rate"] == "CAN.bit_rate"
    assert [t["name"] for t in components["bus"]["terminals"]] == ["Node1", "Node2"]


@pytest.mark.long
def test_bundle_writes_valid_fmus(tmp_path: Path) -> None:
    controller, whole = tmp_path / "pd.fmu", tmp_path / "pd.ssp"
    out = ["--out", str(tmp_path / "pd.bundle")]
    assert entry.run(["bundle", "pd", *out, "--fmu", str(controller), "--can"]) == 0
    assert entry.run(["bundle", "pd", *out, "--fmu", str(whole)]) == 0
    assert validate_fmu(str(controller)) == []
    with zipfile.ZipFile(controller) as archive:
        manifest = archive.read("extra/org.fmi-standard.fmi-ls-bus/fmi-ls-manifest.xml").decode()
    assert 'isBusSimulationFMU="false"' in manifest
    assert sorted(load_system(whole).components) == ["bus", "controller", "io", "machine"]
    assert validate_fmu(str(nodes.build_machine_io(tmp_path / "io.fmu"))) == []


def test_values_are_set_on_the_command_line(
    packed: Mapping[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "record.parquet"
    line = ["simulate", str(packed["over"]), "--stop", "0.5", "--out", str(out), "--record", "bus.dropped"]
    for wrong, words in (
        ("nonsense", "--set nonsense is not of the form NAME=VALUE"),
        ("target=7", "no input or parameter of that name; did you mean target_"),
        ("target_x=left", "input target_x needs a number"),
        ("bus.rate=1", "component bus has no parameter 'rate'"),
        ("bus.bit_rate=500000", "a bus at two rates"),
    ):
        assert entry.run([*line, "--set", wrong]) == 2
        assert words in capsys.readouterr().err
    assert not out.exists()
    given = ["--set", "target_x=7", "--set", "bus.drop_probability=1", "--set", "controller.plain=false"]
    assert entry.run([*line, *given]) == 0
    assert records.read(out).column("bus.dropped")[-1] > 300


@pytest.mark.parametrize("build", [reference.build_controller, reference.build_plain])
def test_the_controller_does_what_it_carries(
    slewright_here: Command, tmp_path: Path, build: Callable[[Bundle, Path], Path]
) -> None:
    """Three seconds with the machine by plain signals; another parameter, and the outputs differ."""
    fmu = build(built(), tmp_path / "c.fmu")
    (experiment,) = experiments.read(fmu)
    assert experiment.references is not None
    found = series.read(experiment.references[1], "outputs.csv").columns
    assert found["control_mode"][-1] == 3.0  # automatic
    assert np.ptp(found["u_slew"]) > 0.2
    assert not found["fault_code"].any()
    assert slewright_here("check", fmu, "--reference").returncode == 0
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    (changed,) = (name for name in files if name.endswith("inputs.csv"))
    files[changed] = files[changed].replace(b",7,7,4,", b",7,6,4,")
    fmu.write_bytes(pack(files))
    assert slewright_here("check", fmu, "--reference").returncode == 1
