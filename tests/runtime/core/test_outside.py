"""The core of a bundle whose controller is a policy outside: its commands go through the gate, or none do."""

import numpy as np
import pytest

from runtime.image import INPUT, OUTPUT, Status
from runtime.interfaces.outside import LATE
from specs.errors import InputError
from specs.parameters import load
from tests.runtime.bench import AUTOMATIC, FAULT, Bench
from tests.runtime.bundles import built, core

NAMES = ("policy_u_slew", "policy_qd_boom_ref", "policy_qd_stick_ref", "policy_heartbeat")
GATE = {name: p.value for name, p in load("gate").items()}


@pytest.fixture
def bench() -> Bench:
    return Bench(core("outside"))


class Policy:
    """Commands in each tick of a bench."""

    def __init__(self, bench: Bench, **asked: float) -> None:
        self.bench, self.asked, self.beat = bench, asked, 0

    def tick(self, count: int = 1) -> Bench:
        for _ in range(count):
            self.beat += 1
            self.bench.set(
                **{f"policy_{n}": v for n, v in self.asked.items()}, policy_heartbeat=self.beat // 5
            )
            self.bench.tick()
        return self.bench

    def automatic(self) -> "Policy":
        self.tick(3)
        self.bench.set(operator_enable=1.0)
        self.tick(3)
        self.bench.set(automatic_request=1.0)
        self.tick(5)
        assert self.bench.mode == AUTOMATIC
        return self


def test_the_policy_commands_and_the_gate_has_the_last_word(bench: Bench):
    policy = Policy(bench, u_slew=1.0, qd_boom_ref=0.05, qd_stick_ref=0.02).automatic()
    policy.tick(20)
    sent = np.array([seen["value"][OUTPUT.at("u_slew")] for seen in bench.seen])
    rises = np.diff(sent)
    assert sent[-1] > 0.5
    assert rises.max() <= GATE["gate_rise"] * 0.02 + 1e-12
    assert (bench.out("qd_boom_ref"), bench.out("qd_stick_ref")) == (0.05, 0.02)


@pytest.mark.parametrize("how", ["silent", "never", "old", "no_number"])
def test_without_fresh_commands_it_stops_through_the_gate_and_says_why(bench: Bench, how: str):
    policy = Policy(bench, u_slew=1.0).automatic()
    policy.tick(30)
    assert bench.out("u_slew") > 0.0
    if how == "silent":
        bench.tick(LATE)  # the heartbeat stands still
    for name in NAMES:
        if how == "never":
            bench.status[name] = Status.NEVER
        if how == "old":
            bench.age[name] = LATE
    if how == "no_number":
        policy.asked["u_slew"] = float("nan")
    policy.tick(5) if how == "no_number" else bench.tick()
    assert (bench.mode, bench.fault) == (FAULT, "policy_timeout")
    before = bench.out("u_slew")
    assert bench.seen[-2]["value"][OUTPUT.at("u_slew")] - before <= GATE["gate_fall"] * 0.02 + 1e-12
    bench.tick(10)
    assert bench.commands == [0.0, 0.0, 0.0]


def test_automatic_operation_does_not_begin_without_the_policy(bench: Bench):
    for name in NAMES:
        bench.status[name] = Status.NEVER
    bench.tick(3).set(operator_enable=1.0).tick(3).set(automatic_request=1.0).tick(5)
    assert bench.mode != AUTOMATIC


def test_nothing_depends_on_it_where_the_bundle_has_a_controller_of_its_own():
    bench = Bench(core("pd"))
    for name in NAMES:
        bench.status[name] = Status.TWO_SENDERS
    bench.tick(3).set(operator_enable=1.0).tick(3).set(automatic_request=1.0).tick(40)
    assert (bench.mode, bench.fault) == (AUTOMATIC, "none")


def test_a_snapshot_goes_on_bit_for_bit(bench: Bench):
    policy = Policy(bench, u_slew=0.7, qd_boom_ref=0.1).automatic()
    policy.tick(13)
    kept = bench.core.snapshot()
    first = policy.tick().seen[-1].tobytes()
    bench.core.restore(kept)
    assert bench.core.step(bench.image, bench.now).tobytes() == first
    assert INPUT.at("policy_heartbeat")


def test_another_engine_is_refused():
    from deployment.bundling.build import bundle

    with pytest.raises(InputError, match="evaluated outside: no --engine onnxruntime"):
        bundle("outside", built("pd").folder / "x", engine="onnxruntime")
    with pytest.raises(InputError, match="only"):
        bundle("pd", built("pd").folder / "x", engine="outside")
