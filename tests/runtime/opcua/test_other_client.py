"""The server, read and called by another stack: open62541 (o6; skipped, visibly, where it is missing)."""

import importlib.util
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from runtime.image import INPUT, OUTPUT, Status
from tests.conftest import ROOT
from tests.runtime.interfaces.beside import Beside, drawn, value
from tests.runtime.modbus.certificates import Authority, utf8

pytest.importorskip("asyncua")
X = INPUT.at("target_x")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("o6") is None, reason="o6 (open62541) is not installed"),
]


def test_open62541_reads_every_signal_and_commands_with_a_certificate(tmp_path: Path):
    from tests.runtime.interfaces.both import Both

    authority = Authority(tmp_path)
    server = authority.give("server", uri="urn:slewright:runtime")
    planner = authority.give("planner", utf8("Planner"), uri="urn:test:client")
    files = [str(p) for p in (*planner, authority.path)]
    security = {"certificate": str(server[0]), "key": str(server[1]), "authority": str(authority.path)}
    run, images = tmp_path / "run", drawn(1)
    run.mkdir()
    told = {"host": "127.0.0.1", "port": 0, "closed": False, "security": security}
    with Beside("opcua", run, Both(run, "opcua"), **told) as served:
        command = [sys.executable, "-m", "tests.runtime.opcua.other_client", served.ready, *files]
        served.publish(images)
        time.sleep(0.5)
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as client:
            followed: set[tuple[float, int]] = set()  # until its session ends
            while client.poll() is None:
                served.publish()
                followed.add(tuple(served.inputs[k][X].item() for k in ("value", "status")))  # type: ignore[arg-type]
                time.sleep(0.02)
            assert client.stdout
            found = json.loads(client.stdout.read().strip().splitlines()[-1])
        assert found.pop("anonymous") == "BAD_USER_ACCESS_DENIED"
        assert found.pop("planner") == "done"
        for s in (*INPUT.signals, *OUTPUT.signals):
            wanted = "BAD_WAITING_FOR_INITIAL_DATA" if s.kind == "target" else value(images, s.name)
            assert found[s.name] == wanted, s.name
        assert (8.0, Status.OK) in followed
