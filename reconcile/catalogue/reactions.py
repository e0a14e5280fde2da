"""What hangs from an axis and swings pulls back on it.

Where the swing is recorded, as an input of the model: at a port of its own kind, `hung`.  Role `pull` of the
port is what one kilogram hanging there pulls along the axis: for a tool at deflection θ below a trolley

    pull = (g cos θ + l θ'²) sin θ         m/s2, an axis in N

and at radius r from a turning axis r times that (m2/s2, an axis in N.m).  `axis`: the axis that is pulled.

Where it is not recorded (form swinging): at an axis about the vertical that knows its reach r, with the swing
hidden, as the angle about that axis by which the hanging mass is ahead; small swings across the reach.
"""

from reconcile.catalogue.effect import Effect, Namespace, Parameter, Result, none

NEWTON = "Newtonian mechanics: tension of a pendulum's rod on its suspension"
FREQUENCIES = (1.5, 2.5, 4.0)  # rad/s, of the free swing, where fits start: rods of 4.4, 1.6 and 0.6 m


def _reaction(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(None, at={"force": p.mass * c.pull})


def _swinging(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """The mass turns about the axis at `turning` (rad/s), held to the suspension by its weight."""
    ahead_rate = w.turning - c.v
    pulled = p.frequency**2 * w.ahead + p.damping * ahead_rate
    rates = {"ahead": ahead_rate, "turning": -pulled}
    return Result(p.mass * c.reach2 * pulled, rates, {"ahead": 0.0, "turning": c.v})


EFFECTS = (
    Effect(
        "tool_reaction",
        "coupling",
        "F = mass pull, pull = (g cos θ + l θ'²) sin θ of what hangs at deflection θ (times its radius)",
        (Parameter("mass", "kg", none, "Of what hangs", amplitude=True),),
        _reaction,
        NEWTON,
        needs=("pull",),
        port="hung",
    ),
    Effect(
        "tool_reaction",
        "coupling",
        "F = mass r² (frequency² s + damping s'), s'' + damping s' + frequency² s = −v'",
        (
            Parameter("mass", "kg", none, "Of what hangs", amplitude=True),
            Parameter("frequency", "rad/s", lambda s: FREQUENCIES, "Of the free swing", low=0.3, high=10.0),
            Parameter("damping", "1/s", lambda s: (0.1,), "Of the swing"),
        ),
        _swinging,
        NEWTON,
        hidden=("ahead", "turning"),
        beside={"ahead": "position", "turning": "velocity"},
        needs=("reach2", "continuous"),
        form="swinging",
    ),
)
