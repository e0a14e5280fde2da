"""Who a TLS client is: Modbus/TCP Security puts its role into the certificate.

The role is a UTF-8 string in the extension 1.3.6.1.4.1.50316.802.1.  Source: Modbus Organization, MODBUS/TCP
Security Protocol Specification, 21 (2018), 8.3.  `Planner` reads and writes; all other roles, and none, read.
"""

import ssl
from pathlib import Path

from specs.errors import InputError

ROLE = "1.3.6.1.4.1.50316.802.1"
WRITERS, OPERATORS = ("Planner",), ("Operator",)
NAME_LENGTH = 40
UTF8 = 0x0C  # tag of a UTF8String in DER


def role(certificate: bytes) -> str | None:
    """The role in a certificate (DER); None if it has none."""
    from cryptography import x509

    try:
        extensions = x509.load_der_x509_certificate(certificate).extensions
        found = extensions.get_extension_for_oid(x509.ObjectIdentifier(ROLE)).value
    except (x509.ExtensionNotFound, x509.DuplicateExtension, ValueError):  # none, or none that can be read
        return None
    data = found.value if isinstance(found, x509.UnrecognizedExtension) else b""
    if len(data) < 2 or data[0] != UTF8 or data[1] > 127 or len(data) != 2 + data[1]:
        return None
    return data[2:].decode("utf-8", "replace")


def may_write(certificate: bytes | None) -> bool:
    """Whether the holder of a certificate (DER) may write."""
    return certificate is not None and role(certificate) in WRITERS


def may_acknowledge(certificate: bytes | None) -> bool:
    """Whether the holder of a certificate (DER) may acknowledge alarms."""
    return certificate is not None and role(certificate) in OPERATORS


def common_name(certificate: bytes | None) -> str:
    """The holder's name in a certificate (DER), for people; empty if it has none."""
    from cryptography import x509

    try:
        subject = x509.load_der_x509_certificate(certificate or b"").subject
        found = subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    except ValueError:
        return ""
    name = str(found[0].value) if found else ""
    return "".join(c for c in name if c.isprintable() and c != ":")[:NAME_LENGTH]


def context(certificate: Path, key: Path, authority: Path) -> ssl.SSLContext:
    """TLS 1.2 or newer, both sides with certificates of `authority`; InputError if a file is not that."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    made.verify_mode = ssl.CERT_REQUIRED
    try:
        made.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise InputError(f"modbus.tls: {certificate} with {key}: {_reason(error)}") from None
    try:
        made.load_verify_locations(authority)
    except (OSError, ssl.SSLError) as error:
        raise InputError(f"modbus.tls: {authority}: {_reason(error)}") from None
    return made


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
