"""TLS on its own port: both sides with certificates, and the role in the client's says what it may."""

import ssl
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from pymodbus.client import ModbusTlsClient

from runtime.modbus.holding import HEARTBEAT
from runtime.modbus.roles import context, may_write, role
from runtime.shared import private_folder
from specs.errors import InputError
from specs.signals import definition
from specs.tables import header_values
from tests.runtime.modbus.certificates import Authority, utf8
from tests.runtime.modbus.served import Raw, Served

ILLEGAL_FUNCTION = 1
HEADER = header_values(definition().modbus.tables["input"])


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("certificates"))


@pytest.fixture(scope="module")
def served(authority: Authority) -> Iterator[Served]:
    certificate, key = authority.give("server")
    files = {"certificate": str(certificate), "key": str(key), "authority": str(authority.path)}
    with Served(private_folder(), files) as found:
        yield found


class Secure(Raw):
    """The raw client over TLS."""

    def __init__(self, port: int, authority: Path, own: tuple[Path, Path] | None) -> None:
        super().__init__(port)
        made = ssl.create_default_context(cafile=str(authority))
        if own:
            made.load_cert_chain(*own)
        self.socket = made.wrap_socket(self.socket, server_hostname="127.0.0.1")


def test_a_planner_reads_and_writes(served: Served, authority: Authority) -> None:
    client = Secure(served.tls, authority.path, authority.give("planner", utf8("Planner")))
    assert client.read(4, 0, 5) == HEADER
    assert client.write(HEARTBEAT, 7) == 0
    client.close()


def test_pymodbus_own_client(served: Served, authority: Authority) -> None:
    """As docs/reference/buses.md has it."""
    certificate, key = authority.give("planner", utf8("Planner"))
    made = ssl.create_default_context(cafile=authority.path)
    made.load_cert_chain(certificate, key)
    made.check_hostname = False
    with ModbusTlsClient("127.0.0.1", port=served.tls, sslctx=made) as client:
        for _ in range(3):
            assert client.read_input_registers(0, count=5, device_id=1).registers == HEADER
        assert not client.write_register(HEARTBEAT, 7, device_id=1).isError()


@pytest.mark.parametrize("kind", [None, "Observer", "planner"])
def test_any_other_role_only_reads(served: Served, authority: Authority, kind: str | None) -> None:
    own = authority.give("other", None if kind is None else utf8(kind))
    client = Secure(served.tls, authority.path, own)
    assert client.read(4, 0, 5) == HEADER
    assert client.write(HEARTBEAT, 7) == ILLEGAL_FUNCTION
    mask = struct.pack(">HHH", HEARTBEAT, 0, 1)
    assert client.ask(22, mask) == bytes((22 | 0x80, ILLEGAL_FUNCTION))
    both = struct.pack(">HHHHBH", 0, 1, HEARTBEAT, 1, 2, 3)
    assert client.ask(23, both) == bytes((23 | 0x80, ILLEGAL_FUNCTION))
    client.close()


def test_nobody_comes_in_without_a_certificate_of_the_authority(
    served: Served, authority: Authority, tmp_path: Path
) -> None:
    stranger = Authority(tmp_path, "stranger").give("planner", utf8("Planner"))
    for own in (None, stranger):
        with pytest.raises((ssl.SSLError, ConnectionError)):
            Secure(served.tls, authority.path, own).read(4, 0, 5)  # TLS 1.3 refuses with the first answer


def test_plain_requests_get_nothing_on_the_secure_port(served: Served) -> None:
    with pytest.raises((ConnectionError, OSError)):
        Raw(served.tls).read(4, 0, 5)


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        (utf8("Planner"), "Planner"),
        (None, None),
        (b"", None),
        (b"\x0c\x09Planner", None),
        (b"\x16\x07Planner", None),  # another kind of string
    ],
)
def test_roles_as_they_stand(authority: Authority, value: bytes | None, wanted: str | None) -> None:
    pem = authority.give("someone", value)[0].read_bytes()
    der = x509.load_pem_x509_certificate(pem).public_bytes(Encoding.DER)
    assert role(der) == wanted
    assert may_write(der) == (wanted == "Planner")


def test_no_certificate_no_role() -> None:
    assert not may_write(None)
    assert not may_write(b"no certificate")


def test_files_that_are_none_are_refused(authority: Authority, tmp_path: Path) -> None:
    certificate, key = authority.give("server")
    (tmp_path / "junk").write_text("junk")
    with pytest.raises(InputError, match=r"modbus\.tls: .*nowhere"):
        context(tmp_path / "nowhere", key, authority.path)
    with pytest.raises(InputError, match=r"modbus\.tls"):
        context(certificate, authority.give("other")[1], authority.path)
    with pytest.raises(InputError, match=r"modbus\.tls: .*junk"):
        context(certificate, key, tmp_path / "junk")
