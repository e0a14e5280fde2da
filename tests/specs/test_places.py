"""Which signal is where: every wired signal has a place on everything, no place is two signals'."""

import csv

import pytest

from specs import places
from specs.signals import definition

ROWS = list(csv.DictReader(places.table().splitlines()[1:]))
UNIQUE = ("signal", "CAN", "Modbus", "OPC UA", "ROS 2 command", "MCAP, Foxglove", "FMI")


def test_every_signal_has_its_row_and_every_wired_one_its_places():
    assert [row["signal"] for row in ROWS] == list(definition().signals)
    for row in ROWS:
        if definition().signals[row["signal"]].wired:
            assert all(row[column] for column in ("CAN", "Modbus", "OPC UA", "ROS 2", "MCAP, Foxglove"))


@pytest.mark.parametrize("column", UNIQUE)
def test_no_place_is_two_signals(column: str):
    found = [row[column] for row in ROWS if row[column]]
    assert len(found) == len(set(found))


def test_places_in_standard_messages_are_of_signals_and_apart():
    assert places.standard().keys() <= definition().signals.keys()
    assert len(set(places.standard().values())) == len(places.standard())
    assert {r["signal"] for r in ROWS if r["OPC UA method"]} == {
        r["signal"] for r in ROWS if r["ROS 2 command"]
    }
