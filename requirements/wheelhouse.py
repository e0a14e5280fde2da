"""Fills a folder with all wheels that an installation without a network needs, the project's own among them.

`make wheelhouse PLATFORM=aarch64` runs it.  Versions and hashes come from the locks; markers are evaluated
for the computer that the wheels are for, which need not be this one.  Nothing is built but the project's own
wheel, so every dependency has to have one for that platform.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from packaging.markers import default_environment
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
LOCKS = {extra: ROOT / "requirements" / f"{extra}.lock" for extra in ("runtime", "verify")}
MACHINES = ("x86_64", "aarch64")
GLIBC_MINOR = 36  # 2.36 is Debian 12's
SUMS = "SHA256SUMS"
TARGET = "SLEWRIGHT_WHEEL_TARGET"  # read by hatch_build.py
ZIG = "SLEWRIGHT_ZIG"  # read by fmus/toolchain/compiler.py


def environment(machine: str, python: str) -> dict[str, str]:
    """Marker variables of a Linux computer with CPython `python` (major.minor)."""
    found = {key: str(value) for key, value in default_environment().items()}
    told = {"python_version": python, "python_full_version": f"{python}.0", "platform_machine": machine}
    linux = {"sys_platform": "linux", "platform_system": "Linux", "os_name": "posix"}
    cpython = {"implementation_name": "cpython", "platform_python_implementation": "CPython"}
    return {**found, **told, **linux, **cpython}


def wanted(lock: str, found: dict[str, str]) -> dict[str, str]:
    """Requirement with hashes by name, of the text of a lock: those whose markers hold."""
    blocks = re.split(r"\n(?=[A-Za-z0-9])", re.sub(r"(?m)^ *#.*\n?", "", lock).strip())
    chosen = {}
    for block in blocks:
        requirement = Requirement(block.split(" \\\n")[0].split(" --hash")[0].strip())
        if requirement.marker is None or requirement.marker.evaluate(found):
            hashes = re.findall(r"--hash=\S+", block)
            chosen[requirement.name] = " ".join([f"{requirement.name}{requirement.specifier}", *hashes])
    return chosen


def platforms(machine: str) -> list[str]:
    """Platform tags of wheels that run there, for `pip download`, the newest glibc first."""
    modern = [f"manylinux_2_{minor}_{machine}" for minor in range(GLIBC_MINOR, 4, -1)]
    return [*modern, *(f"manylinux{name}_{machine}" for name in ("2014", "2010", "1"))]


def download(lines: list[str], machine: str, python: str, out: Path) -> None:
    """Get the wheels of requirement lines; ends the program with pip's words if one is missing."""
    with tempfile.TemporaryDirectory() as scratch:
        listed = Path(scratch) / "requirements.txt"
        listed.write_text("\n".join(lines) + "\n")
        tags = [option for tag in platforms(machine) for option in ("--platform", tag)]
        which = ["--implementation", "cp", "--python-version", python, "--only-binary", ":all:", "--no-deps"]
        _pip("download", "--require-hashes", "-r", str(listed), *which, *tags, "--dest", str(out))


def own(machine: str, out: Path) -> None:
    """Build the project's wheel for another or this machine."""
    offline = ["--no-deps", "--no-build-isolation", "--no-index"]
    _pip("wheel", str(ROOT), *offline, "--wheel-dir", str(out), **{TARGET: f"{machine}-linux", ZIG: "1"})


def sums(folder: Path) -> None:
    """Write the SHA-256 of every wheel, as `sha256sum --check` reads it."""
    wheels = sorted(folder.glob("*.whl"))
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in wheels]
    (folder / SUMS).write_text("".join(lines))


def _pip(command: str, *arguments: str, **more: str) -> None:
    line = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input", "--quiet", command]
    done = subprocess.run([*line, *arguments], env={**os.environ, **more}, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def main() -> None:
    """Make the folder beside its place, then put it there: a wheelhouse is whole or not there."""
    told = argparse.ArgumentParser(description=__doc__)
    told.add_argument("--platform", choices=MACHINES, required=True)
    told.add_argument("--python", default="3.11", metavar="3.N", help="of the computer it is for")
    told.add_argument("--extras", nargs="+", choices=sorted(LOCKS), default=["runtime"])
    told.add_argument("--out", type=Path, required=True)
    asked = told.parse_args()
    found = environment(asked.platform, asked.python)
    chosen: dict[str, str] = {}
    for extra in asked.extras:
        chosen |= wanted(LOCKS[extra].read_text(), found)
    part = asked.out.with_name(asked.out.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    download(list(chosen.values()), asked.platform, asked.python, part)
    own(asked.platform, part)
    sums(part)
    shutil.rmtree(asked.out, ignore_errors=True)
    part.rename(asked.out)
    wheels = list(asked.out.glob("*.whl"))
    size = sum(path.stat().st_size for path in wheels) / 1e6
    print(f"{asked.out}: {len(wheels)} wheels, {size:.0f} MB, for {asked.platform}, Python {asked.python}")


if __name__ == "__main__":
    main()
