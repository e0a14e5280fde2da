"""What a store holds, checked as at a start, and whether a key can go."""

from dataclasses import asdict, dataclass, replace
from typing import Any

from runtime.archive import trust
from runtime.archive.names import SHOWN
from runtime.archive.start import Place
from runtime.archive.store import State
from specs.errors import InputError


@dataclass(frozen=True)
class Entry:
    """A bundle of a store; what cannot be read of it is ""."""

    role: str
    digest: str
    proven: bool
    controller: str = ""
    release: str = ""
    signer: str = ""
    problem: str = ""  # why it would not run

    def row(self) -> list[str]:
        """For a table."""
        texts = [self.role, self.controller, self.release, self.digest[:SHOWN], self.signer]
        return [*texts, "yes" if self.proven else "no", self.problem or "as signed"]

    def figures(self) -> dict[str, Any]:
        """For a file."""
        return asdict(self)


@dataclass(frozen=True)
class Overview:
    """All bundles of a store; `damaged`: copies of its pointer that are."""

    entries: tuple[Entry, ...]
    damaged: tuple[str, ...]

    @property
    def runs(self) -> bool:
        """Whether the runtime would start with the active one."""
        first = self.entries[0] if self.entries else None
        return bool(first and first.role == "active" and not first.problem and not self.damaged)


def overview(place: Place) -> Overview:
    """Check every bundle; InputError if there is no store."""
    store = place.store()
    return Overview(tuple(_entry(place, digest, store.state) for digest in store.digests()), store.damaged)


def check_retirement(place: Place, name: str) -> None:
    """Raise InputError where a machine would not start without the key `name`."""
    known = trust.read(place.keys)
    key = trust.find(known, name)
    if len(known.trusted) == 1:
        raise InputError(f"{key.name} is the only trusted key: add its successor first (--now: all the same)")
    active = place.store().state.active if place.folder.is_dir() else ""
    if active and _signer(place, active) == key.name:
        raise InputError(
            f"{key.name} signed the active bundle: install one that another key signed first "
            "(--now: retire it all the same)"
        )


def _signer(place: Place, digest: str) -> str:
    try:
        return place.verified(digest).signer
    except InputError:
        return ""


def _entry(place: Place, digest: str, state: State) -> Entry:
    roles = {state.fallback: "to go back to", state.active: "active"}
    proven = digest == state.fallback or (digest == state.active and state.proven)
    entry = Entry(roles.get(digest, "left over"), digest, proven)
    try:
        found = place.verified(digest)
        told = {"release": found.release, "signer": found.signer}
        entry = replace(entry, controller=found.manifest["controller"], **told)
        place.fit(digest)
        place.unpacked(digest).library()
    except InputError as error:
        return replace(entry, problem=str(error))
    return entry
