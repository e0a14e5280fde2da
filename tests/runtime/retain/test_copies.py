"""Retained values outlive a power cut at every write, sync and rename."""

import itertools
from pathlib import Path

import pytest

from deployment.faults.disks import ForgettingDisk, PowerCutError
from runtime.retain.copies import COPIES, Folder, Retained
from specs.errors import InputError

LAYOUT = "0123456789abcdef"


def save_until_cut(disk: ForgettingDisk) -> int:
    """How many saves came back before the power went."""
    kept = Retained(disk, LAYOUT)
    for number in itertools.count(1):
        try:
            kept.save({"value": number})
        except PowerCutError:
            return number - 1
    raise AssertionError


OPERATIONS = 4  # of one save: write, sync, rename, sync of the folder


@pytest.mark.parametrize("half", [0.0, 0.3, 0.99, 1.0])
@pytest.mark.parametrize("names_arrived", [False, True])
@pytest.mark.parametrize("saves", [1, 2, 3, 5])
def test_power_cut_at_every_operation(saves: int, names_arrived: bool, half: float):
    for cut in range(OPERATIONS * saves):
        disk = ForgettingDisk(cut, half)
        done = save_until_cut(disk)
        after = Retained(disk.after_cut(names_arrived), LAYOUT).load()
        assert after in ([{}, {"value": 1}] if done == 0 else [{"value": done}, {"value": done + 1}])


def test_a_second_power_cut_before_the_first_save_is_over():
    for first, second in itertools.product(range(3 * OPERATIONS), range(OPERATIONS)):
        disk = ForgettingDisk(first, 0.5)
        save_until_cut(disk)
        again = disk.after_cut(names_arrived=True)
        before = Retained(again, LAYOUT).load()
        again.left, again.half = second, 0.5
        with pytest.raises(PowerCutError):
            Retained(again, LAYOUT).save({"value": 100})
        assert Retained(again.after_cut(names_arrived=False), LAYOUT).load() in (before, {"value": 100})


def test_a_disk_that_forgets_everything_not_synced_loses_it():
    """The test's disk can fail: without syncs a save is lost, whole or in part."""
    disk = ForgettingDisk(half=0.5)
    disk.write("retain.a", b"12345678")
    assert disk.after_cut(names_arrived=False).read("retain.a") is None
    assert disk.after_cut(names_arrived=True).read("retain.a") == b"1234"


def test_saves_alternate_and_the_newer_is_read(tmp_path: Path):
    kept = Retained(Folder(tmp_path), LAYOUT)
    assert kept.load() == {}
    for number in range(3):
        kept.save({"hours": number / 3})
    assert {p.name for p in tmp_path.iterdir()} == set(COPIES)
    assert Retained(Folder(tmp_path), LAYOUT).load() == {"hours": 2 / 3}


@pytest.mark.parametrize("at", range(0, 90, 7))
def test_a_damaged_byte_leaves_the_other_copy(tmp_path: Path, at: int):
    kept = Retained(Folder(tmp_path), LAYOUT)
    kept.save({"starts": 1})
    kept.save({"starts": 2})
    newer = tmp_path / COPIES[1]
    data = bytearray(newer.read_bytes())
    data[at % len(data)] ^= 0x10
    newer.write_bytes(data)
    again = Retained(Folder(tmp_path), LAYOUT)
    assert again.load() == {"starts": 1}
    assert again.damaged == (COPIES[1],)


def test_both_damaged_and_another_layout_are_refused(tmp_path: Path):
    kept = Retained(Folder(tmp_path), LAYOUT)
    kept.save({"starts": 1})
    with pytest.raises(InputError, match=f"of layout {LAYOUT}, not fedc"):
        Retained(Folder(tmp_path), "fedc").load()
    for name in COPIES:
        (tmp_path / name).write_bytes(b"SLWRKEEP")
    with pytest.raises(InputError, match=r"retain\.a and retain\.b damaged"):
        Retained(Folder(tmp_path), LAYOUT).load()


def test_a_damaged_copy_alone_is_no_first_start(tmp_path: Path):
    Retained(Folder(tmp_path), LAYOUT).save({"fault_code": 3})
    only = tmp_path / COPIES[0]
    only.write_bytes(only.read_bytes()[:-1])
    with pytest.raises(InputError, match=f"{tmp_path}: {COPIES[0]} damaged"):
        Retained(Folder(tmp_path), LAYOUT).load()


def test_a_copy_that_must_have_been_there_is_missed(tmp_path: Path):
    kept = Retained(Folder(tmp_path), LAYOUT)
    assert kept.missing == ()
    kept.save({"fault_code": 0})
    assert Retained(Folder(tmp_path), LAYOUT).missing == ()  # there was one only
    kept.save({"fault_code": 0})
    kept.save({"fault_code": 3})
    (tmp_path / COPIES[0]).unlink()
    again = Retained(Folder(tmp_path), LAYOUT)
    assert again.missing == (COPIES[0],)
    assert again.load() == {"fault_code": 0}
