"""The batched simulation is the FMUs' own: random roll-outs of 10 s through the orchestrator beside it."""

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
import torch

from fmus.equations.kinematics import geometry
from fmus.models.machine.model import MODEL as MACHINE
from fmus.models.slew_nn.network import SlewNetwork
from fmus.models.slew_nn.untrained import untrained
from fmus.toolchain.stepper import Stepper
from learning.policy.simulation.drive import Drive
from learning.policy.simulation.period import OWN_DEAD_BAND, TICKS, plane_tool, spatial_tool
from learning.policy.simulation.plant import Plant, nominal, warped
from orchestrator.run.simulate import simulate
from orchestrator.system.assembly import assemble
from orchestrator.system.stimuli import Stimuli
from specs import systems
from tests.fmus.models.machine_runs import COARSE, PARAMETERS, start, working

WEIGHTS = Path(__file__).resolve().parents[4] / "fmus" / "models" / "slew_nn" / "weights.npz"
PERIODS = 100  # 10 s
COMMANDS = ("u_slew", "qd_boom_ref", "qd_stick_ref")
LIMIT = 1e-4  # of the largest value in a roll-out
SYSTEM = {
    "description": "The mixed simulation, driven from outside",
    "step_s": 0.02,
    "stop_s": 10.0,
    "components": {
        "slew": {"fmu": "slew_nn", "inputs": {"system": ["u_slew"], "arm": ["inertia", "inertia_rate"]}},
        "arm": {"fmu": "arm", "inputs": {"system": ["qd_boom_ref", "qd_stick_ref"]}},
        "tool": {
            "fmu": "tool",
            "inputs": {"slew": ["q_slew", "qd_slew"], "arm": ["radius", "radius_rate", "height"]},
        },
    },
    "outputs": {
        "slew": ["q_slew", "qd_slew", "p_slew_a", "p_slew_b"],
        "arm": ["q_boom", "q_stick", "qd_boom", "qd_stick", "inertia"],
        "tool": ["q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y"],
    },
}


def moves(seed: int) -> np.ndarray:
    """Commands [PERIODS, 3], some held for longer, some beyond the limits of the arm's loops."""
    rng = np.random.default_rng(seed)
    fast = np.column_stack([rng.uniform(-1, 1, PERIODS), rng.uniform(-0.25, 0.25, (PERIODS, 2))])
    return np.repeat(fast[::4], 4, axis=0) if seed % 2 else fast


@pytest.mark.parametrize("seed", [1, 2])
def test_roll_outs_are_those_of_the_fmus(seed: int) -> None:
    """Slew networks, arm and tool over 10 s, 1e-4 relative; delays, joint limits and coupling included."""
    commands = moves(seed)
    changed: dict[str, Any] = {
        "tool_length_x": 1.7,
        "tool_length_y": 2.2,
        "tool_damping_x": 0.15,
        "load": 1200.0,
    }
    run = simulate(
        assemble(systems.parse("mixed", SYSTEM)),
        PERIODS * TICKS,
        Stimuli({k * TICKS: dict(zip(COMMANDS, r, strict=True)) for k, r in enumerate(commands.tolist())}),
        {
            "arm.load_mass": 1200.0, "tool.load_mass": 1200.0, "tool.tool_length_x": 1.7,
            "tool.tool_length_y": 2.2, "tool.tool_damping_x": 0.15, "slew.start_slew_pressure": 1.7e6,
        },
    )  # fmt: skip
    plant = Plant(Drive([SlewNetwork.load(WEIGHTS)]))
    machine = nominal(1, **changed)
    g = geometry()
    one = torch.ones(1)
    state = plant.start(g.start_q_slew * one, g.start_q_boom * one, g.start_q_stick * one, 1.7e6)
    state.sent[:] = torch.tensor(commands[0])[:, None]  # as the FMU's delay lines start
    found = []
    for row in commands:
        state = plant.advance(state, torch.tensor(row, dtype=torch.float32)[:, None], machine)
        drive = [state.q, state.omega[-1], state.p_r[-1], state.p_l[-1]]
        found.append([*drive, *state.arm, plant.inertia(state, machine), *state.tool[:4]])
    ours = np.array([[float(v) for v in row] for row in found])
    names = [name for outputs in SYSTEM["outputs"].values() for name in outputs]
    for column, name in enumerate(names):
        theirs = run.column(name)[TICKS::TICKS]
        worst = np.abs(ours[:, column] - theirs).max() / np.abs(theirs).max()
        assert worst <= LIMIT, (name, worst)
    assert np.ptp(run.column("q_boom")) > 0.1


def test_networks_are_those_of_numpy_also_several_at_once() -> None:
    """Two networks, one an ensemble mirrored: each group of machines has its own."""
    nets = [untrained(s, (24, 16), (16,), members=2, symmetric=True, residual=True) for s in (1, 2)]
    rng = np.random.default_rng(3)
    u, w = rng.uniform(-1, 1, (8, 10)), rng.uniform(-0.5, 0.5, (8, 10))
    p_l, p_r = rng.uniform(1e6, 2e7, (2, 8, 10))
    inertia = rng.uniform(3e5, 8e5, 8)
    drive = Drive(nets, dtype=torch.float64)
    past = [torch.tensor(v.T.copy()) for v in (u, p_l, p_r, w)]
    ours = drive(past[0], past[1], past[2], past[3], torch.tensor(inertia))
    for part, net in ((slice(0, 4), nets[0]), (slice(4, 8), nets[1])):
        theirs = net.predict(u[part], p_l[part], p_r[part], w[part], inertia[part])
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(a[part].numpy(), b, rtol=1e-9)


def test_networks_of_several_sizes_side_by_side() -> None:
    """Neighbours of one size together, another size, its mirror image: each as numpy's, ahead or not."""
    small = [untrained(s, (24, 16), (16,), residual=True) for s in (1, 2)]
    large = untrained(3, (32, 8), (24, 8))
    nets, ahead = [*small, large, large.mirrored()], [0, 2, 2, 0]
    rng = np.random.default_rng(3)
    u, w = rng.uniform(-1, 1, (8, 9)), rng.uniform(-0.5, 0.5, (8, 10))
    p_l, p_r = rng.uniform(1e6, 2e7, (2, 8, 10))
    joystick, inertia = rng.uniform(-1, 1, 8), rng.uniform(3e5, 8e5, 8)
    drive = Drive(nets, dtype=torch.float64, ahead=ahead)
    past = [torch.tensor(v.T.copy()) for v in (u, p_l, p_r, w)]
    after = drive.onward(past, torch.tensor(joystick), torch.tensor(inertia))
    assert [group.count for group in drive.groups] == [2, 2]
    assert torch.equal(after[0], torch.cat([past[0][1:], torch.tensor(joystick)[None]]))
    for i, (net, periods) in enumerate(zip(nets, ahead, strict=True)):
        own = slice(2 * i, 2 * i + 2)
        held = np.repeat(joystick[own, None], periods + 1, axis=1)
        seen = np.hstack([u[own, periods:], held])
        theirs = net.predict(seen, p_l[own], p_r[own], w[own], inertia[own])
        for a, b in zip(after[1:], theirs, strict=True):
            np.testing.assert_allclose(a[-1, own].numpy(), b, rtol=1e-9)


@pytest.mark.parametrize(("residual", "ahead"), [(True, 0), (False, 2)])
def test_one_operation_for_the_drive_is_what_its_parts_are(residual: bool, ahead: int) -> None:
    """Histories a period on and all gradients: against the way that ensembles take."""
    net = untrained(1, (24, 16), (16,), residual=residual)
    short = Drive([net], dtype=torch.float64, ahead=[ahead])
    long = Drive([net], dtype=torch.float64, ahead=[ahead])
    long.groups[0].plain = False
    draw = torch.Generator().manual_seed(2)
    rows, scales = (9, 10, 10, 10, 1, 1), (1.0, 1e7, 1e7, 0.5, 1.0, 4e5)
    inputs = [
        (s * torch.rand(r, 8, generator=draw, dtype=torch.float64)).requires_grad_()
        for r, s in zip(rows, scales, strict=True)
    ]
    found = []
    for drive in (short, long):
        after = drive.onward(inputs[:4], inputs[4][0], inputs[5][0])
        total = sum(
            (torch.sin(a) * torch.linspace(1, 2, a.shape[0], dtype=a.dtype)[:, None]).sum() for a in after
        )
        found.append((after, torch.autograd.grad(total, inputs)))  # type: ignore[arg-type]
    for ours, theirs in zip(*found, strict=True):
        for a, b in zip(ours, theirs, strict=True):
            torch.testing.assert_close(a, b, rtol=1e-9, atol=1e-12)


def test_dead_band_moved_by_two_straight_lines() -> None:
    """At the wanted dead band the networks see their own; 0 and full stay; both ways alike."""
    u = torch.tensor([0.0, 0.15, -0.15, 1.0, 0.075])
    band = torch.full_like(u, 0.15)
    expected = [0.0, OWN_DEAD_BAND, -OWN_DEAD_BAND, 1.0, OWN_DEAD_BAND / 2]
    np.testing.assert_allclose(warped(u, band).numpy(), expected, rtol=1e-6, atol=1e-7)


def test_more_flow_is_more_joystick_beyond_the_dead_band() -> None:
    """Twice the gain: twice the way beyond the dead band, full joystick at most; inside nothing changes."""
    own = OWN_DEAD_BAND
    u = torch.tensor([0.5 * own, own + 0.2, -own - 0.2, 0.9])
    found = warped(u, torch.full_like(u, own), torch.full_like(u, 2.0))
    np.testing.assert_allclose(found.numpy(), [0.5 * own, own + 0.4, -own - 0.4, 1.0], rtol=1e-6)


def test_latency_holds_back_joystick_and_references() -> None:
    """Two ticks of latency: a period's joystick is two fifths the old one; the arm moves two ticks later."""
    plant = Plant(Drive([untrained(1)]))
    one = torch.ones(1)
    state = plant.start(0 * one, 1.2 * one, -1.5 * one)
    after = plant.advance(state, torch.tensor([[1.0], [0.0], [0.0]]), nominal(1, latency=2.0))
    assert float(after.u[-1]) == pytest.approx(0.6)
    start = dict.fromkeys((0.0, 2.0), 0.0)
    for latency in start:
        now, machine = state, nominal(1, latency=latency, boom_delay=0.2)
        for _ in range(4):
            now = plant.advance(now, torch.tensor([[0.0], [0.2], [0.0]]), machine)
        start[latency] = float(now.arm[0] - 1.2)
    assert start[0.0] - start[2.0] == pytest.approx(2 * 0.02 * 0.2, rel=0.05)


def test_the_drive_alone_can_be_later() -> None:
    """A delay of 1.5 periods: the joystick's step comes half after two, whole after three."""
    plant = Plant(Drive([untrained(1)]))
    one = torch.ones(1)
    state, seen = plant.start(0 * one, 1.2 * one, -1.5 * one), []
    for _ in range(4):
        state = plant.advance(state, torch.tensor([[1.0], [0.0], [0.0]]), nominal(1, slew_delay=7.5))
        seen.append(float(state.u[-1]))
    assert seen == pytest.approx([0.0, OWN_DEAD_BAND + (0.5 - OWN_DEAD_BAND), 1.0, 1.0])


def test_an_edge_is_more_of_a_change_and_nothing_of_what_stays() -> None:
    """A step from 0.2 to 0.4 with an edge of a half is seen as 0.5 in its first period."""
    plant = Plant(Drive([untrained(1)]))
    one = torch.ones(1)
    state, seen = plant.start(0 * one, 1.2 * one, -1.5 * one), []
    for lever in (0.2, 0.2, 0.4, 0.4):
        state = plant.advance(state, torch.tensor([[lever], [0.0], [0.0]]), nominal(1, edge=0.5))
        seen.append(float(state.u[-1]))
    assert seen[1:] == pytest.approx([0.2, 0.5, 0.4])


def test_counts_states_outside_the_data() -> None:
    """As SlewNetwork.outside does."""
    net = SlewNetwork.load(WEIGHTS)
    rng = np.random.default_rng(1)
    inertia, u, w = rng.uniform(1e5, 1.6e6, 500), rng.uniform(-1, 1, 500), rng.uniform(-1.2, 1.2, 500)
    found = Drive([net], dtype=torch.float64).outside(*(torch.tensor(v) for v in (inertia, u, w)))
    assert (found.numpy() == net.outside(inertia, u, w)).all()
    assert 0 < found.float().mean() < 1


def on_the_machines_motion(tick: Any, run: dict[str, np.ndarray], lengths: list[float]) -> np.ndarray:
    """Rates (roll, pitch; rad/s) [n, 2] of a simulated tool whose suspension moves as a machine's does."""
    pose = np.array([run[f"true_{n}"] for n in ("q_boom", "q_stick", "qd_boom", "qd_stick")])
    rate = run["true_qd_slew"]
    t, x, y = ca.SX.sym("t", 6), ca.SX.sym("x", 4), ca.SX.sym("y", 4)
    w, a = ca.SX.sym("w"), ca.SX.sym("a")
    varied = ca.vertcat(1.0, 1.0, *lengths, 0.1, 0.1)
    step = ca.Function("step", [t, x, y, w, a], [tick(t, x, y, w, a, varied)])
    state, found = np.zeros(6), []
    for k in range(pose.shape[1] - 1):
        turn = (rate[k + 1] - rate[k]) / 0.02
        state = np.array(step(state, pose[:, k], pose[:, k + 1], rate[k], turn)).ravel()
        found.append(state[2:4])
    return np.array(found)


def test_the_spatial_tool_swings_as_the_reference_machines_own() -> None:
    """Moved as the machine moves, its tool is followed within 10 %; the paper's plane pendulums are not."""
    run = Stepper(MACHINE, start(1.0, -1.2), COARSE).run(working, 8.0, every=0.02)
    theirs = np.column_stack([run["true_qd_tool_x"], run["true_qd_tool_y"]])[1:]
    first, second = PARAMETERS.grab_com, PARAMETERS.grab_com**2 + PARAMETERS.grab_gyration**2
    lengths = [second / first, second / first + PARAMETERS.grab_offset]
    off = [
        float(np.abs(on_the_machines_motion(tick, run, lengths) - theirs).max() / np.abs(theirs).max())
        for tick in (spatial_tool, plane_tool)
    ]
    assert off[0] < 0.1
    assert off[1] > 0.3


@pytest.mark.long
def test_boom_and_stick_ring_on_their_oil_at_the_frequency_told() -> None:
    """After a step of the boom's reference: twice the response without oil, swinging about it, dying away."""
    plant = Plant(Drive([SlewNetwork.load(WEIGHTS)]), spatial=True)
    zero = torch.zeros(2)
    state = plant.start(zero, zero + 0.7, zero - 1.2, 1.7e6)
    machine = nominal(2, boom_oil=torch.tensor([0.0, 2 * np.pi * 2.0]), oil_damping=0.1)
    command = torch.tensor([[0.0], [0.1], [0.0]]).expand(3, 2)
    rates = []
    for _ in range(60):
        state = plant.advance(state, command, machine)
        rates.append(state.arm[2].numpy().copy())
    rigid, ringing = np.array(rates).T
    assert np.all(state.ring[:, 0].numpy() == 0.0)
    np.testing.assert_allclose(rigid[-30:], 0.1, rtol=1e-3)
    assert 0.16 < ringing.max() < 0.2
    beyond = ringing[8:33] - rigid[8:33]
    turns = np.flatnonzero(np.diff(np.sign(beyond)))
    assert np.diff(turns).mean() * 0.1 == pytest.approx(0.25, abs=0.05)
    assert abs(ringing[-1] - rigid[-1]) < 0.01
