"""A small web server for the page: fixed files, JSON and one stream; made for loopback.

The standard library reads the requests.  Added to it: names in `Host` are refused but localhost (so that no
name of another site can be made to lead here), requests and connections are bounded in size, number and time,
and a strict policy forbids the page to load anything from elsewhere.
"""

import json
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from runtime.hmi.hub import Hub
from runtime.hmi.sessions import Refused
from runtime.places import is_near, keep_alive, leaves

PAGE = Path(__file__).parent / "page"
FULL_STREAMS = "too many pages are open at this controller: close some, or look from its own computer"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
CONNECTIONS, STREAMS = 64, 24
KEPT, KEPT_STREAMS = 16, 4  # of these, for this computer
BODY = 4096  # bytes of a request's body
REQUEST_S = 10.0  # that a connection may take for a request, or stay idle
STREAM_S = 5.0  # that a reader of the stream may take for what is sent to it
QUIET_S = 2.0  # without an event: a line that keeps the stream open
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Request:
    """What a route is given."""

    query: Mapping[str, str]
    body: Mapping[str, Any]
    key: str  # of the session, "" without one
    where: str  # address it came from
    near: bool  # from this computer


Route = Callable[[Request], Any]  # returns what is sent as JSON; raises Refused


@dataclass(eq=False)
class Visit:
    """A connection and its place."""

    connection: socket.socket
    near: bool  # from this computer
    heard: int  # when its last request began
    busy: bool = False  # in the middle of a request, or a stream
    streams: bool = False


class Site(ThreadingHTTPServer):
    """Serves the page, `routes` by method and path, and `hub` as /api/stream."""

    daemon_threads = True
    allow_reuse_address = True
    request_queue_size = CONNECTIONS

    def __init__(
        self,
        host: str,
        port: int,
        routes: Mapping[tuple[str, str], Route],
        hub: Hub | None,
        names: Iterable[str] = (),
    ) -> None:
        """`names`: by which the page may be asked for beside its address."""
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self.routes, self.hub = routes, hub
        self.names = tuple(name.lower() for name in names)
        self.files = _files()
        self.visits: dict[socket.socket, Visit] = {}
        self._lock = threading.Lock()
        self.deadlines: dict[socket.socket, float] = {}
        super().__init__((host, port), Handler)

    @property
    def port(self) -> int:
        """That it listens on."""
        return self.server_address[1]

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own; if all places are taken, an idle one makes room."""
        near = is_near(client_address[0])
        visit = Visit(request, near, time.monotonic_ns())
        with self._lock:
            leaving = leaves(self.visits.values(), visit, CONNECTIONS, KEPT)
            if leaving is not visit:
                self.visits[request] = visit
            if leaving is not None and leaving is not visit:
                del self.visits[leaving.connection]
        if leaving is visit:
            _say_full(request)
            self.shutdown_request(request)
            return
        if leaving is not None:
            _end(leaving.connection)
        keep_alive(request)
        super().process_request(request, client_address)

    def stream(self, connection: socket.socket) -> bool:
        """Whether a connection may become a stream; some are kept for this computer."""
        with self._lock:
            visit = self.visits.get(connection)
            streams = [v for v in self.visits.values() if v.streams]
            far = sum(not v.near for v in streams)
            if visit is None or len(streams) >= STREAMS:
                return False
            if not visit.near and far >= STREAMS - KEPT_STREAMS:
                return False
            visit.streams = visit.busy = True
            return True

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """All of one connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.deadlines.pop(request, None)
            with self._lock:
                self.visits.pop(request, None)

    def service_actions(self) -> None:
        """Twice a second: end connections that take too long for a request."""
        now = time.monotonic()
        for connection, end in list(self.deadlines.items()):
            if now > end:
                self.deadlines.pop(connection, None)
                _end(connection)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that broke is its own affair."""


class Handler(BaseHTTPRequestHandler):
    """One connection."""

    server: Site  # type: ignore[assignment]
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "slewright", ""
    timeout = REQUEST_S
    disable_nagle_algorithm = True

    def handle_one_request(self) -> None:
        """One request, within its time."""
        self.server.deadlines[self.connection] = time.monotonic() + REQUEST_S
        super().handle_one_request()
        if visit := self.server.visits.get(self.connection):
            visit.busy = False

    def do_GET(self) -> None:
        """Files, the stream, and what can be asked for."""
        path = self._path()
        if path is None:
            return
        if path in self.server.files:
            self._send(HTTPStatus.OK, *self.server.files[path])
        elif path == "/api/stream" and self.server.hub:
            self._stream(self.server.hub)
        else:
            self._answer("GET", path, {})

    def do_HEAD(self) -> None:
        """As GET, without the body."""
        self.do_GET()

    def do_POST(self) -> None:
        """What is to be done."""
        path = self._path()
        if path is None:
            return
        try:
            body = self._body()
        except Refused as error:
            self._refuse(error, close=True)  # what is left of the body must not be read as a request
            return
        self._answer("POST", path, body)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What the standard library refuses: nothing of the request is said back."""
        self.request_version = "HTTP/1.1"  # an answer without a head is read as one
        self.command = self.command or "GET"
        self._refuse(Refused(int(code), "this is no request that is answered here"), close=True)

    def log_message(self, format: str, *args: Any) -> None:
        """Not a line a request: who asks for nonsense must not fill our disk."""

    def _path(self) -> str | None:
        """What is asked for; None, and answered, where host or path are none of ours."""
        if visit := self.server.visits.get(self.connection):
            visit.busy, visit.heard = True, time.monotonic_ns()
        if not self._known_host():
            return None
        try:
            parts = urlsplit(self.path)
            self._query = {k: v[-1] for k, v in parse_qs(parts.query, max_num_fields=20).items()}
        except ValueError:
            self._refuse(Refused(400, "this is no address"), close=True)
            return None
        return parts.path

    def _known_host(self) -> bool:
        host = self.headers.get("Host", "")
        name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
        if name.lower() in ("localhost", *self.server.names) or _is_address(name):
            return True
        names = ", ".join(("its address", "localhost", *self.server.names))
        self._refuse(
            Refused(421, f"ask for this page as {names}; [hmi] names = [...] adds names"), close=True
        )
        return False

    def _body(self) -> Mapping[str, Any]:
        origin = self.headers.get("Origin")
        if origin is not None and origin.partition("://")[2] != self.headers.get("Host"):
            raise Refused(403, "not from this page")
        if self.headers.get_content_type() != "application/json":
            raise Refused(415, "JSON is wanted")
        length = self.headers.get("Content-Length", "")
        if self.headers.get("Transfer-Encoding") or not length.isascii() or not length.isdigit():
            raise Refused(411, "a length is wanted")
        if int(length[:9]) > BODY or len(length) > 9:
            raise Refused(413, f"at most {BODY} bytes")
        try:
            found = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            raise Refused(400, "this is no JSON") from None
        if not isinstance(found, dict):
            raise Refused(400, "an object is wanted")
        return found

    def _answer(self, method: str, path: str, body: Mapping[str, Any]) -> None:
        route = self.server.routes.get((method, path))
        if route is None:
            known = any(p == path for _, p in self.server.routes) or path in self.server.files
            self._refuse(Refused(405 if known else 404, "there is no such page"))
            return
        scheme, _, key = self.headers.get("Authorization", "").partition(" ")
        where = self.client_address[0]
        near = is_near(where)
        try:
            found = route(Request(self._query, body, key if scheme == "Bearer" else "", where, near))
        except Refused as error:
            self._refuse(error)
            return
        self._send_json(HTTPStatus.OK, found)

    def _refuse(self, error: Refused, close: bool = False) -> None:
        self.close_connection = self.close_connection or close
        self._send_json(error.status, {"error": str(error)})

    def _send_json(self, status: int, content: Any) -> None:
        data = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        self._send(status, "application/json", data)

    def _send(self, status: int, kind: str, data: bytes) -> None:
        self._head(status, kind)
        self.send_header("Content-Length", str(len(data)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def _head(self, status: int, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        for name, value in HEADERS.items():
            self.send_header(name, value)

    def _stream(self, hub: Hub) -> None:
        """Server-sent events: always the newest; who does not take them is left behind, then hung up on."""
        self.close_connection = True
        if self.command == "HEAD" or not self.server.stream(self.connection):
            self._refuse(Refused(503, FULL_STREAMS))
            return
        self.server.deadlines.pop(self.connection, None)
        self.connection.settimeout(STREAM_S)
        try:
            self._head(HTTPStatus.OK, "text/event-stream")
            self.end_headers()
            number = 0
            while not hub.closed:
                number, data = hub.after(number, QUIET_S)
                self.wfile.write(data or b": still here\n\n")
        except OSError:
            return


def secure(site: Site, context: ssl.SSLContext) -> None:
    """Speak TLS; each connection shakes hands in its own thread, when it first reads."""
    site.socket = context.wrap_socket(site.socket, server_side=True, do_handshake_on_connect=False)


def _end(connection: socket.socket) -> None:
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:
        return


def _say_full(connection: socket.socket) -> None:
    """Why there is no answer; over TLS nothing can be said before its handshake."""
    if isinstance(connection, ssl.SSLSocket):
        return
    content = json.dumps({"error": "all connections to this page are in use; close some"}).encode()
    head = f"HTTP/1.1 503 Service Unavailable\r\nContent-Length: {len(content)}\r\nConnection: close\r\n\r\n"
    try:
        connection.setblocking(False)
        connection.send(head.encode() + content)
    except OSError:
        return


def _files() -> dict[str, tuple[str, bytes]]:
    found = {f"/{p.name}": (TYPES[p.suffix], p.read_bytes()) for p in PAGE.iterdir() if p.suffix in TYPES}
    return {**found, "/": found["/index.html"]}


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
