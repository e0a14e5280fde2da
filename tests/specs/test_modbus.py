"""The generated Modbus map: a header on each table, no overlap, and the places of signals.toml."""

import csv
from typing import Literal

import pytest

from specs import tables
from specs.signals import definition, signals

ON_MODBUS = {name: s for name, s in signals().items() if s.modbus}


@pytest.fixture(scope="module")
def rows() -> list[dict[str, str]]:
    lines = tables.modbus_csv().splitlines()
    assert lines[0].startswith("# Generated from specs/signals.toml")
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


@pytest.mark.parametrize("table", ["input", "holding"])
def test_header_says_what_follows(table: str, rows: list[dict[str, str]]) -> None:
    head = [r for r in rows if r["table"] == table][:5]
    assert [r["name"] for r in head] == ["magic", "magic", "model_id", "version", "length"]
    assert [int(r["address"]) for r in head] == [0, 1, 2, 3, 4]
    magic = b"".join(int(r["start"]).to_bytes(2, "big") for r in head[:2])
    assert magic == b"SLWR"
    body = [r for r in rows if r["table"] == table][5:]
    assert int(head[4]["start"]) == sum(int(r["registers"]) for r in body)


@pytest.mark.parametrize("table", ["input", "holding"])
def test_registers_follow_each_other_without_overlap(table: str, rows: list[dict[str, str]]) -> None:
    following = 0
    for row in (r for r in rows if r["table"] == table):
        assert int(row["address"]) == following, row["name"]
        following += int(row["registers"])
    assert following <= 125 * 2  # two read requests at most


def test_map_agrees_with_the_signals(rows: list[dict[str, str]]) -> None:
    found = {r["name"]: r for r in rows if not r["description"].startswith(("header", "server"))}
    assert set(found) == set(ON_MODBUS)
    for name, s in ON_MODBUS.items():
        row, place = found[name], s.modbus
        assert place
        assert (row["table"], int(row["address"]), row["type"]) == (place.table, place.address, place.type)
        assert (row["unit"], float(row["scale"])) == (s.unit, place.scale)
        assert (float(row["min"]), float(row["max"])) == (s.min, s.max)
        assert row["word_order"] == ("high_first" if len(place.registers) == 2 else "")
        assert row["access"] == ("rw" if place.table == "holding" else "r")


def test_map_lists_the_servers_own_registers(rows: list[dict[str, str]]) -> None:
    found = {r["name"]: r for r in rows if r["description"].startswith("server")}
    services = definition().modbus.services
    assert set(found) == set(services)
    for name, place in services.items():
        assert (found[name]["table"], int(found[name]["address"])) == (place.table, place.address)
        assert found[name]["access"] == ("rw" if place.table == "holding" else "r")


@pytest.mark.parametrize("table", ["input", "holding"])
def test_one_request_reads_a_whole_table(table: Literal["input", "holding"]) -> None:
    """125 registers are the most a read may ask for, 123 the most a write may carry."""
    assert definition().modbus.tables[table].body.stop <= {"input": 125, "holding": 123}[table]


def test_integer_registers_hold_their_range() -> None:
    for s in ON_MODBUS.values():
        if s.modbus and s.modbus.type == "uint16":
            assert s.min is not None
            assert s.max is not None
            assert s.min / s.modbus.scale >= 0
            assert s.max / s.modbus.scale <= 65535, s.name


def test_only_targets_can_be_written_and_a_heartbeat_guards_them() -> None:
    """Commands never come over Modbus; what a client asks for lapses when its heartbeat stops."""
    writable = {name: s for name, s in ON_MODBUS.items() if s.modbus and s.modbus.table == "holding"}
    assert {s.kind for s in writable.values()} == {"target"}
    assert "planner_heartbeat" in writable
    assert all(s.timeout_s for s in writable.values())
    assert "controller_heartbeat" in ON_MODBUS


def test_model_ids_are_the_vendors_own() -> None:
    ids = [table.model_id for table in definition().modbus.tables.values()]
    assert len(set(ids)) == len(ids)
    assert min(ids) >= 64001
