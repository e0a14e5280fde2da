"""Build hook of the wheel: compiles the orchestrator's core, so that a run needs no compiler.

With the ziglang package the core is built for glibc 2.17 and the wheel may be installed on any Linux of that
age (manylinux); with the system's compiler alone it fits machines like this one.  SLEWRIGHT_WHEEL_TARGET
names another platform (aarch64-linux), for which ziglang is needed.  An editable install compiles nothing:
orchestrator/core/native.py does that at the first run.
"""

import importlib.util
import os
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

TARGET = "orchestrator/core/bin"
OTHER = "SLEWRIGHT_WHEEL_TARGET"  # environment variable: a platform of fmus.toolchain.compiler.TARGETS


class CoreHook(BuildHookInterface):
    """Adds the compiled core to the wheel and names its platform."""

    scratch: tempfile.TemporaryDirectory[str] | None = None

    def dependencies(self) -> list[str]:
        """What an isolated build installs beside hatchling."""
        return ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, unless the install is editable."""
        if self.target_name != "wheel" or version == "editable":
            return
        sys.path.insert(0, self.root)
        portable = importlib.util.find_spec("ziglang") is not None
        # Only now: the project is not on the path when the hook is loaded.
        from fmus.toolchain import compiler
        from orchestrator.core import native

        if portable:
            os.environ[compiler.ALWAYS_ZIG] = "1"
        self.scratch = tempfile.TemporaryDirectory()
        other = os.environ.get(OTHER)
        built = native.build(Path(self.scratch.name), other)
        for path in (built.library, built.host):
            if path is not None:
                build_data["force_include"][str(path)] = f"{TARGET}/{path.name}"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform_tag(portable, other)}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Drop the compiled files; the wheel has them."""
        if self.scratch is not None:
            self.scratch.cleanup()


def platform_tag(portable: bool, other: str | None = None) -> str:
    """The wheel's platform: manylinux where the core was built for an old glibc; `other`: not this one's."""
    machine, _, system = (other or "").partition("-")
    plain = f"{system}-{machine}" if other else sysconfig.get_platform()
    tag = plain.replace("-", "_").replace(".", "_")
    return tag.replace("linux", "manylinux_2_17", 1) if portable and tag.startswith("linux") else tag
