"""What hangs from an axis and swings pulls back on it: at a port of its own kind, `hung`.

The model knows the axis; the swing is recorded, as an input of the model.  Role `pull` of the port is what
one kilogram hanging there pulls along the axis: for a tool at deflection θ below a trolley

    pull = (g cos θ + l θ'²) sin θ         m/s2, an axis in N

and at radius r from a turning axis r times that (m2/s2, an axis in N.m).  `axis`: the axis that is pulled.
"""

from reconcile.catalogue.effect import Effect, Namespace, Parameter, Result, none


def _reaction(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(None, at={"force": p.mass * c.pull})


EFFECTS = (
    Effect(
        "tool_reaction",
        "coupling",
        "F = mass pull, pull = (g cos θ + l θ'²) sin θ of what hangs at deflection θ (times its radius)",
        (Parameter("mass", "kg", none, "Of what hangs", amplitude=True),),
        _reaction,
        "Newtonian mechanics: tension of a pendulum's rod on its suspension",
        needs=("pull",),
        port="hung",
    ),
)
