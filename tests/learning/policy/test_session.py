"""Trainings end to end, small: files, going on along the same curve, and what stops them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from fmus.models.slew_nn.untrained import untrained
from learning.policy import export, session
from learning.policy.curve import NAME
from learning.policy.gradient import GradientTrainer
from learning.policy.recipe import recipe
from learning.policy.session import Options
from learning.policy.simulation.environment import POSE
from learning.policy.simulation.situation import hidden
from learning.policy.valid import ABSENT
from specs.errors import InputError, RunError

SMALL: dict[str, Any] = {
    "envs": 8, "iterations": 4, "episode_s": 0.5, "layers": (8,), "steps": 4, "epochs": 1, "batches": 1,
}  # fmt: skip


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small slew network."""
    path = tmp_path_factory.mktemp("networks") / "small.npz"
    untrained(1, residual=True).save(path)
    return path


def options(network: Path, out: Path, recipe: str, **more: Any) -> Options:
    """A short training."""
    task = "slew" if "slew" in recipe else "full"
    return Options(
        task, recipe, networks=(network,), out=out, changed={**SMALL, **more.pop("changed", {})}, **more
    )


def curve(out: Path) -> list[dict[str, float]]:
    """The learning curve."""
    return [json.loads(line) for line in (out / NAME).read_text().splitlines()]


def quiet(what: str, done: float, total: float) -> None:
    """No progress."""


@pytest.mark.parametrize("recipe", [pytest.param("full", marks=pytest.mark.long), "slew", "paper"])
def test_a_killed_training_goes_on_along_the_same_curve(recipe: str, network: Path, tmp_path: Path) -> None:
    """Two iterations, then the rest from the checkpoint: every figure and the policy as if in one go."""
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    more = {"changed": {"consecutive": 0.5, "swinging": 0.5, "asymmetric": recipe == "paper"}}
    done = session.run(options(network, whole, recipe, **more), quiet)
    first = session.run(options(network, parts, recipe, **more, stop_after=2), quiet)
    assert first["iterations"] == 2
    assert not first["policy"]
    with (parts / NAME).open("a") as file:
        file.write('{"iteration": 3, "rew')  # ended while it wrote a line
    second = session.run(options(network, parts, recipe, **more), quiet)
    assert second["resumed_at"] == 2
    assert curve(parts) == curve(whole)
    one, other = (export.read(Path(d["policy"])) for d in (done, second))
    for a, b in zip(one.weights, other.weights, strict=True):
        assert (a[0] == b[0]).all()
        assert (a[1] == b[1]).all()
    assert one.contract.made["seed"] == 1
    assert "slewright train policy" in one.contract.made["command"]
    assert one.contract.made["processor_s"] == done["processor_s"]
    assert second["processor_s"] > first["processor_s"] > 0
    assert one.contract.data_sha256 == session.digest([network])
    assert any(whole.glob("events*"))


def test_learning_improves_the_reward(network: Path) -> None:
    """By the gradient: the first episode of a seed once more, with what was learnt on others since."""
    chosen = recipe("full", iterations=20, rate=0.005, curriculum=0.0, episode_s=3.0, envs=64)
    first, again = (session.make_trainer(chosen, [network], 1) for _ in range(2))
    before = first.iterate()["reward"]
    for _ in range(19):
        first.iterate()
    again.mlp.load_state_dict(first.mlp.state_dict())
    assert again.iterate()["reward"] > before + 0.02


def test_a_reward_that_is_no_number_stops_and_keeps_the_last_good(
    network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The term is named; the checkpoint is that of before, and still loads."""
    session.run(options(network, tmp_path, "full", stop_after=2), quiet)
    kept = (tmp_path / "checkpoint.pt").read_bytes()
    weighed = GradientTrainer.rewards

    def broken(self: Any, *args: Any) -> Any:
        rewards = weighed(self, *args)
        return rewards | {"closing": rewards["closing"] * float("nan")}

    with monkeypatch.context() as patch:
        patch.setattr(GradientTrainer, "rewards", broken)
        with pytest.raises(RunError, match=r"reward term closing is .*checkpoint\.pt"):
            session.run(options(network, tmp_path, "full"), quiet)
    assert (tmp_path / "checkpoint.pt").read_bytes() == kept
    assert session.run(options(network, tmp_path, "full"), quiet)["resumed_at"] == 2


def test_trained_ranges_hold_all_that_is_drawn(network: Path) -> None:
    """Also below zero; what is not drawn (the nominal dead band) is left out."""
    chosen = recipe("full", envs=4, layers=(8,), random={"dead_band": ABSENT})
    found = session.ranges(session.make_trainer(chosen, [network], 1), chosen)
    assert found["q_stick"] == POSE["stick"]
    assert found["slew_error"] == (-2.5, 2.5)
    assert "slew_dead_band" not in found


def test_checkpoints_of_another_training_are_refused(network: Path, tmp_path: Path) -> None:
    """Another layout, recipe, seed or slew network; a file that is none."""
    session.run(options(network, tmp_path, "full", stop_after=1), quiet)
    for more, named in (
        ({"changed": {"history": 3}}, "layout|history"),
        ({"changed": {"rate": 0.5}}, "recipe: rate"),
        ({"seed": 2}, "seed"),
    ):
        with pytest.raises(InputError, match=f"checkpoint of another.*({named})"):
            session.run(options(network, tmp_path, "full", **more), quiet)
    other = tmp_path / "other.npz"
    untrained(2, residual=True).save(other)
    with pytest.raises(InputError, match="set of slew networks"):
        session.run(options(other, tmp_path, "full"), quiet)
    (tmp_path / "checkpoint.pt").write_bytes(b"nothing")
    with pytest.raises(InputError, match="no readable checkpoint"):
        session.run(options(network, tmp_path, "full"), quiet)
    (tmp_path / "checkpoint.pt").unlink()
    (tmp_path / "checkpoint.pt").mkdir()
    with pytest.raises(InputError, match=r"checkpoint\.pt is a folder"):
        session.run(options(network, tmp_path, "full"), quiet)


def test_wrong_words_are_refused(network: Path, tmp_path: Path) -> None:
    """Task, recipe of another task, budget, field; a slew network without pressures or of another history."""
    with pytest.raises(InputError, match="recipe slew is for task slew"):
        Options("full", "slew").chosen()
    with pytest.raises(InputError, match="no budget 'ful'"):
        Options("full", budget="ful").chosen()
    with pytest.raises(InputError, match="no field 'speed'"):
        session.changes(["speed=1"])
    assert session.changes(["envs=64", "weights.action=0.5"]) == {"envs": 64, "weights": {"action": 0.5}}
    words = ["random.pace=[0.5,1.5]", "last.settle_rad=0.1", "prior=parabola"]
    told = session.changes(words)
    assert told["random"] == {"pace": (0.5, 1.5)}
    assert session.Options(changed=told).command.endswith(" ".join(f"--set {w}" for w in words))
    assert session.Options(changed=told).chosen().random.pace == (0.5, 1.5)
    assert " --device cpu --set" in session.Options(changed=told, device="cpu").command
    assert "--device" not in session.Options(changed=told).command
    with pytest.raises(InputError, match="no 'paces' in random"):
        session.Options(changed=session.changes(["random.paces=[1,2]"])).chosen()
    with pytest.raises(InputError, match=r"none\.npz"):
        session.run(Options("full", networks=(tmp_path / "none.npz",), out=tmp_path / "x"), quiet)
    with pytest.raises(InputError, match="envs = 1: valid is from 2"):
        session.run(Options("full", networks=(network,) * 2, out=tmp_path / "x", changed={"envs": 1}), quiet)
    assert not (tmp_path / "x").exists()
    good = untrained(1)
    cut = (good.velocity[0].weights[0][:, :31], *good.velocity[0].weights[1:])
    replace(good, velocity=(replace(good.velocity[0], weights=cut),)).save(tmp_path / "short.npz")
    with pytest.raises(InputError, match="velocity network of 31 inputs; with a history of 10 it has 41"):
        session.run(Options("full", networks=(tmp_path / "short.npz",), out=tmp_path / "x"), quiet)


def test_training_leaves_one_thread(network: Path, tmp_path: Path) -> None:
    """A seed is a core's."""
    session.run(options(network, tmp_path, "slew", stop_after=1), quiet)
    assert torch.get_num_threads() == 1


def test_products_in_bfloat16_learn_nearly_the_same(network: Path) -> None:
    """One update of PPO in mixed precision moves the weights along those of single precision."""
    moved = []
    for mixed in (False, True):
        chosen = recipe("paper", envs=64, steps=8, epochs=1, batches=1, layers=(32,), mixed=mixed)
        trainer = session.make_trainer(chosen, (network,), 1)
        before = [p.detach().clone() for p in trainer.mlp.parameters()]
        trainer.iterate()
        after = trainer.mlp.parameters()
        moved.append(torch.cat([(b - a).detach().flatten() for a, b in zip(before, after, strict=True)]))
    assert float(torch.nn.functional.cosine_similarity(*moved, dim=0)) > 0.9


def test_a_student_is_held_to_a_teacher_that_is_not_exported(network: Path, tmp_path: Path) -> None:
    """The nearer to its teacher's answers the more that counts; a folder without one is refused."""
    small = {"iterations": 8, "envs": 32, "episode_s": 1.0, "layers": (16, 16), "network": ""}
    told = {**small, "privileged": True}
    done = session.run(options(network, tmp_path / "teacher", "full", changed=told), quiet)
    assert not done["policy"]
    assert not list((tmp_path / "teacher").glob("*.onnx"))
    apart = []
    for imitation in (0.0, 100.0):
        student = recipe("full", **small, teacher=str(tmp_path / "teacher"), imitation=imitation, rate=0.01)
        trainer = session.make_trainer(student, [network], 2)
        for _ in range(student.iterations):
            trainer.iterate()
        s = trainer.environment.fresh()
        seen = trainer.interface.features(trainer.environment.observe(s))
        wanted = trainer.teacher(torch.cat([seen, hidden(s)], dim=1)) if trainer.teacher else 0.0
        apart.append(float((trainer.mlp(seen) - wanted).square().sum(1).mean().detach()))
    assert apart[1] < 0.7 * apart[0]
    with pytest.raises(InputError, match="privileged=true"):
        session.make_trainer(recipe("full", **small, teacher=str(tmp_path)), [network], 1)
    with pytest.raises(InputError, match="plain network"):
        recipe("full", privileged=True, network="mirror")
    with pytest.raises(InputError, match="PPO's network"):
        recipe("paper", network="convolution")


def test_plants_to_train_on_have_a_name(network: Path) -> None:
    """Each stands for files; none that a training could not run on, and not beside other networks."""
    for plant, files in session.PLANTS.items():
        told = Options("full", "paper", plant=plant)
        assert told.drives(told.chosen()) == files
        assert f"--plant {plant}" in told.command
    assert session.PLANTS["published"] != session.PLANTS["networks"]
    both = Options(plant="published", networks=(network,))
    for wrong, named in (
        (Options(plant="machine"), "valid: networks, published"),
        (Options(plant=str(network.parent)), "valid: networks, published"),
        (both, "excludes"),
    ):
        with pytest.raises(InputError, match=named):
            wrong.drives(wrong.chosen())


def test_an_imported_plant_is_trained_on_if_it_says_its_inertia_number(tmp_path: Path) -> None:
    """By its file or folder; else with the project's number, when that is asked for."""
    folder = tmp_path / "stranger"
    folder.mkdir()
    stranger = replace(untrained(1, residual=True), meta={"imported": ["p.pth", "w.pth"]})
    stranger.save(folder / "weights.npz")
    told = Options(recipe="slew", task="slew", plant=str(folder))
    (path,) = told.drives(told.chosen())
    assert replace(told, plant=str(path)).drives(told.chosen()) == (path,)
    chosen = recipe("slew", **SMALL)
    with pytest.raises(InputError, match="--our-inertia"):
        session.make_trainer(chosen, [path], 1)
    with pytest.raises(InputError, match="--our-inertia"):
        session.run(replace(told, out=tmp_path / "out"), lambda said: None)
    assert not (tmp_path / "out").exists()  # what is refused leaves no folder
    assert session.make_trainer(chosen, [path], 1, our_inertia=True)
    assert replace(told, our_inertia=True).command.endswith(" --our-inertia")
    stranger.told_in_our_inertia(0.8, 0.0).save(path)
    assert session.make_trainer(chosen, [path], 1)


def test_an_early_end_is_worth_what_the_recipe_says(network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every step costs, an end that is worth nothing is the best there is: it has to cost as well."""
    earned = {}
    for ending in (0.0, -8.0):
        chosen = recipe("paper", **{**SMALL, "ending": ending})
        trainer = session.make_trainer(chosen, [network], 1)
        over = torch.arange(trainer.environment.n) < 3
        monkeypatch.setattr(trainer.environment, "ended", lambda s, over=over: over)
        found = []
        monkeypatch.setattr(
            trainer.algorithm,
            "process_env_step",
            lambda o, r, d, e, f=found: f.append((r, d, e["time_outs"])),
        )
        monkeypatch.setattr(trainer.algorithm, "compute_returns", lambda o: None)
        monkeypatch.setattr(trainer.algorithm, "update", lambda: {})
        trainer.iterate()
        reward, done, timed = found[0]
        assert bool(done[over].all())
        assert not bool(timed[over].any())
        earned[ending] = reward
    assert (earned[-8.0] - earned[0.0]).tolist() == pytest.approx([-8.0] * 3 + [0.0] * 5, abs=1e-5)


def test_a_gpu_is_for_ppo_and_only_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for able, wanted in ((False, ("cpu", "cpu")), (True, ("cuda", "cpu"))):
        monkeypatch.setattr(torch.cuda, "is_available", lambda able=able: able)
        assert tuple(session.device_of("auto", recipe(name)) for name in ("paper", "full")) == wanted
    assert session.device_of("cuda", recipe("full")) == "cuda"
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(InputError, match="no GPU here"):
        session.device_of("cuda", recipe("paper"))
    with pytest.raises(InputError, match="auto, cpu, cuda"):
        session.device_of("tpu", recipe("paper"))


def test_a_family_goes_on_from_a_policy_and_keeps_its_limit(network: Path, tmp_path: Path) -> None:
    """Its weights are where training begins; the limit is in the contract; another network is refused."""
    small = {"layers": (8, 4), "network": "mirror"}
    told = options(network, tmp_path / "a", "family", changed={**small, "start": ""})
    first = Path(session.run(told, quiet)["policy"])
    assert export.read(first).contract.change == recipe("family").change
    told = options(network, tmp_path / "b", "family", changed={**small, "start": str(first), "rate": 1e-30})
    second = export.read(Path(session.run(told, quiet)["policy"]))
    for (a, _), (b, _) in zip(export.read(first).weights, second.weights, strict=True):
        assert a == pytest.approx(b, abs=1e-6)
    with pytest.raises(
        InputError, match=r"start .*full.onnx: not a full policy of history 5, .*layers \[8, 4\]"
    ):
        session.run(
            options(network, tmp_path / "c", "family", changed={**small, "start": "full.onnx"}), quiet
        )
