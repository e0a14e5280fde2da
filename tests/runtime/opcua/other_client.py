"""Reads and calls with open62541, by way of o6; arguments PORT CERTIFICATE KEY AUTHORITY, JSON on stdout.

A process of its own, since o6 prints and ends its process after ten minutes.
"""

import json
import sys
from pathlib import Path
from typing import Any

import o6 as other  # type: ignore[import-not-found]

from runtime.image import INPUT, OUTPUT
from specs.opcua import NAMESPACE, node

o6: Any = other


def main(port: str, certificate: str, key: str, server: str) -> None:
    """Every signal without a certificate, then a target with one."""
    url = f"opc.tcp://127.0.0.1:{port}/slewright"
    found: dict[str, Any] = {}
    with o6.Client(url) as client:
        index = list(client.read("i=2255")).index(NAMESPACE)
        for s in (*INPUT.signals, *OUTPUT.signals):
            try:
                held = client.read(f"ns={index};s={node(s)}")
                found[s.name] = held.value if hasattr(held, "value") else held
            except o6.StatusCodeError as error:
                found[s.name] = str(error)
        found["anonymous"] = call(client, index)
    secured = o6.Client(
        url,
        certificate=Path(certificate),
        privateKey=Path(key),
        trustList=[Path(server)],
        securityMode=3,
        securityPolicy="http://opcfoundation.org/UA/SecurityPolicy#Basic256Sha256",
        applicationUri="urn:test:client",
    )
    with secured as client:
        found["planner"] = call(client, index)
    sys.stdout.write("\n" + json.dumps(found, default=float) + "\n")


def call(client: Any, index: int) -> str:
    """Ask for a target: "done" or why not."""
    given = [o6.Double(v) for v in (8.0, 1.0, 4.0, 1.0, 0.0)]
    try:
        status, *_ = client.call(f"ns={index};s=Slewright", f"ns={index};s=SetTarget", given)
    except o6.StatusCodeError as error:
        return str(error)
    return "done" if status == o6.StatusCode.GOOD else str(status)


if __name__ == "__main__":
    main(*sys.argv[1:])
