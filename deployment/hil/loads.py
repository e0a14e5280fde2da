"""What disturbs the runtime while its timing is measured: twenty Modbus clients, or a full computer."""

import asyncio
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from deployment.hil.rig import HOST, PATIENCE_S
from runtime.helpers import ROOT
from runtime.image import INPUT, OUTPUT
from runtime.modbus.cells import create
from runtime.modbus.port import ModbusPort
from runtime.shared import private_folder
from specs.errors import RunError

CLIENTS = 20
PAGES = 3  # browsers
PAGES_S = 10.0  # until they show something
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
REGISTERS = 100  # of a request: nearly what Modbus allows (125)
STRESS = ("stress-ng", "--cpu", "2", "--io", "1", "--vm", "1", "--vm-bytes", "128M", "--quiet")


@contextmanager
def clients(port: int, seconds: float) -> Iterator[dict[str, Any]]:
    """CLIENTS clients in a process of their own, which ask without a pause for `seconds`."""
    command = [sys.executable, "-m", "deployment.hil.loads", str(port), str(seconds)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    found: dict[str, Any] = {}
    try:
        if not process.stdout or process.stdout.readline() != "ready\n":
            raise RunError("the Modbus clients did not start")
        yield found
        found |= json.loads(process.stdout.readline() or "{}")
    finally:
        process.kill()
        process.wait()


def browser() -> str | None:
    """A headless browser of this computer, if it has one."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


@contextmanager
def pages(port: int, count: int = PAGES) -> Iterator[None]:
    """So many browsers with the operator's page open: its main one, its trends and its statistics."""
    quiet = (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--no-first-run",
    )
    folder = Path(tempfile.mkdtemp(prefix="slewright-pages-"))
    opened = []
    try:
        for number in range(count):
            address = f"http://{HOST}:{port}/#{('machine', 'trends', 'statistics')[number % 3]}"
            profile = f"--user-data-dir={folder / str(number)}"
            command = [browser() or "", *quiet, "--remote-debugging-port=0", profile, address]
            opened.append(
                subprocess.Popen(
                    command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
                )
            )
        time.sleep(PAGES_S)
        yield
    finally:
        for process in opened:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def readers(port: int, count: int = PAGES) -> Iterator[None]:
    """So many pages on other computers: what the HMI sends them is taken, and nothing is drawn here."""
    stop = threading.Event()

    def read() -> None:
        with urllib.request.urlopen(f"http://{HOST}:{port}/api/stream", timeout=PAGES_S) as stream:
            while not stop.is_set() and stream.readline():
                pass

    threads = [threading.Thread(target=read, daemon=True) for _ in range(count)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join(PAGES_S)


@contextmanager
def planning(port: int, scenario: str) -> Iterator["subprocess.Popen[str]"]:
    """A planner (deployment/hil/planner.py) in a process of its own, connected and writing."""
    command = [sys.executable, "-m", "deployment.hil.planner", str(port), scenario]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        if not process.stdout or process.stdout.readline() != "ready\n":
            raise RunError("the Modbus client did not start")
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def stress() -> Iterator[None]:
    """Processors, disk and memory busy."""
    process = subprocess.Popen(STRESS, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        time.sleep(0.5)
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


@contextmanager
def server() -> Iterator[int]:
    """A Modbus server without a control process, for what is measured beside ours; its port."""
    folder = private_folder()
    control = ModbusPort(*create(folder))
    told = {"folder": str(folder), "host": HOST, "port": 0, "tls": None, "ports": str(folder / "ports")}
    process = subprocess.Popen([sys.executable, "-m", "runtime.modbus.process", json.dumps(told)], cwd=ROOT)
    try:
        control.receive(INPUT.new(), 0)
        control.send(OUTPUT.new(), 0)
        yield _port_of(folder / "ports", process)
    finally:
        process.terminate()
        process.wait()
        shutil.rmtree(folder, ignore_errors=True)


def _port_of(path: Path, process: subprocess.Popen[bytes]) -> int:
    end = time.monotonic() + PATIENCE_S
    while not path.is_file() or not path.read_text():
        if process.poll() is not None or time.monotonic() > end:
            raise RunError("the Modbus server did not start")
        time.sleep(0.02)
    return json.loads(path.read_text())["plain"]


def main(port: int, seconds: float) -> None:
    """The clients' process: says `ready`, asks, says how often."""

    async def ask(end: float) -> int:
        reader, writer = await asyncio.open_connection(HOST, port)
        body = bytes([1, 4, 0, 0, 0, REGISTERS])
        request = bytes([0, 1, 0, 0, 0, len(body)]) + body
        count = 0
        while time.monotonic() < end:
            writer.write(request)
            head = await reader.readexactly(6)
            await reader.readexactly(int.from_bytes(head[4:6], "big"))
            count += 1
        writer.close()
        return count

    async def all_of_them() -> list[int]:
        print("ready", flush=True)
        end = time.monotonic() + seconds
        return await asyncio.gather(*(ask(end) for _ in range(CLIENTS)))

    counts = asyncio.run(all_of_them())
    print(json.dumps({"rps": sum(counts) / seconds}), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
