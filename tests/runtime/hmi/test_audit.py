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
