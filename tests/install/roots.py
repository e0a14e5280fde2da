"""Fresh Debian roots, and commands in them; everything that is mounted is so in a namespace of its own.

What does not change is kept in a folder of the system's temporary files (or SLEWRIGHT_ROOTS), never in the
project: who copies that would copy a root with all that is mounted in it.
"""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

RELEASE = "bookworm"  # Debian 12, whose Python is 3.11
# What Debian's installer leaves, as far as the guide rests on it.
INSTALLED = ("systemd", "systemd-sysv", "udev", "dbus", "iproute2", "kmod")
PYTHON = ("python3", "python3-venv", "python3-pip", "libstdc++6")  # the last one is in every installed Debian
LOWEST = ["nice", "-n", "10"]
PATIENCE_S = 3600.0
INSIDE = """
set -eu
root=$1
[ "$2" = online ] || ip link set lo up
mount --bind "$root" "$root"
mount -t proc proc "$root/proc"
mount -t sysfs sysfs "$root/sys" || true
mount --rbind /dev "$root/dev"
mount -t tmpfs tmpfs "$root/run"
exec chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 \
    DEBIAN_FRONTEND=noninteractive OMP_NUM_THREADS=1 $4 sh -eux -c "cd '$3'; $(cat)"
"""


def folder() -> Path:
    """Where roots are kept between runs."""
    found = os.environ.get("SLEWRIGHT_ROOTS") or Path(tempfile.gettempdir()) / "slewright-roots"
    Path(found).mkdir(parents=True, exist_ok=True)
    return Path(found)


def need(*programs: str, root: bool = True) -> None:
    """Skip, and say why, where a program or the right to use it is missing."""
    missing = [name for name in programs if shutil.which(name) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    if root and os.geteuid() != 0:
        pytest.skip("needs root: it makes roots of other systems and mounts in them")


def run(line: list[str], **options) -> subprocess.CompletedProcess[str]:
    """A command with its output kept; the lowest priority, and an end after an hour."""
    kept = {"capture_output": True, "text": True, "check": False, "timeout": PATIENCE_S}
    return subprocess.run([*LOWEST, *line], **{**kept, **options})


def fresh(architecture: str) -> Path:
    """A Debian root as it is installed (amd64), or only unpacked (others: enough for qemu-user's python3)."""
    need("mmdebstrap", "unshare")
    path = folder() / f"{RELEASE}-{architecture}"
    if not path.is_dir():
        native = architecture == "amd64"
        how = ["--variant=minbase"] if native else ["--variant=extract", "--skip=check/qemu"]
        which = [f"--architectures={architecture}", f"--include={','.join(INSTALLED if native else PYTHON)}"]
        part = path.with_name(f"{path.name}.part")
        shutil.rmtree(part, ignore_errors=True)
        private = ["unshare", "--mount", "--propagation", "private"]
        done = run([*private, "mmdebstrap", "--mode=root", *how, *which, RELEASE, str(part)])
        if done.returncode:
            pytest.skip(f"no fresh Debian root: {done.stderr.strip().splitlines()[-1:]}")
        part.rename(path)
    return path


def copy(source: Path, target: Path) -> Path:
    """A root of one's own, with this computer's way into the network."""
    subprocess.run(["cp", "--archive", "--reflink=auto", str(source), str(target)], check=True)
    shutil.copy("/etc/resolv.conf", target / "etc" / "resolv.conf")
    return target


def inside(
    root: Path, text: str, *, online: bool = False, at: str = "/root"
) -> subprocess.CompletedProcess[str]:
    """Run shell commands in a root, each shown, until the first that fails; without `online` no network."""
    spaces = ["--mount", "--propagation", "private", "--pid", "--fork", "--kill-child"]
    spaces += [] if online else ["--net"]
    settings = _certificates(root) if online else ""
    line = ["unshare", *spaces, "sh", "-c", INSIDE, "sh", str(root), "online" if online else "", at, settings]
    return run(line, input=text)


def _certificates(root: Path) -> str:
    """Where this computer trusts more than Debian does, pip in the root has to, too."""
    trusted = os.environ.get("PIP_CERT")
    if not trusted:
        return ""
    shutil.copy(trusted, root / "tmp" / "trusted.pem")
    return "PIP_CERT=/tmp/trusted.pem"
