"""Bringing a bundle into a machine's store, and going back: every check before anything takes effect."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from runtime.archive import container, trust
from runtime.archive.differences import Change, differences
from runtime.archive.disk import StoreFolder
from runtime.archive.names import SHOWN
from runtime.archive.signed import Signed, check_fit, verify
from runtime.archive.start import Place
from runtime.archive.store import State, Store, held
from runtime.policy import open_core
from specs.errors import InputError


@dataclass(frozen=True)
class Offer:
    """A bundle that could be installed, and what it would change."""

    signed: Signed
    before: State
    changes: tuple[Change, ...]
    unknown: str = ""  # why the changes cannot be told

    @property
    def first(self) -> bool:
        """Whether nothing is there to compare with."""
        return not self.before.active

    def lines(self) -> Iterator[str]:
        """What it is, and what it would change, section by section."""
        yield f"{self.signed.name}, signed by {self.signed.signer}, digest {self.signed.digest}"
        if self.first:
            yield "the first bundle of this store: nothing to compare with"
        elif self.unknown:
            yield f"what it changes cannot be told: {self.unknown}"
        elif not self.changes:
            yield "nothing is different from the active bundle"
        for section, changes in groupby(self.changes, lambda change: change.section):
            yield f"{section}:"
            yield from (f"  {change}" for change in changes)

    def figures(self) -> dict[str, Any]:
        """The same for JSON."""
        changes = [vars(change) for change in self.changes]
        signed = self.signed
        return {"digest": signed.digest, "name": signed.name, "signed_by": signed.signer, "changes": changes}


def offer(place: Place, archive: Path) -> Offer:
    """Check an archive for this machine and compare it with what is active; changes nothing.

    Raises InputError with the first thing that is wrong with the archive.
    """
    if place.folder.exists() and not place.folder.is_dir():
        raise InputError(f"{place.folder} is no folder: a store is one")
    signed = verify(container.read(archive), trust.read(place.keys), str(archive))
    check_fit(signed, str(archive))
    if not place.folder.is_dir():
        return Offer(signed, State(), ())
    before = place.store().state
    return Offer(signed, before, *_changes(place, before.active, signed))


def install(place: Place, offered: Offer) -> None:
    """Let the offered bundle be the active one.

    Raises InputError if another one was installed meanwhile, or if its core does not load on this machine;
    what was active is still active then.
    """
    place.folder.mkdir(parents=True, exist_ok=True)
    with held(place.folder):
        store = Store(StoreFolder(place.folder))
        if store.state != offered.before:
            raise InputError(f"store {place.folder} has changed meanwhile: look at the difference again")
        store.stage(offered.signed)
        try:
            _try(place, offered.signed.digest)
        except InputError:
            store.clean()
            raise
        store.activate(offered.signed.digest)
        store.clean()


def roll_back(place: Place) -> Offer:
    """Let the last good bundle be the active one; what that changed.  InputError if there is none."""
    place.store()  # says if there is none
    with held(place.folder):
        store = place.store()
        before = store.state
        if not before.fallback:
            raise InputError(
                f"store {place.folder} holds no other good bundle to go back to (good: it has run for 10 s)"
            )
        signed = _try(place, before.fallback)
        done = Offer(signed, before, *_changes(place, before.active, signed))
        store.roll_back()
        store.clean()
    return done


def _try(place: Place, digest: str) -> Signed:
    """Read a bundle of the store as the runtime will, up to its core's first state."""
    from runtime.can.native import check

    signed = place.fit(digest)
    check(open_core(place.unpacked(digest)).library)
    return signed


def _changes(place: Place, active: str, signed: Signed) -> tuple[tuple[Change, ...], str]:
    if not active:
        return (), ""
    try:
        return tuple(differences(place.store().files(active), signed.files)), ""
    except InputError as error:
        return (), f"active bundle {active[:SHOWN]}: {error}"
