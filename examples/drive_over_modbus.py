"""Drive the runtime over Modbus: python examples/drive_over_modbus.py [FOLDER]

It starts the simulated machine and the controller on this computer, sends a target as a planner would, and
plots what it read. Needs the extras `runtime` and `verify`. A real machine takes more:
docs/explanation/hazards.md.
"""

import secrets
import struct
import subprocess
import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
from pymodbus.client import ModbusTcpClient

from deployment.hil.rig import free_port
from specs.signals import signals

PLACES = {name: s.modbus for name, s in signals().items() if s.modbus}

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples").resolve() / "modbus"
folder.mkdir(parents=True, exist_ok=True)
slewright, port = [sys.executable, "-m", "slewright"], free_port()
subprocess.run([*slewright, "bundle", "pd", "--out", "pd.bundle"], cwd=folder, check=True)
can = '[can]\ninterface = "slewright"\nchannel = "bus"\n'
(folder / "machine.toml").write_text(f'bundle = "pd.bundle"\n{can}[modbus]\nport = {port}\n')


def place(name):
    """The signal's Modbus address."""
    return PLACES[name].address


def words(value):
    """A float32 as two registers, the high one first."""
    return struct.unpack(">2H", struct.pack(">f", value))


def read(name):
    """A signal's value now."""
    float32 = PLACES[name].type == "float32"
    found = client.read_input_registers(place(name), count=2 if float32 else 1).registers
    return client.convert_from_registers(found, client.DATATYPE.FLOAT32) if float32 else found[0]


def turn():
    """Commit a target in one request, then keep the heartbeat going for 6 s: (s, rad, joystick) as read."""
    target = [*words(6.0), *words(7.0), *words(5.0), 1, 1]  # x, y, z in m; valid; its number
    number = 1 + secrets.randbelow(65534)  # of the claim: nobody else knows it, and no register shows it
    rest = [*words(0.0), *words(1.0), 0, 1, number]  # load in kg, pace, heartbeat, commit, claim
    if client.write_registers(place("target_x"), [*target, *rest]).isError():
        sys.exit("the server refuses to be written to: another client writes, and it must end first")
    began, seen = time.monotonic(), []
    for beat in range(1, 61):
        client.write_register(place("planner_heartbeat"), beat)
        seen.append((time.monotonic() - began, read("q_slew"), read("u_slew")))
        time.sleep(0.1)
    print(f"mode {read('control_mode')}, fault {read('fault_code')}, slew angle {seen[-1][1]:.2f} rad")
    return seen


quiet = {"cwd": folder, "stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL}
started = [subprocess.Popen([*slewright, "machine", "--channel", "bus"], **quiet)]
client = ModbusTcpClient("127.0.0.1", port=port)
try:
    while not (folder / "bus").exists():  # the machine makes the bus
        time.sleep(0.1)
    started.append(subprocess.Popen([*slewright, "run", "--config", "machine.toml"], **quiet))
    while not (
        client.connect() and read("control_mode") == 6
    ):  # ARMED: the simulated operator has enabled it
        time.sleep(0.2)
    seen = turn()
finally:
    client.close()
    for process in reversed(started):
        process.terminate()
        process.wait()

plt.rcParams.update({"svg.hashsalt": "slewright", "svg.fonttype": "none"})
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 4), layout="constrained")
times, angles, joystick = zip(*seen, strict=True)
above.plot(times, angles, ".-")
above.set_ylabel("q_slew [rad]")
below.plot(times, joystick, ".-")
below.set_ylabel("u_slew [1]")
below.set_xlabel("time [s]")
figure.savefig(folder.parent / "drive_over_modbus.svg", metadata={"Date": None})
