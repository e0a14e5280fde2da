"""Numbers that stand for no value are told from states, and whole numbers stay exact, on CAN."""

import pytest

from records.formats import read_measurement
from records.formats.codes import means_no_value, of_states


@pytest.fixture
def read(tmp_path):
    """Read raw numbers of one signal on CAN, with its value table."""

    def reader(place: str, raws, table: str = "", more: str = "", unit: str = ""):
        dbc, path = tmp_path / "r.dbc", tmp_path / "r.log"
        message = f'BO_ 256 M: 8 A\n SG_ s : {place} [0|0] "{unit}" A\n'
        dbc.write_text(f'VERSION ""\nNS_ :\nBS_:\nBU_: A\n{message}{more}\nVAL_ 256 s {table} ;\n')
        frames = [(raw & (2**64 - 1)).to_bytes(8, "little").hex() for raw in raws]
        path.write_text("".join(f"({0.5 * k:.6f}) can0 100#{d}\n" for k, d in enumerate(frames)))
        return read_measurement(path, dbc=dbc, protocol="can")

    return reader


@pytest.mark.parametrize(
    ("place", "table", "raws", "values"),
    [
        ("0|1@1+ (1,0)", '0 "invalid" 1 "valid"', [0, 1, 0], [0, 1, 0]),
        ("0|1@1+ (1,0)", '0 "ok" 1 "Invalid"', [0, 1, 0], [0, 1, 0]),
        ("0|8@1+ (1,0)", '0 "not available" 1 "available" 255 "SNA"', [0, 1, 255], [0, 1]),
        ("0|8@1+ (1,0)", '0 "Error" 255 "No error"', [0, 255, 7], [0, 255, 7]),
        ("0|8@1+ (1,0)", '254 "Error" 255 "N.A."', [0, 254, 255, 7], [0, 7]),
        ("0|16@1- (0.1,0)", '32766 "Error" 32767 "SNA" -1 "Error"', [5, 32766, 32767, 65535], [0.5, -0.1]),
    ],
)
def test_codes_are_no_samples_and_states_are(read, place, table, raws, values):
    assert read(place, raws, table)["s"].values.tolist() == pytest.approx(values)


@pytest.mark.parametrize("word", [
    "SignalNotAvailable", "SNV", "not supported", "non disponible", "Nicht definiert: undefiniert", "无效",
    "Timeout", "Implausible", "Open circuit", "Short to ground", "Out of range", "SignalFailure",
])  # fmt: skip
def test_words_for_no_value(read, word):
    assert read("0|16@1+ (0.1,0)", [5, 65535], f'65535 "{word}"')["s"].values.tolist() == [0.5]


@pytest.mark.parametrize(("place", "unit", "said"), [
    ("0|16@1+ (0.1,0)", "", True), ("0|16@1+ (1,0)", "bar", True), ("0|16@1+ (1,0)", "", False),
])  # fmt: skip
def test_numbers_of_a_quantity_that_have_a_name_are_kept_and_said(read, place, unit, said):
    found = read(place, [5, 65535, 6, 65535], '65535 "Init" 7 "Warm"', unit=unit)
    assert len(found["s"].values) == 4
    assert any("the DBC names are kept as values, 2 times: 65535 'Init'" in r for r in found.repairs) is said


def test_a_code_of_a_float_is_its_number(read):
    bits = [0x3FC00000, 0x477FFF00]  # 1.5 and 65535
    found = read("0|32@1- (1,0)", bits, '65535 "SNA"', "SIG_VALTYPE_ 256 s : 1;")
    assert found["s"].values.tolist() == [1.5]


@pytest.mark.parametrize(("scale", "offset"), [(1, 5), (10, 0), (1, -3), (-1, 0), (3, 2**40)])
def test_whole_numbers_of_64_bits_stay_exact_under_a_rule_of_whole_numbers(read, scale, offset):
    raws = [2**53 + 1, 2**53 + 3, 12, 2**57 + 1]
    found = read(f"0|64@1+ ({scale},{offset})", raws)["s"].values
    assert [int(v) for v in found] == [scale * raw + offset for raw in raws]


def test_whole_numbers_that_a_rule_rounds_are_said(read):
    assert any("rounded to floats" in note for note in read("0|64@1+ (0.5,0)", [2**63 + 1, 3]).repairs)
    assert not any("rounded" in note for note in read("0|64@1+ (0.5,0)", [2**40 + 1, 3]).repairs)


def test_states_are_told_from_codes_by_their_opposite():
    assert of_states(["valid", "invalid", "SNA"]) == {"invalid"}
    assert of_states(["verfügbar", "nicht verfügbar", "ungültig"]) == {"nicht verfügbar"}
    assert not of_states(["on", "off", "invalid", "not available"])
    assert not means_no_value("No_error", True)
    assert means_no_value("Sensor_error", True)
