"""One server for the tests of a file, and certificates for those who come to it."""

from typing import Any

import pytest

from tests.runtime.interfaces.beside import Beside
from tests.runtime.interfaces.both import Both
from tests.runtime.modbus.certificates import Authority, utf8


@pytest.fixture(scope="module")
def papers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The server's certificate, planners' and others'."""
    authority = Authority(tmp_path_factory.mktemp("papers"))
    stranger = Authority(tmp_path_factory.mktemp("stranger"), "stranger")
    uri = "urn:test:client"
    return {
        "server": authority.give("server", uri="urn:slewright:runtime"),
        "planner": authority.give("planner", utf8("Planner"), uri=uri),
        "second": authority.give("second", utf8("Planner"), uri=uri),
        "operator": authority.give("operator", utf8("Operator"), uri=uri),
        "viewer": authority.give("viewer", utf8("Viewer"), uri=uri),
        "stranger": stranger.give("planner-of-another", utf8("Planner"), uri=uri),
        "authority": authority.path,
    }


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, papers: dict[str, Any]):
    tmp_path = tmp_path_factory.mktemp("run")
    files = dict(zip(("certificate", "key"), map(str, papers["server"]), strict=True))
    security = {**files, "authority": str(papers["authority"])}
    told = {"host": "127.0.0.1", "port": 0, "closed": False, "security": security}
    with Beside("opcua", tmp_path, Both(tmp_path, "opcua"), **told) as found:
        yield found
