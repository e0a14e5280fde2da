"""The web server: what is no request of ours is refused, and nobody who is slow holds up anybody else."""

import json
import random
import shutil
import socket
import threading
from collections.abc import Iterator

import pytest

from runtime.hmi import desk as desks, web
from runtime.hmi.live import Live
from runtime.hmi.sessions import Refused
from runtime.hmi.web import BODY, HEADERS, Request
from runtime.modbus.port import PERIOD_NS
from runtime.shared import private_folder
from tests.runtime.bench import STANDBY
from tests.runtime.bundles import core
from tests.runtime.hmi.served import Served, until, value

LONG = 10**12


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    """One for all tests; rights do not lapse here, since a test's computer may be slow."""
    folder = private_folder("slewright-test-")
    patch = pytest.MonkeyPatch()
    patch.setattr(desks, "LAPSE_NS", LONG)
    patch.setattr("runtime.hmi.port.timeout_ticks", lambda signal: LONG // PERIOD_NS)
    with Served(core("pd"), folder) as found:
        yield found
    patch.undo()
    shutil.rmtree(folder, ignore_errors=True)


def raw(served: Served, request: bytes, seconds: float = 5.0) -> bytes:
    """The answer to some bytes, until the server closes or says no more."""
    with socket.create_connection(("127.0.0.1", served.site.port), timeout=seconds) as connection:
        connection.sendall(request)
        connection.shutdown(socket.SHUT_WR)
        found = b""
        while data := connection.recv(65536):
            found += data
    return found


def get(path: str, *headers: str) -> bytes:
    return (
        "\r\n".join([f"GET {path} HTTP/1.1", "Host: 127.0.0.1", *headers, "Connection: close"]) + "\r\n\r\n"
    ).encode()


def post(path: str, body: bytes, *headers: str) -> bytes:
    length = () if any(h.startswith("Content-Length") for h in headers) else (f"Content-Length: {len(body)}",)
    kind = () if any(h.startswith("Content-Type") for h in headers) else ("Content-Type: application/json",)
    lines = [f"POST {path} HTTP/1.1", "Host: 127.0.0.1", *kind, *length, *headers, "Connection: close"]
    return ("\r\n".join(lines) + "\r\n\r\n").encode() + body


def status(answer: bytes) -> int:
    return int(answer.split(b" ", 2)[1]) if answer.startswith(b"HTTP/1.1 ") else 0


def test_every_answer_forbids_the_page_to_load_anything_from_elsewhere(served: Served):
    for path in ("/", "/main.js", "/style.css", "/api/catalogue", "/nothing"):
        head = raw(served, get(path)).partition(b"\r\n\r\n")[0].decode()
        assert all(f"{name}: {value}" in head for name, value in HEADERS.items()), path
    assert "default-src 'none'" in HEADERS["Content-Security-Policy"]


def test_the_page_names_no_other_place_and_makes_no_markup_of_text():
    for path in web.PAGE.iterdir():
        text = path.read_text().replace('"http://www.w3.org/2000/svg"', "")
        assert "://" not in text, path.name
        assert "innerHTML" not in text
        assert "eval(" not in text


@pytest.mark.parametrize(
    ("request_", "expected"),
    [
        (get("/../tokens.json"), 404),
        (get("/%2e%2e/tokens.json"), 404),
        (get("http://["), 400),
        (get("/", "Host: evil.example").replace(b"Host: 127.0.0.1\r\n", b""), 421),
        (get("/").replace(b"Host: 127.0.0.1\r\n", b""), 421),
        (get("/api/history?signals=q_slew&seconds=nan"), 400),
        (get("/api/history?signals=nonsense"), 400),
        (get("/api/history?" + "&".join(f"a{k}=1" for k in range(50))), 400),
        (get("/api/target"), 405),
        (get("/" + 70000 * "a"), 414),
        (get("/", *(f"A{k}: b" for k in range(200))), 431),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", 400),
        (b"GET\r\n\r\n", 400),
        (b"BREW / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n", 501),
        (post("/api/session", b"{}", "Origin: http://evil.example"), 403),
        (post("/api/session", b"{}", "Content-Type: text/plain"), 415),
        (post("/api/session", b"{}", "Content-Length: -1"), 411),
        (post("/api/session", b"{}", "Content-Length: 99999999999999999999"), 413),
        (post("/api/session", b"x" * (BODY + 1)), 413),
        (post("/api/session", b"{"), 400),
        (post("/api/session", b"[1]"), 400),
        (post("/api/session", b"[" * 4000), 400),
        (post("/api/session", b"\xff\xfe"), 400),
        (post("/api/session", b'{"token": 1, "name": []}'), 400),
        (post("/api/session", b'{"token": "guess", "name": "Eve"}'), 403),
        (post("/api/hold", b"{}"), 401),
        (post("/api/hold", b"{}", "Authorization: Bearer 0"), 401),
        (post("/api/hold", b"{}", "Authorization: Basic 0"), 401),
        (post("/nothing", b"{}"), 404),
    ],
)
def test_what_is_wrong_is_refused_and_the_server_goes_on(served: Served, request_: bytes, expected: int):
    assert status(raw(served, request_)) == expected
    assert status(raw(served, get("/api/catalogue"))) == 200


def test_random_bytes_do_no_harm(served: Served):
    found = random.Random(3)
    whole = post("/api/session", b'{"token": "guess", "name": "Eve"}')
    for _ in range(60):
        cut = bytearray(whole[: found.randrange(1, len(whole))])
        for _ in range(found.randrange(1, 6)):
            cut[found.randrange(len(cut))] = found.randrange(256)
        raw(served, bytes(cut))
    assert status(raw(served, get("/api/catalogue"))) == 200


def test_what_needs_a_session_or_a_role_is_refused_without(served: Served):
    bodies = {
        "target": {"target_x": 6.0, "target_y": 7.0, "target_z": 5.0},
        "force": {"signal": "q_boom", "value": 1.0},
    }
    for path in ("control", "control/end", "beat", "hold", "target", "force", "force/end", "acknowledge"):
        assert served.ask(f"api/{path}", bodies.get(path, {}))[0] == 401, path
        assert served.ask(f"api/{path}", bodies.get(path, {}), session="f" * 32)[0] == 401, path
    assert served.ask("api/audit")[0] == 401
    operator = served.sign_in("operator")
    assert served.ask("api/force", bodies["force"], operator) == (
        403,
        {"error": "only the service role may force inputs"},
    )
    assert served.ask("api/target", bodies["target"], operator)[0] == 409


def test_a_session_takes_control_sets_a_target_and_gives_it_back(served: Served):
    session, other = served.sign_in("operator"), served.sign_in("operator", "Bob")
    assert served.ask("api/control", {}, session) == (200, {})
    assert served.ask("api/control", {}, other)[0] == 409
    assert (
        served.ask("api/target", {"target_x": 6, "target_y": 7, "target_z": 5.5, "pace": 0.5}, session)[0]
        == 200
    )
    until(lambda: value(served, "target_z") == 5.5 and value(served, "pace") == 0.5)
    assert served.ask("api/target", {"target_x": 600}, session)[0] == 400
    assert served.ask("api/hold", {}, session)[0] == 200
    until(lambda: value(served, "target_valid") == 0.0)
    assert served.ask("api/control/end", {}, session)[0] == 200
    found = served.ask("api/audit", session=session)[1]["entries"]
    assert [e["what"] for e in found[:4]] == ["control ended", "hold", "go to target", "take control"]
    assert {(e["who"], e["role"], e["from"]) for e in found[:4]} == {("Ada", "operator", "127.0.0.1")}


def test_forcing_over_the_web_shows_and_ends_with_standby(served: Served):
    service = served.sign_in("service", "Grace")
    assert served.mode == STANDBY
    assert served.ask("api/force", {"signal": "p_pump", "value": 1.5e7}, service)[0] == 200
    until(lambda: value(served, "p_pump") == 1.5e7)
    until(lambda: served.watch.newest is not None and served.watch.newest["outputs"]["flags"] & 2048)
    served.bench.set(operator_enable=1.0)
    until(lambda: served.watch.mode() not in (STANDBY, -1) and served.desk.forcer is None)
    assert served.ask("api/force", {"signal": "p_pump", "value": 1.5e7}, service)[0] == 409
    served.bench.set(operator_enable=0.0)
    until(lambda: served.mode == STANDBY)
    assert value(served, "p_pump") != 1.5e7
    found = served.ask("api/audit", session=service)[1]["entries"]
    assert [(e["what"], e["result"][:8]) for e in found[:3]] == [
        ("force", "refused:"),
        ("forcing ended", "STANDBY "),
        ("force", "done"),
    ]


def test_from_another_computer_nothing_is_changed_without_tls(served: Served):
    key = served.sign_in("service")
    for secure in (False, True):
        route = web_routes(served, secure)[("POST", "/api/acknowledge")]
        if secure:
            assert route(Request({}, {}, key, "192.0.2.7", False)) == {}
        else:
            with pytest.raises(Refused, match="without TLS"):
                route(Request({}, {}, key, "192.0.2.7", False))


def web_routes(served: Served, secure: bool):
    return Live(served.watch, served.desk, {}, secure).routes()


def test_who_is_slow_holds_up_nobody(served: Served):
    """Half requests, a stream that is not read, and many connections: others have their answers and news."""
    where = ("127.0.0.1", served.site.port)
    idle = [socket.create_connection(where) for _ in range(30)]
    for connection in idle:
        connection.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ")
    deaf = socket.create_connection(where)
    deaf.sendall(get("/api/stream"))
    try:
        assert status(raw(served, get("/api/catalogue"))) == 200
        with socket.create_connection(where, timeout=20) as reader:
            reader.sendall(get("/api/stream"))
            lines = reader.makefile("rb")
            ticks = []
            while len(ticks) < 5:
                line = lines.readline()
                if line.startswith(b'data: {"t"') and b'"tick"' in line:
                    ticks.append(json.loads(line[6:])["tick"])
        assert ticks == sorted(set(ticks))
    finally:
        for connection in (*idle, deaf):
            connection.close()


def test_a_request_that_never_ends_is_ended(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(web, "REQUEST_S", 0.5)
    site = web.Site("127.0.0.1", 0, {}, None)
    threading.Thread(target=site.serve_forever, args=(0.1,), daemon=True).start()
    with socket.create_connection(("127.0.0.1", site.port), timeout=20) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n")
        assert connection.recv(100) == b""  # it was hung up on
    site.shutdown()
    site.server_close()


def test_idle_connections_make_room_and_full_streams_say_so(served: Served, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(web, "CONNECTIONS", 4)
    monkeypatch.setattr(web, "STREAMS", 1)
    where = ("127.0.0.1", served.site.port)
    until(lambda: not served.site.visits)
    idle = [socket.create_connection(where, timeout=20) for _ in range(12)]
    assert status(raw(served, get("/api/catalogue"))) == 200
    assert idle[0].recv(10) == b"", "the longest quiet made room"
    with socket.create_connection(where, timeout=20) as reader:
        reader.sendall(get("/api/stream"))
        assert status(reader.recv(100)) == 200
        assert web.FULL_STREAMS.encode() in raw(served, get("/api/stream"))
        assert web.FULL_STREAMS.encode() in raw(served, get("/api/full"))
        more = [socket.create_connection(where, timeout=20) for _ in range(12)]
        assert reader.recv(100), "who watches keeps the place"
        for connection in (*idle, *more):
            connection.close()
