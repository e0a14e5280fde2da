"""Every input of this folder is read as it was meant, or refused with words that help."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from specs.errors import InputError
from tests.records.foreign.cases import DATA, Case, line

TABLE = tomllib.loads((Path(__file__).parent / "expected.toml").read_text(encoding="utf-8"))
ENTRIES: list[dict[str, Any]] = [
    {k: tuple(v) if isinstance(v, list) else v for k, v in c.items()} for c in TABLE["case"]
]
CASES = [Case(**entry) for entry in ENTRIES]


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c.file} {c.options or ''}")
def test_it_is_read_as_it_was_meant_or_refused(case: Case):
    if case.refused:
        with pytest.raises(InputError) as caught:
            case.measured()
        assert case.refused in str(caught.value)
        assert case.options.get("dbc", case.file) in str(caught.value) or case.file in str(caught.value)
        return
    found = case.measured()
    assert tuple(line(c) for c in found.channels.values()) == case.read
    assert (found.start.isoformat() if found.start else "") == case.start
    for words in case.says:
        assert any(words in said for said in found.repairs), found.repairs


def test_every_input_is_in_the_table():
    there = {p.name for p in DATA.iterdir() if p.suffix != ".dbc"}
    assert {c.file for c in CASES} == there
