"""What only somebody at a terminal does: press Ctrl-C, say yes, read where the page is and its tokens."""

import json
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from deployment.bundling import archive as signing
from deployment.hil.rig import free_port
from runtime.archive import keys
from runtime.can.busd import start_bus
from runtime.shared import private_folder
from slewright import __main__ as entry
from tests.runtime.bundles import built
from tests.terminal import CTRL_C, PATIENCE_S, Terminal

CONFIGURATION = """bundle = "{bundle}"
[can]
interface = "slewright"
channel = "{channel}"
[realtime]
fifo = false
lock = false
[hmi]
port = {port}
"""


@pytest.fixture
def configuration(tmp_path: Path) -> Iterator[tuple[Path, int]]:
    """A configuration on a local bus where nobody else is, and the page's port."""
    sockets, port = private_folder("slewright-test-"), free_port()
    bus = start_bus(sockets / "bus", 0)
    path = tmp_path / "machine.toml"
    path.write_text(
        CONFIGURATION.format(bundle=built("pd").folder, channel=sockets / "bus", port=port), "utf-8"
    )
    yield path, port
    bus.terminate()
    bus.wait()
    (sockets / "bus").unlink(missing_ok=True)
    sockets.rmdir()


def post(address: str, **body: str) -> int:
    """Status of an answer."""
    request = urllib.request.Request(address, json.dumps(body).encode(), {"Content-Type": "application/json"})
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def await_cycles(address: str) -> None:
    """Until the control process has shown something; interrupted before its first cycle it says nothing."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        with urllib.request.urlopen(f"{address}api/history?signals=control_mode", timeout=10) as answer:
            if json.loads(answer.read())["t"]:
                return
        time.sleep(0.1)
    raise AssertionError("no cycle was shown")


@pytest.mark.long
def test_run_says_where_its_page_is_and_its_tokens(configuration: tuple[Path, int]) -> None:
    path, port = configuration
    with Terminal("run", "--config", path, "--hmi", cwd=path.parent) as terminal:
        address = terminal.until(r"operator's page: (http://127\.0\.0\.1:\d+/)")[1]
        assert address == f"http://127.0.0.1:{port}/"
        token = terminal.until(r"token of operator: ([0-9a-f]{40})\s")[1]
        terminal.until(r"shown this once")
        page = f"{address}api/session"
        assert post(page, token=token, name="Ada") == 200
        assert post(page, token="0" * 40, name="Ada") == 403
        await_cycles(address)
        terminal.type(CTRL_C)
        terminal.until(r"\d+ ticks, \d+ overruns")
        assert terminal.ends() == 0
    with pytest.raises(urllib.error.URLError):
        post(page, token=token, name="Ada")


@pytest.mark.long
def test_ctrl_c_ends_commissioning_with_a_record(configuration: tuple[Path, int], tmp_path: Path) -> None:
    path, _ = configuration
    told = ("commission", "--config", path, "--out", tmp_path / "records", "--who", "Ada")
    with Terminal(*told) as terminal:
        terminal.until(r"Area clear\? Ready\? \[Enter when done\]")
        terminal.type(CTRL_C)
        assert terminal.ends() == 130
        assert "slewright: interrupted" in terminal.said
        assert "Traceback" not in terminal.said
    record = json.loads((tmp_path / "records" / "01-bus.json").read_text())
    assert (record["verdict"], record["who"]) == ("interrupted", "Ada")


@pytest.mark.parametrize(("answer", "code"), [("n\n", 1), ("y\n", 0)])
def test_install_asks_whoever_looks_at_the_difference(tmp_path: Path, answer: str, code: int) -> None:
    key, store = keys.new(tmp_path / "works.pem"), tmp_path / "store"
    signing.write(built("pd"), tmp_path / "pd.slwb", key, "first")
    assert entry.run(["deploy", "keys", "add", str(tmp_path / "works.pub.pem"), "--store", str(store)]) == 0
    with Terminal("deploy", "install", tmp_path / "pd.slwb", "--store", store) as terminal:
        terminal.until(r"Is this what you want to run\? \[y/N\]")
        terminal.type(answer)
        assert terminal.ends() == code
        assert ("runs from the next start on" in terminal.said) is (code == 0)
    assert entry.run(["deploy", "list", "--store", str(store)]) == (code != 0)
