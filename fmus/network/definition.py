"""The form of an FMU on networks: its numbers, and its terminals of FMI-LS-BUS (low cut)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from specs.units import known

Type = Literal["Float64", "UInt32", "Boolean"]
Causality = Literal["input", "output", "parameter", "structuralParameter"]

TIME_VR, PORT_VR, OWN_VR = 70_001, 80_000, 100_000
PORT_MEMBERS = ("Rx_Data", "Tx_Data", "Rx_Clock", "Tx_Clock")  # value references in this order (network.c)
LARGEST = {"Float64": 1e300, "UInt32": 2.0**32 - 1, "Boolean": 1.0}


@dataclass(frozen=True)
class Number:
    """A variable that is a number; `vr`: its value reference, `place`: its name in C, after `NW_`."""

    name: str
    vr: int
    type: Type
    causality: Causality
    description: str = ""
    unit: str = ""
    start: float = 0.0
    min: float | None = None
    max: float | None = None
    tunable: bool = False
    place: str = ""

    @property
    def known_unit(self) -> str:
        """Its unit, where the project knows it; else nothing."""
        return self.unit if self.unit and known(self.unit) else ""

    @property
    def limits(self) -> tuple[float, float]:
        """What it may be set to."""
        largest = LARGEST[self.type]
        low = -largest if self.type == "Float64" else 0.0
        return low if self.min is None else self.min, largest if self.max is None else self.max


@dataclass(frozen=True)
class NetworkFmu:
    """An FMU with network terminals `ports`.

    configuration  of every terminal: name of the member -> variable
    is_bus         it simulates the bus itself
    step_s         a step that suits it
    """

    name: str
    description: str
    ports: tuple[str, ...]
    numbers: tuple[Number, ...]
    configuration: Mapping[str, str] = field(default_factory=dict)
    is_bus: bool = False
    step_s: float = 0.001

    @property
    def by_reference(self) -> tuple[Number, ...]:
        """Numbers in the order of their value references, as network.c looks them up."""
        return tuple(sorted(self.numbers, key=lambda n: n.vr))


def config_h(fmu: NetworkFmu, token: str) -> str:
    """network_config.h: what network.c and the FMU's own file know of it."""
    numbers = fmu.by_reference
    kinds = {"Float64": "FLOAT64", "UInt32": "UINT32", "Boolean": "BOOLEAN"}
    rows = [
        f"X({n.vr}, {kinds[n.type]}, {float(n.start)!r}, {n.limits[0]!r}, {n.limits[1]!r})" for n in numbers
    ]
    places = [f"  NW_{n.place or n.name} = {i}," for i, n in enumerate(numbers)]
    return "\n".join(
        [
            f'#define NW_TOKEN "{token}"',
            f"#define NW_PORTS {len(fmu.ports)}",
            f"#define NW_PORT_VR {PORT_VR}",
            f"#define NW_TIME_VR {TIME_VR}",
            "#define NW_TABLE(X) " + " ".join(rows),
            "enum {",
            *places,
            f"  NW_VALUES = {len(numbers)}",
            "};\n",
        ]
    )
