"""What is trained and how: rewards and their curriculum, what is randomised, both methods' settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from learning.policy import valid
from learning.policy.simulation.rewards import SLEW_ONLY, TERMS, Shape
from specs.ahead import Ahead
from specs.errors import InputError, nearest
from specs.policy import HISTORY, TASKS

Range = tuple[float, float]
Method = Literal["ppo", "gradient"]
NETWORKS = ("", "mirror", "convolution", "transformer")


@dataclass(frozen=True)
class Randomisation:
    """Ranges from which each simulated machine and start is drawn, uniformly; SI; `off` switches them off."""

    load: Range = (0.0, 2000.0)
    load_told: float = 0.5  # share of episodes in which the load is told; else 0 is
    response: Range = (0.45, 0.8)  # P of boom and stick (identified: 0.64, 0.56)
    arm_delay: Range = (0.2, 0.36)  # s (identified: 0.28, 0.26), longer than the encoder's 0.2
    oil_hz: Range = (0.0, 0.0)  # Hz, of boom and stick on their cylinders' oil; 0: rigid, as the FMU
    oil_damping: Range = (0.05, 0.2)  # 1, of that ringing
    dead_rate: Range = (0.0, 0.0)  # rad/s: of smaller references of the arm little arrives; 0: as the FMU
    arm_gain: Range = (1.0, 1.0)  # of the arm's references
    tool_length: Range = (1.2, 2.3)  # m, of the pendulum; draws.toml: com + gyration^2 / com
    tool_damping: Range = (0.05, 0.2)  # 1/s
    dead_band: Range = (0.09, 0.18)  # of the joystick, as specs/draws.toml spreads it
    inertia_scale: Range = (0.8, 1.3)  # what the pose's own inertia leaves out, and the drive's torque
    gain: Range = (0.88, 1.25)  # of the joystick's flow, as specs/draws.toml spreads it
    latency: Range = (0.0, 5.0)  # ticks of 0.02 s from answer to command, beyond the networks' own delay
    slew_delay: Range = (0.0, 0.0)  # s, of the slew drive alone, beyond latency and the networks' own delay
    edge: Range = (0.0, 0.0)  # share of the joystick's change in a period that is added to it or taken off
    rate_filter: Range = (0.0, 0.0)  # share of the last value in what gyro and tool IMU show of a rate
    slew_error: Range = (0.35, 2.5)  # rad, either way
    small_moves: float = 0.1  # share of targets nearer than that
    pace: Range = (0.5, 1.5)
    angle_noise: float = 0.0005  # rad, encoders
    rate_noise: float = 0.003  # rad/s, encoders
    imu_angle_noise: float = 0.002
    imu_rate_noise: float = 0.002
    imu_angle_bias: float = 0.02  # rad, IMU and its mount
    imu_rate_bias: float = 0.005  # rad/s
    angle_bias: float = 0.001  # rad, encoders

    def off(self) -> "Randomisation":
        """The nominal machine with perfect sensors; starts and targets stay random."""
        return replace(
            self, load=(0.0, 0.0), load_told=0.0, response=(-1.0, -1.0), arm_delay=(-1.0, -1.0),
            oil_hz=(0.0, 0.0), dead_rate=(0.0, 0.0), arm_gain=(1.0, 1.0),
            tool_length=(2.0, 2.0), tool_damping=(0.1, 0.1), dead_band=(-1.0, -1.0),
            inertia_scale=(1.0, 1.0), gain=(1.0, 1.0), latency=(0.0, 0.0), pace=(1.0, 1.0),
            slew_delay=(0.0, 0.0), edge=(0.0, 0.0), rate_filter=(0.0, 0.0),
            angle_noise=0.0, rate_noise=0.0, imu_angle_noise=0.0, imu_rate_noise=0.0,
            imu_angle_bias=0.0, imu_rate_bias=0.0, angle_bias=0.0,
        )  # fmt: skip


@dataclass(frozen=True)
class Recipe:
    """One way to train; `weights` are of rewards.TERMS a second, `gentle` a power of 1 / pace on `quiet`."""

    name: str
    why: str
    task: str = "full"
    method: Method = "gradient"
    history: int = HISTORY
    prior: str = ""  # the law that the network's answer is added to (specs.policy.PRIORS)
    change: float = 0.0  # of the joystick in a period: a limit inside the policy; 0: without
    start: str = ""  # ONNX policy whose weights training begins with; a bare name is one that ships
    layers: tuple[int, ...] = (256, 128, 128)  # paper; of a transformer: each encoder layer's hidden width
    network: str = ""  # of NETWORKS: plain, left and right alike, filters along the history, a transformer
    weights: Mapping[str, float] = field(default_factory=dict)
    quiet: tuple[str, ...] = ("oscillation", "swing", "sway")  # terms that weigh more at a slower pace
    gentle: float = 2.0
    first: Shape = field(default_factory=Shape)  # widths of the terms at the start …
    last: Shape = field(default_factory=Shape)  # … and at the end of the curriculum
    curriculum: float = 0.5  # share of the training after which it is at its end
    late_terms: tuple[str, ...] = ("one_shot",)  # their weights rise from 0 with the curriculum
    random: Randomisation = Randomisation()
    episode_s: float = 10.0
    ending: float = 0.0  # reward where the grab comes too low or too near and the episode ends (PPO)
    lead_s: float = 0.0  # targets move along ways and are told this much ahead; 0: they stand
    waypoints_s: tuple[float, ...] = ()  # places of the way that are seen, s ahead (specs/ahead.py)
    field_m: float = 0.0  # there are things beside the ways, and they are seen up to this distance; 0: none
    consecutive: float = 0.0  # share of episodes that begin where another ended, the tool still swinging
    swinging: float = 0.0  # share of fresh starts with the tool swinging
    ahead_s: float = (
        0.2  # what is taken off the slew networks' speed, which is late (plant.py); 0: as in the FMU
    )
    family: bool = False  # each slew network also as its mirror image, and with and without `ahead_s`
    spatial: bool = False  # the tool is the reference machine's spatial pendulum, not the paper's plane ones
    envs: int = 2048
    iterations: int = 1000
    rate: float = 1e-3
    # PPO
    steps: int = 24
    epochs: int = 3
    batches: int = 4
    deviation: float = 0.4  # of the actions at the start (authors' code)
    deviation_least: float = 1e-6  # and at least, however sure the policy is
    discount: float = 0.98
    trace: float = 0.95
    entropy: float = 0.0
    clip: float = 0.2
    schedule: str = "adaptive"  # of the learning rate; authors' code: "fixed"
    mixed: bool = False  # the update's matrix products in bfloat16
    critic_first: float = 0.0  # share of the iterations in which the critic alone learns
    mirrored: bool = False  # every step is learnt from as it was and with left and right exchanged
    asymmetric: bool = False  # the critic sees load, tool length, dead band, pressures
    # by the gradient of the simulation
    norm: float = 1.0  # largest norm of a gradient
    fade: float = 1.0  # share of an episode's gradient that passes from one step to the one before it
    level: float = 0.0  # largest gradient of one machine in medians over machines; 0: without limit
    privileged: bool = False  # a teacher: the network sees `situation.hidden` too, and is not exported
    teacher: str = ""  # folder of one, whose answers the network is held to as well
    imitation: float = 1.0  # weight of that, of the answers' squared distance a second

    def __post_init__(self) -> None:
        if self.task not in TASKS:
            raise InputError(f"no task '{self.task}'; valid: {', '.join(TASKS)}")
        if self.network not in NETWORKS:
            raise InputError(f"no network '{self.network}'; valid: {', '.join(NETWORKS[1:])}, or none")
        valid.check(self.__dict__, valid.RECIPE)
        for name in self.weights:
            if name not in TERMS:
                raise InputError(f"no reward term '{name}'; {nearest(name, TERMS)}")
        valid.check(self.weights, dict.fromkeys(self.weights, valid.FINITE), "weights.")
        valid.check(self.first.__dict__, valid.WIDTHS, "first.")
        valid.check(self.last.__dict__, valid.WIDTHS, "last.")
        valid.check(self.random.__dict__, valid.RANDOM, "random.")
        self._check_ahead()
        self._check_method()

    @property
    def ahead(self) -> Ahead:
        """What is seen of the way and of things."""
        return Ahead(self.waypoints_s, self.field_m)

    def _check_ahead(self) -> None:
        """What is seen of a way needs one, and what a thing costs needs things."""
        if self.ahead and not (self.lead_s and self.task == "full"):
            raise InputError("waypoints_s and field_m need ways: --task full and --set lead_s=SECONDS")
        if self.weights.get("clearance") and not self.field_m:
            raise InputError("weights.clearance needs things: --set field_m=METRES")

    def _check_method(self) -> None:
        """What only the other method heeds would be ignored without a word."""
        if (self.privileged or self.teacher) and self.network:
            raise InputError("a teacher is a plain network, and so are its students: --set network=")
        if self.method == "ppo" and self.network:
            raise InputError(f"PPO's network is a plain one, not '{self.network}': --set network=")
        if self.privileged and self.teacher:
            raise InputError(
                f"a teacher (privileged) has no teacher itself: --set teacher=, not {self.teacher}"
            )
        other = (
            ("asymmetric", "mixed", "mirrored", "critic_first", "ending")
            if self.method == "gradient"
            else ("privileged", "teacher")
        )
        for name in other:
            if getattr(self, name):
                able = "ppo" if self.method == "gradient" else "gradient"
                raise InputError(f"{name} is for --set method={able}; by {self.method} nothing heeds it")
        if self.method == "ppo" and self.batches > self.envs * self.steps:
            raise InputError(
                f"batches = {self.batches}: valid is up to envs x steps, {self.envs * self.steps}"
            )

    @property
    def terms(self) -> tuple[str, ...]:
        """Reward terms with a weight."""
        return tuple(name for name, weight in self.weights.items() if weight)

    def shape(self, progress: float) -> Shape:
        """Widths of the terms at a share of the training."""
        done = min(1.0, progress / self.curriculum) if self.curriculum > 0 else 1.0
        mix = {k: (1 - done) * v + done * getattr(self.last, k) for k, v in self.first.__dict__.items()}
        return Shape(**mix)

    def weight(self, name: str, progress: float) -> float:
        """A term's weight at a share of the training."""
        done = min(1.0, progress / self.curriculum) if self.curriculum > 0 else 1.0
        return self.weights[name] * (done if name in self.late_terms else 1.0)


_PAPER = {
    "balance": 1.0, "target": 1.0, "action": 0.1, "overshoot": 2.0, "oscillation": 0.5, "decouple": 0.5,
    "one_shot": 0.2,
}  # fmt: skip
_OURS = {
    "balance": 0.3, "closing": 0.15, "settle": 1.0, "overshoot": 4.0, "sway": 2.0, "action": 0.05,
    "one_shot": 0.05, "keep_out": 2.0, "limits": 0.05,
}  # fmt: skip
_OWN_PPO = {
    "balance": 1.0, "target": 1.0, "settle": 0.5, "action": 0.1, "overshoot": 2.0, "sway": 2.0,
    "one_shot": 0.1, "keep_out": 1.0, "limits": 0.05,
}  # fmt: skip
_ON_PATH = {
    "balance": 1.0, "target": 1.0, "closing": 3.0, "sway": 2.5, "action": 0.3, "keep_out": 2.0,
    "limits": 0.05,
}  # fmt: skip
_AMONG = {**_ON_PATH, "clearance": 6.0}
_FAST = {**_OURS, "balance": 0.5, "closing": 0.3, "settle": 2.0, "overshoot": 0.3, "sway": 0.2}
_SMOOTH = {  # a dear joystick holds the loop calm at rest, where a cheap one chatters on quick drives
    **_FAST, "balance": 0.3, "settle": 4.0, "overshoot": 0.6, "sway": 0.05, "action": 8.0, "one_shot": 1.0,
}  # fmt: skip
_CALM = {**_OURS, "settle": 1.7, "closing": 0.25, "action": 1.0, "one_shot": 0.5}
_EVEN: dict[str, Any] = {"network": "mirror", "layers": (128, 64, 64)}  # dense, the paper's 256, 128, 128
_DRIVES: dict[str, Any] = {  # as far as slew drives differ
    "gain": (0.75, 1.33), "inertia_scale": (0.7, 1.4), "slew_delay": (0.0, 0.25), "edge": (-0.2, 0.5),
    "rate_filter": (0.0, 0.4),
}  # fmt: skip
_LIKE_OURS = Randomisation(oil_hz=(1.3, 2.6), dead_rate=(0.005, 0.018), arm_gain=(0.95, 1.2))
_NARROW: dict[str, Any] = {
    "first": Shape(0.7, 0.5, 0.05, 0.06), "last": Shape(0.7, 0.5, 0.05, 0.06), "curriculum": 0.0,
}  # fmt: skip
_FAMILY: dict[str, Any] = {
    "family": True, **_NARROW, "fade": 0.99, "level": 2.0, "spatial": True, "episode_s": 15.0,
    "consecutive": 0.5, "envs": 192,
    "random": replace(_LIKE_OURS, **_DRIVES),
}  # fmt: skip
_EXACT: dict[str, Any] = {"first": Shape(0.5, 0.5), "last": Shape(0.5, 0.5)}  # beside a way
_SEEING: dict[str, Any] = {  # the way now, before, at and after the target that is told, and things
    "lead_s": 1.2, "waypoints_s": (0.0, 0.4, 0.8, 2.0, 3.0), "field_m": 3.0,
}  # fmt: skip
_ALWAYS_FRESH: dict[str, Any] = {"envs": 256, "consecutive": 0.0, "swinging": 0.5}  # PPO: ways cost time
_SCRATCH: dict[str, Any] = {  # ours, PPO
    "method": "ppo", "deviation_least": 0.05, "asymmetric": True, "spatial": True, "episode_s": 15.0,
    "consecutive": 0.5, "first": Shape(8.0, 4.0, 0.3, 0.4), "last": Shape(1.0, 0.5, 0.1, 0.06),
    "late_terms": ("one_shot", "sway"),
}  # fmt: skip
_RECIPES = (
    Recipe(
        "paper", "the paper's seven terms, PPO", method="ppo", weights=_PAPER, ahead_s=0.0,
        first=Shape(8.0, 4.0, 0.3), last=Shape(1.0, 1.0, 0.1), ending=-8.0, deviation_least=0.05,
    ),
    Recipe(
        "paper_slew", "the paper's slew-only policy: five terms, PPO", task="slew", method="ppo",
        weights={k: v for k, v in _PAPER.items() if k in SLEW_ONLY},
        first=Shape(8.0, 4.0, 0.3), last=Shape(1.0, 1.0, 0.1), ahead_s=0.0, deviation_least=0.05,
    ),
    Recipe(
        "ppo", "ours, PPO from scratch: no law to start from, a critic that sees the machine",
        weights=_OWN_PPO, ending=-8.0, **_SCRATCH,
        random=_LIKE_OURS,
    ),
    Recipe(
        "ppo_slew", "ours, slew-only, PPO from scratch, over a family of drives", task="slew", **_SCRATCH,
        weights={k: v for k, v in _OWN_PPO.items() if k != "keep_out"} | {"overshoot": 4.0, "sway": 0.35},
        family=True, random=Randomisation(**_DRIVES), iterations=1500,
    ),
    Recipe(
        "full", "ours: through the simulation's own gradient", prior="gentle", weights=_OURS, **_EVEN,
        first=Shape(5.0, 1.0, 0.2, 0.4), last=Shape(0.7, 0.5, 0.05, 0.06), curriculum=0.25,
        fade=0.99, level=2.0, spatial=True,
        random=_LIKE_OURS,
        episode_s=15.0, consecutive=0.5, envs=192, iterations=1500, rate=1.5e-3,
    ),
    Recipe(
        "single_ppo", "ours: goes on from `single.onnx` by PPO, on machines like the project's",
        method="ppo", prior="gentle", start="single.onnx", weights=_OURS, **_NARROW, spatial=True,
        random=_LIKE_OURS, episode_s=15.0, consecutive=0.5, asymmetric=True, mirrored=True, critic_first=0.2,
        envs=1024, iterations=90, rate=5e-5, schedule="fixed", steps=48, epochs=2, batches=2, discount=0.99,
        trace=0.9, deviation=0.03, deviation_least=0.02, ending=-8.0,
    ),
    Recipe(
        "family", "ours, on a family of drives: goes on from `single.onnx`, the joystick's change limited",
        prior="gentle", start="single.onnx", change=0.2, weights=_CALM, **_EVEN, **_FAMILY, iterations=420,
        rate=1e-3,
    ),
    Recipe(
        "robust", "ours, on a family of drives: goes on from `ppo.onnx` by the simulation's gradient",
        start="ppo.onnx", weights={**_OURS, "action": 0.3}, **_FAMILY, iterations=300, rate=5e-4,
    ),
    Recipe(
        "slew_robust",
        "ours, slew-only, on a family of drives: goes on from `ppo_slew.onnx` by the simulation's gradient",
        task="slew", start="ppo_slew.onnx", weights=_SMOOTH, iterations=150, rate=5e-4,
        **{**_FAMILY, "random": Randomisation(**_DRIVES)},
    ),
    Recipe(
        "path", "ours, led along planned paths: goes on from `full.onnx` by the simulation's gradient",
        start="full.onnx", weights=_ON_PATH, **{**_FAMILY, **_EXACT}, lead_s=1.2, iterations=500, rate=5e-4,
    ),
    Recipe(
        "path_field", "ours, led along planned paths, seeing more of the way and the distances to things: "
        "goes on from `path.onnx` by the simulation's gradient",
        start="path.onnx", weights=_AMONG, **{**_FAMILY, **_EXACT, "envs": 96, "episode_s": 12.0}, **_SEEING,
        iterations=240, rate=7e-4,
    ),
    Recipe(
        "path_field_ppo", "the same by PPO: goes on from `path_field.onnx`", method="ppo",
        start="path_field.onnx", weights=_AMONG, **{**_FAMILY, **_EXACT, **_ALWAYS_FRESH}, **_SEEING,
        asymmetric=True, iterations=100, rate=1e-4, schedule="fixed", steps=48, trace=0.9, deviation=0.05,
        deviation_least=0.02, ending=-8.0,
    ),
    Recipe(
        "slew", "ours, slew-only, for speed", task="slew", prior="parabola", weights=_FAST, **_EVEN,
        first=Shape(5.0, 1.0, 0.2, 0.4), last=Shape(0.7, 0.5, 0.05, 0.05), curriculum=0.25, fade=0.985,
        spatial=True, random=Randomisation(pace=(0.5, 2.0)),
        episode_s=12.0, consecutive=0.5, envs=128, iterations=150, rate=1.5e-3,
    ),
)  # fmt: skip
RECIPES = {r.name: r for r in _RECIPES}
TINY: dict[str, Any] = {
    "envs": 32,
    "iterations": 3,
    "episode_s": 1.0,
    "steps": 4,
    "epochs": 1,
    "batches": 1,
}


GROUPS = ("weights", "random", "first", "last")  # fields of a recipe that hold others


def _with(old: Any, group: str, told: Mapping[str, Any]) -> Any:
    """Weights, ranges or widths with some of them changed; InputError for a name that is none."""
    if group == "weights":
        return {**old, **told}
    for name in told:
        if name not in old.__dict__:
            raise InputError(f"no '{name}' in {group}; {nearest(name, old.__dict__)}")
    return replace(old, **told)


def recipe(name: str, tiny: bool = False, **changed: Any) -> Recipe:
    """The recipe of that name with fields changed; what of it is not, cut down to seconds if `tiny`."""
    if name not in RECIPES:
        raise InputError(f"no recipe '{name}'; {nearest(name, RECIPES)} (valid: {', '.join(RECIPES)})")
    base = RECIPES[name]
    inner = {group: changed.pop(group) for group in GROUPS if isinstance(changed.get(group), dict)}
    told = changed | {g: _with(getattr(base, g), g, values) for g, values in inner.items()}
    return replace(base, **((TINY | told) if tiny else told))
