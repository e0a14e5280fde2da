"""The rig and how a truth of it is examined."""

from pathlib import Path

import pytest

from reconcile.equations.model import Folder, read_folder
from reconcile.recordings.data import runs_of
from reconcile.workflow import examine
from tests.reconcile.truth import Truth, record

RIG = Path(__file__).with_name("rig")


@pytest.fixture(scope="session")
def rig() -> Folder:
    """The rig's model folder."""
    return read_folder(RIG)


@pytest.fixture(scope="session")
def examined(rig: Folder):
    """Record a truth and examine it: the figures of the report."""

    def run(truth: Truth, **options) -> dict:
        return examine(rig, runs_of(record(truth, **options), rig, "run"))[0]

    return run
