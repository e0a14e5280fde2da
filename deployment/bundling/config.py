"""The generated part of a core beside its blocks: constants, limits of the gate, geometry of the machine."""

from collections.abc import Iterable, Mapping

import casadi as ca

from deployment.bundling import guard
from deployment.bundling.blocks import Block, External, Outside
from fmus.equations import kinematics
from fmus.toolchain import codegen
from runtime.image import INPUT, TICK_S, Group, group
from specs import parameters
from specs.signals import signal

GATE_SENSORS = ("imu_cabin_rate_z", "q_slew", "q_boom", "q_stick", "qd_boom", "qd_stick")
FILE = "gate"  # of specs/parameters


def constants(changes: Mapping[str, float]) -> dict[str, float]:
    """Values of specs/parameters/gate.toml, some changed; InputError for a wrong one."""
    known = parameters.load(FILE)
    for name, value in changes.items():
        parameters.parameter(name, FILE).check(value)
    return {name: changes.get(name, p.value) for name, p in known.items()}


def config_h(c: Mapping[str, float], controller: Block | External | Outside) -> str:
    """`core_config.h`: what check.c, mode.c and step.c need to know."""
    values = {
        "SLR_DEBOUNCE": ticks(c["input_debounce"]),
        "SLR_STUCK": ticks(c["input_stuck"]),
        "SLR_MOVING": c["input_moving"],
        "SLR_DEFLECTED": c["joystick_deflected"],
        "SLR_TARGET_TOLERANCE": c["target_tolerance"],
        "SLR_OVERRUNS": int(c["overruns_allowed"]),
        "SLR_STATUS_TICKS": ticks(1.0 / (signal("controller_heartbeat").rate_hz or 50.0)),
    }
    if isinstance(controller, External):
        values |= {"SLR_EXTERNAL_PERIOD": controller.period}
    lines = [f"#define {name} {value!r}" for name, value in values.items()]
    if isinstance(controller, External):
        lines.append(f"#define SLR_EXTERNAL_OUTPUTS {_places('OUT', controller.outputs)}")
    if isinstance(controller, Outside):
        lines.append(f"#define SLR_OUTSIDE_INPUTS {_places('IN', controller.commands)}")
        lines.append(f"#define SLR_OUTSIDE_OUTPUTS {_places('OUT', controller.outputs)}")
        lines.append(f"#define SLR_OUTSIDE_COMMANDS {len(controller.outputs)}")
    return (
        "/* Constants of the core, generated from specs/parameters/gate.toml. */\n" + "\n".join(lines) + "\n"
    )


def _places(side: str, names: Iterable[str]) -> str:
    return "{" + ", ".join(f"SLR_{side}_{name}" for name in names) + "}"


def config_c(
    controller: Block | External | Outside,
    arm: Block,
    estimator: Block,
    c: Mapping[str, float],
    zeros: Mapping[str, float],
    guarded: bool = False,
) -> str:
    """`core_config.c`: which blocks, which inputs they need, sensors' zeros, the gate's limits."""
    needed = {*controller.inputs, *arm.inputs, *GATE_SENSORS, *(guard.SENSORS if guarded else ())}
    off = ", ".join(repr(zeros.get(s.name, 0.0)) for s in INPUT.signals)
    sensors = [int(s.name in needed and group(s) in (Group.SENSOR, Group.POLICY)) for s in INPUT.signals]
    return (
        '/* The bundle\'s own part of the core, generated. */\n#include "slr.h"\n\n'
        f"extern const SlrBlock {controller.symbol}, {arm.symbol}, {estimator.symbol};\n"
        f"const SlrBlock *const slr_controller = &{controller.symbol};\n"
        f"const SlrBlock *const slr_arm = &{arm.symbol};\n"
        f"const SlrBlock *const slr_estimator = &{estimator.symbol};\n"
        f"const uint8_t slr_needed[SLR_IN_COUNT] = {{{', '.join(map(str, sensors))}}};\n"
        f"const double slr_zero[SLR_IN_COUNT] = {{{off}}};\n"
        f"const SlrGateLimits slr_limits = {limits(c)};\n"
        "const char slr_identity_text[] = SLR_IDENTITY;\n"
    )


def parameters_c(digest: str) -> str:
    """`parameters.c`: which parameters.json belongs to the core."""
    return f'#include "slr.h"\n\nconst char *slr_parameters(void) {{ return "{digest}"; }}\n'


def limits(c: Mapping[str, float]) -> str:
    """The initialiser of a SlrGateLimits; rates a tick."""
    speeds = ", ".join(repr(c[f"gate_speed_{name}"]) for name in ("slew", "arm", "arm"))
    zones = ", ".join([repr(c["gate_zone_point"])] * 2 + [repr(c["gate_zone_joint"])] * 4)
    return (
        f"{{.range = {c['gate_range']!r}, .creep = {c['gate_creep']!r}, "
        f".rise = {c['gate_rise'] * TICK_S!r}, .fall = {c['gate_fall'] * TICK_S!r}, "
        f".speed = {{{speeds}}}, .ahead = {c['gate_ahead']!r}, .zone = {{{zones}}}}}"
    )


def geometry_c() -> str:
    """`geometry.c`: walls of the gate, reach of a target, pose for the guard: fmus.equations.kinematics."""
    generator = ca.CodeGenerator("geometry.c", codegen.CASADI_OPTIONS)
    generator.add(geometry())
    generator.add(guard.pose())
    code = codegen.with_our_mathematics(generator.dump())
    return code + (
        '\n#include "slr.h"\n'
        "void slr_geometry(const double *joints, const double *target, double *walls, double *distance,\n"
        "                  double *reach) {\n"
        "  const double *arg[] = {joints, target};\n  double *res[] = {walls, distance, reach};\n"
        "  slr_geometry_f(arg, res, 0, 0, 0);\n}\n" + guard.POSE_C
    )


def geometry() -> ca.Function:
    """(joints: q_slew, q_boom, q_stick, qd_boom, qd_stick; target) -> walls [4 x 6], distance, reach.

    A wall's column is distance, rate, gradient by boom and by stick; the order is that of gate.h.
    """
    p = kinematics.geometry()
    joints, target = ca.SX.sym("joints", 5), ca.SX.sym("target", 3)
    q_slew, q, qd = joints[0], joints[1:3], joints[3:5]
    radius, tip = kinematics.arm_tip(q[0], q[1], p)
    point = ca.vertcat(*kinematics.grab_point(q_slew, radius, tip, p))
    distances = [
        point[2] - p.keepout_height,
        radius - p.keepout_radius,
        *(q[0] - p.boom_min, p.boom_max - q[0], q[1] - p.stick_min, p.stick_max - q[1]),
    ]
    columns = []
    for d in distances:
        gradient = ca.jacobian(d, q)
        columns.append(ca.vertcat(d, ca.mtimes(gradient, qd), gradient.T))
    return ca.Function(
        "slr_geometry_f",
        [joints, target],
        [ca.densify(ca.horzcat(*columns)), ca.norm_2(point - target), reach(target)],
    )


def reach(target: ca.SX) -> ca.SX:
    """By how much the grab point can hang at `target` [m or rad]; negative where `reachable` says no."""
    p = kinematics.geometry()
    radius, z = ca.norm_2(target[:2]), target[2]
    _, q_boom, q_stick = kinematics.inverse(radius, 0.0, z, p)
    tip, height = kinematics.arm_tip(q_boom, q_stick, p)
    miss = ca.norm_2(ca.vertcat(tip - radius, height - p.tool_length - z))
    joints = (q_boom - p.boom_min, p.boom_max - q_boom, q_stick - p.stick_min, p.stick_max - q_stick)
    rooms = (z - p.keepout_height, radius - p.keepout_radius, 1e-6 - miss, *joints)
    least = rooms[0]
    for room in rooms[1:]:
        least = ca.fmin(least, room)
    return least


def ticks(seconds: float) -> int:
    """Whole base ticks."""
    return round(seconds / TICK_S)
