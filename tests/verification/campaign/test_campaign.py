"""Campaigns: nothing is lost, nothing is done twice, and results do not depend on who did them."""

import functools
import json
import os
import signal
import time
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from specs.errors import InputError
from specs.schema import ROOT
from tests.orchestrator.systems import OSCILLATOR, write_ssp
from tests.verification.campaign import ending
from verification.campaign import pool
from verification.campaign.journal import Journal
from verification.campaign.plan import digest, load_plan
from verification.campaign.run import Campaign, run_campaign
from verification.campaign.worker import work

PLAN = """
name = "short"
keep = "{keep}"

[[files]]
path = "test.ssp"
stop_s = 0.2
seeds = {seeds}
faults = ["no-fault", "noisy"]

[[faults.noisy]]
target = "speed.x"
kind = "noise"
std = 0.1
"""


def written(folder: Path, seeds: Sequence[int] = range(1, 7), keep: str = "none", text: str = PLAN) -> Path:
    """A plan of short runs of the oscillator."""
    write_ssp(folder, OSCILLATOR, ["position", "speed"])
    path = folder / "plan.toml"
    path.write_text(text.format(seeds=list(seeds), keep=keep))
    return path


def done(folder: Path, name: str = "out", jobs: int = 1, **more: Any) -> Campaign:
    return run_campaign(load_plan(folder / "plan.toml"), folder / name, jobs, **more)


def test_every_run_has_a_key_and_its_figures(tmp_path: Path) -> None:
    written(tmp_path, [1, 2])
    campaign = done(tmp_path)
    keys = ["test/no-fault/1", "test/no-fault/2", "test/noisy/1", "test/noisy/2"]
    assert list(campaign.results) == keys
    figures = {key: campaign.results[key]["figures"]["place end"] for key in keys}
    assert figures[keys[0]] == figures[keys[1]] == pytest.approx(0.98, abs=0.01)
    assert len({*figures.values()}) == 3  # each seed another noise
    table = pq.read_table(tmp_path / "out" / "results.parquet")
    assert table.column("key").to_pylist() == keys
    assert table.column("place end").to_pylist() == list(figures.values())
    assert (
        json.loads((tmp_path / "out" / "campaign.json").read_text())["content_hash"] == campaign.content_hash
    )


@pytest.mark.long
def test_a_campaign_goes_on_where_it_stopped(tmp_path: Path) -> None:
    written(tmp_path, [1, 2])
    first = done(tmp_path)
    assert first.done == 4
    written(tmp_path, [1, 2, 3])
    second = done(tmp_path)
    assert (second.done, len(second.results)) == (2, 6)
    assert done(tmp_path).done == 0
    journal = tmp_path / "out" / "results.jsonl"
    journal.write_text(journal.read_text()[:-20])  # a crash in the middle of the last line
    assert done(tmp_path).done == 1
    assert done(tmp_path).content_hash == second.content_hash


def test_a_changed_run_is_done_again(tmp_path: Path) -> None:
    written(tmp_path, [1])
    done(tmp_path)
    written(tmp_path, [1], text=PLAN.replace("std = 0.1", "std = 0.2"))
    assert done(tmp_path).done == 1


def test_where_a_scenario_lies_does_not_matter_but_what_it_says(tmp_path: Path) -> None:
    """The same runs in another checkout are not stale; runs of a changed target file are."""
    targets = (ROOT / "scenarios" / "four_targets.toml").read_text()
    digests = []
    for name, text in (("a", targets), ("b", targets), ("c", targets.replace("10.5", "10.6"))):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "mine.toml").write_text(text)
        (folder / "plan.toml").write_text('[runs]\nscenarios = ["mine.toml"]\nsystems = ["nominal"]\n')
        digests.append([digest(run, {"machine": "0"}) for run in load_plan(folder / "plan.toml").runs])
    assert digests[0] == digests[1]
    assert set(digests[0]).isdisjoint(digests[2])


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.long)])
def test_a_killed_worker_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: int) -> None:
    written(tmp_path)
    expected = done(tmp_path, "expected").content_hash
    once = functools.partial(ending.killed_once, str(tmp_path / "marker"))
    monkeypatch.setattr(pool, "local", functools.partial(pool.local, do=once))
    assert done(tmp_path, jobs=jobs).content_hash == expected
    assert (tmp_path / "marker").exists()


@pytest.mark.long
def test_a_run_that_kills_its_workers_is_given_up_and_the_others_are_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path, [1, 2, 3])
    bad = "test/noisy/3"
    with monkeypatch.context() as patch:
        patch.setattr(
            pool, "local", functools.partial(pool.local, do=functools.partial(ending.killed_by, bad))
        )
        campaign = done(tmp_path, jobs=2)
    assert campaign.failed == [bad]
    assert campaign.results[bad]["failed"] == "its worker process ended 3 times during this run"
    assert len(campaign.results) == 6
    again = done(tmp_path, retry_failed=True)
    assert (again.done, again.failed) == (1, [])


def test_failed_runs_are_kept_with_their_reason_and_repeated_alone(tmp_path: Path) -> None:
    written(
        tmp_path, [1], "failed", PLAN.replace('kind = "noise"\nstd = 0.1', 'kind = "fail"\nstart_s = 0.05')
    )
    path = tmp_path / "plan.toml"
    path.write_text(path.read_text().replace("speed.x", "speed"))
    campaign = done(tmp_path)
    assert campaign.failed == ["test/noisy/1"]
    reason = "component speed failed in the step from t = 0.05 s: a fault of the scenario made it fail"
    assert campaign.results["test/noisy/1"]["failed"].startswith(reason)
    assert [p.name for p in (tmp_path / "out" / "records").glob("*.parquet")] == ["test--noisy--1.parquet"]
    assert reason in (tmp_path / "out" / "summary.html").read_text()
    alone = done(tmp_path, only=["test/noisy/1"])
    assert (alone.done, alone.failed) == (1, ["test/noisy/1"])


def test_ctrl_c_keeps_what_came(tmp_path: Path) -> None:
    written(tmp_path, range(60))

    def interrupted(what: str, finished: float | None = None, total: float | None = None) -> None:
        if finished:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        done(tmp_path, progress=interrupted)
    kept = len((tmp_path / "out" / "results.jsonl").read_text().splitlines())
    assert 0 < kept < 120
    assert done(tmp_path).done == 120 - kept


def _with_a_pool(folder: Path) -> None:
    tasks = [{"key": str(i), "ssp": "", "marker": str(folder / f"pid{i}")} for i in range(2)]
    list(pool.local(tasks, 2, ending.sleepy))  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL here")
def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    parent = get_context("spawn").Process(target=_with_a_pool, args=(tmp_path,))
    parent.start()
    pids = [int(_content(tmp_path / f"pid{i}")) for i in range(2)]
    parent.kill()
    parent.join()
    deadline = time.monotonic() + 20.0
    while any(_runs(pid) for pid in pids):
        assert time.monotonic() < deadline, "workers outlive their parent"
        time.sleep(0.05)


def _content(path: Path) -> str:
    deadline = time.monotonic() + 60.0
    while not (path.is_file() and path.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return path.read_text()


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"


def test_two_campaigns_do_not_write_to_one_folder(tmp_path: Path) -> None:
    written(tmp_path, [1])
    (tmp_path / "out").mkdir()
    with (
        Journal(tmp_path / "out" / "results.jsonl"),
        pytest.raises(InputError, match="works on this campaign"),
    ):
        done(tmp_path)
    assert done(tmp_path).done == 2  # its lock went with it


def test_the_handler_s_runs_have_the_four_metrics(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(
        '[runs]\nscenarios = ["four_targets_unknown"]\nsystems = ["nominal"]\nseeds = [1, 2]\nstop_s = 15.0\n'
    )
    campaign = done(tmp_path)
    found = [r["figures"] for r in campaign.results.values()]
    assert list(campaign.results) == [f"four_targets_unknown/nominal/nominal/no-fault/pi/{s}" for s in (1, 2)]
    assert all(f["error"] > 0.0 and f["tool"] > 0.0 for f in found)
    assert found[0] != found[1]  # another load


def test_memory_does_not_grow_with_the_number_of_runs(tmp_path: Path) -> None:
    """Of this process, in which the runs are done; the first hundred fill the caches."""
    written(tmp_path, range(600), text=PLAN.replace('"no-fault", ', ""))
    plan = load_plan(tmp_path / "plan.toml")
    tasks = [
        {"key": r.key, "digest": "", "spec": r.spec, "ssp": str(tmp_path / "test.ssp")} for r in plan.runs
    ]
    work(tasks[:100])
    before = _resident_kb()
    work(tasks[100:])
    assert _resident_kb() - before < 4096


def _resident_kb() -> int:
    status = Path("/proc/self/status")
    if not status.is_file():
        pytest.skip("no /proc here")
    line = next(x for x in status.read_text().splitlines() if x.startswith("VmRSS"))
    return int(line.split()[1])


@pytest.mark.long
def test_a_dask_cluster_gives_the_same_results(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    written(tmp_path)
    expected = done(tmp_path, "expected").content_hash
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", scheduler_port=0, dashboard_address=None
    ) as cluster:
        campaign = done(tmp_path, scheduler=cluster.scheduler_address)
    assert (campaign.done, campaign.content_hash) == (12, expected)


def test_a_scheduler_that_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "SCHEDULER_S", "1s")
    written(tmp_path, [1])
    began = time.monotonic()
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1 "):
        done(tmp_path, scheduler="tcp://127.0.0.1:1")
    assert time.monotonic() - began < 60.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "needs [runs] or [[files]]"),
        ("x = [", "not valid TOML"),
        ("rums = 1", "unknown key rums; did you mean runs?"),
        ('keep = "some"\n[runs]\nscenarios = []', "keep = 'some'; valid: none, failed, worst, all"),
        ("[runs]", "runs: missing scenarios"),
        ('[runs]\nscenarios = ["four_target_2t"]', "unknown scenario 'four_target_2t'; did you mean"),
        ('[runs]\nscenarios = ["four_targets_2t"]\nsystems = ["real"]', "no system 'real'"),
        ('[runs]\nscenarios = ["four_targets_2t"]\ndraws = ["valid"]', "unknown set of draws 'valid'"),
        (
            '[runs]\nscenarios = ["four_targets_2t"]\ndraws = ["validation-99"]',
            "draw 99 of set validation: valid are",
        ),
        ('[runs]\nscenarios = ["four_targets_2t"]\ndraws = ["test-1"]', "the test set is sealed"),
        ('[runs]\nscenarios = ["four_targets_2t"]\nfaults = ["x"]', "faults: no set 'x'; valid: no-fault"),
        ('[runs]\nscenarios = ["four_targets_2t"]\ncontrollers = ["bang"]', "no controller 'bang'"),
        ('[[files]]\npath = "none.ssp"\nstop_s = 1.0', "files.1: there is no file none.ssp"),
        ('[[files]]\npath = "test.ssp"\nstop_s = -1.0', "stop_s = -1: must be above 0"),
        ('[[files]]\npath = "test.ssp"\nstop_s = 1.0\n' * 2, "two runs have the key test/no-fault/1"),
        (
            '[[files]]\npath = "test.ssp"\nstop_s = 1.0\n[[faults.a]]\nkind = "bias"',
            "faults.a.1: missing target",
        ),
    ],
)
def test_mistakes_in_a_plan_are_named(tmp_path: Path, text: str, words: str) -> None:
    write_ssp(tmp_path, OSCILLATOR, ["position", "speed"])
    path = tmp_path / "plan.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_plan(path)
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) <= 2


def test_an_unknown_key_is_refused_before_anything_runs(tmp_path: Path) -> None:
    written(tmp_path, [1])
    with pytest.raises(InputError, match=r"no run 'test/noisy/9'; did you mean test/noisy/1"):
        done(tmp_path, only=["test/noisy/9"])
    assert not (tmp_path / "out").exists()
