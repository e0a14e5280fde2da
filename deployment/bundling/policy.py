"""A policy's ONNX file as a bundle's controller: C made from its graph, or evaluated by onnxruntime."""

import json
from pathlib import Path

import numpy as np

from deployment.bundling.blocks import Block, External
from deployment.bundling.content import Content
from learning.policy import export
from learning.policy.controller import of_policy
from learning.policy.export import Policy
from runtime import bundle as form
from specs.policy import CHANNELS, LIMITS, SENSORS, TARGETS, check_signals
from specs.signals import signal

SAMPLES, SEED = 16, 1  # observations that both engines must answer alike


def content(path: Path, engine: str) -> Content:
    """What goes into the bundle of the policy in `path`; InputError for one of another contract."""
    policy = export.read(path)
    check_signals(policy.contract, str(path))
    files = {"policy.onnx": path.read_bytes(), "parity.json": _parity(policy)}
    if engine == form.ONNXRUNTIME:
        return Content(path.stem, External([*SENSORS, *TARGETS]), engine, files)
    return Content(path.stem, Block(of_policy(policy), "controller"), engine, files)


def _parity(policy: Policy) -> bytes:
    """Observations within the signals' usual sizes, and the policy's answers in double precision."""
    random = np.random.default_rng(SEED)
    samples = [_observation(policy.contract.history, random) for _ in range(SAMPLES)]
    pairs = [{"observation": o.tolist(), "action": policy(o).tolist()} for o in samples]
    return (json.dumps({"pairs": pairs}) + "\n").encode()


def _observation(history: int, random: np.random.Generator) -> np.ndarray:
    sizes = [_size(name) for name in CHANNELS for _ in range(history)]
    once = [
        random.uniform(6.0, 12.0),
        random.uniform(3.0, 8.0),
        random.uniform(0.0, 2000.0),
        random.uniform(0.5, 1.5),
    ]
    rows = random.uniform(-1.0, 1.0, len(sizes)) * sizes
    pose = {"q_boom": 1.2, "q_stick": -1.6}
    rows += [pose.get(name, 0.0) for name in CHANNELS for _ in range(history)]
    return np.array([*rows, *once], dtype=np.float32).astype(np.float64)  # exact in both precisions


def _size(channel: str) -> float:
    """By how much a channel varies."""
    if channel in LIMITS:
        return LIMITS[channel][1]
    if channel.startswith("q_"):
        return 0.3
    return 1.0 if channel not in SENSORS else 0.5 * (signal(channel).nominal or 1.0)
