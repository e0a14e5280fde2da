"""`slewright reproduce`: all items in the paper's order, kept and found again; what is refused."""

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from learning.policy import export
from records.paper import ROWS, SLEW_ONLY, WITH_ESTIMATE, WITHOUT_ESTIMATE
from slewright import __main__ as entry
from slewright.commands.controllers.reproduce import ROLES
from specs.errors import InputError
from tests.conftest import ROOT
from verification.paper import asked as asking, items, page, reproduction, slew_model, trials
from verification.paper.asked import EFFORTS, Asked
from verification.paper.items import Item
from verification.paper.made import COLUMNS, NO_BREAK, Made, filled
from verification.paper.store import Store
from verification.paper.why import WHY
from verification.plants.trial import Job, Ran

POLICIES = ROOT / "learning" / "policies"
ORDER = [
    *("data", "networks", "slew_ablation", "open_loop", "arm_and_tool", "slew_only", "four_targets"),
    *("driver", "five_targets", "strategies", "no_load_estimate"),
]


def asked(out: Path, budget: str = "quick", targets: int = 1) -> Asked:
    """A quick reproduction of one target."""
    effort = replace(EFFORTS[budget], targets=targets)
    return Asked(budget, effort, 1, 1, out, lambda *said: None)


def test_all_items_in_the_papers_order() -> None:
    assert items.names() == ORDER
    assert [*WHY] == ORDER
    assert [i.name for i in items.chosen(["driver", "data"])] == ["data", "driver"]
    assert [i.name for i in items.chosen([])] == ORDER


@pytest.mark.parametrize("place", [SLEW_ONLY, WITH_ESTIMATE, WITHOUT_ESTIMATE])
def test_every_row_of_the_paper_has_ours_beside_it(place: str) -> None:
    rows = {row.name: row for row in ROWS if row.place == place}
    lines = {line.row: line for line in trials.LINES[place] if line.row}
    assert [*lines] == [*rows]
    assert all(row.load in ("", lines[name].load) for name, row in rows.items())


# ---- what is refused ----


def test_the_help_names_every_role() -> None:
    assert sorted(ROLES.split(", ")) == sorted(asking.ROLES)


def test_an_unknown_name_ends_with_2_and_the_valid_ones(capsys: Any, tmp_path: Path) -> None:
    assert entry.run(["reproduce", "slew_onyl", "--quick", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "no item 'slew_onyl'" in said
    assert all(name in said for name in ORDER)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"paper={POLICIES / 'slew.onnx'}", "slew.onnx: a policy of task slew; paper is of task full"),
        (f"paper={POLICIES / 'ppo.onnx'}", "ppo.onnx: a policy of recipe ppo; paper is of recipe paper"),
        (f"paper_slew_no_history={POLICIES / 'paper_slew.onnx'}", "a policy of history 5; .* of history 1"),
        (f"paper={POLICIES / 'paper.onnx'} paper=x.onnx", "--policy paper=x.onnx: paper is given twice"),
        ("papre=x.onnx", "no role 'papre'; did you mean paper.*valid: .*ppo"),
        ("slow=x.onnx", "no role 'slow'.*valid: paper_slew_no_history, .*slew"),
        ("x.onnx", "valid is ROLE=FILE, with a role of: .*paper"),
        ("paper=nothing.onnx", "no policy nothing.onnx"),
        (f"paper={ROOT / 'README.md'}", "README.md is no readable ONNX file"),
    ],
)
def test_policies_that_do_not_fit_are_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        asking.policies(text.split())


def test_a_policy_with_weights_that_are_no_numbers_is_refused(tmp_path: Path) -> None:
    found = export.read(POLICIES / "paper_slew.onnx")
    (w, b), *rest = found.weights
    path = export.write(replace(found, weights=[(np.full_like(w, np.nan), b), *rest]), tmp_path / "nan.onnx")
    with pytest.raises(InputError, match=r"nan.onnx: layer 0 has weights that are not finite"):
        asking.policies([f"paper_slew={path}"])


@pytest.mark.parametrize(
    "words", [["--budget", "huge"], ["--quick", "--budget", "tiny"], ["--page", "no/x.md"]]
)
def test_wrong_words_end_with_2(words: list[str], tmp_path: Path, capsys: Any) -> None:
    assert entry.run(["reproduce", "networks", *words, "--out", str(tmp_path / "out")]) == 2
    assert "slewright: " in capsys.readouterr().err


@pytest.mark.parametrize("out", ["file", "file/below", "closed"])
def test_a_folder_that_cannot_be_made_ends_with_2(out: str, tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "closed").mkdir()
    (tmp_path / "closed" / "items").touch()  # as a folder that cannot be written to: also for root
    assert entry.run(["reproduce", "networks", "--quick", "--out", str(tmp_path / out)]) == 2
    said = capsys.readouterr().err
    assert str(tmp_path / out) in said
    assert "(0/1)" not in said  # before the first item


# ---- kept, and found again ----


def test_the_store_finds_what_it_kept_and_nothing_else(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert store.find("a", {"seed": 1}) is None
    assert store.get("a", {"seed": 1}, lambda: {"x": (1, float("nan"))}) == {"x": [1, None]}
    assert store.get("a", {"seed": 1}, lambda: pytest.fail("made again")) == {"x": [1, None]}
    assert store.find("a", {"seed": 2}) is None
    (file,) = tmp_path.iterdir()
    file.write_text(file.read_text()[:20])
    assert store.get("a", {"seed": 1}, lambda: 3) == 3


def test_a_policy_trained_again_is_the_same_one(tmp_path: Path) -> None:
    found = export.read(POLICIES / "paper_slew.onnx")
    later = replace(found.contract, made={**found.contract.made, "commit": "another"})
    path = export.write(replace(found, contract=later), tmp_path / "again.onnx")
    assert asking.digest(path) == asking.digest(POLICIES / "paper_slew.onnx")
    assert asking.digest(POLICIES / "ppo.onnx") != asking.digest(POLICIES / "paper.onnx")


def test_an_interrupted_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    broken = ["second"]

    def item(name: str) -> Item:
        def make(_: Asked) -> Made:
            if name in broken:
                raise KeyboardInterrupt
            made.append(name)
            return Made({"name": name}, text=name)

        return Item(name, "Table 0", name, make)

    wanted = [item("first"), item("second")]
    with pytest.raises(KeyboardInterrupt):
        items.make(asked(tmp_path), wanted)
    broken.clear()
    found = items.make(asked(tmp_path), wanted)
    assert made == ["first", "second"]
    assert found["first"]["paper"] == {"name": "first"}
    assert found["second"]["command"] == "slewright reproduce second --quick --targets 1 --seed 1"
    items.make(asked(tmp_path, targets=2), wanted)  # other settings: made again
    assert made == ["first", "second"] * 2


def test_ours_are_shown_with_their_standard_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [replace(_rows()[0], speed=speed) for speed in (9.0, 11.0)]
    monkeypatch.setattr(trials.trial, "run", lambda jobs, *_: (Ran(rows, [1.0], 3, 15.0, None) for _ in jobs))
    monkeypatch.setattr(trials, "_jobs", lambda *_: [None])
    text = trials.make(asked(tmp_path), SLEW_ONLY).text
    assert "| 10.00 ± 1.00 | 0.50 ± 0.00 |" in text.replace(NO_BREAK, " ")
    assert "| 14.04 | 38.10 |" in text  # the paper's
    assert text.endswith(filled(trials.NOTE))


def test_table_three_has_the_stored_intervals() -> None:
    found = json.loads(slew_model.STORED.read_text())
    text = slew_model._features(found)
    assert "0.47 ± 0.15 (×0.75)" in text.replace(NO_BREAK, " ")
    assert "| 1.80 (×1.12) |" in text  # the paper's


def test_a_table_goes_on_cell_by_cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[int] = []

    def run(jobs: list[Job], *_: Any) -> Iterator[Ran]:
        for number, _job in enumerate(jobs):
            if len(runs) == 3:
                runs.append(len(jobs))
                raise KeyboardInterrupt
            runs.append(number)
            yield Ran(_rows(), [1.0], 3, 15.0, None)

    monkeypatch.setattr(trials.trial, "run", run)
    monkeypatch.setattr(trials, "_jobs", lambda *_: [None])
    with pytest.raises(KeyboardInterrupt):
        trials.make(asked(tmp_path), SLEW_ONLY)
    assert runs == [0, 1, 2, 12]
    found = trials.make(asked(tmp_path), SLEW_ONLY)
    assert len(runs) == 4 + 9  # of 12 cells three were kept
    assert found.reference is not None
    assert found.reference["rows"]["History"]["speed"] == 10.0
    assert "speed ×0.69" in trials.ratios(found.as_dict())


def _rows() -> list[Any]:
    from records.metrics import TargetMetrics

    return [TargetMetrics(1, 0.0, 90.0, 90.0, True, True, 9.0, 10.0, 0.5, 0.2, 1.0, 5.0)]


# ---- the command ----


def test_an_item_from_what_ships_with_its_page(tmp_path: Path, capsys: Any) -> None:
    out, page = tmp_path / "figures.json", tmp_path / "paper.md"
    words = ["networks", "open_loop", "--quick", "--out", str(tmp_path / "out"), "--page", str(page)]
    assert entry.run(["reproduce", *words, "--json", str(out)]) == 0
    assert "Table II" in capsys.readouterr().out
    found = json.loads(out.read_text())
    assert [*found["items"]] == ["networks", "open_loop"]
    assert found["seed"] == 1
    assert found["commit"]
    assert "slewright" in found["versions"]
    assert {"paper", *COLUMNS, "command"} <= {*found["items"]["networks"]}
    text = page.read_text()
    assert text.index("## Table II") < text.index("## Fig. 2")
    assert "simulated" in text
    picture = page.with_suffix("") / "open-loop-40-s.svg"
    assert "Slew speed [°/s]" in picture.read_text()
    ET.fromstring(picture.read_text())
    assert "<svg" in (tmp_path / "out" / reproduction.PAGE).read_text()


def test_the_page_that_ships_has_every_item() -> None:
    text = (ROOT / "docs" / "results" / "paper.md").read_text()
    places = [f"## {item.place}: {item.title}" for item in items.ITEMS]
    assert [line for line in text.splitlines() if line.startswith("## ")][:-1] == places
    for name in ORDER:
        assert filled(f"**Where they differ.** {WHY[name]}") in text, name
    assert text.count(filled(trials.NOTE)) == 3  # Tables IV to VI
    assert page.TRAINING[""] in " ".join(text.split())


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_the_whole_of_it_on_a_tiny_budget(tmp_path: Path) -> None:
    out = tmp_path / "figures.json"
    words = ["--budget", "tiny", "--jobs", "1", "--out", str(tmp_path / "out"), "--json", str(out)]
    assert entry.run(["reproduce", *words]) == 0
    found = json.loads(out.read_text())["items"]
    assert [*found] == ORDER
    for name, item in found.items():
        assert item["paper"], name
        assert item["reference"] or name == "networks"
        assert item["published"], name
        assert item["nominal"] or name == "data"
        assert item["command"].startswith(f"slewright reproduce {name} --budget tiny")
    kept = sorted((tmp_path / "out" / "items").iterdir())
    times = [path.stat().st_mtime_ns for path in kept]
    assert len(kept) == len(ORDER)
    assert entry.run(["reproduce", *words]) == 0
    assert [path.stat().st_mtime_ns for path in kept] == times
