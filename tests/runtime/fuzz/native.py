"""The core's C code beside the fuzzed cases: under sanitizers, and its edges count, too."""

import struct
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from deployment.bundling import build
from fmus.toolchain import compiler
from specs.errors import RunError
from tests.edges import Edge
from tests.runtime.bundles import built
from tests.runtime.core.test_platforms import CHECKED, RUNNER, runner

EDGE_RUNNER = RUNNER.with_name("edge_runner.c")
TRACED = [*CHECKED, "-fsanitize-coverage=trace-pc"]
NUMBER = struct.Struct("=I")


class Native:
    """A process that takes cases as edge_runner.c reads them; one that ended is started anew."""

    def __init__(self, command: Sequence[str], said: IO[bytes]) -> None:
        self._command, self._said = command, said
        self._process: subprocess.Popen[bytes] | None = None

    def edges(self, case: bytes) -> set[Edge]:
        """Those that no case before it took; RunError with the sanitizer's words if the process ended."""
        if self._process is None:
            self._said.seek(0)
            self._said.truncate()
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said
            )
        given, answer = self._process.stdin, self._process.stdout
        if not given or not answer:
            raise RuntimeError("no pipes, though they were asked for")
        with suppress(BrokenPipeError):  # it ended: what it said of that comes below
            given.write(case)
            given.flush()
        count = answer.read(NUMBER.size)
        if len(count) != NUMBER.size:
            self.close()
            self._said.seek(0)
            raise RunError("with sanitizers: " + self._said.read()[-2000:].decode(errors="replace"))
        found = answer.read(NUMBER.unpack(count)[0] * NUMBER.size)
        return {("core", 0, 0, number) for (number,) in NUMBER.iter_unpack(found)}

    def close(self) -> None:
        """End the process."""
        if self._process:
            with suppress(BrokenPipeError):
                self._process.communicate()
        self._process = None


@contextmanager
def compiled() -> Iterator[Native]:
    """The library, compiled with sanitizers; RunError where the compiler has none.

    Edges are those of the hand-written code: what is generated from equations has only limits and tables.
    """
    host, sources = compiler.host().name, built("pi").folder / "sources"
    flags = [*build.UNUSED_OUT, *TRACED, '-DSLR_IDENTITY="test"', "-I", str(sources / "core")]
    with tempfile.TemporaryDirectory() as name, tempfile.TemporaryFile() as said:
        folder = Path(name)
        objects = build.objects_of(sources, "test", folder, host, CHECKED)
        for path in sorted((sources / "core").glob("*.c")):
            if path.name not in build.UNCHECKED:
                compiler.compile_object(path, folder / f"{path.stem}.o", host, flags)
        library = compiler.link_shared(objects, folder / "core.so", host, CHECKED)
        program = runner(folder, host, [*CHECKED, "-rdynamic"], EDGE_RUNNER)
        native = Native([str(program), str(library)], said)
        try:
            yield native
        finally:
            native.close()
