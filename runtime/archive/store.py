"""The bundles of a machine, and which of them runs: always one that is whole, whenever the power goes.

bundles/DIGEST/      one folder a bundle, all of its archive's files
pointer.a, .b        which one is active, which one to go back to: two copies (runtime/retain/copies.py)
keys/                the trusted keys (runtime/archive/trust.py), unless they are kept elsewhere

A bundle is written file by file (temporary file, sync, rename), then the folders are synced, and only then
the pointer names it; what no copy of the pointer names any more is removed after that.  The bundle to go back
to is the last good one: one that has run (`prove`).  A bundle that never ran does not take its place.
"""

import fcntl
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from runtime.archive.container import LARGEST
from runtime.archive.disk import Disk
from runtime.archive.names import SHOWN
from runtime.archive.signed import DIGEST, Signed
from runtime.retain.copies import Retained
from specs.errors import InputError

BUNDLES = "bundles/"
POINTERS = ("pointer.a", "pointer.b")
LAYOUT = "slewright-store1"
PART = "staging.part"
LOCK = ".in-use"


@dataclass(frozen=True)
class State:
    """What the pointer says: digests, "" for none."""

    active: str = ""
    proven: bool = False  # whether the active one has run
    fallback: str = ""  # the last good one beside it


class Store:
    """The bundles on a disk."""

    def __init__(self, disk: Disk) -> None:
        """Raises InputError for a pointer of another version's store."""
        self.disk = disk
        self._pointer = Retained(disk, LAYOUT, POINTERS)
        self.damaged = self._pointer.damaged
        self._states = [_state(copy.layout, copy.values) for copy in self._pointer.whole]

    @property
    def state(self) -> State:
        """What was said last."""
        return self._states[0] if self._states else State()

    def files(self, digest: str) -> dict[str, bytes]:
        """All files of a bundle by their names in the archive; InputError if it cannot be read."""
        found, total = {}, 0
        at = f"{BUNDLES}{digest}/"
        for name in self.disk.below(at):
            data = self.disk.read(name)
            total += len(data or b"")
            if data is None or total > LARGEST:
                raise InputError(
                    f"bundle {digest[:SHOWN]}: {name.removeprefix(at)} is no plain file or too large"
                )
            found[name.removeprefix(at)] = data
        return found

    def digests(self) -> list[str]:
        """The bundles that are there, the active one first, then the one to go back to."""
        there = {name.removeprefix(BUNDLES).partition("/")[0] for name in self.disk.below(BUNDLES)}
        known = [d for d in (self.state.active, self.state.fallback) if d]
        return [*known, *sorted(there.difference(known))]

    def stage(self, signed: Signed) -> None:
        """Put a bundle beside the others; files that are there already and right are left alone."""
        at = f"{BUNDLES}{signed.digest}/"
        for name in self.disk.below(at):
            if name.removeprefix(at) not in signed.files or self.disk.read(name) is None:
                self.disk.remove(name)
        for name, data in signed.files.items():
            if self.disk.read(at + name) != data:
                self.disk.write(PART, data)
                self.disk.sync(PART)
                self.disk.rename(PART, at + name)
        self.disk.sync_folder()

    def activate(self, digest: str) -> None:
        """Let a staged bundle be the one that runs; the one that ran before is kept to go back to."""
        before = self.state
        if digest == before.active:
            self._save(before)
            return
        fallback = before.active if before.proven else before.fallback
        proven = digest == before.fallback
        self._save(State(digest, proven, "" if fallback == digest else fallback))

    def roll_back(self) -> None:
        """Let the last good bundle be the one that runs; what ran is kept if it was good too."""
        before = self.state
        self._save(State(before.fallback, True, before.active if before.proven else ""))

    def prove(self, digest: str) -> None:
        """The active bundle has run: from now on it is one to go back to."""
        if self.state.active == digest and not self.state.proven:
            self._save(State(digest, True, self.state.fallback))

    def clean(self) -> None:
        """Remove what neither copy of the pointer names; nothing where a damaged copy may have named it."""
        if self.damaged:
            return
        kept = {d for state in self._states for d in (state.active, state.fallback)}
        for name in self.disk.below(BUNDLES):
            if name.removeprefix(BUNDLES).partition("/")[0] not in kept:
                self.disk.remove(name)
        self.disk.sync_folder()

    def _save(self, state: State) -> None:
        self._pointer.save(asdict(state))
        self._states = [state, *self._states[:1]]


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keep the store to this process; InputError if another one has it."""
    with (folder / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(f"{folder} is in use by another slewright deploy") from None
        yield


def _state(layout: str, values: Mapping[str, object]) -> State:
    active, proven, fallback = (values.get(name) for name in ("active", "proven", "fallback"))
    digests = [d for d in (active, fallback) if d != ""]
    if layout != LAYOUT or not all(isinstance(d, str) and DIGEST.fullmatch(d) for d in digests):
        raise InputError(f"the store's pointer is of another version (layout {layout})")
    return State(str(active), bool(proven), str(fallback))
