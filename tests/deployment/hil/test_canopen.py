"""The machine with CANopen encoders, inclinometers and valves, driven for real on a bus of ours."""

import time
from collections.abc import Callable, Iterator

import pytest

from deployment.faults.processes import Plant
from runtime.canopen import cells
from runtime.supervisor import Supervisor
from specs.signals import definition
from tests.runtime.bundles import built

pytest.importorskip("canopen")
pytestmark = pytest.mark.slow
CODES = definition().signals["fault_code"].values


@pytest.fixture
def plant() -> Iterator[Plant]:
    with Plant(built("pd"), 1, canopen=True) as found:
        yield found


def all_accepted(supervisor: Supervisor) -> bool:
    return 0 not in cells.read(cells.join(supervisor.folder)[0])


def until(plant: Plant, true: Callable[[], bool]) -> None:
    """Neutral periods until something is true, for as long as a busy computer may take."""
    end = time.monotonic() + 120
    while not true():
        plant.wait_periods(5)
        assert time.monotonic() < end


def fault(plant: Plant) -> str:
    return CODES[int(plant.shown("fault_code"))]


def test_it_drives_loses_a_device_stops_and_drives_again(plant: Plant):
    path = plant.configuration("recorder")
    with Supervisor(path) as supervisor:
        until(plant, lambda: all_accepted(supervisor))
        plant.go_automatic()
        before = plant.devices.commands()
        assert plant.drive(600, lambda: any(plant.devices.commands().values())), before
        plant.devices.by_name["encoder_boom"].switch_off()
        assert plant.drive(200, plant.stopped)
        assert fault(plant) == "sensor_timeout"
        plant.devices.by_name["encoder_boom"].switch_on()
        until(plant, lambda: all_accepted(supervisor))
        plant.acknowledge()
        plant.go_automatic()
        plant.devices.by_name["valve_slew"].emergency(0x5000, 0x01)
        assert plant.drive(200, plant.stopped)
        assert fault(plant) == "machine_not_ready"
        assert supervisor.watch() is None
