"""`slewright bundle --sign` and `slewright deploy`, as someone at a machine uses them."""

import json
import shutil
from pathlib import Path

import pytest

from deployment.bundling import archive as signing
from runtime import configuration
from runtime.archive import container, keys, start
from runtime.archive.names import BUNDLE, DBC, SIGNATURE
from runtime.archive.signed import sign
from runtime.archive.start import Place
from runtime.archive.store import BUNDLES
from slewright import __main__ as entry
from specs.errors import InputError
from tests.runtime.bundles import NO_RATE_LIMIT, built

OFFERED = {"pd": ("pd", ()), "pi": ("pi", NO_RATE_LIMIT)}  # archive -> controller, changes


@pytest.fixture(scope="module")
def works(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where bundles are signed: two keys, the second endorsed by the first, archives by the first."""
    folder = tmp_path_factory.mktemp("works")
    one = keys.new(folder / "one.pem")
    keys.new(folder / "two.pem")
    assert (
        entry.run(["deploy", "keys", "endorse", str(folder / "two.pub.pem"), "--by", str(folder / "one.pem")])
        == 0
    )
    for name, (controller, changes) in OFFERED.items():
        signing.write(built(controller, changes), folder / f"{name}.slwb", one, name)
    return folder


class Machine:
    """A machine's computer: its store, and the commands given there."""

    def __init__(self, folder: Path, works: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self.works, self.capsys = folder, works, capsys
        self.store, self.place = folder / "store", Place(folder / "store")

    def deploy(self, *told: str | Path) -> tuple[int, str, str]:
        """Exit code, stdout, stderr."""
        self.capsys.readouterr()
        code = entry.run(["deploy", *map(str, told), "--store", str(self.store)])
        found = self.capsys.readouterr()
        return code, found.out, found.err

    def install(self, archive: str | Path) -> str:
        """Install and accept an archive of the works; what was shown."""
        path = self.works / f"{archive}.slwb" if isinstance(archive, str) else archive
        digest = json.loads(self.figures(path))["digest"]
        code, out, err = self.deploy("install", path, "--accept", digest[:8])
        assert code == 0, err
        return out

    def figures(self, path: Path) -> str:
        """What an archive would change, as JSON; nothing is installed."""
        assert self.deploy("install", path, "--json", self.folder / "x.json")[0] == 1
        return (self.folder / "x.json").read_text()

    def trust(self) -> None:
        """Trust the works' first key."""
        assert self.deploy("keys", "add", self.works / "one.pub.pem")[0] == 0

    def ran(self) -> None:
        """The active bundle runs long enough."""
        assert self.chosen().prove()

    def chosen(self) -> start.Active:
        """What the runtime would run."""
        config = self.folder / "machine.toml"
        config.write_text('[can]\ninterface = "socketcan"\nchannel = "can0"\n[store]\nfolder = "store"\n')
        return start.chosen(configuration.read(config), config)


@pytest.fixture
def machine(tmp_path: Path, works: Path, capsys: pytest.CaptureFixture[str]) -> Machine:
    """A new machine."""
    return Machine(tmp_path, works, capsys)


def test_install_run_update_and_back(machine: Machine):
    machine.trust()
    assert "the first bundle of this store" in machine.install("pd")
    assert machine.chosen().said == f"bundle pd pd {machine.place.store().state.active[:12]}, signed by one"
    machine.ran()
    out = machine.install("pi")
    for line in ("controller: pd -> pi", "gate_rise: 10.0 1/s -> 100.0 1/s", "added pi_slew_gain: "):
        assert line in out
    assert "CAN:" not in out
    assert machine.chosen().bundle.controller == "pi"
    code, out, _ = machine.deploy("rollback")
    assert code == 0
    assert "gate_rise: 100.0 1/s -> 10.0 1/s" in out
    assert machine.chosen().bundle.controller == "pd"
    code, _, err = machine.deploy("rollback")
    assert code == 2
    assert "holds no other good bundle" in err


def test_nothing_takes_effect_before_it_is_accepted(machine: Machine):
    machine.trust()
    for accept, code, said in (
        ((), 1, "not installed; accept it with --accept "),
        (("--accept", "00000000"), 2, "nothing was installed"),
        (("--accept", ""), 2, "give 8 digits or more"),
    ):
        found = machine.deploy("install", machine.works / "pd.slwb", *accept)
        assert found[0] == code
        assert said in found[2]
    assert [p.name for p in machine.store.iterdir()] == ["keys"]


def test_an_archive_without_a_known_key_is_refused(machine: Machine):
    code, _, err = machine.deploy("install", machine.works / "pd.slwb", "--accept", "00000000")
    assert code == 2
    assert "signed by the unknown key" in err
    assert "trusted: none" in err
    assert not machine.store.exists()


def test_rotation_of_keys(machine: Machine):
    """New key, new signature, then the old key goes; what the old key alone signed no longer runs."""
    machine.trust()
    machine.install("pd")
    code, _, err = machine.deploy("keys", "retire", "one")
    assert (code, "is the only trusted key" in err) == (2, True)
    code, out, _ = machine.deploy("keys", "add", machine.works / "two.pub.pem")
    assert (code, "endorsed by one" in out) == (0, True)
    code, _, err = machine.deploy("keys", "retire", "one")
    assert (code, "one signed the active bundle" in err) == (2, True)
    again = machine.folder / "again.slwb"
    signing.write(built("pd"), again, keys.read_private(machine.works / "two.pem"), "pd")
    assert "nothing is different" in machine.install(again)
    assert machine.deploy("keys", "retire", "one")[0] == 0
    assert machine.chosen().signer == "two"
    code, _, err = machine.deploy("install", machine.works / "pi.slwb")
    assert (code, "signed by one" in err, "was retired" in err) == (2, True, True)
    code, out, _ = machine.deploy("keys", "list")
    assert [line.split()[1] for line in out.splitlines() if "│" in line] == ["one", "two"]
    shutil.rmtree(machine.store)
    code, _, err = machine.deploy("keys", "list")
    assert (code, "there is no such folder" in err) == (2, True)


def test_a_leaked_key_stops_the_machine_and_the_way_back_is_said(machine: Machine):
    machine.trust()
    machine.deploy("keys", "add", machine.works / "two.pub.pem")
    again = machine.folder / "again.slwb"
    signing.write(built("pd"), again, keys.read_private(machine.works / "two.pem"), "2")
    machine.install(again)
    machine.ran()
    machine.install("pi")
    assert machine.deploy("keys", "retire", "one", "--now")[0] == 0
    with pytest.raises(
        InputError, match=r"one .* was retired\nthe last good one, .*: slewright deploy rollback"
    ):
        machine.chosen()
    assert machine.deploy("list")[0] == 1
    assert machine.deploy("rollback")[0] == 0
    assert machine.chosen().signed.release == "2"  # type: ignore[union-attr]


SPOILT = {
    "flipped": (
        lambda p: p.write_bytes(p.read_bytes()[:-1] + b"!"),
        r"step\.c was changed since it was signed",
    ),
    "gone": (Path.unlink, r"step\.c is missing"),
    "empty": (lambda p: p.write_bytes(b""), r"step\.c was changed"),
    "stranger": (lambda p: p.with_name("new.c").write_bytes(b""), r"new\.c is not in its manifest"),
    "link": (lambda p: (p.unlink(), p.symlink_to("/etc/passwd")), r"step\.c is no plain file"),
    "folder": (lambda p: (p.unlink(), p.mkdir()), r"step\.c is no plain file"),
}


@pytest.mark.parametrize("how", SPOILT)
def test_what_was_changed_in_the_store_is_refused_at_the_start(machine: Machine, how: str):
    machine.trust()
    machine.install("pd")
    machine.ran()
    machine.install("pi")
    act, said = SPOILT[how]
    active = machine.store / BUNDLES / machine.place.store().state.active
    act(active / BUNDLE / "sources" / "core" / "step.c")
    with pytest.raises(InputError, match=said) as refused:
        machine.chosen()
    assert "slewright deploy rollback --store" in str(refused.value)
    code, out, _ = machine.deploy("list")
    assert (code, "step.c" in out or "new.c" in out) == (1, True)
    assert machine.deploy("rollback")[0] == 0
    assert machine.chosen().bundle.controller == "pd"
    machine.install("pi")
    assert machine.chosen().bundle.controller == "pi"


def test_a_bundle_in_anothers_place_is_refused(machine: Machine):
    """Both are rightly signed; but the one that was accepted is the one that has to run."""
    machine.trust()
    machine.install("pd")
    pd = machine.place.store().state.active
    machine.ran()
    machine.install("pi")
    pi = machine.place.store().state.active
    shutil.rmtree(machine.store / BUNDLES / pi)
    shutil.copytree(machine.store / BUNDLES / pd, machine.store / BUNDLES / pi)
    with pytest.raises(InputError, match=f"bundle {pi[:12]}: {pd[:12]} is in its place"):
        machine.chosen()


def test_a_damaged_pointer_is_refused_and_said_anew(machine: Machine):
    machine.trust()
    machine.install("pd")
    machine.ran()
    newest = machine.store / "pointer.b"
    newest.write_bytes(newest.read_bytes()[:-1] + b"!")
    with pytest.raises(InputError, match=r"pointer\.b is damaged"):
        machine.chosen()
    assert machine.deploy("list")[0] == 1
    machine.install("pd")
    assert machine.chosen().bundle.controller == "pd"


def test_a_core_that_does_not_load_is_not_installed(machine: Machine):
    """Rightly signed, but its machine code is none: found before it takes effect; nothing is left of it."""
    machine.trust()
    machine.install("pd")
    before = machine.place.store().digests()
    from runtime import bundle as form

    files = container.read(machine.works / "pi.slwb")
    name = f"core-{form.host()}.so"
    inner = json.loads(files[BUNDLE + form.MANIFEST])
    inner["files"][name] = form.digest(b"none")
    changed = {**files, BUNDLE + name: b"none", BUNDLE + form.MANIFEST: json.dumps(inner).encode()}
    changed = {n: d for n, d in changed.items() if n not in (SIGNATURE, "release.json")}
    path = machine.folder / "bad.slwb"
    path.write_bytes(container.pack(sign(changed, "", keys.read_private(machine.works / "one.pem"))))
    digest = json.loads(machine.figures(path))["digest"]
    code, _, err = machine.deploy("install", path, "--accept", digest)
    assert (code, "cannot be loaded" in err) == (2, True)
    assert machine.place.store().digests() == before
    assert machine.chosen().bundle.controller == "pd"


def test_only_the_signed_configuration_runs(machine: Machine):
    machine.trust()
    config = machine.folder / "signed.toml"
    config.write_text('[can]\ninterface = "socketcan"\nchannel = "can1"\n[store]\nfolder = "store"\n')
    path = machine.folder / "with.slwb"
    signing.write(built("pd"), path, keys.read_private(machine.works / "one.pem"), "", config)
    machine.install(path)
    with pytest.raises(InputError, match=r'not the configuration .*: can\.channel: "can1" -> "can0"'):
        machine.chosen()
    config.write_text("# a remark changes nothing\n" + config.read_text())
    assert start.chosen(configuration.read(config), config).bundle.controller == "pd"


def test_a_store_without_a_bundle_and_none_at_all(machine: Machine):
    with pytest.raises(InputError, match="there is no such folder"):
        machine.chosen()
    machine.trust()
    with pytest.raises(InputError, match="holds no bundle; slewright deploy install"):
        machine.chosen()


def test_an_active_bundle_of_older_specs_is_still_compared_with(machine: Machine):
    """After an update of the software: the old bundle no longer fits, the difference names what moved."""
    machine.trust()
    one = keys.read_private(machine.works / "one.pem")
    files = container.read(machine.works / "pd.slwb")
    files = {n: d for n, d in files.items() if n not in (SIGNATURE, "release.json")}
    old = {**files, DBC: files[DBC].replace(b" u_boom : 32|16@1+", b" u_boom : 32|15@1+")}
    from runtime.archive import trust
    from runtime.archive.disk import StoreFolder
    from runtime.archive.signed import verify
    from runtime.archive.store import Store

    signed = verify(sign(old, "old", one), trust.read(machine.place.keys), "x")
    store = Store(StoreFolder(machine.store))
    store.stage(signed)
    store.activate(signed.digest)
    with pytest.raises(InputError, match="made for other specs"):
        machine.chosen()
    assert "CAN:\n  signal u_boom place: bit 32, 15 bits" in machine.install("pd")


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (("install", "none.slwb"), "there is no such file"),
        (("install", "/"), "there is no such file"),
        (("list",), "there is no such folder"),
        (("rollback",), "there is no such folder"),
        (("keys", "retire", "none"), "no trusted key 'none'"),
        (("keys", "add", "none.pem"), "there is no such file"),
        (("keys", "retire", "one", "--keys", "none"), "none: no trusted key 'one'"),
    ],
)
def test_what_is_refused(machine: Machine, told: tuple[str, ...], said: str):
    code, _, err = machine.deploy(*told)
    assert code == 2
    assert said in err
    assert err.count("\n") <= 2
    assert not machine.store.exists()


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (("--archive", "x.slwb"), "add --sign KEY.pem"),
        (("--release", "1.0"), "add --sign KEY.pem"),
        (("--sign", "none.pem"), "there is no such file"),
        (("--sign", "KEY", "--release", "a b"), "release 'a b'"),
        (("--sign", "KEY", "--archive", "none/x.slwb"), "there is no folder none"),
        (("--sign", "KEY", "--config", "none.toml"), "none.toml"),
        (("--sign", "PUBLIC"), "holds no private key"),
    ],
)
def test_bundle_refuses_before_it_compiles(
    works: Path, tmp_path: Path, told: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
):
    places = {"KEY": str(works / "one.pem"), "PUBLIC": str(works / "one.pub.pem")}
    code = entry.run(["bundle", "pd", "--out", str(tmp_path / "b"), *(places.get(t, t) for t in told)])
    assert code == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
