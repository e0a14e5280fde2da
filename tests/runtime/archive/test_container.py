"""The file of an archive: one form only, and every other one refused with its reason."""

import io
import tarfile
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from runtime.archive import container
from runtime.archive.container import BLOCK, END, pack, unpack
from specs.errors import InputError

FILES = {"a.json": b"{}", "bundle/core.so": bytes(range(256)) * 5, "bundle/empty": b"", "z": b"x" * BLOCK}
NAMES = st.from_regex(r"[a-z0-9_+-][a-z0-9_.+-]{0,8}(/[a-z0-9_+-]{1,9}){0,3}", fullmatch=True)


def entry(name: str, data: bytes = b"", kind: bytes = tarfile.REGTYPE) -> bytes:
    """One entry as tarfile writes it."""
    told = tarfile.TarInfo(name)
    told.type, told.size = kind, len(data)
    told.linkname = "target" if kind in (tarfile.SYMTYPE, tarfile.LNKTYPE) else ""
    return told.tobuf(tarfile.USTAR_FORMAT) + data + bytes(-len(data) % BLOCK)


def refused(data: bytes) -> str:
    with pytest.raises(InputError) as error:
        unpack(data, "file.slwb")
    assert str(error.value).startswith("file.slwb: ")
    assert "\n" not in str(error.value)
    return str(error.value)


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(NAMES, st.binary(max_size=1200), max_size=5))
def test_what_is_packed_is_unpacked_and_any_tar_program_reads_it(files: dict[str, bytes]):
    data = pack(files)
    assert unpack(data, "x") == files
    assert pack(dict(reversed(files.items()))) == data
    with tarfile.open(fileobj=io.BytesIO(data)) as tar:
        assert {m.name: tar.extractfile(m).read() for m in tar} == files  # type: ignore[union-attr]


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_no_other_bytes_are_taken(data: st.DataObject):
    whole = pack(FILES)
    at = data.draw(st.integers(0, len(whole) - 1))
    kind = data.draw(st.sampled_from(["flip", "cut", "insert", "swap"]))
    more = data.draw(st.binary(min_size=1, max_size=600))
    changed = {
        "flip": whole[:at] + bytes([whole[at] ^ (more[0] or 1)]) + whole[at + 1 :],
        "cut": whole[:at] + whole[at + len(more) :],
        "insert": whole[:at] + more + whole[at:],
        "swap": whole[at:] + whole[:at],
    }[kind]
    try:
        assert pack(unpack(changed, "x")) == changed
    except InputError:
        return


def test_every_byte_of_headers_gaps_and_end_counts():
    """A flipped bit is refused anywhere but in contents and names, where it makes other ones."""
    whole, at, inside = pack(FILES), 0, set()
    for name in sorted(FILES):
        inside |= {*range(at, at + container.LONGEST), *range(at + BLOCK, at + BLOCK + len(FILES[name]))}
        at += BLOCK + -(-len(FILES[name]) // BLOCK) * BLOCK
    for place in set(range(len(whole))) - inside:
        refused(whole[:place] + bytes([whole[place] ^ 0x20]) + whole[place + 1 :])


@pytest.mark.parametrize("length", [0, 1, 511, 512, 513, 1024, 1600, 2048, 4096])
def test_a_file_that_is_cut_short(length: int):
    said = refused(pack(FILES)[:length])
    assert ("cut short" if length >= BLOCK else "no archive of slewright bundle --sign") in said


ODD = {
    "link": (entry("a", kind=tarfile.SYMTYPE), "entry 'a' is a link"),
    "hard link": (entry("a", kind=tarfile.LNKTYPE), "entry 'a' is a link"),
    "device": (entry("a", kind=tarfile.CHRTYPE), "entry 'a' is a device"),
    "folder": (entry("a", kind=tarfile.DIRTYPE), "entry 'a/' is a folder"),
    "pipe": (entry("a", kind=tarfile.FIFOTYPE), "entry 'a' is a pipe"),
    "sparse": (entry("a", kind=tarfile.GNUTYPE_SPARSE), "entry 'a' is no plain file"),
    "up": (entry("../a"), "entry name '../a' is not allowed"),
    "up inside": (entry("a/../../b"), "is not allowed"),
    "absolute": (entry("/etc/passwd"), "is not allowed"),
    "hidden": (entry("a/.b"), "is not allowed"),
    "backslash": (entry("a\\b"), "is not allowed"),
    "colour": (entry("a\x1b[31m"), "is not allowed"),
    "no name": (entry(""), "is not allowed"),
    "twice": (entry("a") + entry("a"), "entry a is there twice"),
    "order": (entry("b") + entry("a"), "entries are not in order"),
}


@pytest.mark.parametrize("case", ODD)
def test_entries_that_no_archive_has(case: str):
    data, said = ODD[case]
    assert said in refused(data + END)


def test_sizes_beyond_the_file_and_beyond_all_bounds(tmp_path: Path):
    told = tarfile.TarInfo("a")
    told.size = 1 << 32
    assert "cut short in entry a" in refused(told.tobuf(tarfile.USTAR_FORMAT) + END)
    told.size = 1 << 40  # more than eleven octal digits: tar then writes base 256
    assert "header of entry a is damaged" in refused(told.tobuf(tarfile.GNU_FORMAT) + END)
    many = b"".join(entry(f"{n:05}") for n in range(container.MOST + 1))
    assert f"more than {container.MOST} entries" in refused(many + END)
    large = tmp_path / "large.slwb"
    with large.open("wb") as file:
        file.truncate(container.LARGEST + 1)
    with pytest.raises(InputError, match="larger than an archive can be"):
        container.read(large)


def test_what_is_no_archive(tmp_path: Path):
    for said, data in (("behind its end", pack(FILES) + b"\0"), ("no archive", b"PK\3\4" + bytes(2000))):
        assert said in refused(data)
    compressed = io.BytesIO()
    with tarfile.open(fileobj=compressed, mode="w:gz") as tar:
        tar.addfile(tarfile.TarInfo("a"))
    assert "no archive" in refused(compressed.getvalue())
    for path, said in ((tmp_path, "no such file"), (tmp_path / "none", "no such file")):
        with pytest.raises(InputError, match=said):
            container.read(path)


@pytest.mark.parametrize("name", ["", "a" * 101, "../a", "ä", ".a", "a//b", "a/"])
def test_names_that_are_not_packed(name: str):
    with pytest.raises(InputError, match="is not allowed"):
        pack({name: b""})
