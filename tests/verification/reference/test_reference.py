"""`check --reference`: experiments in the forms of the standard's drafts, and files that are wrong."""

import hashlib
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus.toolchain.build import build_fmu
from fmus.toolchain.loader import model_folders
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from tests.conftest import Command
from tests.orchestrator.every import every
from verification.reference import series

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
HEAD = (
    'xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" '
    'fmi-ls:fmi-ls-version="1.0.0-alpha.1"'
)
EXPERIMENT = (
    '<Experiment name="steps" startTime="0" stopTime="2" stepSize="0.02" tolerance="1e-6">'
    '<Parameters source="p.ssv"/><Stimuli source="in.csv"/><References source="ref.csv"/></Experiment>'
)
PARAMETERS = (
    '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" '
    'name="p"><ssv:Parameters><ssv:Parameter name="boom_response"><ssv:Real value="0.3"/></ssv:Parameter>'
    "</ssv:Parameters></ssv:ParameterSet>"
)
INPUTS = "time,qd_boom_ref\n0,0\n0.5,0\n0.5,0.1\n1.2,0.1\n1.2,-0.05\n2,-0.05\n"


@pytest.fixture(scope="module")
def reference() -> str:
    """What the arm does with PARAMETERS and INPUTS, every fifth tick."""
    system = load_system(build_fmu(model_folders()["arm"], 2), 0.02)
    (name,) = system.components
    drive = {0: {"qd_boom_ref": 0.0}, 25: {"qd_boom_ref": 0.1}, 60: {"qd_boom_ref": -0.05}}
    record = simulate(system, 100, Stimuli(drive), {f"{name}.boom_response": 0.3})
    rows = zip(record.time[::5], record.column("q_boom")[::5], record.column("qd_boom")[::5], strict=True)
    return "time,q_boom,qd_boom\n" + "".join(f"{t:.17g},{q:.17g},{v:.17g}\n" for t, q, v in rows)


def packed(folder: Path, **files: str) -> Path:
    """The arm's FMU with these files of FMI-LS-REF and no others; `manifest` is fmi-ls-manifest.xml."""
    path = folder / "arm.fmu"
    built = build_fmu(model_folders()["arm"], 2)
    with zipfile.ZipFile(built) as own, zipfile.ZipFile(path, "w") as opened:
        for name in own.namelist():
            if not name.startswith(FOLDER):
                opened.writestr(name, own.read(name))
        for name, text in files.items():
            place = "fmi-ls-manifest.xml" if name == "manifest" else name.replace("_", ".", 1)
            opened.writestr(f"{FOLDER}/{place}", text)
    return path


def manifest(inner: str) -> str:
    return f'<?xml version="1.0"?><fmiReferences {HEAD}>{inner}</fmiReferences>'


def forms(reference: str) -> dict[str, dict[str, str]]:
    files = {"p_ssv": PARAMETERS, "in_csv": INPUTS, "ref_csv": reference}
    digest = hashlib.sha3_256(f"<Experiments>{EXPERIMENT}</Experiments>".encode()).hexdigest()
    apart = f'<Related role="experiment/smoke-test" source="exp.xml" checksum="{digest}"/>'
    return {
        "in the manifest": files | {"manifest": manifest(EXPERIMENT)},
        "in a file": files
        | {"exp_xml": f"<Experiments>{EXPERIMENT}</Experiments>", "manifest": manifest(apart)},
    }


@pytest.mark.parametrize("form", ["in the manifest", "in a file"])
def test_an_experiment_that_agrees_and_one_that_does_not(
    slewright_here: Command, tmp_path: Path, reference: str, form: str
) -> None:
    file = tmp_path / "r.json"
    right = packed(tmp_path, **forms(reference)[form])
    done = slewright_here("check", right, "--reference", "--json", file)
    assert done.returncode == 0, done.stderr
    found = json.loads(file.read_text())["reference"]["steps"]
    assert found["agrees"]
    assert found["signals"]["q_boom"]["difference"] == 0.0
    lines = reference.splitlines()
    time, q, v = lines[-1].split(",")
    lines[-1] = f"{time},{float(q) + 0.01},{v}"
    wrong = packed(tmp_path, **forms("\n".join(lines) + "\n")[form])
    done = slewright_here("check", wrong, "--reference", "--json", file)
    assert done.returncode == 1
    signals = json.loads(file.read_text())["reference"]["steps"]["signals"]
    assert signals["q_boom"]["difference"] == pytest.approx(0.01, rel=1e-6)
    assert signals["q_boom"]["time_s"] == pytest.approx(2.0)


def test_a_result_alone_is_that_of_the_default_experiment(slewright_here: Command, tmp_path: Path) -> None:
    system = load_system(build_fmu(model_folders()["arm"], 2), 0.1)
    record = simulate(system, 20, Stimuli())
    rows = "".join(f"{0.1 * k!r},{q!r}\n" for k, q in enumerate(record.column("q_boom").tolist()))
    text = manifest('<Related type="text/csv" source="out.csv" role="result"/>')
    path = packed(tmp_path, manifest=text, out_csv="time,q_boom\n" + rows)
    done = slewright_here("check", path, "--reference")
    assert done.returncode == 0, done.stderr + done.stdout


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"manifest": "<fmiReferences"}, "is not valid XML"),
        ({"manifest": manifest(EXPERIMENT.replace("ref.csv", "gone.csv"))}, "there is no 'gone.csv'"),
        ({"manifest": manifest(EXPERIMENT.replace('source="ref.csv"', ""))}, "has no 'source'"),
        ({"manifest": manifest(EXPERIMENT.replace("in.csv", "https://a.b/in.csv"))}, "not in the archive"),
        ({"manifest": manifest(EXPERIMENT.replace('stopTime="2"', 'stopTime="two"'))}, "is not a number"),
        ({"ref_csv": "time,q_boom\n0,1\n0.2\n"}, "line 3: 1 cells under 2 names"),
        ({"ref_csv": "time,q_boom\n1,1\n0.2,1\n"}, "no time that rises"),
        ({"ref_csv": "time,nonsense\n0,1\n2,1\n"}, "no number of an output"),
        (
            {"manifest": manifest('<Related role="experiment" source="ref.csv" checksum="00"/>')},
            "not what its SHA3-256 checksum says",
        ),
        ({"manifest": manifest("")}, "names no experiment"),
    ],
)
def test_files_that_are_wrong_are_named(
    slewright_here: Command, tmp_path: Path, reference: str, changed: dict[str, str], said: str
) -> None:
    path = packed(tmp_path, **(forms(reference)["in the manifest"] | changed))
    done = slewright_here("check", path, "--reference")
    assert done.returncode == 2, done.stdout
    assert said in done.stderr


def test_a_file_without_experiments_is_said(slewright_here: Command, tmp_path: Path) -> None:
    done = slewright_here("check", packed(tmp_path), "--reference")
    assert done.returncode == 2
    assert "carries no reference experiments" in done.stderr


@pytest.mark.parametrize(("row", "code"), [("-2 3", 0), ("-2 4", 1)])
def test_arrays_and_large_numbers(slewright_here: Command, tmp_path: Path, row: str, code: int) -> None:
    """Inputs that step are seen a tick later; the reference has the row before the event, too."""
    fmu = every(3, tmp_path).path
    number = 2**63 - 1
    after = "".join(f"{t},1 {row},-{number},{2**64 - 1}\n" for t in (0.2, 0.4))
    stimuli = f"time,Int16.array_in,Int64.in,UInt64.in\n0,0 0 0,0,0\n0.2,1 -2 3,-{number},{2**64 - 1}\n"
    files = {
        "fmi-ls-manifest.xml": manifest(
            '<Experiment name="large" startTime="0" stopTime="0.4" stepSize="0.1" tolerance="1e-9">'
            '<Stimuli source="in.csv"/><References source="ref.csv"/></Experiment>'
        ),
        "in.csv": stimuli,
        "ref.csv": f"time,Int16.array_out,Int64.out,UInt64.out\n0,0 0 0,0,0\n0.2,0 0 0,0,0\n{after}",
    }
    with zipfile.ZipFile(fmu, "a") as opened:
        for name, text in files.items():
            opened.writestr(f"{FOLDER}/{name}", text)
    done = slewright_here("check", fmu, "--reference")
    assert done.returncode == code, done.stderr + done.stdout


def test_a_table_of_the_reference_fmus() -> None:
    text = "\n".join(
        (
            '"time","Float64_continuous_input","Boolean_input","String_input"',
            *("0,0,0,a", "1,1,false,b", "1,3,true,b", "2,5,1,c", ""),
        )
    )
    found = series.read(text.encode(), "in.csv")
    assert found.texts == ("String_input",)
    np.testing.assert_array_equal(found.held("Boolean_input", np.array([0.5, 1.0, 1.5])), [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(found.columns["Float64_continuous_input"], [0.0, 1.0, 3.0, 5.0])
