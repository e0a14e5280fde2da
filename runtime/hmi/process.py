"""The HMI process: `python -m runtime.hmi.process JSON`, started by the supervisor, low in priority.

It joins the cells in `folder` (runtime/hmi/cells.py) and serves until SIGTERM.  Port 0 takes any; the one it
has is written to the file `port`.
"""

import json
import os
import signal
import ssl
import threading
import time
from pathlib import Path
from typing import Any

from runtime import bundle
from runtime.helpers import end_with, run, told_to_end
from runtime.hmi import around, tokens
from runtime.hmi.audit import Audit
from runtime.hmi.cells import join
from runtime.hmi.desk import Desk
from runtime.hmi.hub import Hub
from runtime.hmi.live import Live
from runtime.hmi.outsiders import Outsiders
from runtime.hmi.planners import Planners
from runtime.hmi.sessions import Sessions
from runtime.hmi.watch import Watch
from runtime.hmi.web import Site, secure
from runtime.modbus.cells import BEAT_S
from specs.errors import InputError

NICE = 10  # below everything that the machine needs
LOOK_S = 0.025


def main(text: str) -> None:
    """Serve until told to end."""
    end_with(signal.SIGTERM)
    os.nice(NICE)
    told = json.loads(text)
    cells = join(Path(told["folder"]))
    hub, audit = Hub(), Audit(Path(told["audit"]))
    folder = Path(told["folder"])
    scene = around.of_bundle(bundle.scene_of(Path(told["bundle"])))
    planners, outsiders = Planners(folder, audit), Outsiders(folder, audit)
    watch = Watch(cells, audit, hub, planners, told["bus_again"], outsiders, scene)
    sessions = Sessions(tokens.read(Path(told["tokens"])), audit)
    desk = Desk(sessions, cells[2].write, watch.granted, watch.mode)
    watch.desk = desk
    site = open_site(told, Live(watch, desk, told["about"], bool(told["tls"])).routes(), hub)
    Path(told["port_file"]).write_text(str(site.port))
    serving = threading.Thread(target=site.serve_forever, daemon=True)
    serving.start()
    _beat(watch, desk)
    hub.close()
    site.shutdown()


def open_site(told: dict[str, Any], routes: Any, hub: Hub | None) -> Site:
    """Listen; InputError if the port is in use or a certificate is none."""
    try:
        site = Site(told["host"], told["port"], routes, hub, told.get("names", ()))
    except OSError as error:
        raise InputError(
            f"hmi: port {told['port']} of {told['host']} cannot be had: {error.strerror}"
        ) from None
    if told.get("tls"):
        secure(site, context(Path(told["tls"]["certificate"]), Path(told["tls"]["key"])))
    return site


def context(certificate: Path, key: Path) -> Any:
    """TLS 1.2 or newer with this certificate; InputError if the files are not that."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        made.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise InputError(f"hmi.tls: {certificate} with {key}: {error.strerror or error}") from None
    return made


def _beat(watch: Watch, desk: Desk) -> None:
    """Look at what is new, and give a sign of life; the signal only leaves a note."""
    next_beat = 0.0
    while not told_to_end():
        watch.look(time.monotonic_ns())
        if time.monotonic() >= next_beat:
            desk.tick(time.monotonic_ns())
            next_beat = time.monotonic() + BEAT_S
        time.sleep(LOOK_S)


if __name__ == "__main__":
    run(main)
