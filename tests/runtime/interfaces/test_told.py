"""What interfaces tell reaches the alarm list and the audit log, once, and cannot fill them."""

import json
from pathlib import Path

from runtime.hmi.alarms import Alarms, Condition, Level
from runtime.hmi.audit import Audit
from runtime.hmi.outsiders import JOIN_NS, SHOWN_NS, Outsiders
from runtime.interfaces.told import KEPT, LINES, Teller


def test_a_refusal_is_an_alarm_and_in_the_audit_log(tmp_path: Path):
    audit = Audit(tmp_path / "audit")
    outsiders, now = Outsiders(tmp_path, audit), JOIN_NS
    outsiders.look(now)  # nothing is there yet
    teller = Teller(tmp_path, "opcua")
    assert teller.tell("mallory was refused: its certificate is not issued by the authority", Level.WARNING)
    assert teller.tell("planner has the right to command", Level.NOTE)
    outsiders.look(now := now + JOIN_NS)
    (found,) = outsiders.conditions()
    assert found.text.startswith("OPC UA: somebody was refused")
    assert found.cause.startswith("mallory was refused")
    entries = [json.loads(line) for path in (tmp_path / "audit").iterdir() for line in path.open()]
    assert [e["what"].split()[0] for e in entries] == ["mallory", "planner"]
    outsiders.look(now + SHOWN_NS)
    assert outsiders.conditions() == []


def test_a_device_that_is_missing_is_an_alarm_in_its_own_words(tmp_path: Path):
    outsiders = Outsiders(tmp_path, Audit(tmp_path / "audit"))
    assert Teller(tmp_path, "canopen").tell("valve_slew is missing: no boot-up message", Level.WARNING)
    outsiders.look(JOIN_NS)
    (found,) = outsiders.conditions()
    assert found.text == "CANopen: a device is missing, refused or in trouble"
    assert found.cause.startswith("valve_slew is missing")


def test_a_process_that_was_started_again_goes_on_with_its_cell(tmp_path: Path):
    outsiders, now = Outsiders(tmp_path, Audit(tmp_path / "audit")), JOIN_NS
    for text in ("first", "second"):
        assert Teller(tmp_path, "ros2").tell(text, Level.WARNING)
        outsiders.look(now := now + JOIN_NS)
        assert [c.cause for c in outsiders.conditions()] == [text]


def test_who_tries_again_and_again_fills_no_log(tmp_path: Path, capsys):
    teller = Teller(tmp_path, "ros2")
    assert sum(teller.tell("the same", Level.WARNING) for _ in range(100)) == 1
    assert (
        sum(teller.tell(f"another {n} \n\x1b[31m" + "x" * 500, Level.WARNING) for n in range(100))
        == LINES - 1
    )
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == LINES > KEPT
    assert not any("\x1b" in line for line in lines)


def test_who_acknowledged_over_an_interface_shows_in_alarms_and_audit_log(tmp_path: Path):
    audit, alarms = Audit(tmp_path / "audit"), Alarms()
    alarms.update([Condition("emergency_stop", Level.CRITICAL, "Emergency stop is open", "")], [], 1.0)
    outsiders = Outsiders(tmp_path, audit)
    Teller(tmp_path, "opcua").acknowledge("emergency_stop", "ann", "ann acknowledged Emergency stop: seen")
    outsiders.look(JOIN_NS)
    assert outsiders.conditions() == []
    (found,) = outsiders.acknowledged
    alarms.acknowledge_key(*found)
    assert [a.acknowledged for a in alarms.listed()] == ["ann (OPC UA)"]
    assert alarms.acknowledge_key("no_such", "ann") == []
    entries = [json.loads(line) for path in (tmp_path / "audit").iterdir() for line in path.open()]
    assert entries[-1]["what"] == "ann acknowledged Emergency stop: seen"
