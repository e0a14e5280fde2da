"""A configuration is read strictly: whatever does not fit is refused at the start with one message."""

import socket
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from runtime import configuration
from runtime.supervisor import _check_outside, lock
from specs.errors import InputError
from tests.conftest import ROOT
from tests.runtime.bundles import built

DBC = ROOT / "specs" / "generated" / "slewright.dbc"
MAP = ROOT / "specs" / "generated" / "modbus_map.csv"
WHOLE = """
bundle = "bundle"

[can]
interface = "slewright"
channel = "bus"
dbc = "slewright.dbc"

[rates]
base_hz = 50
policy_hz = 10

[realtime]
priority = 70

[modbus]
port = 1502
map = "modbus_map.csv"

[recorder]
folder = "recording"

[retain]
folder = "retained"
signals = ["fault_code", "load_estimate"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "slewright.dbc").write_bytes(DBC.read_bytes())
    (tmp_path / "modbus_map.csv").write_bytes(MAP.read_bytes())
    return tmp_path


def written(folder: Path, text: str = WHOLE) -> Path:
    path = folder / "machine.toml"
    path.write_text(text)
    return path


def test_a_whole_configuration_and_its_paths(folder: Path):
    found = configuration.read(written(folder))
    assert found.bundle == folder / "bundle"
    assert found.can.channel == str(folder / "bus")  # a socket, so its place is the file's folder, too
    assert found.realtime.priority == 70
    assert found.modbus is not None
    assert found.modbus.host == "127.0.0.1"
    assert found.recorder is not None
    assert found.recorder.folder == folder / "recording"


def test_the_shortest_configuration(folder: Path):
    text = '[can]\ninterface = "socketcan"\nchannel = "can0"\n[store]\nfolder = "s"\n'
    found = configuration.read(written(folder, text))
    assert (found.modbus, found.recorder, found.retain) == (None, None, None)
    assert found.realtime.fifo
    assert found.realtime.lock


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("priority", "prioritee", "unknown key realtime.prioritee (did you mean priority?)"),
        (
            'channel = "bus"',
            'chanel = "bus"',
            "unknown key can.chanel (did you mean channel?); missing can.ch",
        ),
        ('"slewright.dbc"', r'"slewright.dbc\u0000"', "a text with a NUL character"),
        ("[rates]", "[rate]", "unknown key rate"),
        ('"load_estimate"', '"load_estimat"', "unknown signal 'load_estimat'; did you mean load_estimate"),
        ('"slewright"', '"slewrite"', "'slewright', 'socketcan' or 'slcan' (is 'slewrite')"),
        ("base_hz = 50", "base_hz = 100", "base_hz = 100: this runtime runs at 50 Hz"),
        ("policy_hz = 10", "policy_hz = 20", "policy_hz = 20: this runtime runs at 10 Hz"),
        ("priority = 70", "priority = 99", "priority = 99: 1 to 98"),
        ("priority = 70", 'priority = "high"', "priority"),
        ('channel = "bus"', 'channel = "bus"\nbit_rate = 500000', "runs at 250000 bit/s"),
        ('bundle = "bundle"', "", "missing bundle (a folder) or [store]"),
        ("[can]", '[store]\nfolder = "s"\n[can]', "[store] leaves no room for bundle"),
        ('interface = "slewright"', 'interface = "socketcan"', "nobody has signed: on a real bus"),
        ('interface = "slewright"', 'interface = "slcan"', "with unsigned = true only"),
        ('folder = "recording"', 'folder = "retained"', "recorder.folder and retain.folder are the same"),
        (
            'folder = "recording"',
            'folder = "./x/../retained"',
            "recorder.folder and retain.folder are the same",
        ),
        ("port = 1502", 'port = "1502"', "modbus.port: Input should be a valid integer (is '1502')"),
        ('["fault_code", "load_estimate"]', "[]", "signals is empty"),
        (
            'channel = "bus"',
            'channel = "b\\nus"',
            "can.channel: 'b\\nus' has a character that cannot be printed",
        ),
        ('folder = "recording"', 'folder = "r"\nlimit_mb = 1', "limit_mb = 1: at least 8 MB"),
        ("[can]", "[can", "not valid TOML"),
        ('"slewright.dbc"', '"none.dbc"', "none.dbc"),
        ('"modbus_map.csv"', '"none.csv"', "none.csv"),
    ],
)
def test_what_does_not_fit_is_refused(folder: Path, old: str, new: str, said: str):
    assert old in WHOLE
    with pytest.raises(InputError) as refused:
        configuration.read(written(folder, WHOLE.replace(old, new, 1)))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_dbc_that_does_not_match_the_specs_is_refused(folder: Path):
    dbc = folder / "slewright.dbc"
    for old, new, said in (
        (" SG_ q_boom : ", " SG_ q_bom : ", "no signal q_boom"),
        ("BO_ 2566852738", "BO_ 2566852739", "x"),
    ):
        if old in DBC.read_text():
            dbc.write_text(DBC.read_text().replace(old, new))
            with pytest.raises(InputError, match="does not match the specs" if said == "x" else said):
                configuration.read(written(folder))
    dbc.write_text(DBC.read_text().replace("(0.0001,-3.2)", "(0.0002,-3.2)", 1))
    with pytest.raises(InputError, match=r"does not match the specs: \w+ is at .* not "):
        configuration.read(written(folder))
    dbc.write_text("this is not a DBC")
    with pytest.raises(InputError, match="cannot be read as a DBC"):
        configuration.read(written(folder))


def test_a_register_map_that_does_not_match_the_specs_is_refused(folder: Path):
    path, text = folder / "modbus_map.csv", MAP.read_text()
    row = next(line for line in text.splitlines() if ",target_x," in line)
    path.write_text(text.replace(row + "\n", ""))
    with pytest.raises(InputError, match="no register target_x in table holding"):
        configuration.read(written(folder))
    path.write_text(text.replace(row, row.replace("float32", "uint32")))
    with pytest.raises(InputError, match="target_x has type uint32, not float32"):
        configuration.read(written(folder))


def test_a_bus_that_does_not_exist_is_refused(folder: Path):
    found = configuration.read(written(folder, WHOLE.replace('"bus"', f'"{folder / "bus"}"')))
    with pytest.raises(InputError, match="is no local bus"):
        configuration.check_surroundings(found)
    text = "unsigned = true\n" + WHOLE.replace('"bus"', '"can7"').replace('"slewright"', '"socketcan"')
    with pytest.raises(InputError, match="there is no CAN interface can7"):
        configuration.check_surroundings(configuration.read(written(folder, text)))


@pytest.fixture
def bus(folder: Path):
    """Something that a local bus could be."""
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(folder / "bus"))
        yield folder / "bus"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[realtime]\n", "[realtime]\ncore = 4096\n", "core: 4096 is not one of this machine's; valid: "),
        (
            "[modbus]\n",
            '[modbus]\ntls = { port = 1503, certificate = "a", key = "b", authority = "c" }\n',
            "tls",
        ),
        ("[modbus]\n", '[modbus]\nhost = ""\n', "modbus: host is empty; 0.0.0.0 is every network"),
        ("[hmi]\n", "[hmi]\nport = 1502\n", "modbus.port and hmi.port are both 1502"),
    ],
)
def test_what_the_computer_lacks_is_refused_before_anything_starts(folder: Path, bus: Path, old, new, said):
    text = WHOLE.replace('"bus"', f'"{bus}"')
    text = text.replace(old, new) if old in text else text + "\n" + new
    with pytest.raises(InputError, match=said):
        configuration.check_surroundings(configuration.read(written(folder, text)))


def test_a_file_that_is_no_bus_is_refused(folder: Path):
    (folder / "bus").touch()
    found = configuration.read(written(folder, WHOLE.replace('"bus"', f'"{folder / "bus"}"')))
    with pytest.raises(InputError, match="is no local bus"):
        configuration.check_surroundings(found)


def test_a_local_bus_may_be_in_a_folder_of_any_name(tmp_path: Path):
    (tmp_path / "a@b").mkdir()
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(tmp_path / "a@b" / "bus"))
        text = (
            WHOLE.partition("[modbus]")[0]
            .replace('"bus"', '"a@b/bus"')
            .replace('dbc = "slewright.dbc"\n', "")
        )
        configuration.check_surroundings(configuration.read(written(tmp_path, text)))


def test_a_folder_belongs_to_one_run_at_a_time(folder: Path):
    with lock(folder), pytest.raises(InputError, match="in use by another run"):
        lock(folder)
    lock(folder).close()


def test_a_port_in_use_is_refused(folder: Path, bus: Path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        text = WHOLE.replace('"bus"', f'"{folder / "bus"}"').replace("1502", str(port))
        with pytest.raises(InputError, match=f"port {port} of 127.0.0.1 cannot be had"):
            configuration.check_surroundings(configuration.read(written(folder, text)))


@given(at=st.integers(0, len(WHOLE) - 1), drop=st.integers(0, 12), put=st.text(max_size=6))
@settings(max_examples=150)
def test_any_damage_is_read_or_refused_with_one_message(tmp_path_factory, at: int, drop: int, put: str):
    folder = tmp_path_factory.mktemp("damaged")
    text = WHOLE.replace('dbc = "slewright.dbc"\n', "").replace('map = "modbus_map.csv"\n', "")
    path = folder / "machine.toml"
    path.write_bytes((text[:at] + put + text[at + drop :]).encode("utf-8", "surrogatepass"))
    said, found = "", None
    try:
        found = configuration.read(path)
    except InputError as error:
        said = str(error)
    assert found is not None or str(path) in said
    if found is not None:
        assert (found.rates.base_hz, found.can.bit_rate) == (50.0, 250_000)


DEVICES = WHOLE + '[canopen]\ninterface = "slewright"\nchannel = "devices"\n'


def test_a_bus_of_canopen_devices_and_its_makers_files(folder: Path):
    found = configuration.read(written(folder, DEVICES + 'eds = { encoder_slew = "maker.eds" }\n')).canopen
    assert found
    assert (found.channel, found.eds) == (str(folder / "devices"), {"encoder_slew": folder / "maker.eds"})


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('eds = { encoder_slw = "maker.eds" }\n', "no CANopen node 'encoder_slw'; did you mean encoder_slew"),
        ("bit_rate = 250000\n", "bit_rate"),
    ],
)
def test_what_the_devices_bus_does_not_have_is_refused(folder: Path, more: str, said: str):
    with pytest.raises(InputError, match=said):
        configuration.read(written(folder, DEVICES + more))


@pytest.mark.parametrize("instead", ["slcan", "virtual"])
def test_devices_need_a_bus_that_two_processes_can_join(folder: Path, instead: str):
    text = DEVICES[::-1].replace('"slewright"'[::-1], f'"{instead}"'[::-1], 1)[::-1]
    with pytest.raises(InputError, match="interface"):
        configuration.read(written(folder, text))


def test_in_shadow_nobody_sets_up_devices(folder: Path):
    with pytest.raises(InputError, match="a master that sends nothing sets up no device"):
        configuration.read(written(folder, "shadow = true\n" + DEVICES))


def test_a_devices_bus_that_is_not_there_and_an_eds_that_is_none_are_refused(folder: Path):
    from runtime.canopen.start import identities
    from runtime.configuration import Canopen, _check_bus

    with pytest.raises(InputError, match=r"canopen.channel: .*devices is no local bus"):
        _check_bus("canopen", Canopen(interface="slewright", channel=str(folder / "devices")))
    pytest.importorskip("canopen")
    with pytest.raises(InputError, match=r"none.eds does not exist"):
        identities({"encoder_slew": folder / "none.eds"})


@pytest.mark.parametrize("name", ["policy", "/", "/a b", "/1st", "//a", "/a/"])
def test_the_role_of_a_policy_outside_is_a_nodes_full_name(name: str):
    with pytest.raises(InputError, match="a node's full name"):
        configuration.Ros2(policy=name)
    assert configuration.Ros2(policy="/swing/policy").policy


def test_configuration_and_bundle_agree_on_a_policy_outside():
    can = configuration.Can(interface="slewright", channel="bus")
    with_role, without = (
        configuration.Configuration(can=can, bundle=Path("b"), ros2=configuration.Ros2(policy=policy))
        for policy in ("/swing/policy", "")
    )
    _check_outside(with_role, built("outside"))
    _check_outside(without, built("pd"))
    with pytest.raises(InputError, match="no node has its role"):
        _check_outside(without, built("outside"))
    with pytest.raises(InputError, match="has a controller of its own, pd"):
        _check_outside(with_role, built("pd"))


@pytest.mark.parametrize(
    "name", ["crane 7", "crane7:8080", "https://crane7", "*.example", "", "kran.müller", "-a"]
)
def test_a_name_that_no_browser_asks_for_is_refused(folder: Path, name: str):
    with pytest.raises(InputError, match="is no name of a computer"):
        configuration.read(written(folder, WHOLE + f'\n[hmi]\nnames = ["crane7.example", "{name}"]\n'))
    assert configuration.read(written(folder, WHOLE + '\n[hmi]\nnames = ["Crane-7", "10.0.0.7"]\n')).hmi
