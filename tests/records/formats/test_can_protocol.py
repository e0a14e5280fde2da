"""What a DBC or a log leaves open: whether J1939's rules hold, and in which zone a log begins."""

import pytest

from records.formats import read_measurement
from specs.errors import InputError


def test_the_start_of_a_trace_is_local_time(tmp_path):
    path = tmp_path / "r.trc"
    path.write_text(
        ";$FILEVERSION=1.1\n;$STARTTIME=46107.4\n      1)  0.0  Rx  0100  8  E8 03 00 00 00 00 00 00\n"
    )
    dbc = tmp_path / "r.dbc"
    dbc.write_text('VERSION ""\nNS_ :\nBS_:\nBU_: A\nBO_ 256 M: 8 A\n SG_ p : 0|16@1+ (1,0) [0|0] "" A\n')
    assert "the start states no time zone: taken as UTC" in read_measurement(path, dbc=dbc).repairs


NO_PROTOCOL = 'BA_DEF_  "BusType" STRING ;\nBA_DEF_DEF_  "BusType" "";\nBA_ "BusType" "CAN";\n'


@pytest.mark.parametrize("raw", [0xFFFF, 0xFE00, 0xFE12])
def test_a_bus_of_can_may_carry_j1939_whose_errors_are_no_values(tmp_path, raw):
    dbc, path = tmp_path / "r.dbc", tmp_path / "r.log"
    fields = ' SG_ p : 0|16@1+ (1,0) [0|0] "" A\n SG_ few : 16|4@1+ (1,0) [0|0] "" A\n'
    dbc.write_text(f'VERSION ""\nNS_ :\nBS_:\nBU_: A\nBO_ 2566844926 M: 8 A\n{fields}{NO_PROTOCOL}')
    path.write_text(f"(1.0) can0 18FEF1FE#{raw.to_bytes(2, 'little').hex()}000000000000\n")
    with pytest.raises(InputError, match=r"M.p is at the top .*--protocol j1939 or --protocol can says it"):
        read_measurement(path, dbc=dbc)
    assert read_measurement(path, dbc=dbc, protocol="can")["p"].values.tolist() == [raw]
    path.write_text("(1.0) can0 18FEF1FE#01000F0000000000\n")
    assert "M: all bits set in few, taken as values" in " ".join(read_measurement(path, dbc=dbc).repairs)
