"""`slewright generate`: deterministic files, up to date in the repository, stale ones found."""

import tomllib
from pathlib import Path

import pytest

from specs import generate, tables
from specs.signals import signals
from specs.units import UNITS


def test_generated_files_in_the_repository_are_up_to_date() -> None:
    assert generate.main(check=True) == []


@pytest.mark.parametrize("name", generate.GENERATORS)
def test_same_bytes_each_time_and_a_header_that_names_the_source(name: str) -> None:
    first, second = (generate.GENERATORS[name]() for _ in range(2))
    assert first == second
    assert "Generated from specs/" in (first if isinstance(first, str) else first.decode())


def test_writes_finds_stale_files_and_removes_orphans(tmp_path: Path) -> None:
    written = generate.main(folder=tmp_path)
    assert {p.relative_to(tmp_path).as_posix() for p in written} == set(generate.generators())
    assert generate.main(check=True, folder=tmp_path) == []
    (tmp_path / "slewright.dbc").write_text("edited by hand")
    (tmp_path / "left_over.txt").write_text("from an earlier version")
    stale = generate.main(check=True, folder=tmp_path)
    assert [p.name for p in stale] == ["slewright.dbc", "left_over.txt"]
    assert (tmp_path / "left_over.txt").exists()  # a check writes nothing
    assert generate.main(folder=tmp_path) == stale
    assert generate.main(check=True, folder=tmp_path) == []


def test_fmi_variables_agree_with_signals_and_units() -> None:
    found = tomllib.loads(tables.fmi_variables())
    assert set(found["variable"]) == set(signals())
    for name, s in signals().items():
        entry = found["variable"][name]
        assert (entry["vr"], entry["unit"], entry["start"]) == (s.vr, s.unit, s.start)
        assert entry.get("machine") == s.causality("machine")
        assert entry.get("controller") == s.causality("controller")
    for name, entry in found["unit"].items():
        assert (entry["factor"], entry["offset"]) == (UNITS[name].factor, UNITS[name].offset)
        assert entry["base"] == UNITS[name].exponents


def test_markdown_lists_every_signal() -> None:
    text = tables.signals_markdown()
    assert all(f"| `{name}` |" in text for name in signals())
