"""The CANopen devices: mistakes in their file are named; EDS and DCF files say what the file does."""

import configparser
from pathlib import Path

import pytest

from specs import canopen, canopen_eds
from specs.canopen import definition
from specs.errors import InputError
from specs.signals import signals

TEXT = canopen.PATH.read_text()


def changed(tmp_path: Path, was: str, instead: str) -> Path:
    assert was in TEXT
    path = tmp_path / "canopen.toml"
    path.write_text(TEXT.replace(was, instead, 1))
    return path


@pytest.mark.parametrize(
    ("was", "instead", "said"),
    [
        ('6004 = "q_slew"', '6004 = "q_slw"', r"sends.6004: no sensor 'q_slw'; did you mean q_slew"),
        ('6004 = "q_slew"', '6005 = "q_slew"', "encoder has no object 6005; did you mean 6004"),
        ('6004 = "q_slew"', '6501 = "q_slew"', "cannot be in a PDO"),
        ('6030sub1 = "qd_boom"', '6030sub1 = "qd_slew"', "node: qd_slew is used twice"),
        ("id = 0x21", "id = 0x20", "node: 32 is used twice"),
        ("id = 0x21", "id = 127", "id = 127: 1 to 126"),
        ("counts = 65536", "counts = 262144", "INTEGER16 cannot carry qd_slew = "),
        ('device = "encoder"', 'device = "encodr"', "did you mean encoder"),
        ("profile = 406", "profile = 402", "type: its lower half says profile 406"),
        ('2000 = "zero of q_slew"', '6501 = "zero of q_slew"', "object 6501 is read-only"),
        ('2000 = "zero of q_slew"', '2000 = "zero of q_boom"', "a number, or did you mean zero of q_slew"),
        ('u_slew" }', 'target_x" }', "no command 'target_x'"),
        ("[bus]", "[busses]", r"missing table \[bus\]"),
        ("heartbeat_ms = 100", "heartbeat = 100", "heartbeat"),
        ("6004 = {", "60x4 = {", "'60x4' is no index"),
        ("value = 4 }", "value = 70000 }", "value = 70000: 0 to 65535"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, was: str, instead: str, said: str):
    with pytest.raises(InputError, match=said):
        definition(changed(tmp_path, was, instead))


def test_numbers_and_values_are_each_others():
    for node in definition().nodes:
        for place in (*node.sends, *node.takes):
            for value in (place.signal.min or 0.0, 0.0, place.signal.max or 0.0):
                assert abs(place.entry.si(place.entry.raw(value)) - value) <= 0.5001 * place.entry.scale


def test_a_zero_is_written_with_the_other_sign_in_counts():
    node = definition().node("inclinometer_tool")
    found = {d.shown: d for d in canopen_eds.downloads(node, {"imu_tool_roll": 0.0174532925})}  # one degree
    assert (found["0x6124:0"].value, found["0x6124:0"].data) == (-1000, bytes.fromhex("18 FC FF FF"))
    assert found["0x6114:0"].value == 0


def test_a_pdo_is_switched_off_while_it_is_changed_and_every_signal_has_its_sensor():
    for node in definition().nodes:
        settings = [d for d in canopen_eds.downloads(node, {}) if d.index in (0x1400, 0x1800) and d.sub == 1]
        assert [bool(d.value >> 31) for d in settings] == [True, False] * bool(settings)
    assert canopen.sent().keys() | canopen.taken().keys() <= signals().keys()


@pytest.mark.parametrize("name", [d.name for d in definition().devices.values()])
def test_an_eds_is_whole(name: str):
    """By what CiA 306 asks of a file, read with nothing but a reader of INI files."""
    file = configparser.RawConfigParser()
    file.optionxform = str  # type: ignore[assignment]
    file.read_string(canopen_eds.eds(definition().devices[name]))
    listed = [
        file.get(part, str(i + 1))
        for part in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
        for i in range(file.getint(part, "SupportedObjects"))
    ]
    sections = [s for s in file.sections() if len(s) == 4]
    assert sorted(f"0x{s}" for s in sections) == sorted(listed)
    for section in sections:
        if file.get(section, "ObjectType") != "0x7":
            parts = [s for s in file.sections() if s.startswith(f"{section}sub")]
            assert file.getint(section, "SubNumber") == len(parts)
            highest = max(int(s.partition("sub")[2], 16) for s in parts)
            assert int(file.get(f"{section}sub0", "DefaultValue"), 0) == highest or section in (
                "1600",
                "1A00",
            )
    assert int(file.get("1018sub1", "DefaultValue"), 0) == int(file.get("DeviceInfo", "VendorNumber"), 0)


def test_a_dcf_has_the_node_and_what_is_written():
    file = configparser.RawConfigParser()
    file.read_string(canopen_eds.dcf(definition().node("valve_boom"), {}))
    assert file.getint("DeviceComissioning", "NodeID") == 0x31  # CiA 306 spells it so
    assert int(file.get("1400sub1", "ParameterValue")) == 0x231
    assert int(file.get("1600sub2", "ParameterValue")) == 0x6300_01_10
    assert int(file.get("1017", "ParameterValue")) == 100
