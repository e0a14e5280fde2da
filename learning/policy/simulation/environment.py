"""The training environment: n simulated machines with sensors, targets, rewards and terminations, at 10 Hz.

Targets lie at slew angle 0, so that the slew angle is the error (paper).  Where a recipe leads its policy
(`lead_s`), the target that is told moves along a way, and is by that time ahead of the one that counts.
Everything is a tensor [rows, n] and no operation works in place, so that a whole episode can be
differentiated.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import torch
from torch import Tensor

from fmus.equations import kinematics
from fmus.models.slew_nn.network import HISTORY as SPEEDS, SlewNetwork
from learning.policy.features import errors
from learning.policy.recipe import Randomisation, Recipe
from learning.policy.simulation.ahead import near, of_things, of_way
from learning.policy.simulation.drive import Drive
from learning.policy.simulation.family import members
from learning.policy.simulation.field import Field
from learning.policy.simulation.kernel import Kernel
from learning.policy.simulation.period import tip_of
from learning.policy.simulation.plant import Machine, Plant, nominal
from learning.policy.simulation.rewards import ACTION_SCALE, ARC, MARGIN_M, Instant
from learning.policy.simulation.situation import Situation
from learning.policy.simulation.things import drawn
from learning.policy.simulation.ways import ARM, LEGS, ROUNDING, SLEW, Pace, ways
from specs import parameters
from specs.policy import CHANNELS, SENSORS, SLEW_ERROR, SPACING_S, TICK_S

LATE = 2  # periods by which the arm encoders' rates are late (0.2 s)
FILTERED = ("imu_cabin_rate_z", "imu_tool_rate_x", "imu_tool_rate_y")
POOL = 8192  # poses to draw from
POSE = {"boom": (0.8, 1.4), "stick": (-2.1, -0.3)}  # rad, of the authors' code
RADIUS, HEIGHT = (7.0, 14.0), (2.8, 10.0)  # m, of the grab
SWING = (0.2, 0.5)  # rad and rad/s: largest of a tool that swings at the start
NUMBERS = 4  # of 16 bits, enough for noise, in each of 64 that are drawn: half the time of drawing each


class Environment:
    """n machines; `fresh` and `retargeted` make situations, `observe` and `advance` go through them."""

    def __init__(
        self, recipe: Recipe, networks: Sequence[SlewNetwork], n: int, seed: int, device: str = "cpu"
    ):
        self.recipe, self.random = recipe, recipe.random
        self.members = members(recipe, networks)
        self.n = n - n % len(self.members)
        self.device = device
        drive = Drive([m.network for m in self.members], device, ahead=[m.ahead for m in self.members])
        self.plant = Plant(drive, recipe.task == "slew", recipe.spatial)
        self.boost = parameters.load("slew")["slew_boost_pressure"].value  # Pa, of a drive at rest
        self.generator = torch.Generator(device).manual_seed(seed)
        self._miss, self._sense = Kernel(_miss()), Kernel(_sense(recipe.history))
        self.lowest = kinematics.geometry().keepout_height + MARGIN_M
        self._action_scale = torch.tensor(ACTION_SCALE, device=device)[:, None]
        self._poses = self._pool()
        sizes = _noise_sizes(self.random)
        self.noisy = any(sizes)
        self._noise_step = torch.tensor(sizes, device=device)[:, None] / 2**16
        self._quiet = torch.zeros(len(sizes), self.n, device=device)
        self.lead = round(recipe.lead_s / SPACING_S)
        self.ahead = recipe.ahead
        self.sight = max(self.lead, *(round(t / SPACING_S) for t in (0.0, *recipe.waypoints_s)))
        self.field = Field(device) if recipe.field_m else None

    # ---- random numbers ----

    def uniform(self, low: float, high: float, *shape: int) -> Tensor:
        """[*shape, n] uniform numbers; all `low` if that is `high`."""
        size = (*shape, self.n)
        if low == high:
            return torch.full(size, low, device=self.device)
        return low + (high - low) * torch.rand(size, generator=self.generator, device=self.device)

    def _either_way(self, size: float, *shape: int) -> Tensor:
        return self.uniform(-size, size, *shape)

    def _pool(self) -> Tensor:
        """[4, POOL]: boom, stick, radius and height of the grab, of poses that are allowed."""
        g = kinematics.geometry()
        draw = torch.Generator().manual_seed(1)
        found: list[Tensor] = []
        while sum(p.shape[1] for p in found) < POOL:
            boom, stick = (
                low + (high - low) * torch.rand(POOL, generator=draw) for low, high in POSE.values()
            )
            radius, height = (torch.as_tensor(v) for v in kinematics.arm_tip(boom.numpy(), stick.numpy(), g))
            z = height - g.tool_length
            good = (radius > RADIUS[0]) & (radius < RADIUS[1]) & (z > HEIGHT[0]) & (z < HEIGHT[1])
            found.append(torch.stack([boom, stick, radius, z])[:, good])
        return torch.cat(found, dim=1)[:, :POOL].to(self.device)

    def poses(self) -> Tensor:
        """[4, n] of the pool."""
        index = torch.randint(POOL, (self.n,), generator=self.generator, device=self.device)
        return self._poses[:, index]

    # ---- situations ----

    def machines(self) -> Machine:
        """Machines as the recipe's ranges say; a range of (-1, -1) leaves the nominal value."""
        r, base = self.random, nominal(self.n, self.device)

        def drawn(low_high: tuple[float, float], otherwise: Tensor) -> Tensor:
            return otherwise if low_high[0] < 0 else self.uniform(*low_high)

        def ticks(otherwise: Tensor) -> Tensor:
            if r.arm_delay[0] < 0:
                return otherwise
            return (self.uniform(*r.arm_delay) / TICK_S).round().long()

        length = self.uniform(*r.tool_length)
        of_arm = r.oil_damping, r.dead_rate, r.arm_gain
        varied = [
            drawn(r.response, base.named("boom_response")), drawn(r.response, base.named("stick_response")),
            length, length, self.uniform(*r.tool_damping), self.uniform(*r.tool_damping),
        ]  # fmt: skip
        return Machine(
            torch.stack(varied), self.uniform(*r.load), ticks(base.boom_delay), ticks(base.stick_delay),
            self.uniform(*r.latency).floor(), drawn(r.dead_band, base.dead_band),
            self.uniform(*r.inertia_scale), self.uniform(*r.gain),
            self.uniform(*r.slew_delay) / TICK_S, self.uniform(*r.edge), self.uniform(*r.rate_filter),
            torch.cat([2 * math.pi * self.uniform(*r.oil_hz, 2), *(self.uniform(*x)[None] for x in of_arm)]),
        )  # fmt: skip

    def fresh(self) -> Situation:
        """New machines at rest in random poses, the tool hanging, or (share `swinging`) swinging."""
        boom, stick, *_ = self.poses()
        error, way, things = self._aims(torch.stack([boom, stick]))
        state = self.plant.start(error, boom, stick, self.boost)
        if self.recipe.swinging:
            moving = (self.uniform(0.0, 1.0) < self.recipe.swinging).float()
            swing = torch.cat([self._either_way(SWING[0], 2), self._either_way(SWING[1], 2)]) * moving
            state.tool = torch.cat([swing, state.tool[4:]])
        machine, r = self.machines(), self.random
        bias = torch.cat([self._either_way(r.angle_bias, 3), self._either_way(r.imu_angle_bias, 2),
                          self._either_way(r.imu_rate_bias, 2)])  # fmt: skip
        told = machine.load * (self.uniform(0.0, 1.0) < r.load_told)
        zero = torch.zeros(self.n, device=self.device)
        found = Situation(
            state, machine, zero.expand(len(CHANNELS), self.recipe.history, -1), zero.expand(LATE + 1, 2, -1),
            zero.expand(3, -1), state.q, self.at(way, self.lead)[1:], way, things, told,
            self.uniform(*r.pace), bias, zero.long(),
        )  # fmt: skip
        row = self._row(found)
        return replace(found, sensors=row[:, None].expand(-1, self.recipe.history, -1))

    def retargeted(self, now: Situation) -> Situation:
        """The same machines as they are, with new targets: angle and history turn with the target."""
        q, way, things = self._aims(now.state.arm[:2])
        target = self.at(way, self.lead)[1:]
        turned = replace(_turned(now, q), start=q, target=target, way=way, things=things)
        return replace(turned, pace=self.uniform(*self.random.pace), age=torch.zeros_like(now.age))

    def _aims(self, arm: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Slew errors [n] at the start, ways [3, periods, n] from arm angles [2, n], things beside them."""
        if not self.lead:
            error = self._slew_errors()
            way = torch.cat([0.0 * error[None], self._targets(*arm)])[:, None]
            return error, way, torch.zeros(0, 0, self.n, device=self.device)
        turns = torch.cumsum(torch.stack([self._slew_errors() for _ in range(LEGS)]), 0)
        start = torch.cat([torch.zeros_like(arm[:1]), arm])
        further = [torch.cat([turn[None], self.poses()[:2]]) for turn in turns]
        pace = Pace(self.uniform(*SLEW), self.uniform(*ARM), self.uniform(*ROUNDING))
        angles = ways(torch.stack([start, *further]), pace, self.periods + self.sight + 1)
        radius, height = self.plant.tip(_in_row(torch.cat([angles[1:], 0.0 * angles[1:]])))[0]
        place = torch.stack([radius, height - kinematics.geometry().tool_length]).view(2, -1, self.n)
        way = torch.cat([angles[:1], place])
        things = drawn(self.field, self.uniform, angles) if self.field else way.new_zeros(0, 0, self.n)
        return -self.at(way, self.lead)[0], way, things

    def at(self, way: Tensor, period: Tensor | int) -> Tensor:
        """Where targets are [3, n] in periods [n]."""
        at = torch.as_tensor(period, device=way.device).clamp(max=way.shape[1] - 1).expand(self.n)
        return way.gather(1, at.expand(3, 1, -1))[:, 0]

    def _counts(self, s: Situation) -> Tensor:
        """The target that counts [3, n]: its angle less that of the one that is told, radius and height."""
        if not self.lead:
            return torch.cat([torch.zeros_like(s.target[:1]), s.target])
        now, told = self.at(s.way, s.age), self.told(s)
        return torch.cat([now[:1] - told[:1], now[1:]])

    def told(self, s: Situation) -> Tensor:
        """The target that is told [3, n]: angle on the way, radius, height."""
        return self.at(s.way, s.age + self.lead)

    def _slew_errors(self) -> Tensor:
        low, high = self.random.slew_error
        size = self.uniform(low, high)
        near = self.uniform(0.0, 1.0) < self.random.small_moves
        size = torch.where(near, self.uniform(0.0, low), size)
        return size * torch.sign(self.uniform(-1.0, 1.0))

    def _targets(self, boom: Tensor, stick: Tensor) -> Tensor:
        """[2, n]: random ones, or for slew-only the present place."""
        if self.recipe.task == "full":
            return self.poses()[2:]
        radius, height = self.plant.tip(torch.stack([boom, stick, 0 * boom, 0 * boom]))[0]
        return torch.stack([radius, height - kinematics.geometry().tool_length])

    # ---- one step ----

    def observe(self, s: Situation) -> Tensor:
        """Observations [N, n] (specs/policy.py)."""
        rows = s.sensors.reshape(-1, self.n)
        seen = torch.cat([rows, s.target, s.told[None], s.pace[None]])
        if not self.ahead:
            return seen
        told = self.told(s)[0]
        places = [self.at(s.way, s.age + round(t / SPACING_S)) for t in self.ahead.waypoints_s]
        things = [of_things(s, told, self.field, self.ahead)] if self.field else []
        return torch.cat([seen, *of_way(s, told, places), *things])

    def advance(self, s: Situation, action: Tensor) -> Situation:
        """0.1 s on with limited commands [3, n]; slew-only: the arm stays, whatever its references."""
        if self.recipe.task == "slew":
            action = torch.cat([action[:1], torch.zeros_like(action[1:])])
        state = self.plant.advance(s.state, action, s.machine)
        flat = s.sensors.reshape(-1, self.n), s.rates.reshape(-1, self.n)
        now = (action, state.q, state.arm, state.tool, state.omega, s.bias, self._noise())
        sensors, rates = self._sense(*flat, *now, s.machine.rate_filter)
        after = replace(
            s, state=state, action=action, age=s.age + 1,
            sensors=sensors.view(s.sensors.shape), rates=rates.view(s.rates.shape),
        )  # fmt: skip
        if not self.lead:
            return after
        last, told = self.told(s), self.told(after)
        return replace(_turned(after, after.state.q + last[0] - told[0]), target=told[1:])

    def _row(self, s: Situation) -> Tensor:
        """What the sensors show now [channels, n], in the order of CHANNELS; noise is new each time."""
        state, flat = s.state, (s.sensors.reshape(-1, self.n), s.rates.reshape(-1, self.n))
        shifted = torch.cat([flat[1][:2], flat[1][:-2]])  # `_sense` moves the arm's rates on by a period
        now = (s.action, state.q, state.arm, state.tool, state.omega, s.bias, self._noise())
        return self._sense(flat[0], shifted, *now, s.machine.rate_filter)[0].view(s.sensors.shape)[:, -1]

    def _noise(self) -> Tensor:
        """Uniform (paper), about of the deviations that the recipe says, [sensors, n]."""
        if not self.noisy:
            return self._quiet
        sensors = self._quiet.shape[0]
        bits = torch.empty(-(-sensors * self.n // NUMBERS), dtype=torch.int64, device=self.device)
        bits.random_(-(2**63), None, generator=self.generator)
        return bits.view(torch.int16)[: sensors * self.n].view(sensors, -1) * self._noise_step

    def instant(self, before: Situation, after: Situation) -> Instant:
        """What the rewards of the step from `before` to `after` depend on."""
        return self.instants([before], [after])

    def instants(self, before: Sequence[Situation], after: Sequence[Situation]) -> Instant:
        """The same of many steps at once, [rows, steps * n]: most of an operation's cost is its call."""
        used = 1 if self.recipe.task == "slew" else 3
        many = lambda take, which=after: torch.cat([take(s) for s in which], dim=-1)  # noqa: E731
        arm, tool, q = (many(lambda s, k=k: getattr(s.state, k)) for k in ("arm", "tool", "q"))
        counts = many(self._counts)
        q = q - counts[0]
        (point,) = self._miss(q, arm, tool, counts[1:])
        error = point if self.recipe.task == "full" else ARC * q[None]
        low = (self.lowest - point[2] - counts[2]).clamp(min=0.0)
        action, last = (many(lambda s: s.action, w) / self._action_scale for w in (after, before))
        return Instant(
            error, action[:used], last[:used], q, many(lambda s: s.start), many(lambda s: s.state.omega[-1]),
            arm[2], arm[3], tool[2], tool[3], tool[0], tool[1], low, torch.zeros_like(low),
            near(after, [self.told(s)[0] for s in after], self.field) if self.field else None,
        )  # fmt: skip

    def error(self, s: Situation) -> Tensor:
        """Grab point less target [3, n], m."""
        return self._miss(s.state.q, s.state.arm, s.state.tool, s.target)[0]

    def ended(self, s: Situation) -> Tensor:
        """Where the grab is too low or too near the cabin: the episode terminates, bool [n]."""
        g, (x, y, z) = kinematics.geometry(), self.error(s)
        low = z + s.target[1] < g.keepout_height
        near = (x + s.target[0]).square() + y.square() < g.keepout_radius**2
        return low | near

    def unknown(self, s: Situation) -> Tensor:
        """Where the slew drive is in a state that its networks saw no data of, bool [n]."""
        inertia = self.plant.inertia(s.state, s.machine)
        return self.plant.drive.outside(inertia, s.state.u[-1], s.state.omega[-1])

    @property
    def periods(self) -> int:
        """Steps of an episode."""
        return round(self.recipe.episode_s / SPACING_S)


def _in_row(values: Tensor) -> Tensor:
    """[rows, periods, n] -> [rows, periods * n]."""
    return values.reshape(len(values), -1)


def _turned(s: Situation, q: Tensor) -> Situation:
    """The same with the slew angle, now `q` and before, counted from another direction."""
    place = CHANNELS.index(SLEW_ERROR)
    row = (s.sensors[place] + (q - s.state.q))[None]
    sensors = torch.cat([s.sensors[:place], row, s.sensors[place + 1 :]])
    return replace(s, state=replace(s.state, q=q), sensors=sensors)


@cache
def _sense(history: int) -> ca.Function:
    """(sensors, rates, action, angle, arm, tool, speeds, bias, noise, share) -> (sensors, rates) a period on.

    The sensors' newest row is what they show of angle, arm, tool and speed; the arm's rates are LATE, those
    of gyro and tool IMU keep a `share` of their last value.
    """
    sensors, rates = ca.SX.sym("sensors", len(CHANNELS) * history), ca.SX.sym("rates", 2 * (LATE + 1))
    sizes = {"action": 3, "q": 1, "arm": 4, "tool": 6, "omega": SPEEDS, "bias": 7, "noise": len(SENSORS),
             "filter": 1}  # fmt: skip
    action, q, arm, tool, omega, bias, noise, share = now = [ca.SX.sym(n, k) for n, k in sizes.items()]
    rates_on = ca.vertcat(rates[2:], arm[2:])
    angles = ca.vertcat(q, arm[:2], tool[:2]) + bias[:5]
    speeds = ca.vertcat(omega[SPEEDS - 1], rates_on[:2], tool[2:4] + bias[5:])
    row = ca.vertcat(action, ca.vertcat(angles, speeds) + noise)
    for name in FILTERED:
        i = CHANNELS.index(name)
        row[i] += share * (sensors[(i + 1) * history - 1] - row[i])
    rows = [ca.vertcat(sensors[i * history + 1 : (i + 1) * history], row[i]) for i in range(len(CHANNELS))]
    return ca.Function("sense", [sensors, rates, *now], [ca.vertcat(*rows), rates_on])


@cache
def _miss() -> ca.Function:
    """(angle, arm, tool, target) -> grab point less target [3]."""
    q, arm, tool, target = inputs = [ca.SX.sym(n, k) for n, k in (("q", 1), ("a", 4), ("t", 6), ("g", 2))]
    tip = tip_of()(arm)
    return ca.Function("miss", inputs, [ca.cse(errors()(ca.vertcat(q, tip, tool[:2], target)))])


def _noise_sizes(r: Randomisation) -> list[float]:
    """Widths of the sensors' uniform noise, which has about the deviation that is told."""
    sizes = [r.angle_noise] * 3 + [r.imu_angle_noise] * 2
    sizes += [r.imu_rate_noise, r.rate_noise, r.rate_noise, r.imu_rate_noise, r.imu_rate_noise]
    return [2 * 1.7 * size for size in sizes]


def without_noise(recipe: Recipe) -> Recipe:
    """The recipe on nominal machines with perfect sensors."""
    return replace(recipe, random=Randomisation().off())


def load_networks(paths: Sequence[Any], our_inertia: bool = False) -> list[SlewNetwork]:
    """Slew networks from files; InputError names what is wrong with one.

    One that does not say on which inertia number it was trained is refused without `our_inertia`.
    """
    found = [SlewNetwork.load(path) for path in paths]
    for path, network in zip(paths, found, strict=True):
        network.check_plant(str(path), our_inertia)
    return found
