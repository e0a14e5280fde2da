"""A value reference stays with its name for good: recordings, systems and others' tools refer to it.

`value_references.csv` remembers every one ever given out, also of what has gone.  It only grows: after adding
a signal or parameter, run `python -m tests.specs.test_value_references`.
"""

import csv
from pathlib import Path

import pytest

from specs import parameters
from specs.errors import InputError
from specs.signals import definition, signals

LIST = Path(__file__).with_name("value_references.csv")


def remembered() -> dict[int, str]:
    """Value reference -> name, as committed."""
    with LIST.open(encoding="utf-8", newline="") as file:
        return {int(row["vr"]): row["name"] for row in csv.DictReader(file)}


def current() -> dict[int, str]:
    """Value reference -> name of all signals and parameters there are."""
    found = {s.vr: s.name for s in signals().values()}
    return found | {p.vr: p.name for p in parameters.check().values()}


def reused(old: dict[int, str], new: dict[int, str]) -> list[str]:
    """What has taken over a value reference of another name, and what has changed its own."""
    places = {name: vr for vr, name in old.items()}
    taken = [f"{vr} was {old[vr]}, is {name}" for vr, name in new.items() if old.get(vr, name) != name]
    moved = [f"{name} was {places[name]}, is {vr}" for vr, name in new.items() if places.get(name, vr) != vr]
    return taken + moved


def test_no_value_reference_was_reused() -> None:
    assert reused(remembered(), current()) == []


def test_every_value_reference_is_remembered() -> None:
    forgotten = sorted(set(current()) - set(remembered()))
    assert not forgotten, f"{forgotten}: run python -m tests.specs.test_value_references"


def test_signals_that_have_gone_are_retired() -> None:
    gone = {vr: n for vr, n in remembered().items() if vr < 1000 and vr not in current()}
    assert gone == dict(definition().retired)


@pytest.mark.parametrize(
    ("new", "count"), [({1: "a"}, 0), ({2: "b", 3: "c"}, 0), ({1: "b"}, 1), ({9: "a"}, 1)]
)
def test_reuse_is_seen(new: dict[int, str], count: int) -> None:
    assert len(reused({1: "a"}, new)) == count


def update() -> None:
    """Add what is new to the list; refuses to rewrite what is there."""
    old, new = remembered() if LIST.exists() else {}, current()
    if faults := reused(old, new):
        raise SystemExit("; ".join(faults))
    with LIST.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("vr", "name"))
        writer.writerows(sorted((new | old).items()))


if __name__ == "__main__":
    try:
        update()
    except InputError as error:
        raise SystemExit(str(error)) from None
