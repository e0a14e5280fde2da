"""PPO by rsl-rl-lib on the batched environment: its algorithm and storage, our loop around them.

Our loop, because a run that is killed must go on along the same learning curve: a checkpoint holds the
machines, all generators and the algorithm.  The critic may see what no sensor tells (`Recipe.asymmetric`).
"""

import contextlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor, nn

from fmus.models.slew_nn.network import SlewNetwork
from learning.policy.features import mirrored
from learning.policy.gradient import begin
from learning.policy.recipe import Recipe
from learning.policy.simulation.kernel import Tanh
from learning.policy.simulation.situation import Situation, hidden, hidden_mirrored
from learning.policy.trainer import Trainer
from specs.policy import SPACING_S

SPARE = 10  # steps for which a set of fresh starts is drawn from


class PpoTrainer(Trainer):
    """One seed of a recipe, trained by PPO."""

    def __init__(
        self, recipe: Recipe, networks: Sequence[SlewNetwork], seed: int, device: str = "cpu"
    ) -> None:
        from rsl_rl.algorithms import PPO

        super().__init__(recipe, networks, seed, device)
        e = self.environment
        with torch.no_grad():
            fresh = e.fresh()
            start = (e.uniform(0.0, 1.0) * e.periods).long()  # so that episodes do not all end together
            self.now, self.spare, self.steps = replace(fresh, age=start), fresh, 0
        self.num_envs, self.num_actions, self.cfg = e.n, self.interface.outputs, {}
        with contextlib.redirect_stdout(io.StringIO()):  # it prints its networks
            self.algorithm = PPO.construct_algorithm(self._seen(self.now), self, _settings(recipe), device)  # type: ignore[arg-type]
        self.mlp: nn.Sequential = self.algorithm.actor.mlp
        if recipe.start:
            begin(self.mlp, recipe, self.interface)
        elif recipe.prior:  # begin with the prior's own answers, as the other method does
            with torch.no_grad():
                self.mlp[-1].weight.mul_(0.05)  # type: ignore[operator]
        if recipe.mixed:
            self._hasten()
        self.algorithm.train_mode()

    def iterate(self) -> dict[str, float]:
        """`recipe.steps` steps of all machines and an update."""
        terms: dict[str, Tensor] = {}
        none = torch.zeros((), device=self.device)
        unknown, ended = none, none
        ends: list[dict[str, float]] = []
        with torch.no_grad():
            seen = self._seen(self.now)
            for _ in range(self.recipe.steps):
                with torch.autocast(self.device, torch.bfloat16, enabled=self.recipe.mixed):
                    action = self.algorithm.act(seen).float()
                step = self.play(self.now, action, self._observation, leak=0.0)
                after, rewards = step.after, self.rewards([step])
                reward: Any = sum(rewards.values())
                if not bool(torch.isfinite(reward).all()):
                    self.check(rewards, [step])
                for name, value in rewards.items():
                    terms[name] = terms.get(name, none) + value.mean()
                over = self.environment.ended(after)
                unknown = unknown + self.environment.unknown(after).float().mean()
                ended = ended + over.float().mean()
                late = (after.age >= self.environment.periods) & ~over
                if bool(late.any()):
                    ends.append(self._ends(after, late))
                self.now = self._renewed(after, over, late)
                seen = self._seen(self.now)
                earned = reward * SPACING_S + self.recipe.ending * over
                self.algorithm.process_env_step(seen, earned, over | late, {"time_outs": late.float()})
            self.algorithm.compute_returns(seen)
        self.algorithm.actor.requires_grad_(self.progress >= self.recipe.critic_first)
        told = self.algorithm.update()
        losses = {f"loss/{k}": float(v) for k, v in told.items() if v is not None}
        self.check_update(losses, {"actor": self.algorithm.actor, "critic": self.algorithm.critic})
        self.done += 1
        means = {k: sum(d[k] for d in ends) / len(ends) for k in ends[0]} if ends else {}
        return self.report(terms, self.recipe.steps, unknown, ended) | means | losses

    def _hasten(self) -> None:
        """The same update in less time: one operation for all of Adam, a quicker tanh."""
        for model in (self.algorithm.actor, self.algorithm.critic):
            for place, layer in enumerate(model.mlp):
                if isinstance(layer, nn.Tanh):
                    model.mlp[place] = Tanh()
        for group in self.algorithm.optimizer.param_groups:
            group["foreach"], group["fused"] = False, True

    def _ends(self, s: Situation, which: Tensor) -> dict[str, float]:
        error = self.environment.error(s).norm(dim=0)[which].mean()
        return {
            "end_error_m": float(error),
            "end_slew_error_deg": float(torch.rad2deg(s.state.q[which].abs().mean())),
        }

    def _renewed(self, s: Situation, over: Tensor, late: Tensor) -> Situation:
        """New episodes where one is over: fresh, or for a share going on with a new target."""
        e = self.environment
        self.steps += 1
        if self.steps % SPARE == 0:
            self.spare = e.fresh()
        go_on = late & (e.uniform(0.0, 1.0) < self.recipe.consecutive)
        found = s.take(self.spare, (over | late) & ~go_on)
        return found.take(e.retargeted(s), go_on) if self.recipe.consecutive else found

    def _seen(self, s: Situation) -> Any:
        """The groups of observations that actor and critic see."""
        from tensordict import TensorDict

        self._observation = self.environment.observe(s)
        groups = {"policy": self.interface.features(self._observation)}
        if self.recipe.asymmetric:
            groups["hidden"] = hidden(s)
        return TensorDict(groups, batch_size=[self.environment.n], device=self.device)  # type: ignore[arg-type]

    def get_observations(self) -> Any:
        """For rsl-rl-lib."""
        return self._seen(self.now)

    def state(self) -> dict[str, Any]:
        """All that going on needs."""
        own = {"ppo": self.algorithm.save(), "now": self.now, "spare": self.spare, "steps": self.steps}
        return super().state() | own | {"rate": self.algorithm.learning_rate}

    def load(self, state: Mapping[str, Any]) -> None:
        """Go on where `state` was taken."""
        self.algorithm.load(state["ppo"], None, True)
        super().load(state)
        self.now, self.spare = (state[name].on(self.device) for name in ("now", "spare"))
        self.steps = state["steps"]
        self.algorithm.learning_rate = state["rate"]


def with_images(env: PpoTrainer, obs: Any, actions: Tensor | None) -> tuple[Any, Tensor | None]:
    """Observations [n] and actions [n, k] with their mirror images behind them, for rsl-rl-lib's symmetry."""
    from tensordict import TensorDict

    def turned(values: Tensor, end: str) -> Tensor:
        r = env.recipe
        return values * torch.tensor(mirrored(r.task, r.history, end, r.ahead), device=values.device)

    if obs is not None:
        images = {"policy": turned(obs["policy"], "inputs")}
        if "hidden" in obs.keys():  # noqa: SIM118 (a TensorDict is iterated by rows)
            images["hidden"] = hidden_mirrored(obs["hidden"])
        obs = torch.cat([obs, TensorDict(images, batch_size=obs.batch_size)])  # type: ignore[arg-type]
    return obs, None if actions is None else torch.cat([actions, turned(actions, "outputs")])


def _settings(r: Recipe) -> dict[str, Any]:
    """rsl-rl-lib's configuration."""
    network = {"class_name": "rsl_rl.models:MLPModel", "hidden_dims": list(r.layers), "activation": "tanh"}
    deviation = {
        "class_name": "GaussianDistribution", "init_std": r.deviation, "std_range": (r.deviation_least, 1e6),
    }  # fmt: skip
    mirror = {"data_augmentation_func": with_images, "use_data_augmentation": True}
    return {
        "num_steps_per_env": r.steps,
        "obs_groups": {"actor": ["policy"], "critic": ["policy", *(["hidden"] if r.asymmetric else [])]},
        "actor": {**network, "distribution_cfg": deviation},
        "critic": dict(network),
        "algorithm": {
            "class_name": "rsl_rl.algorithms:PPO", "num_learning_epochs": r.epochs,
            "num_mini_batches": r.batches, "clip_param": r.clip, "gamma": r.discount, "lam": r.trace,
            "entropy_coef": r.entropy, "learning_rate": r.rate, "schedule": r.schedule,
            "symmetry_cfg": mirror if r.mirrored else None,
            "value_loss_coef": 1.0, "use_mixed_precision": r.mixed, "max_grad_norm": r.norm,
        },
        "multi_gpu": None,
    }  # fmt: skip
