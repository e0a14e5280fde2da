"""Faults and parameter changes as scenario files and system descriptions state them."""

import copy
import re
from typing import Any

import pytest

from specs import scenario
from specs.errors import InputError
from specs.faults import (
    FOR_EVER,
    KINDS,
    Change,
    Fault,
    by_tick,
    from_attributes,
    read_faults,
    seed_of,
)
from specs.schema import ROOT, read_toml

# One of each kind: the keys of its own, and what the core is to know it by.
ONE_OF_EACH: dict[str, tuple[dict[str, float], tuple[float, float]]] = {
    "stuck": ({"value": 3.0}, (3.0, 1.0)),
    "bias": ({"value": -0.5}, (-0.5, 0.0)),
    "drift": ({"rate_per_s": 0.1}, (0.1, 0.0)),
    "noise": ({"std": 2.0}, (2.0, 0.0)),
    "delay": ({"delay_s": 0.04}, (0.04, 0.0)),
    "dropout": ({"probability": 0.1, "mean_ticks": 5.0}, (0.1, 5.0)),
    "spike": ({"probability": 0.01, "size": 7.0}, (0.01, 7.0)),
    "quantise": ({"step": 0.25}, (0.25, 0.0)),
    "scale": ({"factor": 1.1}, (1.1, 0.0)),
    "saturate": ({"low": -1.0, "high": 2.0}, (-1.0, 2.0)),
    "fail": ({}, (0.0, 0.0)),
}


def entry(kind: str, /, **more: Any) -> dict[str, Any]:
    return {"target": "pi.q_slew", "kind": kind, "start_s": 1.0, **ONE_OF_EACH[kind][0], **more}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_its_keys_and_the_numbers_of_the_core(kind: str) -> None:
    (fault,) = read_faults([entry(kind)], "file: faults")
    assert fault.as_dict() == entry(kind)
    assert fault.values() == ONE_OF_EACH[kind][1]
    assert fault.ticks(0.02) == (50, FOR_EVER)
    assert str(fault).startswith(f"{kind} o")


def test_the_kinds_are_in_the_order_of_the_core() -> None:
    header = (ROOT.parent / "orchestrator/core/core.h").read_text()
    names = re.findall(
        r"SLW_([A-Z]+)", header[: header.index("} slw_fault_kind")].rpartition("typedef enum")[2]
    )
    assert [name.lower() for name in names if name != "N"] == [kind for kind in KINDS if kind != "fail"]


def test_what_may_be_left_out() -> None:
    assert Fault(target="a.x", kind="stuck").values() == (0.0, 0.0)
    assert Fault(target="a.x", kind="dropout", probability=0.5).values() == (0.5, 0.0)
    assert Fault(target="a.x", kind="bias", value=0.0).values() == (0.0, 0.0)
    assert Fault(target="a.x", kind="stuck", end_s=3.0).ticks(0.1) == (0, 30)


@pytest.mark.parametrize("kind", KINDS)
def test_xml_attributes_say_the_same_as_a_scenario(kind: str) -> None:
    text = {key: str(value) for key, value in entry(kind).items()}
    assert from_attributes(text, "x.ssd, line 7: Fault") == read_faults([entry(kind)], "f: faults")[0]


MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    "no such kind": (entry("bias", kind="bais"), r"kind: no fault 'bais'; valid: stuck, bias, .*fail"),
    "missing value": (entry("bias", value=None), r"bias: missing value"),
    "missing size": ({**entry("spike"), "size": None}, r"spike: missing size"),
    "missing target": ({"kind": "stuck"}, r"missing target"),
    "empty target": (entry("stuck", target=" "), r"target: empty"),
    "key of another kind": (entry("bias", std=1.0), r"std: not of a fault 'bias'; valid: .*end_s, value$"),
    "unknown key": (entry("bias", sigma=1.0), r"unknown key sigma"),
    "text": (entry("bias", value="much"), r"value: .*number.*'much'"),
    "not finite": (entry("bias", value=float("inf")), r"value: .*finite"),
    "negative start": (entry("bias", start_s=-1.0), r"start_s = -1: must not be negative"),
    "ends first": (entry("bias", end_s=1.0), r"end_s = 1: must be after start_s = 1"),
    "a failure that ends": (entry("fail", end_s=2.0), r"end_s: .*does not recover"),
    "probability": (entry("spike", probability=1.5), r"probability = 1.5: must be above 0 and at most 1"),
    "no probability": (entry("dropout", probability=0.0), r"probability = 0: must be above 0"),
    "mean_ticks": (entry("dropout", mean_ticks=0.5), r"mean_ticks = 0.5: must be at least 1"),
    "std": (entry("noise", std=0.0), r"std = 0: must be above 0"),
    "step": (entry("quantise", step=-1.0), r"step = -1: must be above 0"),
    "delay": (entry("delay", delay_s=0.0), r"delay_s = 0: must be above 0"),
    "upside down": (entry("saturate", low=3.0), r"low = 3: must not be above high = 2"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_name_file_key_and_valid_choices(mistake: str) -> None:
    data, message = MISTAKES[mistake]
    data = {key: value for key, value in data.items() if value is not None}
    with pytest.raises(InputError, match=rf"^my\.toml: faults\.2: {message}") as caught:
        read_faults([entry("stuck"), data], "my.toml: faults")
    assert "\n" not in str(caught.value)


def test_mistakes_in_xml_name_the_element() -> None:
    with pytest.raises(InputError, match=r"^x\.ssd, line 7: no attribute 'probabilty'; .*probability"):
        from_attributes({"target": "a.x", "kind": "spike", "probabilty": "1"}, "x.ssd, line 7")
    with pytest.raises(InputError, match=r"^x\.ssd, line 7: value: .*'a lot'"):
        from_attributes({"target": "a.x", "kind": "bias", "value": "a lot"}, "x.ssd, line 7")


def test_times_are_whole_steps() -> None:
    with pytest.raises(InputError, match=r"start_s = 0\.03: not a multiple of the step, 0\.02 s"):
        Fault(target="a.x", kind="stuck", start_s=0.03).ticks(0.02)
    with pytest.raises(InputError, match=r"delay_s = 0\.05: not a multiple"):
        Fault(target="a.x", kind="delay", delay_s=0.05).ticks(0.02)


def test_changes_by_tick() -> None:
    late = Change(parameter="machine.load_mass", at_s=2.0, value=500.0)
    early = Change(parameter="pi.on", at_s=0.1, value=True)
    twin = Change(parameter="pi.gain", at_s=2.0, value=2.0)
    assert by_tick([late, early, twin], 0.02) == {
        5: {"pi.on": True},
        100: {"machine.load_mass": 500.0, "pi.gain": 2.0},
    }
    with pytest.raises(InputError, match=r"at_s = 0\.05"):
        by_tick([Change(parameter="a.b", at_s=0.05, value=1.0)], 0.02)


def test_every_fault_of_every_run_has_a_seed_of_its_own() -> None:
    one = Fault(target="a.x", kind="noise", std=1.0)
    seeds = [
        seed_of(f, run, n)
        for f in (one, Fault(target="a.y", kind="noise", std=1.0))
        for run in (1, 2)
        for n in (0, 1)
    ]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed < 2**64 for seed in seeds)
    assert seed_of(one, 1, 0) == 8813785775559315491  # for good: recorded runs rest on it


def scenario_data(**more: Any) -> dict[str, Any]:
    return copy.deepcopy(read_toml(scenario.FOLDER / "four_targets.toml")) | more


def test_a_scenario_has_faults_and_changes() -> None:
    run = scenario.build(
        "mine",
        "2t",
        scenario_data(
            faults=[entry("noise"), entry("fail", target="machine")],
            changes=[{"parameter": "machine.load_mass", "at_s": 30.0, "value": 0.0}],
        ),
        "mine.toml",
    )
    assert [f.kind for f in run.faults] == ["noise", "fail"]
    assert run.parameter_changes() == {1500: {"machine.load_mass": 0.0}}


def test_the_shipped_scenarios_have_none() -> None:
    for name in scenario.names():
        assert scenario.load(name).faults == ()
        assert scenario.load(name).parameter_changes() == {}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"faults": [entry("bias", start_s=60.0)]}, r"faults\.1: start_s = 60: the run ends at 60 s"),
        (
            {"faults": [entry("bias", start_s=0.03)]},
            r"faults\.1: start_s = 0\.03: not a multiple of the step",
        ),
        ({"faults": {"kind": "bias"}}, r"faults: must be a list of tables, each headed \[\[faults\]\]"),
        (
            {"changes": [{"parameter": "mass", "at_s": 1.0, "value": 0}]},
            r"changes\.1: .*component\.parameter",
        ),
        (
            {"changes": [{"parameter": "a.m", "at_s": 99.0, "value": 0}]},
            r"changes\.1: at_s = 99: the run ends",
        ),
        ({"changes": [{"parameter": "a.m", "value": 0}]}, r"changes\.1: missing at_s"),
        (
            {"changes": [{"parameter": "a.m", "at_s": -1.0, "value": 0}]},
            r"changes\.1: at_s = -1: must not be",
        ),
    ],
)
def test_mistakes_in_a_scenario(more: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=rf"^mine\.toml: {message}"):
        scenario.build("mine", "2t", scenario_data(**more), "mine.toml")
