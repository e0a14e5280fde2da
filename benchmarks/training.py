"""What training costs: a step of the environment against its networks' matrix products, an iteration of PPO
against the same with rsl-rl-lib's update as it comes.  Interleaved blocks, processor time (on a GPU the
clock), paired medians.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from learning.policy.recipe import recipe
from learning.policy.session import NETWORKS, device_of, make_trainer
from learning.policy.simulation.plant import Plant
from specs.progress import Report

STEP_LIMIT, UPDATE_LIMIT = (
    1.4,
    1.5,
)  # a step over its products at most; an iteration of theirs over ours at least
MACHINES, STEPS = 1000, 5  # no power of two: rows that lie 4 KiB apart share a place in the cache
PPO: dict[str, Any] = {"envs": 1000, "steps": 12, "epochs": 5, "batches": 4}


def run(blocks: int, report: Report) -> dict[str, Any]:
    """Figures of both: medians, ratios with quartiles, and rates a processor second."""
    device = device_of("auto", recipe("paper"))
    stock, ours = (_trainer(device, mixed=mixed) for mixed in (False, True))
    trainer = _trainer(device, envs=MACHINES)
    step, products = _step(trainer), _products(trainer)
    jobs = {"step": step, "products": products, "stock": stock.iterate, "ours": ours.iterate}
    for job in jobs.values():
        job()
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for block in range(blocks):
        report("blocks", block, blocks)
        for name in list(jobs) if block % 2 else list(jobs)[::-1]:
            began = _now(device)
            jobs[name]()
            times[name].append(_now(device) - began)
    t = {name: np.array(values) for name, values in times.items()}
    samples = PPO["envs"] * PPO["steps"]
    return {
        "blocks": blocks, "device": device, "threads": torch.get_num_threads(),
        "environment": {
            **_ratio(t["step"], t["products"]), "limit": STEP_LIMIT,
            "steps_per_s": MACHINES * STEPS / float(np.median(t["step"])),
        },
        "ppo": {
            **_ratio(t["stock"], t["ours"]), "limit": UPDATE_LIMIT, "epochs": PPO["epochs"],
            "samples_per_s": samples / float(np.median(t["ours"])),
            "stock_samples_per_s": samples / float(np.median(t["stock"])),
        },
    }  # fmt: skip


def _trainer(device: str, **changed: Any) -> Any:
    return make_trainer(recipe("paper", **{**PPO, **changed}), NETWORKS, 1, device)


def _now(device: str) -> float:
    """Seconds: of the processor, or, once a GPU has done all it was told, of the clock."""
    if device == "cpu":
        return time.process_time()
    torch.cuda.synchronize()
    return time.perf_counter()


def missed(figures: dict[str, Any]) -> list[str]:
    """Limits that are not kept."""
    found = []
    if figures["environment"]["ratio"] > STEP_LIMIT:
        found.append(
            f"a step takes {figures['environment']['ratio']:.2f} of its products (at most {STEP_LIMIT})"
        )
    if figures["ppo"]["ratio"] < UPDATE_LIMIT:
        found.append(f"PPO is {figures['ppo']['ratio']:.2f} times as fast (at least {UPDATE_LIMIT})")
    return found


def _ratio(a: np.ndarray, b: np.ndarray) -> dict[str, float]:
    low, middle, high = np.percentile(a / b, (25, 50, 75))
    return {"ratio": float(middle), "ratio_p25": float(low), "ratio_p75": float(high)}


def _step(trainer: Any) -> Callable[[], None]:
    """Steps of the environment as training takes them: simulation, sensors, rewards, network's inputs."""
    e = trainer.environment
    action = torch.zeros(e.n, trainer.interface.outputs, device=e.device)

    @torch.no_grad()
    def job() -> None:
        s, steps = trainer.now, []
        for _ in range(STEPS):
            observation = e.observe(s)
            trainer.interface.features(observation)
            steps.append(trainer.play(s, action, observation, leak=0.0))
            s = steps[-1].after
        trainer.rewards(steps)

    return job


def _products(trainer: Any) -> Callable[[], None]:
    """The same number of evaluations of the slew networks' products alone."""
    plant: Plant = trainer.environment.plant
    parts = [part for group in plant.drive.groups for part in group.parts.values()]
    x = torch.rand(1, 41, trainer.environment.n, device=trainer.device)

    @torch.no_grad()
    def job() -> None:
        for _ in range(STEPS):
            for part in parts:
                for member in part:
                    y = x
                    for w, b in member:
                        y = torch.baddbmm(b, w, y)

    return job
