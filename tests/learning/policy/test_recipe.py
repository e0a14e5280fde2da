"""What a recipe may be: kinds, ranges and what belongs together; and what `--set` and a budget make of it."""

from dataclasses import fields, replace

import pytest

from learning.policy import valid
from learning.policy.recipe import RECIPES, TINY, Randomisation, Recipe, recipe
from learning.policy.session import Options, changes
from learning.policy.simulation.rewards import Shape
from specs.errors import InputError

TEACHER = ("privileged=true", "network=")


def chosen(*words: str, name: str = "full", budget: str = "full") -> Recipe:
    """The recipe of these `--set` words."""
    return Options("full", name, budget=budget, changed=changes(words)).chosen()


def test_every_field_has_a_rule() -> None:
    """A field that is added later is checked, too."""
    apart = {"name", "why", "task", "network"}  # words of their own
    assert set(valid.RECIPE) == {f.name for f in fields(Recipe)} - apart
    assert set(valid.RANDOM) == {f.name for f in fields(Randomisation)}
    assert set(valid.WIDTHS) == {f.name for f in fields(Shape)}


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("history=0", "history = 0: valid is a whole number from 1 to 20"),
        ("history=21", "history = 21"),
        ("history=5.0", "history = 5.0"),
        ("rate=abc", "rate = 'abc': valid is a number above 0"),
        ("rate=0", "rate = 0:"),
        ("rate=NaN", "rate = nan"),
        ("rate=1e400", "rate = inf"),
        ("rate=1e39", "up to 1e\\+30"),
        ("prior=foo", "prior = 'foo': valid is pd, parabola, gentle, or none"),
        ("method=sac", "method = 'sac': valid is ppo, gradient"),
        ("schedule=linear", "schedule = 'linear'"),
        ("network=recurrent", "no network 'recurrent'"),
        ("layers=64", r"layers = 64: valid is \[N"),
        ("layers=[]", "layers ="),
        ("layers=[64,0]", "layers ="),
        ("layers=[64,true]", "layers ="),
        ("envs=0", "envs = 0"),
        ("envs=true", "envs = True"),
        ("envs=abc", "envs = 'abc'"),
        ("iterations=0", "iterations = 0"),
        ("episode_s=0.01", "episode_s = 0.01: valid is a number from 0.1"),
        ("spatial=1", "spatial = 1: valid is true or false"),
        ("fade=1.5", "fade = 1.5"),
        ("ahead_s=1", "ahead_s = 1: valid is a number from 0 to 0.9"),
        ("quiet=sway", 'quiet = \'sway\': valid is a list'),
        ('late_terms=["swya"]', "late_terms"),
        ("late_terms=[{}]", "late_terms"),
        ("weights=3", "weights = 3: valid is weights.TERM=NUMBER"),
        ("weights.sway=abc", "weights.sway = 'abc': valid is a number"),
        ("weights.swya=1", "no reward term 'swya'; did you mean sway"),
        ("random=abc", "random = 'abc'"),
        ("random.load=abc", r"random.load = 'abc': valid is \[LOW,HIGH\]"),
        ("random.load=5", "random.load = 5"),
        ("random.load=[2000,0]", "random.load"),
        ("random.oil_hz=[-1,-1]", "random.oil_hz"),
        ("random.latency=[0,6]", "random.latency .* from 0 to 5"),
        ("random.load_told=2", "random.load_told = 2"),
        ("first.balance_m=0", "first.balance_m = 0"),
        ("last=1", "last = 1"),
        ("asymmetric=true", "asymmetric is for --set method=ppo; by gradient"),
        ("mixed=true", "mixed is for --set method=ppo"),
        ("mirrored=true", "mirrored is for --set method=ppo"),
        ("critic_first=0.1", "critic_first is for --set method=ppo"),
        ("critic_first=2", "critic_first = 2: valid is a number from 0 to 1"),
        ("ending=-1", "ending is for --set method=ppo"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("budget", ["full", "short", "tiny"])
def test_a_wrong_value_is_refused_with_what_is_valid(word: str, named: str, budget: str) -> None:
    """Before anything is trained, and whatever the budget."""
    with pytest.raises(InputError, match=named):
        chosen(word, budget=budget)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("privileged=true",), "privileged is for --set method=gradient; by ppo"),
        (("teacher=out",), "teacher is for --set method=gradient"),
        (("batches=100", "envs=4", "steps=2"), "batches = 100: valid is up to envs x steps, 8"),
    ],
)
def test_what_ppo_does_not_heed_is_refused(words: tuple[str, ...], named: str) -> None:
    with pytest.raises(InputError, match=named):
        chosen(*words, name="paper")


def test_a_teacher_has_none_itself() -> None:
    assert chosen(*TEACHER).privileged
    with pytest.raises(InputError, match="has no teacher itself"):
        chosen(*TEACHER, "teacher=out")


@pytest.mark.parametrize("word", ["name=mine", "why=so", "speed=1"])
def test_what_is_no_field_to_set_is_refused(word: str) -> None:
    with pytest.raises(InputError, match=f"no field '{word.split('=')[0]}'"):
        changes([word])


def test_a_group_is_set_by_its_parts() -> None:
    with pytest.raises(InputError, match=r"valid is weights\.NAME=VALUE"):
        changes(["weights=3", "weights.sway=1"])


def test_what_is_set_wins_over_the_budget() -> None:
    """The rest of it is cut down."""
    tiny = chosen("envs=7", "iterations=5", budget="tiny")
    assert (tiny.envs, tiny.iterations) == (7, 5)
    assert (tiny.episode_s, tiny.steps) == (TINY["episode_s"], TINY["steps"])
    assert chosen(budget="tiny").envs == TINY["envs"]
    assert chosen("iterations=500", budget="short").iterations == 500
    assert chosen("envs=7", budget="short").iterations == RECIPES["full"].iterations // 5


def test_nominal_machines_are_a_recipe() -> None:
    """Ranges that leave the nominal value are valid where there is one."""
    assert replace(recipe("full"), random=Randomisation().off()).random.dead_band == valid.ABSENT
