"""A headless Chromium, spoken to over its debugging pipe (the DevTools protocol, no network)."""

import base64
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

PATIENCE_S = 90.0
PIPES = (  # the browser wants them as 3 and 4
    "import fcntl, os, sys; a, b = (fcntl.fcntl(int(x), fcntl.F_DUPFD, 20) for x in sys.argv[1:3]);"
    "os.dup2(a, 3); os.dup2(b, 4); os.execv(sys.argv[3], sys.argv[3:])"
)
QUIET = ("--disable-gpu", "--disable-background-networking", "--no-first-run", "--hide-scrollbars")


class Browser:
    """One browser process with one page; a context, which ends it."""

    def __init__(self, path: str, profile: Path, size: tuple[int, int] = (1024, 768)) -> None:
        to_us, from_it = os.pipe()
        to_it, from_us = os.pipe()
        command = [path, "--headless", "--no-sandbox", *QUIET, "--remote-debugging-pipe"]
        command += [f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}", "about:blank"]
        # no name is found: whatever the page asked of elsewhere would fail, and be seen
        command += ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-c", PIPES, str(to_it), str(from_it), *command],
            pass_fds=(to_it, from_it),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(from_it)
        os.close(to_it)
        self._in, self._out = to_us, from_us
        self._received, self._count = b"", 0
        self.requests: list[str] = []  # addresses the page asked for
        self.complaints: list[str] = []  # of the console, exceptions and refused loads
        found = self._ask("Target.getTargets")["targetInfos"]
        page = next(t["targetId"] for t in found if t["type"] == "page")
        self._session = ""
        self._session = self._ask("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self._ask(f"{domain}.enable")
        self.resize(*size)

    def resize(self, width: int, height: int) -> None:
        """The size of the page in CSS pixels."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", **metrics)

    def dark(self, wanted: bool = True) -> None:
        """Prefer dark or light colours."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if wanted else "light"}
        self._ask("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, address: str) -> None:
        """Load a page and wait until its script says that it is ready."""
        self._ask("Page.navigate", url=address)
        self.wait("document.body && document.body.dataset.ready === 'yes'")

    def run(self, script: str) -> Any:
        """The value of an expression, awaited if it is a promise; AssertionError if it throws."""
        found = self._ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            raise AssertionError(found["exceptionDetails"].get("exception", found["exceptionDetails"]))
        return found["result"].get("value")

    def wait(self, script: str, seconds: float = PATIENCE_S) -> Any:
        """Wait until an expression is true; its value."""
        end = time.monotonic() + seconds
        while not (found := self.run(script)):
            if time.monotonic() > end:
                raise AssertionError(f"waited in vain for {script}; console: {self.complaints}")
            time.sleep(0.05)
        return found

    def click(self, selector: str) -> None:
        """Click an element."""
        self.run(f"document.querySelector({json.dumps(selector)}).click()")

    def write(self, selector: str, text: str) -> None:
        """Put a text into a field."""
        field = f"document.querySelector({json.dumps(selector)})"
        self.run(f"{field}.value = {json.dumps(text)}; {field}.dispatchEvent(new Event('input'))")

    def press(self, key: str) -> None:
        """Press and let go of a key."""
        codes = {"Tab": 9, "Enter": 13}
        for kind in ("rawKeyDown", "char", "keyUp"):
            text = {"text": "\r"} if key == "Enter" and kind != "keyUp" else {}
            code = codes.get(key, 0)
            self._ask("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **text)

    def picture(self, path: Path) -> None:
        """Save what is seen as PNG."""
        path.write_bytes(base64.b64decode(self._ask("Page.captureScreenshot")["data"]))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._in)
        os.close(self._out)

    def _ask(self, method: str, **params: Any) -> dict[str, Any]:
        self._count += 1
        number = self._count
        message: dict[str, Any] = {"id": number, "method": method, "params": params}
        if getattr(self, "_session", ""):
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        return self._until(lambda m: m.get("id") == number)

    def _until(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        end = time.monotonic() + PATIENCE_S
        while True:
            message = self._next(end)
            if wanted(message):
                if "error" in message:
                    raise AssertionError(message["error"])
                return message["result"]
            self._note(message)

    def _next(self, end: float) -> dict[str, Any]:
        while b"\0" not in self._received:
            left = end - time.monotonic()
            if left < 0 or not select.select([self._in], [], [], left)[0]:
                raise AssertionError("the browser does not answer")
            found = os.read(self._in, 1 << 16)
            if not found:
                raise AssertionError("the browser ended")
            self._received += found
        message, _, self._received = self._received.partition(b"\0")
        return json.loads(message)

    def _note(self, message: dict[str, Any]) -> None:
        params = message.get("params", {})
        match message.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])
            case "Runtime.exceptionThrown":
                self.complaints.append(json.dumps(params["exceptionDetails"])[:600])
            case "Log.entryAdded":
                self.complaints.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")
            case "Runtime.consoleAPICalled":
                self.complaints.append(json.dumps(params["args"])[:600])
