"""The bundle that a store lets run, checked: at the runtime's start, and by `slewright deploy`."""

from dataclasses import dataclass
from pathlib import Path

from runtime import bundle as form
from runtime.archive import trust
from runtime.archive.differences import part
from runtime.archive.disk import StoreFolder
from runtime.archive.names import BUNDLE, CONFIGURATION, SHOWN
from runtime.archive.signed import Signed, check_fit, verify
from runtime.archive.store import BUNDLES, Store, held
from runtime.bundle import Bundle
from runtime.configuration import Configuration
from specs.errors import InputError

KEYS = "keys"


@dataclass(frozen=True)
class Place:
    """A store's folder, and that of the keys which are trusted in it (default: in the store)."""

    folder: Path
    other_keys: Path | None = None

    @property
    def keys(self) -> Path:
        """The folder of the trusted keys."""
        return self.other_keys or self.folder / KEYS

    def store(self) -> Store:
        """The store as it is now; InputError if there is none."""
        if not self.folder.is_dir():
            raise InputError(
                f"{self.folder}: there is no such folder; slewright deploy install makes a store"
            )
        return Store(StoreFolder(self.folder))

    def verified(self, digest: str) -> Signed:
        """A bundle of the store, signature and all files checked; InputError with what is wrong."""
        where = f"bundle {digest[:SHOWN]}"
        found = verify(self.store().files(digest), trust.read(self.keys), where)
        if found.digest != digest:
            raise InputError(f"{where}: {found.digest[:SHOWN]} is in its place")
        return found

    def fit(self, digest: str) -> Signed:
        """The same, and made for this version, specs and platform."""
        found = self.verified(digest)
        check_fit(found, f"bundle {found.name}")
        return found

    def unpacked(self, digest: str) -> Bundle:
        """The bundle's folder as the control process loads it."""
        return form.load(self.folder / BUNDLES / digest / BUNDLE)


@dataclass(frozen=True)
class Active:
    """What runs; `signed` and `place` of a bundle out of a store only."""

    bundle: Bundle
    signed: Signed | None = None
    place: Place | None = None

    @property
    def signer(self) -> str:
        """Name of the key, for recordings."""
        return self.signed.signer if self.signed else "nobody"

    @property
    def said(self) -> str:
        """What runs, in words."""
        name = self.signed.name if self.signed else f"{self.bundle.controller} {self.bundle.digest[:SHOWN]}"
        return f"bundle {name}, signed by {self.signer}"

    def prove(self) -> bool:
        """Keep in mind that it has run; whether that is done. OSError if the store cannot be written."""
        if self.signed is None or self.place is None:
            return True
        try:
            with held(self.place.folder):
                self.place.store().prove(self.signed.digest)
        except InputError:  # in use just now
            return False
        return True


def chosen(wanted: Configuration, config: Path) -> Active:
    """What a configuration lets run: the folder that it names, or the active bundle of its store.

    `config` is its file.  Raises InputError for a bundle that is not to run.
    """
    if wanted.store is not None:
        return active(Place(wanted.store.folder, wanted.store.keys), config)
    return Active(form.load(wanted.bundle or Path()))  # a configuration without both is refused


def active(place: Place, config: Path) -> Active:
    """The active bundle of a store, for the configuration file `config`.

    Raises InputError naming what is wrong and the way back to the last good bundle; nothing is chosen in its
    place, for a machine must not run another program than the one it was given.
    """
    store = place.store()
    if store.damaged:
        raise InputError(
            f"store {place.folder}: {', '.join(store.damaged)} is damaged: which bundle is to run is not "
            "sure; slewright deploy list shows what is there, deploy install or rollback says it anew"
        )
    digest = store.state.active
    if not digest:
        raise InputError(f"store {place.folder} holds no bundle; slewright deploy install brings one")
    try:
        signed = place.fit(digest)
        _check_configuration(signed, config)
        return Active(place.unpacked(digest), signed, place)
    except InputError as error:
        raise InputError(f"{error}{_way_back(place, store.state.fallback)}") from None


def _check_configuration(signed: Signed, config: Path) -> None:
    """A bundle with a configuration runs with no other."""
    if CONFIGURATION not in signed.files:
        return
    if changes := part(CONFIGURATION, signed.files, {CONFIGURATION: config.read_bytes()}):
        raise InputError(
            f"{config} is not the configuration that was signed with {signed.name}: {changes[0]}"
        )


def _way_back(place: Place, fallback: str) -> str:
    if not fallback:
        return ""
    return f"\nthe last good one, {fallback[:SHOWN]}: slewright deploy rollback --store {place.folder}"
