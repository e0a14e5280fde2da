"""A generated set of changed, cut, mixed up and mismatched archives: each is refused, with its reason."""

import itertools
import json
import random
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from runtime.archive import container, install
from runtime.archive.keys import ARCHIVE, KEY
from runtime.archive.names import BUNDLE, DBC, MANIFEST, MAP, NEEDED, SBOM, SIGNALS, SIGNATURE
from runtime.archive.signed import sign, verify
from runtime.archive.start import Place
from runtime.archive.trust import Trust
from runtime.bundle import MANIFEST as INNER
from specs.errors import InputError
from tests.runtime.archive.made import archive, contents, key, trust, written

RIGHT = archive()
TRUST = trust(1, 3, retired=(2,))  # 4 is nobody's
Case = tuple[str, bytes, str]  # name, file, part of the reason


def packed(**changes: bytes) -> bytes:
    return container.pack({**RIGHT, **changes})


def without(name: str) -> dict[str, bytes]:
    return {n: data for n, data in RIGHT.items() if n != name}


def flipped(data: bytes, at: int, bit: int = 1) -> bytes:
    return data[:at] + bytes([data[at] ^ bit]) + data[at + 1 :]


def reason(name: str) -> str:
    """Why an archive is refused in which the file `name` is another one."""
    return {
        MANIFEST: "the signature is not one of works1",
        SIGNATURE: "release.sig cannot be read|unknown key|the signature is not one of",
    }.get(name, f"{name} was changed since it was signed")


def of_contents() -> Iterator[Case]:
    """Each file flipped in several places, emptied, shortened, longer, missing, renamed, another's."""
    for name, data in RIGHT.items():
        for at in sorted({0, len(data) // 3, len(data) // 2, len(data) - 2}):
            yield f"{name}: byte {at}", packed(**{name: flipped(data, at)}), reason(name)
        for what, other in (("empty", b""), ("shorter", data[:-1]), ("longer", data + b"\n")):
            yield f"{name}: {what}", packed(**{name: other}), reason(name)
        gone = f"{name} is missing"
        yield f"{name}: missing", container.pack(without(name)), gone
        renamed = {**without(name), f"{name}.old": data}
        yield f"{name}: renamed", container.pack(renamed), f"{gone}|is not in its manifest"
    for name in (f"{BUNDLE}core-x.so", f"{BUNDLE}a/b", "zzz", "configuration/machine.toml"):
        yield f"added {name}", packed(**{name: b"x"}), f"{name} is not in its manifest"
    names = list(contents())
    for one, other in itertools.pairwise(names):
        swapped = {one: RIGHT[other], other: RIGHT[one]}
        yield f"{one} and {other} swapped", packed(**swapped), "was changed since it was signed"


def of_bytes() -> Iterator[Case]:
    """The file as such: bits, cuts, what stands before and behind it."""
    data = container.pack(RIGHT)
    some = random.Random(1)
    for at in sorted(some.sample(range(len(data)), 150)):
        yield f"bit of byte {at}", flipped(data, at, 1 << some.randrange(8)), "."
    for length in (0, 1, 511, 512, 700, len(data) // 2, len(data) - 1024, len(data) - 512, len(data) - 1):
        yield f"cut at {length}", data[:length], "cut short|no archive"
    yield "bytes behind it", data + bytes(512), "bytes behind its end"
    yield "bytes before it", bytes(512) + data, "bytes behind its end"
    yield "twice", data + data, "bytes behind its end"
    yield "another kind of file", b"PK\x03\x04" + data, "no archive"


def of_signatures() -> Iterator[Case]:
    """Other keys, other things that were signed, and files that are no signature."""
    manifest, told = RIGHT[MANIFEST], json.loads(RIGHT[SIGNATURE])
    for number, said in ((4, "unknown key"), (2, "works2 .*, which was retired")):
        yield f"signed by {number}", container.pack(archive(by=number)), said
    wrong = "the signature is not one of works"
    yield "of another archive", packed(**{SIGNATURE: archive(gain=2.0)[SIGNATURE]}), wrong
    yield "manifest of another archive", packed(**{MANIFEST: archive(gain=2.0)[MANIFEST]}), wrong
    for what, changed in {
        "another trusted key's name": {"key": key(3).public.id},
        "another trusted key's signature": {"signature": text(key(3).sign(ARCHIVE, manifest))},
        "for another purpose": {"signature": text(key(1).sign(KEY, manifest))},
        "shorter": {"signature": told["signature"][:-8]},
        "none": {"signature": ""},
    }.items():
        yield what, packed(**{SIGNATURE: lines({**told, **changed})}), wrong
    cannot = "release.sig cannot be read"
    for what, data in {
        "no JSON": b"{",
        "no table": b"[1]",
        "deep": b"[" * 100_000,
        "no text": lines({**told, "key": 1}),
        "no base 64": lines({**told, "signature": "ä"}),
        "number": lines({**told, "signature": 7}),
        "other form": json.dumps(told).encode(),
    }.items():
        yield f"signature {what}", packed(**{SIGNATURE: data}), cannot


def of_mismatches() -> Iterator[Case]:
    """Rightly signed, but for another machine, version or specs, or not whole."""
    yield "platform", made(platforms=["aarch64-linux", "riscv64-linux"]), "no core for .*, only for aarch64"
    yield "version", made(slewright="0.0.9"), "slewright 0.0.9: here it is"
    yield "layout", made(layout="0" * 16), "specs/signals.toml has changed since"
    yield "format of the bundle", made(format=2), "format 2: here it is 1"
    yield "no platforms", made(platforms=None), "platforms is missing"
    dbc, map_ = RIGHT[DBC], RIGHT[MAP]
    moved = dbc.replace(b"u_slew : 16|16@1+ (3.125e-05,-1)", b"u_slew : 16|16@1+ (6.25e-05,-1)")
    said = (
        r"other specs: specs/slewright.dbc differs \(signal u_slew scale: 3.125e-05 and offset -1 -> 6.25e-05"
    )
    yield "DBC", signed({DBC: moved}), said
    yield "DBC's remarks", signed({DBC: dbc + b"\n"}), "specs/slewright.dbc differs"
    yield "DBC that is none", signed({DBC: b"BO_ x"}), "specs/slewright.dbc differs"
    place = map_.replace(b"input,5,2,float32", b"input,6,2,float32")
    yield "register", signed({MAP: place}), r"\(register input u_slew address: 5 -> 6\)"
    yield "map that is none", signed({MAP: b"\xff"}), "specs/modbus_map.csv differs"
    for name in NEEDED:
        files = {n: data for n, data in contents().items() if n != name}
        yield f"without {name}", container.pack(sign(files, "", key())), f"{name} is missing"
    for what, data in {"no JSON": b"{", "no table": b"[]", "deep": b"[" * 100_000}.items():
        files = {**contents(), BUNDLE + INNER: data}
        yield f"bundle manifest {what}", container.pack(sign(files, "", key())), "manifest.json"
    for what, manifest, said in (
        ("format", {"format": 2, "release": "", "files": {}}, "format 2: this version reads 1"),
        ("release", {"format": 1, "release": "\x1b[31m", "files": {}}, "release.json cannot be read"),
        ("files", {"format": 1, "release": "", "files": []}, "release.json cannot be read"),
        ("nothing", {}, "release.json cannot be read"),
    ):
        yield f"manifest: {what}", resigned(lines(manifest)), said
    yield "manifest no JSON", resigned(b"{"), "release.json cannot be read"


def made(**changes: object) -> bytes:
    return container.pack(archive(**changes))  # type: ignore[arg-type]


def signed(changes: Mapping[str, bytes]) -> bytes:
    return container.pack(sign({**contents(), **changes}, "", key()))


def resigned(manifest: bytes) -> bytes:
    told = {"key": key().public.id, "signature": text(key().sign(ARCHIVE, manifest))}
    return packed(**{MANIFEST: manifest, SIGNATURE: lines(told)})


def text(signature: bytes) -> str:
    import base64

    return base64.b64encode(signature).decode()


def lines(content: object) -> bytes:
    return (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()


SETS = {"contents": of_contents, "bytes": of_bytes, "signatures": of_signatures, "mismatches": of_mismatches}


@pytest.fixture
def place(tmp_path: Path) -> Place:
    """A machine that trusts works1 and works3, and has retired works2."""
    keys = tmp_path / "store" / "keys"
    keys.mkdir(parents=True)
    for known in TRUST.known:
        (keys / f"{known.name}{'.retired' if known.retired else '.pem'}").write_bytes(known.key.pem())
    return Place(tmp_path / "store")


@pytest.mark.parametrize("kind", SETS)
def test_all_of_a_set_are_refused_with_their_reason(kind: str, place: Place, tmp_path: Path):
    before = {p.name for p in place.folder.rglob("*")}
    for name, data, said in SETS[kind]():
        path = tmp_path / "file.slwb"
        path.write_bytes(data)
        with pytest.raises(InputError, match=said) as refused:
            install.offer(place, path)
        assert str(refused.value).startswith(str(path)), name
        assert "\n" not in str(refused.value), name
    assert {p.name for p in place.folder.rglob("*")} == before


def test_the_archive_they_are_made_from_is_taken(place: Place, tmp_path: Path):
    found = install.offer(place, written(tmp_path / "right.slwb", RIGHT))
    assert found.signed.signer == "works1"
    assert found.signed.files == RIGHT
    assert found.first


def test_the_sets_are_not_empty():
    assert {name: len(list(cases())) for name, cases in SETS.items()} == {
        "contents": 101,
        "bytes": 163,
        "signatures": 16,
        "mismatches": 24,
    }


def test_without_any_key_nothing_is_taken():
    with pytest.raises(InputError, match=r"unknown key .*; trusted: none \(deploy keys add\)"):
        verify(RIGHT, Trust(Path("none"), ()), "x")


def test_the_same_contents_and_key_make_the_same_bytes():
    assert archive() == archive()
    again = sign(dict(reversed(contents().items())), "", key())
    assert container.pack(again) == container.pack(RIGHT)
    assert {SBOM, SIGNALS} < again.keys()
