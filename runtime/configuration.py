"""The configuration of a machine controller: one TOML file, read strictly, all of it checked before anything
starts.

What does not fit this version of the specs (a key, a signal, a rate, a DBC, a register map) is refused here
with one message; nothing of it is found out in operation.
"""

import re
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from ipaddress import ip_address
from pathlib import Path
from typing import Any, ClassVar, Literal

from runtime.can.engine import Engine
from runtime.can.joystick import Joysticks
from runtime.canopen.start import identities
from runtime.image import OUTPUT, TICK_S
from runtime.interfaces.beside import library
from runtime.matching import check_dbc, check_map
from runtime.modbus.roles import context
from runtime.realtime import PRIORITY, check_core
from specs import canopen
from specs.errors import InputError, nearest
from specs.schema import STRICT, read_toml, validate
from specs.signals import definition

LOCAL_BUS = "slewright"  # on one computer, for tests and simulated machines
NODE_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")  # ROS 2: namespace and name
HOST_NAME = re.compile(r"(?!-)[A-Za-z0-9-]{1,63}(\.(?!-)[A-Za-z0-9-]{1,63})*")  # as browsers send it
LAST_DOMAIN = 101  # of ROS 2: the ports of higher ones are those of outgoing connections
LOWEST_PRIORITY, HIGHEST_PRIORITY = 1, 98  # 99 is the kernel's own


@dataclass(frozen=True, kw_only=True)
class Rates:
    """Rates of the tasks in Hz: said, so that a file for another version is seen, not chosen."""

    __pydantic_config__: ClassVar[Any] = STRICT

    base_hz: float = 50.0
    policy_hz: float = 10.0

    def __post_init__(self) -> None:
        for key, only in (("base_hz", 1.0 / TICK_S), ("policy_hz", 0.2 / TICK_S)):
            if getattr(self, key) != only:
                raise InputError(f"{key} = {getattr(self, key):g}: this runtime runs at {only:g} Hz")


@dataclass(frozen=True, kw_only=True)
class Realtime:
    """What is asked of the system; what it refuses shows in the status register."""

    __pydantic_config__: ClassVar[Any] = STRICT

    fifo: bool = True
    lock: bool = True
    priority: int = PRIORITY
    core: int | None = None  # the processor core to stay on

    def __post_init__(self) -> None:
        if not LOWEST_PRIORITY <= self.priority <= HIGHEST_PRIORITY:
            raise InputError(f"priority = {self.priority}: {LOWEST_PRIORITY} to {HIGHEST_PRIORITY}")


@dataclass(frozen=True, kw_only=True)
class Can:
    """The bus: `slewright` is the local one over the Unix socket `channel`."""

    __pydantic_config__: ClassVar[Any] = STRICT

    interface: Literal["slewright", "socketcan", "slcan"]
    channel: str
    bit_rate: int = 250_000
    dbc: Path | None = None
    joystick: Joysticks | None = None  # J1939 joysticks; without: the panel's own message
    engine: Engine | None = None  # a J1939 engine; without: the machine's own message

    def __post_init__(self) -> None:
        wanted = definition().bus.bit_rate
        if self.bit_rate != wanted:
            raise InputError(f"bit_rate = {self.bit_rate}: the specs' bus runs at {wanted} bit/s")


@dataclass(frozen=True, kw_only=True)
class Canopen:
    """The bus of the CANopen devices; `eds`: makers' files by node, for devices other than the specs'."""

    __pydantic_config__: ClassVar[Any] = STRICT

    interface: Literal["slewright", "socketcan"]
    channel: str
    eds: Mapping[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.eds:
            canopen.definition().node(name)


@dataclass(frozen=True, kw_only=True)
class Tls:
    """Modbus/TCP Security: roles come from the clients' certificates."""

    __pydantic_config__: ClassVar[Any] = STRICT

    port: int
    certificate: Path
    key: Path
    authority: Path


@dataclass(frozen=True, kw_only=True)
class Modbus:
    """The server; without an address of its own it can be reached from this machine only."""

    __pydantic_config__: ClassVar[Any] = STRICT

    port: int
    host: str = "127.0.0.1"
    map: Path | None = None
    tls: Tls | None = None


@dataclass(frozen=True, kw_only=True)
class HmiTls:
    """What lets the page be reached safely over a network."""

    __pydantic_config__: ClassVar[Any] = STRICT

    certificate: Path
    key: Path


@dataclass(frozen=True, kw_only=True)
class Hmi:
    """The operator's page (docs/how-to/hmi.md); nothing is changed from another computer without TLS."""

    __pydantic_config__: ClassVar[Any] = STRICT

    port: int = 8080
    host: str = "127.0.0.1"
    names: tuple[str, ...] = ()  # by which the page is asked for, as on its certificate
    tokens: Path = Path("hmi-tokens.json")
    audit: Path = Path("audit")
    tls: HmiTls | None = None

    def __post_init__(self) -> None:
        for name in self.names:
            if not HOST_NAME.fullmatch(name):
                raise InputError(f"names: {name!r} is no name of a computer, as in crane7.example (no port)")


@dataclass(frozen=True, kw_only=True)
class Foxglove:
    """The live picture for Foxglove: it has neither users nor TLS, so it stays on this computer."""

    __pydantic_config__: ClassVar[Any] = STRICT

    port: int = 8765
    host: str = "127.0.0.1"

    def __post_init__(self) -> None:
        check_loopback(self.host, "Foxglove's server knows no users")


@dataclass(frozen=True, kw_only=True)
class OpcuaSecurity:
    """What lets OPC UA clients be told apart: without it all of them only read."""

    __pydantic_config__: ClassVar[Any] = STRICT

    certificate: Path
    key: Path
    authority: Path


@dataclass(frozen=True, kw_only=True)
class Opcua:
    """The OPC UA server; without `security` it can be reached from this computer only, and is read-only."""

    __pydantic_config__: ClassVar[Any] = STRICT

    port: int = 4840
    host: str = "127.0.0.1"
    security: OpcuaSecurity | None = None

    @property
    def closed(self) -> bool:
        """Whether it takes signed and encrypted connections only."""
        return not is_loopback(self.host)

    def __post_init__(self) -> None:
        if self.security is None:
            check_loopback(self.host, "without [opcua.security] everybody may read")


@dataclass(frozen=True, kw_only=True)
class Ros2:
    """ROS 2's topics, on this computer only; `commands`: whether publishers on it may send targets.

    `policy`: the node, by its full name, that has the role of the policy outside; with a bundle of "outside".
    """

    __pydantic_config__: ClassVar[Any] = STRICT

    domain: int = 0
    commands: bool = False
    policy: str = ""

    def __post_init__(self) -> None:
        if not 0 <= self.domain <= LAST_DOMAIN:
            raise InputError(f"domain = {self.domain}: 0 to {LAST_DOMAIN}")
        if self.policy and not NODE_NAME.fullmatch(self.policy):
            raise InputError(f"policy = {self.policy!r}: a node's full name as in /namespace/name or /name")


def is_loopback(host: str) -> bool:
    """Whether an address is this computer's own."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_loopback(host: str, why: str) -> None:
    """Raise InputError for an address that is not this computer's own."""
    if not is_loopback(host):
        raise InputError(f"host = {host!r}: 127.0.0.1 or ::1 only, since {why}; use an SSH tunnel from afar")


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Where ticks are recorded, and how much of the disk for."""

    __pydantic_config__: ClassVar[Any] = STRICT

    folder: Path
    limit_mb: float = 2000.0
    segment_s: float = 60.0

    def __post_init__(self) -> None:
        if self.limit_mb < 8.0:
            raise InputError(f"limit_mb = {self.limit_mb:g}: at least 8 MB, so that a segment can be closed")
        if not 10.0 <= self.segment_s <= 3600.0:
            raise InputError(f"segment_s = {self.segment_s:g}: 10 to 3600 s")


@dataclass(frozen=True, kw_only=True)
class Retaining:
    """Which of the controller's outputs outlive a power cut, how often they are saved, and where."""

    __pydantic_config__: ClassVar[Any] = STRICT

    folder: Path
    signals: tuple[str, ...] = ("fault_code", "fault_signal", "load_estimate")
    every_s: float = 5.0

    def __post_init__(self) -> None:
        if not self.signals:
            raise InputError("signals is empty; without [retain] nothing is retained")
        for name in self.signals:
            if name not in OUTPUT.index:
                raise InputError(f"signals: unknown signal '{name}'; {nearest(name, OUTPUT.index)}")
        if self.every_s < 1.0:
            raise InputError(f"every_s = {self.every_s:g}: at least 1 s")


@dataclass(frozen=True, kw_only=True)
class Stored:
    """The store of signed bundles whose active one runs, and the folder of the keys that are trusted."""

    __pydantic_config__: ClassVar[Any] = STRICT

    folder: Path
    keys: Path | None = None  # default: `keys` in the store


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """All of a configuration file; paths are those of the file's folder."""

    __pydantic_config__: ClassVar[Any] = STRICT

    can: Can
    bundle: Path | None = None  # a bundle's folder, which nobody has signed
    unsigned: bool = False  # whether such a one may run on a real bus
    store: Stored | None = None
    shadow: bool = False  # read and compute everything, command nothing (docs/how-to/shadow.md)
    rates: Rates = field(default_factory=Rates)
    realtime: Realtime = field(default_factory=Realtime)
    modbus: Modbus | None = None
    recorder: Recording | None = None
    retain: Retaining | None = None
    hmi: Hmi | None = None
    foxglove: Foxglove | None = None
    opcua: Opcua | None = None
    ros2: Ros2 | None = None
    canopen: Canopen | None = None

    @property
    def interfaces(self) -> tuple[Any, ...]:
        """The interfaces beside Modbus and the page that are asked for."""
        return tuple(part for part in (self.foxglove, self.opcua, self.ros2) if part)

    @property
    def outside(self) -> bool:
        """Whether a policy outside commands."""
        return bool(self.ros2 and self.ros2.policy)

    @property
    def seats(self) -> tuple[str, ...]:
        """The interfaces over which a client may command (runtime/interfaces/seats.py)."""
        ros2 = ("ros2",) if self.ros2 and self.ros2.commands else ()
        return (("opcua",) if self.opcua else ()) + ros2

    def __post_init__(self) -> None:
        if self.shadow and self.recorder is None:
            raise InputError("shadow mode without [recorder]: what it computes would go nowhere")
        if self.shadow and self.canopen:
            raise InputError("shadow mode with [canopen]: a master that sends nothing sets up no device")
        if self.bundle is None and self.store is None:
            raise InputError("missing bundle (a folder) or [store] (of signed ones)")
        if self.store is not None and (self.bundle is not None or self.unsigned):
            raise InputError("[store] leaves no room for bundle or unsigned: what runs is what it holds")
        if self.bundle is not None and not self.unsigned and self.can.interface != LOCAL_BUS:
            raise InputError(
                "bundle is a folder that nobody has signed: on a real bus it runs with unsigned = true only; "
                "signed ones come with [store] (docs/how-to/bundles.md)"
            )


INTERFACES: dict[str, type] = {"foxglove": Foxglove, "opcua": Opcua, "ros2": Ros2}  # that a command can add


def read(path: Path) -> Configuration:
    """Read and check a configuration; raises InputError naming file, key and what is valid."""
    data = read_toml(path)
    _check_texts(data, str(path))
    found = validate(Configuration, data, str(path))
    found = _placed(found, path.absolute().parent)
    _check_folders_differ(found, str(path))
    if found.can.dbc:
        check_dbc(found.can.dbc)
    if found.modbus and found.modbus.map:
        check_map(found.modbus.map)
    return in_shadow(found) if found.shadow else found


def _check_texts(data: Any, where: str, key: str = "") -> None:
    """No text has a character that would break a line of a log."""
    if isinstance(data, dict | list):
        parts = data.items() if isinstance(data, dict) else enumerate(data)
        for part, value in parts:
            _check_texts(value, where, f"{key}.{part}".strip("."))
    elif isinstance(data, str) and not data.isprintable():
        raise InputError(f"{where}: {key}: {data!r} has a character that cannot be printed")


def with_hmi(found: Configuration, folder: Path) -> Configuration:
    """The same with an HMI, the default one if it has none of its own; its files are those of `folder`."""
    return found if found.hmi else replace(found, hmi=_placed(Hmi(), folder))


def with_interface(found: Configuration, name: str, folder: Path) -> Configuration:
    """The same with an interface, the default one if it has none of its own."""
    if getattr(found, name):
        return found
    return replace(found, **{name: _placed(INTERFACES[name](), folder)})


def in_shadow(found: Configuration) -> Configuration:
    """The same in shadow mode, which retains nothing: what it meets is no machine's that it drove."""
    return replace(found, shadow=True, retain=None)


def check_surroundings(found: Configuration) -> None:
    """Raise InputError for what is not there: the bus, a free port, a folder that can be written."""
    _check_bus("can", found.can)
    if found.canopen:
        library("canopen", "canopen", "canopen")
        _check_bus("canopen", found.canopen)
        identities(found.canopen.eds)
    check_core(found.realtime.core)
    _check_ports_differ(found)
    if found.modbus:
        _check_port("modbus", found.modbus.host, found.modbus.port)
        if found.modbus.tls:
            _check_port("modbus", found.modbus.host, found.modbus.tls.port)
            _check_tls(found.modbus.tls)
    if found.foxglove:
        _check_port("foxglove", found.foxglove.host, found.foxglove.port)
    if found.opcua:
        _check_port("opcua", found.opcua.host, found.opcua.port)
        if found.opcua.security:
            check_pair("opcua.security", found.opcua.security)
    if found.hmi:
        _check_port("hmi", found.hmi.host, found.hmi.port)
        _check_folder(found.hmi.audit)
    for part in (found.recorder, found.retain):
        if part:
            _check_folder(part.folder)


def _placed(found: Any, folder: Path) -> Any:
    """The same with relative paths from `folder` on."""
    changes = {}
    for f in fields(found):
        value = getattr(found, f.name)
        if isinstance(value, Path):
            changes[f.name] = folder / value
        elif is_dataclass(value):
            changes[f.name] = _placed(value, folder)
        elif isinstance(value, Mapping) and isinstance(found, Canopen):
            changes[f.name] = {name: folder / path for name, path in value.items()}
    if (
        isinstance(found, Can | Canopen) and found.interface == LOCAL_BUS
    ):  # the others' channels are no files of ours
        changes["channel"] = str(folder / found.channel)
    return replace(found, **changes)


def _check_bus(whose: str, can: Can | Canopen) -> None:
    if can.interface == "socketcan":
        there = [p.name for p in Path("/sys/class/net").glob("*can*")]
        if can.channel not in there:
            have = nearest(can.channel, there) if there else "this machine has none"
            raise InputError(f"{whose}.channel: there is no CAN interface {can.channel}; {have}")
    elif can.interface == LOCAL_BUS:
        if not Path(can.channel).is_socket():
            raise InputError(f"{whose}.channel: {can.channel} is no local bus (slewright machine makes one)")
    elif not Path(can.channel.split("@")[0]).exists():
        raise InputError(f"{whose}.channel: there is no device {can.channel}")


def _check_ports_differ(found: Configuration) -> None:
    tls = found.modbus.tls if found.modbus else None
    parts = {"modbus.port": found.modbus, "modbus.tls.port": tls, "hmi.port": found.hmi}
    parts |= {"foxglove.port": found.foxglove, "opcua.port": found.opcua}
    taken: dict[int, str] = {}
    for name, port in ((name, part.port) for name, part in parts.items() if part):
        if port in taken:
            raise InputError(f"{taken[port]} and {name} are both {port}; give each its own")
        taken[port] = name


def _check_folders_differ(found: Configuration, where: str) -> None:
    """However a folder is spelled: `a`, `./a` and a link to it are one."""
    parts = {"recorder.folder": found.recorder, "retain.folder": found.retain}
    folders = {name: part.folder.resolve() for name, part in parts.items() if part}
    if len(set(folders.values())) < len(folders):
        raise InputError(f"{where}: {' and '.join(folders)} are the same; give each its own")


def _check_port(whose: str, host: str, port: int) -> None:
    if not 0 < port < 65536:
        raise InputError(f"{whose}: port {port}: 1 to 65535")
    if not host.strip():
        raise InputError(f"{whose}: host is empty; 0.0.0.0 is every network, 127.0.0.1 this computer only")
    try:
        with socket.create_server((host, port)):
            pass
    except OSError as error:
        why = str(error.strerror).split(" (")[0]
        raise InputError(f"{whose}: port {port} of {host} cannot be had: {why}") from None


def _check_tls(tls: Tls) -> None:
    context(tls.certificate, tls.key, tls.authority)


def check_pair(whose: str, files: OpcuaSecurity) -> None:
    """Raise InputError unless the key is that of the certificate, of RSA, and the authority is one."""
    from cryptography import x509
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric import rsa

    at = files.certificate
    try:
        certificate = x509.load_pem_x509_certificate(files.certificate.read_bytes())
        at = files.key
        key = serialization.load_pem_private_key(files.key.read_bytes(), None)
        at = files.authority
        x509.load_pem_x509_certificate(files.authority.read_bytes())
    except (OSError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise InputError(f"{whose}: {at}: {reason}") from None
    if not isinstance(key, rsa.RSAPrivateKey):
        raise InputError(f"{whose}: {files.key} is no RSA key, which OPC UA's security policies ask for")
    if key.public_key() != certificate.public_key():
        raise InputError(f"{whose}: {files.key} is not the key of {files.certificate}")


def _check_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".slewright"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"{path} cannot be written to: {error.strerror}") from None
