"""The bus FMU: a CAN bus of classical frames between nodes, with bit rate, arbitration, delay and faults.

python -m fmus.network.bus can_bus.fmu 3     # for three nodes
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from fmus.network.build import HERE, build
from fmus.network.definition import OWN_VR, Causality, NetworkFmu, Number, Type
from fmus.toolchain.build import write_whole
from specs.errors import InputError
from specs.signals import definition

NAME = "can_bus"
LEAST_NODES, MOST_NODES, USUAL_NODES = 2, 16, 4
OWN = ("bus.h", "bus.c", "can_bits.h", "can_bits.c")
ALWAYS_S = 1e9


def definition_of_bus(nodes: int = USUAL_NODES) -> NetworkFmu:
    """Its variables and `nodes` terminals; the bit rate is that of the machine's bus unless told."""
    if not LEAST_NODES <= nodes <= MOST_NODES:
        raise InputError(f"a bus for {nodes} nodes; valid: {LEAST_NODES} … {MOST_NODES}")
    rate = float(definition().bus.bit_rate)
    share = {"min": 0.0, "max": 1.0, "tunable": True}
    numbers = [
        _number(0, "bit_rate", "UInt32", "parameter", "Of the bus, bit/s", start=rate, min=1e3, max=1e6),
        _number(
            1, "delay", "Float64", "parameter", "From a frame's end to its receivers", "s", min=0.0, max=1.0
        ),
        _number(2, "error_probability", "Float64", "parameter", "That a frame is spoiled", "1", **share),
        _number(3, "drop_probability", "Float64", "parameter", "That nobody receives a frame", "1", **share),
        _number(
            4, "fault_identifier", "UInt32", "parameter", "Of the frames with faults; 0: of all", tunable=True
        ),
        _number(5, "fault_from", "Float64", "parameter", "When faults begin", "s", tunable=True),
        _number(6, "fault_until", "Float64", "parameter", "When they end", "s", start=ALWAYS_S, tunable=True),
        _number(7, "seed", "UInt32", "parameter", "Of the random numbers", start=1.0),
        _number(8, "load", "Float64", "output", "Share of time that frames were on the wire", "1"),
        _number(
            9, "longest_wait", "Float64", "output", "Longest time from a frame's arrival to its end", "s"
        ),
        _number(10, "frames", "UInt32", "output", "Frames that were received"),
        _number(11, "errors", "UInt32", "output", "Frames that were spoiled"),
        _number(12, "dropped", "UInt32", "output", "Frames that nobody received"),
        _number(14, "overflows", "UInt32", "output", "Frames lost since 64 of their node waited"),
        _number(13, "arbitrations_lost", "UInt32", "output", "Frames given back to their nodes"),
    ]
    about = "CAN bus: bit rate, arbitration by identifier, delay, faults (FMI-LS-BUS 1.0.0, low cut)"
    ports = tuple(f"Node{number}" for number in range(1, nodes + 1))
    return NetworkFmu(NAME, about, ports, tuple(numbers), {"bit_rate": "bit_rate"}, is_bus=True)


def _number(
    place: int, name: str, kind: Type, causality: Causality, description: str, unit: str = "", **more: float
) -> Number:
    return Number(name, OWN_VR + place, kind, causality, description, unit, **more)  # type: ignore[arg-type]


def build_bus(path: Path, nodes: int = USUAL_NODES) -> Path:
    """Build the bus FMU `path` for so many nodes (FMI 3.0, this platform); RunError if C fails."""
    own = {name: (HERE / name).read_text() for name in OWN} | {"app.h": '#include "bus.h"\n'}
    write_whole(path, build(definition_of_bus(nodes), own))
    return path


def main(arguments: Sequence[str]) -> int:
    """Build the bus that the command line names; 2 for arguments that are none."""
    path = Path(arguments[0]) if arguments else None
    nodes = arguments[1] if len(arguments) > 1 else str(USUAL_NODES)
    try:
        if path is None or len(arguments) > 2 or not nodes.isdecimal():
            raise InputError("python -m fmus.network.bus FILE.fmu NODES: a file and a whole number")
        if path.suffix != ".fmu" or not path.parent.is_dir():
            raise InputError(f"{path}: the name of an FMU in a folder that there is; valid: FILE.fmu")
        print(build_bus(path, int(nodes)))
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
