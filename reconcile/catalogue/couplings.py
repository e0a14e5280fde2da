"""Between drive and load of an axis: a shaft that gives or a gear with play, inertia on both its ends.

The model's inertia J is split: a share turns with the drive, the rest with the load, on which the model's own
friction and springs, and all forces that are attached, act.  What the model's axis is, and its outputs show,
is the load (sensor on the load), or the drive (form motor_sensor: an encoder on the motor); the other end is
hidden, as its twist against the one shown.  On models with fixed steps there are none: a shaft is faster.
"""

import casadi as ca

from reconcile.catalogue import smooth
from reconcile.catalogue.effect import Effect, Namespace, Parameter, Result, Scales, Starts

SHAFT = "Meriam and Kraige, Engineering Mechanics: Dynamics: two inertias on a shaft with damping"
GEAR = "Nordin and Gutman, Automatica 38 (2002) 1633: dead-zone model of backlash"
COUNT = 4  # frequencies, of the two ends against each other, where fits start
SHARES = (0.3, 0.7)
GAPS = (0.3, 3.0, 30.0)  # of what the closed gear gives way under the forces met: where fits of a gear start
CONTACT = 0.5  # damping ratio of a closed gear where fits start: it hardly bounces


def _frequencies(s: Scales) -> list[float]:
    """From what the outputs forget in to what their samples still show, rad/s."""
    low, high = 2.0 / s.memory_s, 2.0 / s.period_s
    return [low * (max(high / low, 2.0)) ** (k / (COUNT - 1)) for k in range(COUNT)]


def _stiffness(s: Scales) -> list[float]:
    """Stiffness for natural frequencies of the ends against each other, for each of SHARES."""
    return [s.inertia * a * (1.0 - a) * f**2 for a in SHARES for f in _frequencies(s)]


def _closed(s: Scales) -> list[float]:
    """Stiffness of a closed gear, which swings hardly slower than samples show."""
    return [s.inertia * a * (1.0 - a) * (1.6 / s.period_s) ** 2 for a in SHARES for _ in GAPS]


def _gaps(s: Scales) -> list[float]:
    return [a * s.f / k for a, k in zip(GAPS * len(SHARES), _closed(s), strict=True)]


def _damping(s: Scales) -> list[float]:
    return [0.2 * s.inertia * a * (1.0 - a) * f for a in SHARES for f in _frequencies(s)]


def _compliance(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """The torque that the twist (hidden end against the shown one, seen from the drive) makes."""
    return Result(p.k * c.twist + p.c * c.twist_rate)


def _gear(c: Namespace, p: Namespace, w: Namespace) -> Result:
    half = 0.5 * p.gap
    low, high = c.twist + half, c.twist - half
    width = c.width * p.gap
    closed = 1.0 + 0.5 * (high / ca.sqrt(high**2 + width**2) - low / ca.sqrt(low**2 + width**2))
    damping = 2.0 * p.damping * ca.sqrt(p.k * c.inertia * p.share * (1.0 - p.share))
    squeezed = smooth.dead_zone(c.twist, -half, half, width)
    return Result(p.k * squeezed + damping * closed * c.twist_rate)


def _share(starts: Starts) -> Parameter:
    return Parameter("share", "1", starts, "Of the inertia, turns with the drive", low=0.02, high=0.98)


def _entries(form: str, shows: str) -> tuple[Effect, Effect]:
    common = {"hidden": ("twist", "twist_rate"), "gated": True, "form": form, "shows": shows}
    common["beside"] = {"twist": "position", "twist_rate": "velocity"}
    compliance = Effect(
        "structural_compliance",
        "coupling",
        "share J v_m' = drive − T, (1 − share) J v' = rest + T, T = k (q_m − q) + c (v_m − v)",
        (
            Parameter("k", "{f}/({q})", _stiffness, "Stiffness"),
            Parameter("c", "{f}/({v})", _damping, "Damping"),
            _share(lambda s: [a for a in SHARES for _ in range(COUNT)]),
        ),
        _compliance,
        SHAFT,
        needs=("continuous", "driven"),
        becomes={"": "k → ∞"},
        **common,  # type: ignore[arg-type]
    )
    gear = Effect(
        "gear_backlash",
        "coupling",
        "share J v_m' = drive − T, (1 − share) J v' = rest + T, T = 0 within the gap of q_m − q, else stiff",
        (
            Parameter("gap", "{q}", _gaps, "Full gap"),
            _share(lambda s: [a for a in SHARES for _ in GAPS]),
            Parameter("k", "{f}/({q})", _closed, "Stiffness of the closed gear"),
            Parameter("damping", "1", lambda s: (CONTACT,), "Ratio, of the closed gear", low=0.02, high=2.0),
        ),
        _gear,
        GEAR,
        needs=("continuous", "driven", "q"),
        width="gap",
        becomes={"": "gap → 0 and k → ∞"},
        **common,  # type: ignore[arg-type]
    )
    return compliance, gear


EFFECTS = (*_entries("", "load"), *_entries("motor_sensor", "motor"))
