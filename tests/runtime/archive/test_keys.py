"""Keys: made, trusted, endorsed, retired; and everything that is no key is refused."""

import stat
import subprocess
from pathlib import Path

import pytest

from runtime.archive import keys, trust
from runtime.archive.keys import ARCHIVE
from runtime.archive.overview import check_retirement
from runtime.archive.start import Place
from specs.errors import InputError
from tests.runtime.archive.made import key


def test_a_key_is_made_and_read(tmp_path: Path):
    made = keys.new(tmp_path / "works.pem")
    assert stat.S_IMODE((tmp_path / "works.pem").stat().st_mode) == 0o600
    again = keys.read_private(tmp_path / "works.pem")
    public = keys.read_public(tmp_path / "works.pub.pem")
    assert again.public == public == made.public
    assert public.signed(ARCHIVE, b"x", again.sign(ARCHIVE, b"x"))
    assert not public.signed(b"other", b"x", again.sign(ARCHIVE, b"x"))
    with pytest.raises(InputError, match="is there already"):
        keys.new(tmp_path / "works.pem")
    with pytest.raises(InputError, match="cannot be written"):
        keys.new(tmp_path / "none" / "works.pem")


def test_an_encrypted_key_asks_for_its_passphrase(tmp_path: Path):
    keys.new(tmp_path / "works.pem", "secret")
    assert b"ENCRYPTED" in (tmp_path / "works.pem").read_bytes()
    assert keys.read_private(tmp_path / "works.pem", lambda: "secret")
    for wrong in ("", "Secret"):
        with pytest.raises(InputError, match="the passphrase is wrong"):
            keys.read_private(tmp_path / "works.pem", lambda wrong=wrong: wrong)


def test_keys_of_openssl_are_read(tmp_path: Path):
    from shutil import which

    if not which("openssl"):
        pytest.skip("no openssl")
    private, public = tmp_path / "k.pem", tmp_path / "k.pub.pem"
    subprocess.run(["openssl", "genpkey", "-algorithm", "ed25519", "-out", private], check=True)
    subprocess.run(["openssl", "pkey", "-in", private, "-pubout", "-out", public], check=True)
    assert keys.read_private(private).public == keys.read_public(public)
    subprocess.run(["openssl", "genpkey", "-algorithm", "x25519", "-out", private], check=True)
    with pytest.raises(InputError, match="of another kind"):
        keys.read_private(private)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "cannot be read as a public key"),
        (b"-----BEGIN PUBLIC KEY-----\nAAAA\n-----END PUBLIC KEY-----\n", "cannot be read as a public key"),
        (b"-----BEGIN PRIVATE KEY-----\n", "is a private key: it stays where bundles are signed"),
        (b"x" * 20_000, "too large for a key"),
    ],
)
def test_what_is_no_public_key(tmp_path: Path, data: bytes, said: str):
    (tmp_path / "key.pem").write_bytes(data)
    with pytest.raises(InputError, match=said):
        keys.read_public(tmp_path / "key.pem")
    with pytest.raises(InputError, match=said):
        trust.read(tmp_path)
    with pytest.raises(InputError, match=r"no private key|cannot be read as a private key|too large"):
        keys.read_private(tmp_path / "key.pem")


def test_rotation(tmp_path: Path):
    """A second key comes in by the first one's word; then the first one is retired and stays out."""
    one, two, three = (key(n).public for n in (1, 2, 3))
    assert trust.add(tmp_path, "works1", one, None) == ""
    with pytest.raises(InputError, match=r"no endorsement by a trusted key \(works1\)"):
        trust.add(tmp_path, "works2", two, None)
    assert trust.add(tmp_path, "works2", two, trust.endorse(two, key(1))) == "works1"
    assert trust.retire(tmp_path, "works1").key == one
    found = trust.read(tmp_path)
    assert {k.name: k.retired for k in found.known} == {"works1": True, "works2": False}
    signature = key(1).sign(ARCHIVE, b"x")
    with pytest.raises(InputError, match=r"signed by works1 .*, which was retired"):
        found.signer(one.id, b"x", signature, "file")
    with pytest.raises(InputError, match="there already: works1, retired"):
        trust.add(tmp_path, "again", one, trust.endorse(one, key(2)))
    with pytest.raises(InputError, match=r"works1 .*, which was retired"):
        trust.add(tmp_path, "works3", three, trust.endorse(three, key(1)))
    with pytest.raises(InputError, match="no trusted key 'works1'"):
        trust.retire(tmp_path, "works1")


@pytest.mark.parametrize(
    ("endorsement", "said"),
    [
        (trust.endorse(key(2).public, key(3)), "signed by the unknown key"),
        (trust.endorse(key(3).public, key(1)), "it is one of the key"),
        (
            trust.endorse(key(2).public, key(1)).replace(b'"signature": "', b'"signature": "AAAA'),
            "the signature is not one of works1",
        ),
        (b"{", "cannot be read"),
        (b"[]", "cannot be read"),
        (b"", "cannot be read"),
    ],
)
def test_endorsements_that_are_none(tmp_path: Path, endorsement: bytes, said: str):
    trust.add(tmp_path, "works1", key(1).public, None)
    with pytest.raises(InputError, match=said):
        trust.add(tmp_path, "works2", key(2).public, endorsement)
    assert [p.name for p in tmp_path.iterdir()] == ["works1.pem"]


def test_an_endorsement_is_no_signature_of_an_archive():
    found = trust.Trust(Path("k"), (trust.Known("works1", key(1).public, False),))
    with pytest.raises(InputError, match="the signature is not one of"):
        found.signer(key(1).public.id, key(2).public.raw, key(1).sign(keys.KEY, key(2).public.raw), "x")


@pytest.mark.parametrize("name", ["", ".hidden", "a/b", "../a", "a b", "x" * 41])
def test_names_that_are_none(tmp_path: Path, name: str):
    with pytest.raises(InputError, match="key name"):
        trust.add(tmp_path, name, key(1).public, None)


def test_names_and_keys_are_there_once(tmp_path: Path):
    trust.add(tmp_path, "works", key(1).public, None)
    with pytest.raises(InputError, match="has a key works already"):
        trust.add(tmp_path, "works", key(2).public, trust.endorse(key(2).public, key(1)))
    with pytest.raises(InputError, match="there already: works"):
        trust.add(tmp_path, "other", key(1).public, trust.endorse(key(1).public, key(1)))


def test_a_key_that_is_trusted_and_retired_is_retired(tmp_path: Path):
    (tmp_path / "a.pem").write_bytes(key(1).public.pem())
    (tmp_path / "b.retired").write_bytes(key(1).public.pem())
    (tmp_path / "README").write_text("other files are nobody's business")
    with pytest.raises(InputError, match="which was retired"):
        trust.read(tmp_path).signer(key(1).public.id, b"x", key(1).sign(ARCHIVE, b"x"), "file")


def test_the_only_key_is_not_retired_by_accident(tmp_path: Path):
    trust.add(tmp_path, "works", key(1).public, None)
    with pytest.raises(InputError, match="is the only trusted key"):
        check_retirement(Place(tmp_path / "store", tmp_path), "works")
