"""The machine with CANopen encoders, inclinometers and valves, driven for real on a bus of ours."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deployment.faults.processes import Plant
from runtime.can.localbus import LocalBus
from runtime.canopen import cells
from runtime.image import INPUT, Status
from runtime.recorder.reader import Recording, Tick
from runtime.recorder.replay import TIMING
from runtime.supervisor import Supervisor
from specs import canopen, canopen_eds
from specs.signals import definition
from tests.runtime.bundles import built

library: Any = pytest.importorskip("canopen")
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


@pytest.mark.long
def test_it_drives_loses_a_device_stops_and_drives_again(plant: Plant):
    with Supervisor(plant.configuration("recorder")) as supervisor:
        until(plant, lambda: all_accepted(supervisor))
        plant.go_automatic()
        assert plant.drive(600, lambda: any(plant.devices.commands().values()))
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


def listeners(plant: Plant, folder: Path) -> tuple[Any, dict[str, set[float]]]:
    """Another program on the devices' bus, as docs/how-to/canopen.md shows it: all values that it sees."""
    network = library.Network(LocalBus(str(plant.devices_channel), node="tool"))
    network.connect()
    heard: dict[str, set[float]] = {}

    def take(pdo: Any, node: canopen.Node) -> None:
        for place, variable in zip(node.sends, pdo, strict=True):
            heard.setdefault(place.signal.name, set()).add(place.entry.si(variable.raw))

    for node in canopen.definition().nodes:
        if node.sends:
            (folder / f"{node.name}.dcf").write_text(canopen_eds.dcf(node, {}))
            remote = network.add_node(node.id, str(folder / f"{node.name}.dcf"))
            remote.tpdo.read(from_od=True)
            remote.tpdo[1].add_callback(lambda pdo, n=node: take(pdo, n))
    return network, heard


@pytest.mark.long
def test_what_another_program_sees_is_what_is_recorded(plant: Plant, tmp_path: Path):
    network, heard = listeners(plant, tmp_path)
    with Supervisor(plant.configuration("recorder")) as supervisor:
        until(plant, lambda: all_accepted(supervisor) and supervisor.now().ticks > 0)
        plant.drive(100, lambda: False)
        supervisor.run(lambda _: None, stop=lambda: True)
    network.disconnect()
    compared = dict.fromkeys(canopen.sent(), 0)
    ticks = [t.entry for t in Recording(plant.folder / "recording").items() if isinstance(t, Tick)]
    for inputs in (np.frombuffer(entry, INPUT.dtype, 1, TIMING.size)[0] for entry in ticks):
        for name in compared:
            place = INPUT.at(name)
            if inputs["status"][place] == Status.OK and inputs["age"][place] == 0:
                value = float(inputs["value"][place])
                assert min(abs(value - other) for other in heard[name]) < 1e-9
                compared[name] += 1
    assert all(count > 10 for count in compared.values())
