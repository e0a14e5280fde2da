"""Collection plans: what they stand for, and every mistake named."""

import re
from pathlib import Path

import pytest

from learning.collection.collect import pilot
from learning.collection.draws import Draws
from learning.collection.excitation import LEAD_S, SHAPES, wanted
from learning.collection.plan import FOLDER, KINDS, PERIOD_S, clearance, load_plan
from specs import draws
from specs.errors import InputError

TINY = (FOLDER / "tiny.toml").read_text()


def test_the_papers_mix_in_minutes():
    plan = load_plan(Path("paper"))
    minutes = {"excitation": 0.0, "driving": 0.0, "closed_loop": 0.0}
    for r in plan.recordings:
        if r.split == "train":
            minutes[r.kind if r.kind in minutes else "excitation"] += r.seconds / 60
    assert minutes == pytest.approx({"excitation": 56.0, "driving": 7.0, "closed_loop": 16.0})
    for split in ("validation", "test"):
        kinds = [r.kind for r in plan.recordings if r.split == split and r.part != "figure"]
        assert all(kinds.count(kind) >= 2 for kind in KINDS if kind != "replay")


def test_each_recording_stands_in_one_split_with_a_pose_of_its_own_off_the_keep_out():
    plan = load_plan(Path("paper"))
    poses = {(r.q_boom, r.q_stick) for r in plan.recordings}
    assert len(poses) == len(plan.recordings)
    assert len({r.name for r in plan.recordings}) == len(plan.recordings)
    for r in plan.recordings:
        assert clearance(r.q_boom, r.q_stick).min() > plan.limits.keepout_margin_m
        assert plan.limits.boom_rad[0] <= r.q_boom <= plan.limits.boom_rad[1]
        assert plan.limits.stick_rad[0] <= r.q_stick <= plan.limits.stick_rad[1]


def test_a_further_part_changes_no_other_recording(tmp_path):
    path = tmp_path / "more.toml"
    more = '[parts.more]\nkind = "steps"\nrecording_s = 4.0\nrecordings = { train = 2 }\n\n[parts.steps]'
    path.write_text(TINY.replace("[parts.steps]", more))
    one, other = load_plan(Path("tiny")), load_plan(path)
    before = {(r.part, r.split): one.digest(r) for r in one.recordings}
    after = {(r.part, r.split): other.digest(r) for r in other.recordings if r.part != "more"}
    assert after == before


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("seed = 1", "sead = 1", "unknown key sead"),
        ("period_s = [1.0, 3.0]", "priod_s = [1.0, 3.0]", "unknown key parts.steps.priod_s"),
        ('kind = "steps"', 'kind = "jumps"', "parts.steps.kind"),
        ("tool_swing_rad = 0.6", "", "missing limits.tool_swing_rad"),
        ("boom_rad = [0.8, 1.4]", "boom_rad = [0.2, 1.4]", "within the joint's 0.6 … 1.5 rad"),
        ("period_s = [1.0, 3.0]", "loads_kg = [9000.0]", "loads_kg"),
        ("period_s = [1.0, 3.0]", "amplitude = [0.5, 1.5]", "amplitude"),
        ("recording_s = 8.0", "recording_s = 8.03", "a multiple of 0.1 s"),
        ("period_s = [1.0, 3.0]", "radius_m = [3.0, 3.5]", "parts.steps: no pose"),
        ("period_s = [1.0, 3.0]", "boom_rad = [0.7, 0.75]", "parts.steps.boom_rad"),
        ("seed = 1", "seed = 1\ntrain_min = 3.0", "but the recordings add up to"),
        ("{ train = 1,", "{ trian = 1,", "trian"),
    ],
)
def test_a_mistake_in_a_plan_is_named(tmp_path, old, new, said):
    path = tmp_path / "plan.toml"
    assert old in TINY
    path.write_text(TINY.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        load_plan(path)
    assert said in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_an_unknown_plan_names_the_known_ones():
    with pytest.raises(InputError, match=r"papr.*did you mean paper"):
        load_plan(Path("papr"))


@pytest.mark.parametrize("which", ["tuning", "tuning:99", "tuning:-1", "test:0", "mine", ""])
def test_an_unknown_or_sealed_machine_is_refused(which):
    with pytest.raises(InputError):
        draws.named(which)


def test_machines_are_the_draws_of_the_specs():
    assert draws.named("nominal") == {}
    assert draws.named("tuning:1") != draws.named("validation:1")


@pytest.mark.parametrize("kind", SHAPES)
def test_excitation_begins_at_rest_keeps_its_range_and_goes_both_ways(kind):
    plan = load_plan(Path("paper"))
    chosen = [r for r in plan.recordings if r.kind == kind and r.split == "train"]
    amplitude = plan.parts[chosen[0].part].amplitude
    lead, ways = round(LEAD_S / PERIOD_S), set()
    for recording in chosen:
        commands = wanted(plan.parts[recording.part], recording, plan.limits, plan.seed)
        assert commands.shape == (recording.periods, 3)
        assert not commands[:lead].any()
        assert abs(commands[:, 0]).max() <= amplitude[1]
        assert abs(commands[:, 1:]).max() <= 0.2 + 1e-12
        assert commands[:, 1:].any() == (kind == "random_references")
        ways |= {bool(u > 0) for u in commands[:, 0] if abs(u) > 0.2}
    assert ways == {True, False}


def test_random_numbers_belong_to_their_key():
    first, again, other = Draws("a", 1), Draws("a", 1), Draws("a", 2)
    one = [first.normal() for _ in range(500)]
    assert one == [again.normal() for _ in range(500)]
    assert one != [other.normal() for _ in range(500)]
    assert sum(one) / 500 == pytest.approx(0.0, abs=0.15)
    assert (sum(x * x for x in one) / 500) ** 0.5 == pytest.approx(1.0, abs=0.15)


def replay(tmp_path: Path, commands: str, kind: str = "replay") -> Path:
    """A plan of one part of 2 s with these commands."""
    limits = TINY.split("[limits]")[1].split("[gains]")[0]
    path = tmp_path / "plan.toml"
    path.write_text(
        f'name = "own"\ndescription = "one"\n[limits]{limits}\n[parts.own]\nkind = "{kind}"\n'
        f"recording_s = 2.0\nrecordings = {{ train = 1 }}\n{commands}\n"
    )
    return path


def test_a_replay_tells_the_machine_what_the_plan_states(tmp_path):
    values = [round(0.05 * k, 2) for k in range(20)]
    plan = load_plan(replay(tmp_path, f"commands = {{ u_slew = {values} }}"))
    told = pilot(plan, plan.recordings[0])
    assert [told(k, {}).u_slew for k in range(20)] == values
    assert {told(k, {}).qd_boom_ref for k in range(20)} == {0.0}


@pytest.mark.parametrize(
    ("commands", "kind", "said"),
    [
        ("commands = { u_slew = [0.1, 0.2] }", "replay", "u_slew: 2 values; recording_s = 2 has 20 periods"),
        (f"commands = {{ u_slew = {[1.5] * 20} }}", "replay", "u_slew: must stay within ±1"),
        (f"commands = {{ qd_boom_ref = {[0.5] * 20} }}", "replay", "qd_boom_ref: must stay within ±0.2"),
        (f"commands = {{ u_boom = {[0.5] * 20} }}", "replay", "u_boom"),
        (
            f"commands = {{ u_slew = {[0.5] * 20} }}",
            "steps",
            "commands: a replay has them, and no other kind",
        ),
        ("", "replay", "commands: a replay has them, and no other kind"),
    ],
)
def test_commands_that_cannot_be_replayed_are_named(tmp_path, commands, kind, said):
    with pytest.raises(InputError, match=re.escape(said)):
        load_plan(replay(tmp_path, commands, kind))
