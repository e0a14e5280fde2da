"""What a bundle changes, in the words that an operator accepts."""

import json

import pytest

from runtime.archive.differences import Change, differences
from runtime.archive.names import BUNDLE, CONFIGURATION, DBC, MAP, SBOM
from specs.errors import InputError
from tests.runtime.archive.made import contents

OLD = contents()
DBC_LINE = b" SG_ u_boom : 32|16@1+ (3.125e-05,-1) [-1|1]"


def changed(**changes: bytes) -> list[str]:
    """In words; double underscores stand for the name of the file."""
    return [f"{c.section}: {c}" for c in differences(OLD, {**OLD, **changes})]


def edit(name: str, *pairs: tuple[bytes, bytes]) -> list[str]:
    data = OLD[name]
    for old, new in pairs:
        assert data.count(old) == 1, old
        data = data.replace(old, new)
    return changed(**{name: data})


def test_nothing_is_different():
    assert differences(OLD, OLD) == []


def test_parameters_with_units():
    name = BUNDLE + "parameters.json"
    values = json.loads(OLD[name])
    values["gate_rise"]["value"] = 8.0
    values["gate_fall"] = {"value": 20.0, "unit": "1/s"}
    del values["gain"]
    assert changed(**{name: json.dumps(values).encode()}) == [
        "parameters: removed gain (was 1.0)",
        "parameters: gate_rise: 10.0 1/s -> 8.0 1/s",
        "parameters: added gate_fall: 20.0 1/s",
    ]


def test_a_signal_that_was_scaled_moved_or_renamed():
    said = edit(DBC, (DBC_LINE, b" SG_ u_boom : 32|15@1- (6.25e-05,-1) [-1|1]"))
    assert said == [
        "CAN: signal u_boom place: bit 32, 16 bits, little-endian, unsigned -> "
        "bit 32, 15 bits, little-endian, signed",
        "CAN: signal u_boom scale: 3.125e-05 and offset -1 -> 6.25e-05 and offset -1",
    ]
    said = edit(DBC, (DBC_LINE, DBC_LINE.replace(b"u_boom", b"u_lift")))
    assert said[0].startswith("CAN: removed signal u_boom (was message SlewCommand, place bit 32, 16 bits")
    assert said[1].startswith("CAN: added signal u_lift: message SlewCommand, place bit 32, 16 bits")


def test_a_message_that_moved_and_one_that_is_new():
    said = edit(DBC, (b"BO_ 2365526400 ArmRateCommand: 8", b"BO_ 2365526401 ArmRateCommand: 8"))
    assert "CAN: message ArmRateCommand identifier: 0x0CFF1180 -> 0x0CFF1181" in said
    new = b'BO_ 2365530999 Extra: 3 Machine\n SG_ extra : 0|8@1+ (1,0) [0|1] "m" Controller\n\n'
    said = edit(DBC, (b"BO_ 2365530241 SlewP", new + b"BO_ 2365530241 SlewP"))
    assert said[0].startswith("CAN: added message Extra: identifier 0x0CFF2377, length 3 bytes")
    assert said[1].startswith("CAN: added signal extra: message Extra, place bit 0, 8 bits")
    assert "unit m" in said[1]


def test_registers():
    said = edit(MAP, (b"input,5,2,float32,high_first,1,u_slew", b"input,6,2,float32,low_first,1,u_slew"))
    assert said == [
        "Modbus: register input u_slew address: 5 -> 6",
        "Modbus: register input u_slew word_order: high_first -> low_first",
    ]


def test_a_configuration():
    before = b'[can]\nchannel = "can0"\n[rates]\nbase_hz = 50\n[[x]]\na = 1\n'
    after = before.replace(b"can0", b"can1").replace(b"[rates]\nbase_hz = 50\n", b"[realtime]\ncore = 1\n")
    said = differences({**OLD, CONFIGURATION: before}, {**OLD, CONFIGURATION: after})
    assert [str(c) for c in said] == [
        'can.channel: "can0" -> "can1"',
        "removed rates.base_hz (was 50)",
        "added realtime.core: 1",
    ]
    assert [str(c) for c in differences(OLD, {**OLD, CONFIGURATION: b"a = 1"})] == ["added a: 1"]


def test_software_code_and_other_files():
    assert edit(SBOM, (b'"2.0"', b'"2.1"')) == ["software: numpy: 2.0 -> 2.1"]
    assert changed(**{k: v for k, v in contents(2.0).items() if "manifest" in k}) == [
        "bundle: compiled code: 1.0 -> 2.0"
    ]
    said = changed(**{BUNDLE + "policy.onnx": b"x"})
    assert said[0].startswith("files: added bundle/policy.onnx: 2d711642b726")


@pytest.mark.parametrize("name", [DBC, MAP, SBOM, BUNDLE + "parameters.json", BUNDLE + "manifest.json"])
def test_what_cannot_be_read_is_said(name: str):
    with pytest.raises(InputError, match=f"{name} cannot be read"):
        differences(OLD, {**OLD, name: b"\xff\x00"})


def test_words():
    assert str(Change("s", "x", "1", "2")) == "x: 1 -> 2"
    assert str(Change("s", "x", None, "2")) == "added x: 2"
    assert str(Change("s", "x", "1", None)) == "removed x (was 1)"
