"""EDS files read: ours fit, a foreign one is told where not, what is no EDS is refused; the command."""

import json
import shutil
from pathlib import Path

import pytest

from runtime.canopen import eds
from runtime.canopen.eds import Identity
from runtime.canopen.start import identities, zeros
from specs import canopen, canopen_eds
from specs.errors import InputError
from specs.generate import FOLDER
from tests.conftest import ROOT, Command

pytest.importorskip("canopen")
NODES = canopen.definition().nodes
# Of python-canopen's tests (MIT licence): a file with sub-objects left out, and nothing that an encoder has.
FOREIGN = ROOT / "tests" / "data" / "canopen" / "sample.eds"


@pytest.mark.parametrize("node", NODES, ids=lambda n: n.name)
def test_our_own_fit_and_say_who_they_are(node: canopen.Node, tmp_path: Path):
    path = FOLDER / "canopen" / f"{node.device.name}.eds"
    assert eds.mismatches(eds.read(path, node.id), node) == []
    assert eds.identity(eds.read(path)) == Identity.of(node.device)
    (tmp_path / "x.dcf").write_text(canopen_eds.dcf(node, {}))
    assert eds.mismatches(eds.read(tmp_path / "x.dcf"), node) == []


def maker(tmp_path: Path, was: str, instead: str, name: str = "encoder") -> Path:
    text, path = (FOLDER / "canopen" / f"{name}.eds").read_text(), tmp_path / "maker.eds"
    assert was in text
    path.write_text(text.replace(was, instead))
    return path


@pytest.mark.parametrize(
    ("was", "instead", "said"),
    [
        ("0x00020196", "0x00020192", "device profile 402, not 406"),
        ("DefaultValue=262144", "DefaultValue=8192", "object 0x6501:0 .* says 8192, not 262144"),
        ("[2000]", "[2001]", "no object 0x2000:0"),
        ("ParameterName=Speed multiplier\nObjectType=0x7\nDataType=0x0006\nAccessType=rw", "ParameterName=x\n"
         "ObjectType=0x7\nDataType=0x0006\nAccessType=ro", "object 0x6031:3 is read-only and says 0, not 1"),
        ("[6004]\nParameterName=Position value\nObjectType=0x7\nDataType=0x0007", "[6004]\nParameterName=x\n"
         "ObjectType=0x7\nDataType=0x0004", "0x6004:0 for q_slew is INTEGER32, not UNSIGNED32"),
    ],
)  # fmt: skip
def test_a_makers_file_that_does_not_fit_is_refused_with_the_place(
    tmp_path: Path, was: str, instead: str, said: str
):
    with pytest.raises(InputError, match=rf"maker.eds: does not fit encoder_slew: .*{said}"):
        identities({"encoder_slew": maker(tmp_path, was, instead)})


def test_a_makers_file_that_fits_says_who_the_device_is_to_be(tmp_path: Path):
    found = identities({"encoder_slew": maker(tmp_path, "0x00000FFF", "0x000001AB")})
    assert found["encoder_slew"].vendor == 0x1AB
    assert found["encoder_boom"].vendor == 0xFFF
    ours, theirs = found["encoder_boom"], found["encoder_slew"]
    assert ours.differs(theirs) == ["vendor 0x000001AB, not 0x00000FFF"]
    assert Identity(None, 1, None).differs(Identity(7, 1, None)) == []


def test_a_foreign_file_is_read_and_told_where_it_does_not_fit():
    for node in NODES:
        found = eds.mismatches(eds.read(FOREIGN, node.id), node)
        assert len(found) > 3
        assert all(f"object {d.shown}" not in " ".join(found) for d in canopen_eds.downloads(node, {})[-1:])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the library's own
@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe\x00garbage", b"[1000]\nObjectType=zero\n", b"[DeviceInfo\n"]
)
def test_what_is_no_eds_is_refused(tmp_path: Path, content: bytes):
    (tmp_path / "bad.eds").write_bytes(content)
    with pytest.raises(InputError, match=r"bad.eds: no EDS"):
        eds.read(tmp_path / "bad.eds")


@pytest.mark.parametrize(
    ("was", "instead", "said"),
    [
        ("DataType=0x0007", "DataType=0xZZ", r"line 78, \[1000\]: DataType=0xZZ is no number"),
        ("VendorNumber=0x", "VendorNumber=0xT", r"line 16, \[DeviceInfo\]: VendorNumber=0xT00000FFF is no"),
        ("ObjectType=0x7", "ObjectType=seven", r"\[1000\]: ObjectType=seven is no number"),
    ],
)
def test_a_broken_number_is_named_with_line_and_section(tmp_path: Path, was: str, instead: str, said: str):
    text = (FOLDER / "canopen" / "encoder.eds").read_text()
    (tmp_path / "x.eds").write_text(text.replace(was, instead, 1))
    with pytest.raises(InputError, match=said):
        eds.read(tmp_path / "x.eds")


@pytest.mark.parametrize(
    ("was", "instead", "said"),
    [
        (
            "DefaultValue=262144",
            "DefaultValue=262x44",
            r"line \d+, \[6501\]: DefaultValue=262x44 is no",
        ),
        ("DefaultValue=262144", "DefaultValue=", None),
        ("DefaultValue=262144", "DefaultValue=0x100000000", r"DefaultValue=0x100000000 does not go into 32"),
        ("DefaultValue=262144", "DefaultValue=-1", r"\[6501\]: DefaultValue=-1 does not go into 32 bits"),
        ("DefaultValue=262144", "DefaultValue=262144\nLowLimit=low", r"\[6501\]: LowLimit=low is no"),
        ("DefaultValue=262144", "DefaultValue=262144 ; counts a turn\nHighLimit=0xFFFFFFFF", None),
        (
            "DefaultValue=262144",
            "ParameterValue=26 21 4?\nDefaultValue=262144",
            r"ParameterValue=26 21 4\? is",
        ),
        ("DefaultValue=262144", "DefaultValue=$NODEID+0x4000", None),
    ],
)
def test_a_value_that_its_type_cannot_be_is_refused_with_its_place(
    tmp_path: Path, was: str, instead: str, said: str | None
):
    if said is None:
        assert len(eds.read(maker(tmp_path, was, instead), 5))
        return
    with pytest.raises(InputError, match=rf"maker.eds: .*{said}"):
        eds.read(maker(tmp_path, was, instead))


def test_zeros_come_from_the_bundles_commissioning_record(tmp_path: Path):
    assert zeros(tmp_path) == {}
    (tmp_path / "commissioning.json").write_text(json.dumps({"zeros": {"q_slew": 0.01}}))
    assert zeros(tmp_path) == {"q_slew": 0.01}
    (tmp_path / "commissioning.json").write_text("[]")
    with pytest.raises(InputError, match="no commissioning record"):
        zeros(tmp_path)


@pytest.mark.long
def test_the_command_writes_and_reads_files(slewright: Command, tmp_path: Path):
    assert slewright("canopen", "dcf", "--out", tmp_path).returncode == 0
    figures = tmp_path / "found.json"
    done = slewright("canopen", "check", tmp_path / "encoder_slew.dcf", "--json", figures)
    assert done.returncode == 0
    assert "encoder_boom: fits" in done.stdout
    assert json.loads(figures.read_text())["identity"]["product"] == 0x406
    shutil.copy(FOREIGN, tmp_path / "foreign.eds")
    done = slewright("canopen", "check", tmp_path / "foreign.eds", "--node", "valve_slew")
    assert done.returncode == 1
    assert "no object 0x6300:1 for u_slew" in done.stdout
    assert slewright("canopen", "check", tmp_path / "none.eds").returncode == 2


def test_a_makers_file_may_be_written_on_windows(tmp_path: Path):
    text = f"; Drehgeber f\xfcr B\xfchne\r\n{FOREIGN.read_text()}"
    for number, encoding in enumerate(("latin-1", "utf-8-sig")):
        file = tmp_path / f"{number}.EDS"
        file.write_bytes(text.encode(encoding))
        assert eds.identity(eds.read(file)) == eds.identity(eds.read(FOREIGN))


def test_files_go_into_a_folder(slewright: Command, tmp_path: Path):
    (tmp_path / "file").touch()
    done = slewright("canopen", "eds", "--out", tmp_path / "file")
    assert done.returncode == 2
    assert "file is a file; name a folder" in done.stderr
