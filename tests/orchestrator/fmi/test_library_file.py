"""Bytes of a library that are damaged are said to be so, and nothing else happens."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from fmus.toolchain import compiler
from orchestrator.fmi.library_file import NotALibrary, read_library


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> bytes:
    folder = tmp_path_factory.mktemp("library")
    (folder / "a.c").write_text("int a(void) { return 1; }\n")
    name = compiler.host().name
    made = compiler.compile_object(folder / "a.c", folder / "a.o", name, [], generated=True)
    return compiler.link_shared([made], folder / "a.so", name).read_bytes()


def read(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    with contextlib.suppress(NotALibrary):
        read_library(path)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.binary(min_size=1, max_size=8)), max_size=6))
def test_damaged_bytes_are_a_library_or_said_to_be_none(tmp_path, library, changes):
    data = bytearray(library)
    for share, put in changes:
        at = int(share * len(data))
        data[at : at + len(put)] = put
    read(tmp_path / "a.so", bytes(data))


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0, 1))
def test_cut_bytes_are_a_library_or_said_to_be_none(tmp_path, library, share):
    read(tmp_path / "a.so", library[: int(share * len(library))])


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from([b"\x7fELF", b"MZ", b"\xcf\xfa\xed\xfe", b""]), st.binary(max_size=400))
def test_any_bytes_are_a_library_or_said_to_be_none(tmp_path, head, rest):
    read(tmp_path / "a.so", head + rest)
