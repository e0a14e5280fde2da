"""Who an OPC UA client is: its application certificate on a signed and encrypted channel.

Certificates are those of Modbus/TLS (runtime/modbus/roles.py): issued by the authority of the configuration,
the role in an extension.  `Planner` commands, `Operator` acknowledges alarms; everybody else, and whoever
comes without a certificate, reads.
"""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from asyncua.crypto.permission_rules import User, UserRole

from runtime.modbus.roles import common_name, may_acknowledge, may_write
from specs.errors import InputError

NOBODY = "anonymous"


class Client(User):
    """Who a session's client is; its role for asyncua is never more than reading and calling."""

    def __init__(self, name: str, commands: bool = False, acknowledges: bool = False) -> None:
        super().__init__(UserRole.User, name)
        self.commands, self.acknowledges = commands, acknowledges


class Users:
    """asyncua's user manager: a client for each session, None for one that is refused."""

    def __init__(self, authority: Path | None, tell: Callable[[str], None]) -> None:
        """`tell` is told who is refused, and why."""
        self._authority, self._tell = load(authority) if authority else None, tell

    def get_user(
        self, iserver: Any, username: Any = None, password: Any = None, certificate: Any = None
    ) -> Client | None:
        """The client with this certificate (of its channel, which proved that it has the key)."""
        if not certificate or self._authority is None:
            return Client(NOBODY)
        name = common_name(certificate)
        if reason := self.distrust(certificate):
            self._tell(f"{name or 'a client'} was refused: {reason}")
            return None
        return Client(name or "a client", may_write(certificate), may_acknowledge(certificate))

    def has_role(self, certificate: bytes | None) -> bool:
        """Whether a certificate is trusted, and lets its holder command or acknowledge."""
        if not certificate or self.distrust(certificate):
            return False
        return may_write(certificate) or may_acknowledge(certificate)

    def distrust(self, certificate: bytes) -> str:
        """Why a certificate (DER) is not trusted; "" if it is."""
        from cryptography import x509
        from cryptography.exceptions import InvalidSignature

        if self._authority is None:
            return "no authority is configured"
        try:
            found, now = x509.load_der_x509_certificate(certificate), datetime.now(UTC)
            if not found.not_valid_before_utc <= now <= found.not_valid_after_utc:
                return "its certificate has expired or is not valid yet"
            found.verify_directly_issued_by(self._authority)
        except (ValueError, TypeError, InvalidSignature):
            return "its certificate is not issued by the authority"
        return ""

    async def validate(self, certificate: Any, description: Any) -> None:
        """asyncua's certificate validator: refuse a session before it is made."""
        from asyncua import ua as types
        from asyncua.common.utils import ServiceError
        from cryptography.hazmat.primitives.serialization import Encoding

        der = certificate.public_bytes(Encoding.DER)
        if reason := self.distrust(der):
            self._tell(f"{common_name(der) or 'a client'} was refused: {reason}")
            ua: Any = types
            raise ServiceError(ua.StatusCodes.BadCertificateUntrusted)


def load(authority: Path) -> Any:
    """The authority's certificate (PEM); InputError if the file is not that."""
    from cryptography import x509

    try:
        return x509.load_pem_x509_certificate(authority.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"opcua.security: {authority}: {error}") from None
