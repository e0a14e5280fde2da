"""The form of a catalogue entry: where an effect attaches, its equation, its parameters and their limits.

An effect is written once, as a CasADi expression of what is at its port (`c`), its parameters (`p`) and its
hidden states (`w`).  Parameters that enter linearly and are zero where the effect is absent are amplitudes;
an effect that is not linear in any parameter has a gate instead (0 absent, 1 there), with which it can be
scored linearly at every start of its parameters before any fit.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

Place = Literal["input", "hydraulic", "force", "inertia", "coupling", "output"]
AXIS_PLACES = ("force", "inertia", "coupling")  # where an effect acts on an axis
Scalar = Any  # casadi.SX
Namespace = Any  # SimpleNamespace of Scalar

ANY = -float("inf")  # the least of a parameter whose sign may be either


@dataclass(frozen=True)
class Scales:
    """Sizes met in the data at a port, from which starts and smoothing widths are made.

    `u`: largest of the input; `v`, `q`, `f`: of speed, position and force at a force port (f: inertia times
    acceleration); `drive`: of the force of inputs there; `y`: of the output; `p`, `d`: of pressure difference
    and demand at a hydraulic port; `period_s`: sample period; `memory_s`: time over which the outputs forget
    where they were; `duration_s`: of the longest recording; `step`: of an output's numbers, 0 if they have
    none.  All > 0, but `drive` and `step` may be 0.
    """

    u: float = 1.0
    v: float = 1.0
    q: float = 1.0
    f: float = 1.0
    drive: float = 0.0
    y: float = 1.0
    step: float = 0.0
    inertia: float = 1.0
    period_s: float = 0.02
    memory_s: float = 0.3
    duration_s: float = 1.0
    q_low: float = -1.0
    q_high: float = 1.0
    angular: bool = False  # the port turns: q in rad
    p: float = 1e7
    d: float = 1.0


Starts = Callable[[Scales], Sequence[float]]


@dataclass(frozen=True)
class Parameter:
    """A parameter: `unit` with {u}, {f}, {v}, {q}, {y}, {inertia} for the units at the port.

    `starts` gives the grid of starts; the k-th start of all parameters of an effect belong together.
    `low`, `high` bound it; a negative `low` of -inf lets its sign be either.  `least`, `most`: bounds by the
    scales.
    """

    name: str
    unit: str
    starts: Starts
    description: str = ""
    amplitude: bool = False
    low: float = 0.0
    high: float = float("inf")
    least: Callable[[Scales], float] = lambda s: -float("inf")
    most: Callable[[Scales], float] = lambda s: float("inf")

    def bounds(self, scales: Scales) -> tuple[float, float]:
        """The least and the most that it may be at a port of these scales."""
        return max(self.low, self.least(scales)), min(self.high, self.most(scales))

    def within(self, value: float, low: float, high: float) -> list[float]:
        """An interval about a value, no further than it may be at all: no lag below 0."""
        return [max(low, min(self.low, value)), min(high, max(self.high, value))]


@dataclass(frozen=True)
class Result:
    """What an effect makes: the new value (input, output), force, or inertia with the force beside it.

    `rates`: of the hidden states; `next`: their values one step on, where the model goes in steps (exact for
    any step; without it a step adds rate times step).  `dry`: on models in steps, the dry friction against
    motion forwards and backwards (both >= 0), which a step takes off the speed and stops it at zero.
    `at`: what an effect at a port of its own kind changes there, by role (hydraulics.py, pendulum.py).
    """

    value: Scalar
    rates: Mapping[str, Scalar] = field(default_factory=dict)
    starts: Mapping[str, Scalar] = field(default_factory=dict)
    force: Scalar = 0.0
    next: Mapping[str, Scalar] = field(default_factory=dict)
    dry: tuple[Scalar, Scalar] | None = None
    at: Mapping[str, Scalar] = field(default_factory=dict)


Build = Callable[[Namespace, Namespace, Namespace], Result]


@dataclass(frozen=True, eq=False)
class Effect:
    """One entry.  `equation` is in words of mathematics; `width` says which scale smooths it (gap: its own).

    `becomes` names the simpler effects it turns into in a limit; `form` tells entries of one name apart.
    `covers`: the one of them that adds nothing beside it, whatever its parameters.
    `delays`: the effect is a transport delay, which no equation holds; its one parameter is the delay, or
    with `clock` the delay gained per second of the recording.  `shows`: of a coupling, the side of the shaft
    that the model's axis is (and its outputs show); the other side is hidden.
    `beside`: hidden states that have to be as exact as the axis's own position or velocity.
    `within`: hidden states that lie within a share of a parameter of where they rest (standard deviation).
    `port`: the kind of port, where it is not what the place says (an input, an output, an axis); `needs` are
    then roles of it.  `clocked`: it uses the time `c.t`.  `over`: it is a curve over that (freeform.py),
    through points around `c.middle`, `c.spacing` apart.

    A build finds in `c` what is at the port, the smoothing `width`, and `step` (s; None: continuous).
    """

    name: str
    place: Place
    equation: str
    parameters: tuple[Parameter, ...]
    build: Build | None
    source: str
    hidden: tuple[str, ...] = ()
    beside: Mapping[str, Literal["position", "velocity"]] = field(default_factory=dict)
    within: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    gated: bool = False
    width: Literal["u", "v", "q", "y", "time", "gap"] | None = None
    becomes: Mapping[str, str] = field(default_factory=dict)
    covers: str = ""
    form: str = ""
    needs: tuple[str, ...] = ()  # what the port must have: "q" (a position), "rad" (an angle) ...
    delays: bool = False
    clock: bool = False
    shows: Literal["load", "motor"] = "load"
    port: Literal["", "hydraulic", "pendulum", "hung", "inputs", "outputs", "offset", "turned"] = ""
    clocked: bool = False
    dry: bool = False  # friction that holds what stands
    over: Literal["", "u", "v", "q", "t"] = ""

    @property
    def key(self) -> str:
        """The entry's own key."""
        return f"{self.name}.{self.form}" if self.form else self.name

    @property
    def shaft(self) -> bool:
        """Whether it parts an axis in two ends (couplings.py)."""
        return self.place == "coupling" and "twist" in self.hidden

    @property
    def amplitudes(self) -> tuple[Parameter, ...]:
        """Parameters that are zero where the effect is absent."""
        return tuple(p for p in self.parameters if p.amplitude)

    def grid(self, scales: Scales) -> int:
        """How many starts it has."""
        return max((len(tuple(p.starts(scales))) for p in self.parameters), default=1)

    def start(self, scales: Scales, k: int) -> dict[str, float]:
        """The k-th start (the last one, if there are fewer)."""
        found = {}
        for p in self.parameters:
            values = tuple(p.starts(scales))
            found[p.name] = float(values[min(k, len(values) - 1)])
        return found


def none(_: Scales) -> Sequence[float]:
    """Starts of an amplitude: nothing."""
    return (0.0,)
