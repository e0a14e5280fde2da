"""Counts steps and fails after `limit` of them: the root of a negative number is none."""

import casadi as ca

from fmus.definition import Model, Variable

MODEL = Model(
    name="burst",
    description="Fails on purpose",
    kind="discrete",
    step=0.01,
    states=(Variable("n", "1"), Variable("root", "1")),
    inputs=(Variable("push", "1", start=0.5),),
    outputs=(Variable("count", "1"),),
    parameters=(Variable("limit", "1", start=3.0),),
    rhs=lambda x, u, m, p: {"n": x.n + 1, "root": ca.sqrt(p.limit - x.n - 1)},
    out=lambda x, u, m, p: {"count": x.n},
)
