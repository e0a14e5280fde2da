"""A signed bundle runs, and is one to go back to after that: real processes on a local bus."""

import time
from pathlib import Path

import pytest

from deployment.bundling.archive import write
from runtime.archive import trust
from runtime.archive.install import install, offer
from runtime.archive.start import Place
from runtime.recorder.reader import Recording
from runtime.supervisor import Supervisor
from specs.errors import InputError
from tests.runtime.archive.made import key
from tests.runtime.bundles import built
from tests.runtime.test_helpers import PATIENCE_S
from tests.runtime.test_supervisor import machine

__all__ = ["machine"]  # the fixture


@pytest.mark.long
def test_a_signed_bundle_is_good_once_it_has_run(machine: Path, monkeypatch: pytest.MonkeyPatch):
    """Out of a store, and marked there as one to go back to; its key is in the recording."""
    monkeypatch.setattr("runtime.supervisor.PROVEN_TICKS", 50)
    folder = machine.parent / "store"
    archive = machine.parent / "pd.slwb"
    write(built("pd"), archive, key(), "1.0")
    trust.add(folder / "keys", "works", key().public, None)
    place = Place(folder)
    install(place, offer(place, archive))
    lines = machine.read_text().splitlines()[1:]
    machine.write_text("\n".join([*lines, "[store]", 'folder = "store"']))
    with Supervisor(machine) as supervisor:
        assert not place.store().state.proven
        end = time.monotonic() + PATIENCE_S
        supervisor.run(lambda _: None, lambda: place.store().state.proven or time.monotonic() > end)
    assert place.store().state.proven
    assert Recording(machine.parent / "rec").metadata()["signed_by"] == "works"
    (folder / "keys" / "works.pem").rename(folder / "keys" / "works.retired")
    with pytest.raises(InputError, match=r"signed by works .*, which was retired"):
        Supervisor(machine)
