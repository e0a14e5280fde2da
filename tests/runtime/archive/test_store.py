"""A store always holds a good bundle, whenever the power goes: at every write, sync, rename and removal."""

import contextlib
import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from runtime.archive.disk import StoreFolder
from runtime.archive.names import SIGNATURE
from runtime.archive.signed import Signed, verify
from runtime.archive.store import BUNDLES, POINTERS, State, Store, held
from specs.errors import InputError
from tests.runtime.archive.disks import CutFolder, ForgetfulStore, PowerCutError
from tests.runtime.archive.made import tiny, trust

A, B, C = tiny(1.0), tiny(2.0), tiny(3.0)
AGAIN = tiny(1.0, by=2)  # the same contents, signed by another key
Act = Callable[[Store], None]


def put(bundle: Signed, runs: bool = True) -> Act:
    """Install a bundle; `runs`: and let it run."""

    def act(store: Store) -> None:
        store.stage(bundle)
        store.activate(bundle.digest)
        store.clean()
        if runs:
            store.prove(bundle.digest)

    return act


def back(store: Store) -> None:
    store.roll_back()
    store.clean()


def spoil(store: Store) -> None:
    """A file of A's core goes bad on the disk."""
    name = next(n for n in store.disk.below(f"{BUNDLES}{A.digest}/") if "core" in n)
    store.disk.write(name, b"bad")
    store.disk.sync(name)


# name -> what was before, what happens while the power goes
SCENES: dict[str, tuple[list[Act], Act]] = {
    "first bundle": ([], put(A, runs=False)),
    "second, the first ran": ([put(A)], put(B, runs=False)),
    "second, the first never ran": ([put(A, runs=False)], put(B, runs=False)),
    "third, the second never ran": ([put(A), put(B, runs=False)], put(C, runs=False)),
    "third, both ran": ([put(A), put(B)], put(C)),
    "the active one again": ([put(A)], put(A, runs=False)),
    "the one before again": ([put(A), put(B)], put(A, runs=False)),
    "the same, signed anew": ([put(B), put(A)], put(AGAIN, runs=False)),
    "it has run": ([put(A), put(B, runs=False)], put(B)),
    "back from one that ran": ([put(A), put(B)], back),
    "back from one that never ran": ([put(A), put(B, runs=False)], back),
}
OF_A_POINTER = 4  # operations of the least that changes anything: write, sync, rename, sync of the folder
CUTS = [(half, arrival) for half in (0.0, 0.5, 1.0) for arrival in (False, True, 1, 2)]


def prepared(before: list[Act]) -> ForgetfulStore:
    disk = ForgetfulStore()
    for act in before:
        act(Store(disk))
    return disk


def whole(store: Store, digest: str) -> bool:
    """Whether all files of a bundle are there, and its signature right."""
    return verify(store.files(digest), trust(1, 2), "x").digest == digest


def good(state: State) -> str:
    """The last good bundle."""
    return state.active if state.proven else state.fallback


def check(store: Store, possible: set[State], kept: str) -> None:
    """What must hold after any power cut."""
    assert store.damaged == ()
    assert store.state in possible
    for digest in (store.state.active, store.state.fallback):
        assert not digest or whole(store, digest)
    assert not kept or kept in (store.state.active, store.state.fallback)


def cuts(before: list[Act], act: Act) -> Iterator[tuple[ForgetfulStore, bool]]:
    """Every disk that a power cut can leave, and whether it came before the act was over."""
    for half, arrival in CUTS:
        for left in range(1000):
            disk = prepared(before)
            disk.left, disk.half = left, half
            try:
                act(Store(disk))
                over = True
            except PowerCutError:
                over = False
            yield (
                disk.back(arrival if isinstance(arrival, bool) else random.Random(f"{arrival} {left}")),
                over,
            )
            if over:
                break


@pytest.mark.parametrize("scene", SCENES)
def test_power_cut_at_every_operation(scene: str):
    before, act = SCENES[scene]
    start = Store(prepared(before)).state
    done = Store(disk := prepared(before))
    act(done)
    steps = {start, done.state, State(done.state.active, False, done.state.fallback)}
    count = 0
    for disk, over in cuts(before, act):
        store = Store(disk)
        check(store, {done.state} if over else steps, good(start))
        count += not over
        if count % 10 == 0:  # and once more, to the end
            if store.state != done.state:
                act(store)
            check(Store(disk), {done.state}, good(done.state))
    assert count >= OF_A_POINTER * len(CUTS)


def test_a_second_power_cut_while_the_first_is_mended():
    before, act = SCENES["third, both ran"]
    start = Store(prepared(before)).state
    for first in range(0, 60, 7):
        for second in range(0, 60, 5):
            disk = prepared(before)
            for left, seed in ((first, 1), (second, 2)):
                disk.left, disk.half = left, 0.5
                with contextlib.suppress(PowerCutError):
                    act(Store(disk))
                disk = disk.back(random.Random(seed))
            store = Store(disk)
            kept = good(start) if store.state.active != C.digest or not store.state.proven else C.digest
            assert whole(store, store.state.active)
            assert kept in (store.state.active, store.state.fallback)


def test_power_cut_at_every_operation_of_a_real_folder(tmp_path: Path):
    """The same with files: what was written is there, what was not begun is not."""
    for left in range(1000):
        folder = tmp_path / str(left)
        folder.mkdir()
        disk = CutFolder(folder)
        put(A)(Store(disk))
        disk.left = left
        try:
            put(B)(Store(disk))
            over = True
        except PowerCutError:
            over = False
        store = Store(StoreFolder(folder))
        check(
            store,
            {State(A.digest, True), State(B.digest, False, A.digest), State(B.digest, True, A.digest)},
            "",
        )
        put(B)(store)
        check(Store(StoreFolder(folder)), {State(B.digest, True, A.digest)}, A.digest)
        if over:
            break
    assert left > 20


def test_a_disk_that_forgets_can_lose_a_bundle():
    """The test can fail: without syncs a bundle that the pointer names is not whole."""

    class Careless(ForgetfulStore):
        def sync(self, name: str) -> None:
            if not name.endswith(".new"):
                return
            super().sync(name)

    disk = Careless()
    put(A)(Store(disk))
    store = Store(disk.back(arrived=False))
    assert store.state.active == A.digest
    with pytest.raises(InputError, match=r"missing|signature|changed|cannot be read"):
        whole(store, A.digest)


def test_a_bundle_that_went_bad_is_mended_by_installing_it_again():
    disk = prepared([put(A), spoil])
    with pytest.raises(InputError, match=r"core-.* was changed since it was signed"):
        whole(Store(disk), A.digest)
    put(A)(Store(disk))
    assert whole(Store(disk), A.digest)
    assert Store(disk).state == State(A.digest, True)


def test_which_bundle_is_kept_to_go_back_to():
    store = Store(ForgetfulStore())
    put(A)(store)
    put(B, runs=False)(store)
    assert store.state == State(B.digest, False, A.digest)
    put(C, runs=False)(store)
    assert store.state == State(C.digest, False, A.digest), "B never ran"
    back(store)
    assert store.state == State(A.digest, True, "")
    put(B)(store)
    back(store)
    assert store.state == State(A.digest, True, B.digest), "both ran: there and back"
    back(store)
    assert store.state == State(B.digest, True, A.digest)
    store.prove(C.digest)
    assert store.state.active == B.digest, "a bundle that is not the active one proves nothing"


def test_what_nobody_goes_back_to_is_removed_after_the_pointers_forgot_it(tmp_path: Path):
    store = Store(StoreFolder(tmp_path))
    for number in range(1, 7):
        put(tiny(float(number)))(store)
        assert len(store.digests()) <= 4
    assert store.digests()[:2] == [tiny(6.0).digest, tiny(5.0).digest]
    assert not [p for p in tmp_path.rglob("*") if p.is_dir() and not any(p.iterdir())]


@pytest.mark.parametrize("name", POINTERS)
def test_a_damaged_pointer_is_seen_and_removes_nothing(name: str, tmp_path: Path):
    put(A)(Store(StoreFolder(tmp_path)))
    put(B)(Store(StoreFolder(tmp_path)))
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[:30] + b"x" + data[31:])
    store = Store(StoreFolder(tmp_path))
    assert store.damaged == (name,)
    put(C)(store)
    assert {A.digest, B.digest, C.digest} <= set(store.digests())
    put(C)(Store(StoreFolder(tmp_path)))
    assert Store(StoreFolder(tmp_path)).damaged == ()


def test_links_and_strangers_in_a_stored_bundle_are_refused(tmp_path: Path):
    store = Store(StoreFolder(tmp_path))
    put(A)(store)
    folder = tmp_path / BUNDLES / A.digest
    signature = (folder / SIGNATURE).read_bytes()
    for target in (tmp_path / "elsewhere", tmp_path):
        (tmp_path / "elsewhere").write_bytes(signature)
        (folder / "bundle" / "link").symlink_to(target)
        with pytest.raises(InputError, match="bundle/link is no plain file"):
            store.files(A.digest)
        (folder / "bundle" / "link").unlink()
    (folder / SIGNATURE).unlink()
    (folder / SIGNATURE).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=r"release\.sig is no plain file"):
        store.files(A.digest)
    put(A)(store)
    assert whole(store, A.digest)
    assert not (folder / SIGNATURE).is_symlink()


def test_two_at_once_are_refused(tmp_path: Path):
    with (
        held(tmp_path),
        pytest.raises(InputError, match="in use by another slewright deploy"),
        held(tmp_path),
    ):
        pass


def test_a_pointer_of_another_version(tmp_path: Path):
    from runtime.retain.copies import Folder, Retained

    Retained(Folder(tmp_path), "slewright-store9", POINTERS).save({"active": "", "proven": 0, "fallback": ""})
    with pytest.raises(InputError, match="of another version"):
        Store(StoreFolder(tmp_path))
