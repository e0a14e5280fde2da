"""The two nodes of the bus as FMUs: virtual controller, and the machine's end with plain signals behind."""

import tempfile
from collections.abc import Mapping
from pathlib import Path

from deployment.bundling.blocks import CORE
from deployment.bundling.build import UNUSED_GONE, UNUSED_OUT, Cached, objects_of
from deployment.bundling.fmu import check_native
from deployment.network import tables
from fmus.definition import Variable
from fmus.network.build import archive, build, compile_sources, write_sources
from fmus.network.definition import OWN_VR, Causality, NetworkFmu, Number
from fmus.toolchain import compiler
from fmus.toolchain.build import write_whole
from runtime.bundle import Bundle
from runtime.control import ControlCore
from specs.signals import definition

HERE = Path(__file__).parent
CONTROLLER, MACHINE_IO = "virtual_controller", "machine_io"
PORT = "CAN"
BIT_RATE, NOTIFICATIONS = "CAN.bit_rate", "org.fmi_standard.fmi_ls_bus.Can_BusNotifications"
CYCLE_PHASE_S = 0.014  # by then all sensors of a cycle have come, and its commands have 6 ms: deployment/hil
SHARED = ("ends.h", "ends.c", "peer.h", "peer.c")
WIRE = ("wire.h", "wire.c")


def controller() -> NetworkFmu:
    """The control core with CAN, and with plain signals: which, the parameter `plain` says."""
    own = (
        Number("plain", OWN_VR + 10, "Boolean", "parameter", "Plain signals instead of CAN"),
        Number("late", OWN_VR + 11, "Boolean", "parameter", "With plain signals: inputs come a cycle later"),
        Number(
            *("cycle_phase", OWN_VR + 12, "Float64", "parameter"),
            description="When in each 20 ms the control core runs",
            unit="s",
            start=CYCLE_PHASE_S,
            min=0.0,
            max=0.0199,
        ),
    )
    about = "Control core of a bundle as a node on CAN (FMI-LS-BUS 1.0.0, low cut), or with plain signals"
    return _node(CONTROLLER, about, own)


def machine_io() -> NetworkFmu:
    """The machine's end: what its sensors, operator and planner send, and the commands that it follows."""
    about = "The controller's CAN bus for a simulated machine: plain signals to frames, and commands back"
    return _node(MACHINE_IO, about, ())


def build_controller(bundle: Bundle, path: Path) -> Path:
    """Build the virtual controller `path` (FMI 3.0, this platform) from a bundle's sources.

    Raises InputError for a bundle whose policy is evaluated outside of its core, RunError if C fails.
    """
    check_native(bundle)
    fmu = controller()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        own = _own("controller", bundle.folder / "sources" / "core")
        words = len(ControlCore(bundle).snapshot()) // 8 + 1
        own["app.h"] = f'#define SLR_EXTRA {words}\n#include "controller.h"\n'
        for name, text in _peer().items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)
        token = write_sources(fmu, own, folder, bundle.identity + repr(sorted(_peer().items())))
        library = _linked(bundle, folder, token)
        content = archive(fmu, token, library, {})
    return _write(path, content)


def build_machine_io(path: Path) -> Path:
    """Build the machine's end `path` (FMI 3.0, this platform); RunError if C fails."""
    own = _own("machine_io", CORE) | {"app.h": '#include "machine_io.h"\n'}
    return _write(path, build(machine_io(), own, _peer()))


def _write(path: Path, content: bytes) -> Path:
    write_whole(path, content)
    return path


def _node(name: str, about: str, own: tuple[Number, ...]) -> NetworkFmu:
    rate = float(definition().bus.bit_rate)
    numbers = (
        *(_signal(v, "input") for v in tables.inputs()),
        *(_signal(v, "output") for v in tables.outputs()),
        Number("bus_errors", OWN_VR, "UInt32", "output", "Bus errors that the bus told of"),
        Number(
            *(BIT_RATE, OWN_VR + 1, "UInt32", "parameter", "Of the bus, bit/s"),
            start=rate,
            min=1e3,
            max=1e6,
            place="bit_rate",
        ),
        Number(
            *(NOTIFICATIONS, OWN_VR + 2, "Boolean", "structuralParameter"),
            description="Specifies whether the respective Network FMU relies on bus notifications.",
            place="notifications",
        ),
        *own,
    )
    terminal = {"BusNotifications": NOTIFICATIONS, "bit_rate": BIT_RATE}
    return NetworkFmu(name, about, (PORT,), numbers, terminal)


def _signal(v: Variable, causality: Causality) -> Number:
    vr = v.vr if v.vr is not None else 0
    return Number(v.name, vr, "Float64", causality, v.description, v.unit, v.start)


def _own(name: str, core: Path) -> dict[str, str]:
    """Hand-written and generated files of one end; `core`: where the image's layout is."""
    texts = {f: (HERE / f).read_text() for f in (*SHARED, f"{name}.h", f"{name}.c")}
    return texts | {
        "image_layout.h": (core / "image_layout.h").read_text(),
        "ends_config.h": tables.ends_config(),
    }


def _peer() -> Mapping[str, str]:
    """What peer.c includes: wire.c among tables of its own."""
    texts = {f"peer/{name}": text for name, text in tables.peer_headers().items()}
    return texts | {f"peer/{name}": (CORE / name).read_text() for name in WIRE}


def _linked(bundle: Bundle, folder: Path, token: str) -> bytes:
    """The controller's library: the bundle's own objects, and the node's around them."""
    host = compiler.host()
    cached = Cached(repr((token, bundle.identity, compiler.identity(host.name), host.name)))
    if cached.path.is_file():
        return cached.path.read_bytes()
    sources = bundle.folder / "sources"
    (folder / "objects").mkdir()
    objects = objects_of(sources, bundle.identity, folder / "objects", host.name)
    objects += compile_sources(folder, host.name, [*UNUSED_OUT, "-I", str(sources / "core")])
    gone = UNUSED_GONE[host.name.partition("-")[2]]
    return cached.put(compiler.link_shared(objects, folder / "fmu.so", host.name, gone)).read_bytes()
