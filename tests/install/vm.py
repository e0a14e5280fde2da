"""The installed controller as a virtual machine: Debian's real-time kernel, systemd, and the kernel's vcan.

The root is the one in which the guide's commands for the controller were executed.  Inside, its commands for
a running controller come first, each block by itself; then the simulated machine joins the bus by SocketCAN.
What is written in /srv/results comes back.
"""

import re
import shutil
import subprocess
import tarfile
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.install import guide
from tests.install.roots import LOWEST, need, run

# One: with two, and a clock that counts instructions, this kernel waits for the second one for ever.
CORES = 1
MEMORY_MB, IMAGE_MB, RESULTS_MB = 1500, 4096, 256
PATIENCE_S = 7200.0
# The processor is emulated and its clock counts instructions, 1 ns each: on a busy computer it all takes
# longer, and nothing in it is late.  So it says nothing of how late a real one is.
CLOCK = ["-accel", "tcg,thread=single", "-icount", "shift=0,sleep=off"]
LEFT_OUT = ("delivery.tar", "wheelhouse-x86_64")  # installed already
SCRIPT = Path(__file__).with_name("vcan.sh")
WHEN = ("started", "driving", "stopped", "hung", "killed", "pulled")  # what systemd says then (vcan.sh)
ALL = "/srv/in-the-machine.sh"
UNIT = f"""[Unit]
After=basic.target dbus.service
[Service]
Type=oneshot
ExecStart=-/bin/sh {ALL}
ExecStopPost=/bin/tar --create --file /dev/vdb --directory /srv results
ExecStopPost=/bin/systemctl poweroff
TimeoutStartSec={round(PATIENCE_S)}
StandardOutput=journal+console
[Install]
WantedBy=multi-user.target
"""
# A virtual bus has no bit rate (docs/how-to/installation.md).
VIRTUAL_BUS = "[Service]\nExecStartPre=\n"
BEGIN = """
mkdir -p /srv/results && cd /srv/results
modprobe vcan
ip link add dev can0 type vcan
"""
# A bundle has to run for 10 s to be one to go back to; nobody types faster.
BLOCK = """
sleep 12
sh -eux > guide-{line}.out 2> guide-{line}.err <<'BLOCK-ENDS'
cd /srv
{text}BLOCK-ENDS
echo $? > guide-{line}.rc
"""


@dataclass(frozen=True)
class Ended:
    """What came back: a folder of results, and the console."""

    results: Path
    console: str

    def text(self, name: str) -> str:
        """A file of the results; empty if there is none."""
        path = self.results / name
        return path.read_text(errors="replace") if path.is_file() else ""


def start(root: Path, into: Path) -> Ended:
    """Boot `root`, which is changed for it, wait until it ends by itself, or end it after PATIENCE_S.

    Says what came of each block of the guide, and how long it took.
    """
    need("qemu-system-x86_64", "mke2fs")
    image, results = into / "root.img", into / "results.img"
    kernel, initrd = (_boot_file(root, name) for name in ("vmlinuz", "initrd.img"))
    _image(root, image)
    with results.open("wb") as file:
        file.truncate(RESULTS_MB << 20)
    words = "root=/dev/vda rw console=ttyS0 irqaffinity=0"
    disks = [o for f in (image, results) for o in ("-drive", f"file={f},format=raw,if=virtio,cache=unsafe")]
    line = ["qemu-system-x86_64", *CLOCK, "-cpu", "max", "-smp", str(CORES), "-m", str(MEMORY_MB)]
    line += ["-kernel", str(kernel), "-initrd", str(initrd), "-append", words, *disks, "-nic", "none"]
    line += ["-display", "none", "-serial", f"file:{into / 'console'}", "-no-reboot"]
    begun = time.monotonic()
    process = subprocess.Popen([*LOWEST, *line], stdin=subprocess.DEVNULL)
    try:
        process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    image.unlink()
    with tarfile.open(results) as archive:
        archive.extractall(into, filter="data")
    ended = Ended(into / "results", (into / "console").read_text(errors="replace"))
    print(f"virtual machine: {time.monotonic() - begun:.0f} s; kernel {ended.text('kernel').strip()}")
    for block in guide.of("running"):
        print(f"{guide.GUIDE.name}:{block.line}: exit code {ended.text(f'guide-{block.line}.rc').strip()}")
    for name in WHEN:
        print(f"{name}: {', '.join(ended.text(name).splitlines())}")
    return ended


def _boot_file(root: Path, name: str) -> Path:
    found = sorted((root / "boot").glob(f"{name}-*-rt-*"))
    if not found:
        pytest.skip("the root has no real-time kernel")
    return found[-1]


def _image(root: Path, image: Path) -> None:
    """The root, with what is to be executed in it, as a file system in a file."""
    for name in LEFT_OUT:
        path = root / "srv" / name
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    blocks = [BLOCK.format(line=block.line, text=block.text) for block in guide.of("running")]
    (root / ALL[1:]).write_text(BEGIN + "".join(blocks) + SCRIPT.read_text())
    configuration = root / "etc" / "slewright" / "machine.toml"  # names a core of the computer it was made on
    configuration.write_text(re.sub(r"core = \d+", f"core = {CORES - 1}", configuration.read_text()))
    units = root / "etc" / "systemd" / "system"
    (units / "in-the-machine.service").write_text(UNIT)
    wanted = units / "multi-user.target.wants" / "in-the-machine.service"
    wanted.parent.mkdir(exist_ok=True)
    wanted.unlink(missing_ok=True)
    wanted.symlink_to("../in-the-machine.service")
    (units / "slewright-can@can0.service.d").mkdir(exist_ok=True)
    (units / "slewright-can@can0.service.d" / "virtual.conf").write_text(VIRTUAL_BUS)
    done = run(["mke2fs", "-q", "-t", "ext4", "-d", str(root), str(image), f"{IMAGE_MB}M"])
    assert done.returncode == 0, done.stderr
