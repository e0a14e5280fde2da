"""Plants: found by name, file or folder, refused where they are none, and trials on them."""

import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from baselines import gains
from fmus.models.slew_nn.fmu import write_folder
from fmus.models.slew_nn.model import of_network
from fmus.models.slew_nn.network import SlewNetwork
from fmus.models.slew_nn.untrained import untrained
from fmus.toolchain.build import build_fmu
from slewright import __main__ as entry
from specs import systems
from specs.errors import InputError, RunError
from tests.conftest import ROOT
from verification.plants import page as pages, plant, study, trial
from verification.plants.plant import find, of_network as plant_of
from verification.plants.trial import Ran, Trial

POLICY = ROOT / "learning" / "policies" / "full.onnx"
KEYS = ("missed_share", "overshoot", "error", "speed", "tool", "rest_peak_to_peak", "sign_changes")


def stranger() -> SlewNetwork:
    """An imported network that does not say on which inertia number it was trained."""
    return replace(untrained(1), meta={"imported": ["p.pth", "w.pth"]})


@pytest.mark.parametrize("name", [n for n in plant.names() if n != "machine"])
def test_every_named_plant_has_the_connectors_of_the_slew_drive(name: str) -> None:
    from fmus.toolchain.loader import load_model

    found = find(name)
    wanted = systems.load("nominal").connectors("slew")
    model = load_model(found.models.get("slew", "slew"))
    names = {v.name for v in model.inputs}, {v.name for v in model.outputs}
    assert {*wanted[0]} <= names[0]
    assert {*wanted[1]} <= names[1]


def test_a_plant_from_a_file_or_folder(tmp_path: Path) -> None:
    network = untrained(1).told_in_our_inertia(0.8, 0.0)
    network.save(tmp_path / "weights.npz")
    assert find(str(tmp_path / "weights.npz")).network is not None
    assert find(str(tmp_path)).models == find(str(tmp_path / "weights.npz")).models
    (tmp_path / "b").mkdir()
    network.save(tmp_path / "b" / "same.npz")
    network.save(tmp_path / "same.npz")
    with pytest.raises(InputError, match="two plants called 'same'"):
        study.find_plants([str(tmp_path / "b" / "same.npz"), str(tmp_path / "same.npz")])
    assert find(str(ROOT / "fmus" / "models" / "slew")).network is None
    for name in ("gain1.1", "gain1.2"):
        (tmp_path / name).mkdir()
        network.save(tmp_path / name / "weights.npz")
        assert find(str(tmp_path / name)).name == name


def test_strangers_are_refused(tmp_path: Path) -> None:
    stranger().save(tmp_path / "no_inertia.npz")
    (net,) = untrained(1).velocity
    broken = replace(net, weights=(np.full_like(net.weights[0], np.nan), *net.weights[1:]))
    replace(untrained(1), velocity=(broken,)).save(tmp_path / "nan.npz")
    short = replace(net, weights=(net.weights[0][:, 10:], *net.weights[1:]), mean_in=net.mean_in[10:])
    replace(untrained(1), velocity=(short,)).save(tmp_path / "short.npz")
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    untrained(1).save(tmp_path / "published.npz")
    (tmp_path / "noise.fmu").write_bytes(b"no FMU")
    (tmp_path / "empty").mkdir()
    for text, said in {
        str(tmp_path / "no_inertia.npz"): "--our-inertia",
        str(tmp_path / "nan.npz"): "not finite",
        str(tmp_path / "short.npz"): "plant short: a velocity network of 31 inputs; .* 41",
        str(tmp_path / "other.npz"): "not a slew network: it lacks 'head'",
        str(tmp_path / "published.npz"): "one of the project's plants is called published",
        str(tmp_path / "noise.fmu"): "noise.fmu",
        str(tmp_path / "empty"): "valid: a .npz file, an FMU, a folder",
        str(ROOT / "fmus" / "models" / "tool"): "no slew drive of this machine: it lacks",
        "publisht": "no plant 'publisht'.*published",
    }.items():
        with pytest.raises(InputError, match=said):
            find(text)
    assert find(str(tmp_path / "no_inertia.npz"), our_inertia=True).network is not None


def test_an_fmu_says_whether_its_inertia_is_known() -> None:
    assert plant.INERTIA_UNKNOWN in of_network(stranger()).description
    assert plant.INERTIA_UNKNOWN not in of_network(untrained(1)).description


def test_an_fmu_of_someone_else_takes_the_projects_inertia_when_that_is_asked_for(tmp_path: Path) -> None:
    own, foreign = tmp_path / "own.fmu", tmp_path / "foreign.fmu"
    for path in (own, foreign):
        path.write_bytes(build_fmu("slew", 2).read_bytes())
    with zipfile.ZipFile(foreign, "a") as archive:
        archive.writestr("resources/note.txt", "not built here")
    assert find(str(own)).name == "own"
    with pytest.raises(InputError, match=r"foreign\.fmu: nothing says which slew inertia .*--our-inertia"):
        find(str(foreign))
    assert find(str(foreign), our_inertia=True).name == "foreign"


def test_a_network_run_ahead_is_written_so(tmp_path: Path) -> None:
    folder = write_folder(untrained(1), "forward", tmp_path, ahead=2)
    assert '"forward", 2)' in (folder / "model.py").read_text()
    late, forward = plant_of(untrained(1), "a"), plant_of(untrained(1), "b", ahead=2)
    assert late.models != forward.models


def test_targets_are_45_to_135_degrees_apart_and_within_reach() -> None:
    found = list(Trial(targets=60, seed=3).scenarios())
    assert [len(s.targets) for _, s in found] == [25, 25, 10]
    assert [s for _, s in found] == [s for _, s in Trial(targets=60, seed=3).scenarios()]
    assert found[0][1].targets != found[1][1].targets
    slews = [t.slew_deg for t in found[0][1].targets]
    assert max(map(abs, slews)) <= trial.MOST_SLEW_DEG
    level = {
        (t.radius_m, t.height_m) for _, s in Trial(targets=9, task="slew").scenarios() for t in s.targets
    }
    assert len(level) == 1


@pytest.mark.parametrize("load", ["3t", "-1", "nan", "2501"])
def test_a_load_that_is_none_is_refused(load: str) -> None:
    with pytest.raises(InputError, match="load"):
        list(Trial(targets=1, load=load).scenarios())


def test_a_trial_out_of_the_trained_region_is_flagged() -> None:
    rows = _rows()
    for share, flagged in ((0.2, True), (0.01, False), (None, False)):
        ran = [Ran(rows, [1.0], 3, 15.0, share) for share in (share, share and 0.0, share and 0.0)]
        found = trial.figures(ran + [ran[1]] * 2, "full")  # one run of five, whose mean share is small
        assert (found["flagged"], found["sign_changes"]) == (flagged, 0.2)
        told = next(iter(study.rows({"published": {"pd": found}})))[-1]
        assert bool(told) is flagged


def test_means_come_with_their_standard_errors() -> None:
    (row,) = _rows()
    rows = [replace(row, speed=speed, slew_error=0.2) for speed in (9.0, 10.0, 11.0, 10.0)]
    found = trial.figures([Ran(rows[:2], [1.0], 3, 15.0, None), Ran(rows[2:], [1.0], 3, 15.0, None)], "slew")
    assert found["speed"] == 10.0
    assert found["standard_error"]["speed"] == pytest.approx((2 / 3 / 4) ** 0.5)
    assert found["standard_error"]["error"] == 0.0
    (alone,) = _figures()
    assert set(alone["standard_error"].values()) == {None}


def test_a_plant_that_runs_away_is_named() -> None:
    (net,) = untrained(1).velocity
    wild = replace(net, weights=(*net.weights[:-1], 1e4 * net.weights[-1]))
    on = plant_of(replace(untrained(1), velocity=(wild,)), "wild")
    with pytest.raises(RunError, match=r"pd on wild: .*not a finite number"):
        study.study(study.find_controllers(["pd"]), [on], Trial(targets=1), 1, lambda *said: None)


def _rows() -> list[Any]:
    from records.metrics import TargetMetrics

    return [TargetMetrics(1, 0.0, 90.0, 90.0, True, True, 9.0, 10.0, 0.5, 0.2, 1.0, 5.0)]


def test_a_controller_fails_where_it_misses_or_overshoots() -> None:
    (good,) = _figures()
    bad = {**good, "missed_share": 0.5, "overshoot": 3.0}
    unknown = {**good, "flagged": True, "outside_max": 0.2}
    found = study.failures({"nominal": {"pd": good}, "published": {"pd": bad}, "mine": {"pd": unknown}})
    assert found == [
        "pd on published: targets missed 50%, at most 1%",
        "pd on published: mean overshoot 3.0°, at most 2.0°",
        "pd on mine: 20 % of a run out of the trained region, at most 5%",
    ]


def _figures() -> list[dict[str, Any]]:
    return [trial.figures([Ran(_rows(), [1.0], 3, 15.0, None)], "full")]


def test_characters_tell_plants_apart(tmp_path: Path) -> None:
    page = tmp_path / "plants.md"
    (good,) = _figures()
    page.write_text("".join(f"<!-- {n}:begin -->\n<!-- {n}:end -->\n" for n in ("plants", "controllers")))
    on = study.find_plants(["nominal", "published"])
    pages.fill(page, on, {p.name: {"pd": good} for p in on}, "slewright compare --plants nominal")
    lines = [line for line in page.read_text().splitlines() if line.startswith("|")]
    assert [line.split(" | ")[0] for line in lines if " | published | " in line] == ["| pd"]
    first, second = (line for line in lines if line.startswith(("| published", "| nominal")))
    assert first.startswith("| published")  # what the others are compared with
    assert float(first.split("|")[-2]) == 0.0 < float(second.split("|")[-2])


# ---- the commands ----


@pytest.mark.parametrize(
    "words",
    [
        ("tune", "pd"), ("compare",), ("evaluate", str(POLICY)), ("verify",), ("train", "policy"),
        ("bundle", "pd", "--out", "none"),
    ],
)  # fmt: skip
def test_our_inertia_without_a_plant_is_refused(words: tuple[str, ...], capsys: Any) -> None:
    assert entry.run([*words, "--our-inertia"]) == 2
    assert "--our-inertia needs --plant" in capsys.readouterr().err


def test_compare_on_plants_takes_gains_from_a_file(tmp_path: Path) -> None:
    slow = {"controller": "pd", "machine": gains.machine(), "gains": {"pd_speed_limit": 0.3}}
    (tmp_path / "slow.json").write_text(json.dumps(slow))
    speeds = []
    for more in ([], ["--gains", f"pd={tmp_path / 'slow.json'}"]):
        out = tmp_path / "figures.json"
        words = ["compare", "--controller", "pd", "--plants", "nominal", "--targets", "1", "--jobs", "1"]
        assert entry.run([*words, "--load", "empty", *more, "--json", str(out)]) == 0
        speeds.append(json.loads(out.read_text())["plants"]["nominal"]["pd"]["speed"])
    assert speeds[1] < 0.9 * speeds[0]
    assert entry.run([*words, "--gains", f"zv={tmp_path / 'slow.json'}"]) == 2


@pytest.mark.slow
def test_a_bundle_carries_its_table_over_plants(tmp_path: Path) -> None:
    from runtime.bundle import load

    words = ["bundle", "pi", "--out", str(tmp_path / "b"), "--plants", "nominal"]
    assert entry.run([*words, "--json", str(tmp_path / "figures.json")]) == 1  # the PI overshoots
    load(tmp_path / "b")
    table = json.loads((tmp_path / "b" / "plants.json").read_text())
    assert table["failures"] == json.loads((tmp_path / "figures.json").read_text())["failures"]
    assert "mean overshoot" in " ".join(table["failures"])
    assert table["passed"] == []
    assert 0.05 < table["drives"]["nominal"]["gain"] < 0.5


def test_evaluate_on_a_plant_writes_its_keys(tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "figures.json"
    asked = ["--plant", "published", "--targets", "2", "--load", "2300", "--json", str(out)]
    assert entry.run(["evaluate", str(POLICY), *asked]) == 0
    said = capsys.readouterr()
    assert "published" in said.out
    assert "load_mass 2300 is outside the trained 0 … 2000" in said.err
    found = json.loads(out.read_text())
    assert {*KEYS, "outside", "flagged", "plant", "load", "seed"} <= {*found}
    assert found["targets"] == 2
    assert all(isinstance(found[key], float) for key in KEYS)


def test_compare_on_plants_takes_a_task_and_a_pace(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    words = ["compare", "--controller", "pd", "--plants", "nominal", "--targets", "1", "--jobs", "1"]
    assert entry.run([*words, "--task", "slew", "--pace", "0.5", "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    assert (found["task"], found["pace"]) == ("slew", 0.5)
    assert entry.run([*words, "--task", "slew", "--json", str(out)]) == 0
    fast = json.loads(out.read_text())
    assert found["plants"]["nominal"]["pd"]["speed"] < fast["plants"]["nominal"]["pd"]["speed"]


def test_compare_on_plants_is_one_table(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    asked = ["--plants", "nominal", "--plants", "published-mirror", "--targets", "1", "--jobs", "1"]
    assert entry.run(["compare", "--controller", "pd", "--load", "empty", *asked, "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    assert {p: [*c] for p, c in found["plants"].items()} == {"nominal": ["pd"], "published-mirror": ["pd"]}
    assert found["worst"]["pd"]["overshoot"] == max(c["pd"]["overshoot"] for c in found["plants"].values())


@pytest.mark.parametrize(
    "words",
    [
        ["evaluate", str(POLICY), "--plant", "publisht"],
        ["evaluate", str(POLICY), "--plant", "published", "--plant", "machine"],
        ["evaluate", str(POLICY), "--plant", "all"],
        ["verify", "--plant", "published", "--plant", "machine"],
        ["evaluate", str(POLICY), "--plant", "published", "--machines", "3"],
        ["evaluate", str(POLICY), "--plant", "published", "--load", "empty", "--load", "2t"],
        ["evaluate", str(POLICY), "--plant", "published", "--draws", "tuning"],
        ["evaluate", str(POLICY), str(POLICY.with_name("slew.onnx")), "--plant", "published"],
        ["compare", "--plants", "nothing"],
        ["compare", "--plants", "published", "--machines", "2"],
        ["compare", "--plants", "published", "--sweeps"],
        ["compare", "--plants", "published", "--task", "slew", "--task", "full"],
        ["compare", "--plants", "published", "--pace", "0.5", "--pace", "0.7"],
        ["verify", "--plant", "published", "--readme", str(ROOT / "README.md")],
        ["verify", "--plant", "published", "--system", "nominal"],
        ["verify", "--plant", "nothing"],
    ],
)
def test_wrong_words_end_with_2(words: list[str], capsys: Any) -> None:
    assert entry.run(words) == 2
    assert "slewright: " in capsys.readouterr().err


def test_several_plants_are_not_taken_for_one(capsys: Any) -> None:
    """What is said names them and the command for several; `all` is no valid choice of `evaluate`."""
    for plants in (["published", "machine"], ["all"]):
        words = [word for plant in plants for word in ("--plant", plant)]
        assert entry.run(["evaluate", str(POLICY), *words]) == 2
        said = f"--plant {', '.join(plants)}: one plant at a time; slewright compare --plants"
        assert said in " ".join(capsys.readouterr().err.split())
    assert entry.run(["evaluate", str(POLICY), "--plant", "moon"]) == 2
    assert "valid: machine, networks," in " ".join(capsys.readouterr().err.split())


def test_verify_runs_on_a_plant(tmp_path: Path, capsys: Any) -> None:
    """Report and figures say which plant it was, and where it left its trained region."""
    published = SlewNetwork.load(ROOT / "fmus" / "models" / "slew_published" / "weights.npz")
    replace(published, region={"omega": (-0.1, 0.1)}).save(tmp_path / "narrow.npz")
    for text, name in (("published", "published"), (str(tmp_path / "narrow.npz"), "narrow")):
        out = tmp_path / f"{name}.json"
        words = ["--plant", text, "--controller", "pd", "--scenario", "four_targets_empty"]
        code = entry.run(["verify", *words, "--out", str(tmp_path / name), "--json", str(out)])
        assert code in (0, 1)
        found = json.loads(out.read_text())
        metrics = json.loads((tmp_path / name / "metrics.json").read_text())
        assert (found["plant"], metrics["plant"]) == (text, name)
        left = found["outside"]["four_targets_empty"]
        warned = "out of the region that narrow was trained on"
        assert (left > 0.05) is (name == "narrow")
        report = (tmp_path / name / "report.html").read_text()
        assert f"--plant {name}" in report
        printed = capsys.readouterr()
        assert f"(verified), plant {name}" in printed.out
        for said in (printed.err, report):
            assert (warned in said) is (name == "narrow")
