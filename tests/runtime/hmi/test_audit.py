"""The audit log: what is done stands on the disk, and nobody's nonsense pushes it out."""

import os
from pathlib import Path

import pytest

from runtime.hmi.audit import Audit


def test_refusals_push_nothing_out_that_was_done(tmp_path: Path):
    audit = Audit(tmp_path, largest=2000, kept=2)
    audit.write("ann", "operator", "::1", "take control", result="done")
    for _ in range(200):
        audit.write("eve", "operator", "::1", "force", signal="x" * 5000, result="refused: no")
    assert "take control" in audit.path().read_text()
    assert sum(p.stat().st_size for p in tmp_path.iterdir()) < 3 * 2000
    assert audit.last(1)[0]["who"] == "eve"


@pytest.mark.parametrize("place", ["::1", "192.0.2.7"])
@pytest.mark.parametrize("kept", [2, 5])
def test_what_one_does_pushes_out_nobody_else(tmp_path: Path, kept: int, place: str):
    audit = Audit(tmp_path, largest=2000, kept=kept)
    for who, role in (("ann", "operator"), ("grace", "service"), ("run", "runtime")):
        audit.write(who, role, "::1", "take control", result="done")
    for number in range(100):
        audit.write("eve", "operator", place, f"go to target {number}", result="done")
    found = audit.last(1000)
    assert {e["who"] for e in found} == {"ann", "grace", "run", "eve"}
    assert sum(p.stat().st_size for p in tmp_path.iterdir()) <= kept * 2000
    assert found[0]["what"] == "go to target 99"
    mine = [e["what"] for e in found if e["who"] == "eve"]
    assert mine == [f"go to target {99 - k}" for k in range(len(mine))]  # the newest, none left out


def test_many_names_of_one_place_push_out_nobody_elsewhere(tmp_path: Path):
    audit = Audit(tmp_path, largest=2000, kept=2)
    audit.write("ann", "operator", "::1", "take control", result="done")
    for number in range(100):
        audit.write(f"eve {number}", "operator", "192.0.2.7", "sign in", result="done")
    assert audit.last(1000)[-1]["who"] == "ann"


def test_half_an_entry_on_a_full_disk_is_an_error_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    audit, write = Audit(tmp_path), os.write
    audit.write("ann", "operator", "::1", "hold", result="done")
    whole = audit.path().read_bytes()
    monkeypatch.setattr(os, "write", lambda descriptor, data: write(descriptor, data[:10]))
    with pytest.raises(OSError, match="No space"):
        audit.write("ann", "operator", "::1", "acknowledge", result="done")
    assert audit.failed
    assert audit.path().read_bytes() == whole
