"""What the tests of collection share: the tiny plan, the machine, and one collection made with them."""

from pathlib import Path

import pytest

from learning.collection.collect import collect
from learning.collection.machine import LockStep
from learning.collection.plan import Plan, load_plan


@pytest.fixture(scope="package")
def plan() -> Plan:
    return load_plan(Path("tiny"))


@pytest.fixture(scope="package")
def machine() -> LockStep:
    return LockStep()


@pytest.fixture(scope="package")
def collected(plan, tmp_path_factory) -> Path:
    """The tiny collection."""
    out = tmp_path_factory.mktemp("collect")
    collect(plan, out)
    return out
