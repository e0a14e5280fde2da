"""Certificates for the tests: an authority, and keys that it signs, some with a role."""

from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.x509.oid import NameOID

from runtime.modbus.roles import ROLE


class Authority:
    """Signs; `folder` takes the files."""

    def __init__(self, folder: Path, name: str = "authority") -> None:
        self.folder, self.name = folder, name
        self.key = ec.generate_private_key(ec.SECP256R1())
        basic = x509.BasicConstraints(ca=True, path_length=0)
        signs = x509.KeyUsage(False, False, False, False, False, True, True, False, False)  # keys and lists
        self.certificate = self._sign(name, self.key, [(basic, True), (signs, True)])
        self.path = self._write(f"{name}.pem", self.certificate)

    def give(self, name: str, role: bytes | None = None, uri: str = "") -> tuple[Path, Path]:
        """Certificate and key of `name`; `role` as bytes of the extension's value.

        With the `uri` of an OPC UA application: of RSA, as its security policies ask for.
        """
        key = rsa.generate_private_key(65537, 2048) if uri else ec.generate_private_key(ec.SECP256R1())
        uris = [x509.UniformResourceIdentifier(uri)] if uri else []
        local = x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1")), *uris])
        extensions: list[tuple[x509.ExtensionType, bool]] = [(local, False)]
        if role is not None:
            extensions.append((x509.UnrecognizedExtension(x509.ObjectIdentifier(ROLE), role), False))
        certificate = self._write(f"{name}.pem", self._sign(name, key, extensions))
        path = self.folder / f"{name}.key"
        form = serialization.PrivateFormat.PKCS8
        path.write_bytes(key.private_bytes(serialization.Encoding.PEM, form, serialization.NoEncryption()))
        return certificate, path

    def _sign(
        self, name: str, key: Any, extensions: list[tuple[x509.ExtensionType, bool]]
    ) -> x509.Certificate:
        now = datetime.now(UTC)
        builder = (
            x509.CertificateBuilder()
            .subject_name(_named(name))
            .issuer_name(_named(self.name))
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(days=1))
            .not_valid_after(now + timedelta(days=1))
        )
        for extension, critical in extensions:
            builder = builder.add_extension(extension, critical)
        return builder.sign(self.key, hashes.SHA256())

    def _write(self, name: str, certificate: x509.Certificate) -> Path:
        path = self.folder / name
        path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        return path


def utf8(text: str) -> bytes:
    """A role as the extension holds it: a UTF8String."""
    data = text.encode()
    return bytes((0x0C, len(data))) + data


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
