"""What the tests of the reference machine share: poses, parameters, a working cycle."""

from types import SimpleNamespace

from fmus.models.machine.model import MODEL

ANGLES = [f"true_q_{j}" for j in ("slew", "boom", "stick", "tool_x", "tool_y")]
POSES = [(0.8, -0.3), (0.8, -2.1), (1.1, -1.2), (1.2, -1.7), (1.4, -0.3), (1.4, -2.1)]  # (boom, stick)
COARSE = 0.002  # s, step where a test is long and asks for behaviour rather than digits
PARAMETERS = SimpleNamespace(**{v.name: v.start for v in MODEL.parameters})


def start(q_boom: float, q_stick: float, **others: float) -> dict[str, float]:
    """Parameter overrides that start in a pose."""
    return {"start_q_boom": q_boom, "start_q_stick": q_stick, **others}


def working(t: float) -> dict[str, float]:
    """All three functions at once, with reversals, for eight seconds."""
    return {
        "u_slew": 0.8 if t < 4 else -0.3 if t < 6 else 0.0,
        "u_boom": 0.6 if 1 <= t < 2.5 else -0.5 if 4 <= t < 6 else 0.0,
        "u_stick": -0.7 if 2 <= t < 3 else 0.4 if 5 <= t < 7 else 0.0,
    }
