"""Slew, boom, stick and freely hanging tool as one multibody system with five joints.

Coordinates q = (slew, boom, stick, tool pitch, tool roll) and their rates v.  Everything is written in the
slewing frame S (x radial along the arm, y to the left, z up), which turns with the rate w = v[slew].

Boom, stick and tool are lines of mass with total m, first moment m1 and second moment m2 along a unit
direction D from a base point B.  With point velocities relative to the ground,

    T = 1/2 m |B'|^2 + m1 B'.D' + 1/2 m2 |D'|^2

which for m1 = m L / 2, m2 = m L^2 / 3 is the slender rod 1/2 m v^2 + 1/2 (m L^2 / 12)(|w|^2 - (w.D)^2).
For a vector r(q) fixed to the machine, r' = J v and r'' = J v' + b with

    J = [e_z x r, dr/dq],    b = w^2 e_z x (e_z x r) + 2 w e_z x (dr/dq v) + d/dq(dr/dq v) v,

so that Lagrange's equations read M v' + c = torques (Kane's form of the same thing), including every Coriolis
and centrifugal term, with

    M = sum JB'(m JB + m1 JD) + JD'(m1 JB + m2 JD),    c = sum JB'(m a_B + m1 a_D) + JD'(m1 a_B + m2 a_D),

a_D = b_D and a_B = b_B - gravity.  The tool hangs on a universal joint: pitch about S's y axis at the arm
tip, roll about an axis `grab_offset` below it.  Pitch is measured from the vertical of S, not from the stick.

Left out: the tool's spin inertia about its own axis (its slenderness makes it < 0.2 % of the slew inertia),
bending of boom and stick, the turning base's own tilt motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from fmus.equations import kinematics

SLEW, BOOM, STICK, PITCH, ROLL = range(5)
Z = (0.0, 0.0, 1.0)

Namespace = Any


@dataclass(frozen=True)
class Vector:
    """A machine-fixed vector in S: value (3), Jacobian (3 x 5) and velocity-product acceleration (3)."""

    value: ca.SX
    jacobian: ca.SX
    bias: ca.SX


@dataclass(frozen=True)
class Line:
    """A line of mass: mass (kg), first (kg m) and second moment (kg m2) along `direction` from `base`."""

    mass: Any
    first: Any
    second: Any
    base: Vector
    direction: Vector


@dataclass(frozen=True)
class Motion:
    """Geometry and mass properties at one state; `lines` of mass are boom, stick and tool."""

    q: ca.SX
    v: ca.SX
    lines: tuple[Line, ...]
    carriage: Any  # inertia of everything that only slews, kg m2
    imbalance: tuple[Any, Any]  # first moments of the same about x = 0 and y = 0, kg m
    grab: ca.SX  # grab point in S, m


def motion(angles: Sequence[Any], rates: Sequence[Any], p: Namespace) -> Motion:
    """Build the machine at joint `angles` (rad) and `rates` (rad/s), both of length 5.

    The angles must be symbols: the Jacobians are taken with respect to them.
    """
    q, v = ca.vertcat(*angles), ca.vertcat(*rates)
    boom, stick = q[BOOM], q[BOOM] + q[STICK]
    along_boom = ca.vertcat(ca.cos(boom), 0, ca.sin(boom))
    along_stick = ca.vertcat(ca.cos(stick), 0, ca.sin(stick))
    foot = ca.vertcat(p.boom_foot_x, 0, p.boom_foot_z)
    knee = foot + p.boom_length * along_boom
    tip = knee + p.stick_length * along_stick
    link = -ca.vertcat(ca.sin(q[PITCH]), 0, ca.cos(q[PITCH]))  # down the upper half of the universal joint
    hang = ca.cos(q[ROLL]) * link + ca.vertcat(0, ca.sin(q[ROLL]), 0)  # down the tool
    joint = tip + p.grab_offset * link

    def moving(r: ca.SX) -> Vector:
        return fixed(r, q, v)

    lines = (
        Line(*rod(p.boom_mass, p.boom_length, p.boom_com), moving(foot), moving(along_boom)),
        Line(*rod(p.stick_mass, p.stick_length, p.stick_com), moving(knee), moving(along_stick)),
        Line(*tool_moments(p), moving(joint), moving(hang)),
    )
    grab = joint + (p.tool_length - p.grab_offset) * hang
    return Motion(q, v, lines, carriage_inertia(p), carriage_moment(p), grab)


def rod(mass: Any, length: Any, com: Any) -> tuple[Any, Any, Any]:
    """(mass, first, second moment) of a slender rod whose centre of mass lies at the fraction `com`."""
    return mass, mass * com * length, mass * length**2 * (com**2 + 1 / 12)


def tool_moments(p: Namespace) -> tuple[Any, Any, Any]:
    """(mass, first, second moment) of grab and load about the roll axis, kg, kg m, kg m2."""
    mass = p.tool_mass + p.load_mass
    first = p.tool_mass * p.grab_com + p.load_mass * p.grab_load_com
    grab = p.tool_mass * (p.grab_com**2 + p.grab_gyration**2)
    load = p.load_mass * (p.grab_load_com**2 + p.grab_load_gyration**2)
    return mass, first, grab + load


def carriage_inertia(p: Namespace) -> Any:
    """Inertia about the slew axis of the bodies that only slew (carriage, cabin), kg m2.

    Taken from `kinematics.inertia_z` by leaving arm, tool and load without mass.
    """
    bare = dict(vars(p)) | {"boom_mass": 0, "stick_mass": 0, "tool_mass": 0}
    return kinematics.inertia_z(ca.SX(0), ca.SX(0), 0, type(p)(**bare))


def carriage_moment(p: Namespace) -> tuple[Any, Any]:
    """First moments (kg m) along x and y of the bodies that only slew: a slope pulls on them."""
    return p.carriage_mass * p.carriage_x + p.cabin_mass * p.cabin_x, p.cabin_mass * p.cabin_y


def equations_of_motion(motion: Motion, gravity: ca.SX, shaking: ca.SX | None = None) -> tuple[ca.SX, ca.SX]:
    """Mass matrix M (5 x 5) and c (5) of M v' + c = torques.

    `gravity` (m/s2) is the gravity vector in S; `shaking` (m/s2) an extra acceleration of the tool's
    suspension in S, felt by the tool alone and passed on by it to the arm.
    """
    mass, c = ca.SX(5, 5), ca.SX.zeros(5)
    mass[SLEW, SLEW] = motion.carriage
    # the slewing bodies' weight turns the machine on a slope
    c[SLEW] = motion.imbalance[1] * gravity[0] - motion.imbalance[0] * gravity[1]
    for line in motion.lines:
        jb, jd = line.base.jacobian, line.direction.jacobian
        a_base, a_dir = line.base.bias - gravity, line.direction.bias
        if line is motion.lines[-1] and shaking is not None:
            a_base = a_base + shaking
        mass += jb.T @ (line.mass * jb + line.first * jd) + jd.T @ (line.first * jb + line.second * jd)
        c += jb.T @ (line.mass * a_base + line.first * a_dir)
        c += jd.T @ (line.first * a_base + line.second * a_dir)
    return mass, c


def tool_swing(motion: Motion, gravity: ca.SX, acceleration: ca.SX) -> ca.SX:
    """(pitch, roll) in rad/s2 of a tool without dampers, where slew, boom and stick accelerate so (3)."""
    mass, c = equations_of_motion(replace(motion, lines=motion.lines[-1:]), gravity)
    # the joint's two axes are at right angles: neither pulls on the other but by velocities, in c
    right = -c[PITCH:] - mass[PITCH:, :PITCH] @ acceleration
    return ca.vertcat(right[0] / mass[PITCH, PITCH], right[1] / mass[ROLL, ROLL])


def tool_rotation(q: ca.SX) -> ca.SX:
    """Rotation matrix from the tool's axes to S: R_y(pitch) R_x(roll)."""
    cy, sy, cx, sx = ca.cos(q[PITCH]), ca.sin(q[PITCH]), ca.cos(q[ROLL]), ca.sin(q[ROLL])
    turn_y = ca.blockcat([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return turn_y @ ca.blockcat([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])


def tool_rate(q: ca.SX, v: ca.SX) -> ca.SX:
    """Angular velocity of the tool in S, rad/s."""
    return ca.vertcat(ca.cos(q[PITCH]) * v[ROLL], v[PITCH], v[SLEW] - ca.sin(q[PITCH]) * v[ROLL])


def grab_jacobian(motion: Motion) -> ca.SX:
    """Jacobian (3 x 5) of the grab point's velocity, in S."""
    return fixed(motion.grab, motion.q, motion.v).jacobian


def energy(motion: Motion, gravity: ca.SX) -> tuple[ca.SX, ca.SX]:
    """(kinetic, potential) energy, J; `gravity` (m/s2) is the gravity vector in S."""
    mass, _ = equations_of_motion(motion, ca.SX.zeros(3))
    moment = ca.vertcat(*motion.imbalance, 0)
    for line in motion.lines:
        moment += line.mass * line.base.value + line.first * line.direction.value
    return ca.dot(motion.v, mass @ motion.v) / 2, -ca.dot(gravity, moment)


def solve(mass: ca.SX, right: ca.SX) -> ca.SX:
    """x of M x = right for a symmetric positive definite M, by an explicit LDL' without pivoting."""
    n = right.shape[0]
    low, diagonal = ca.SX.eye(n), [ca.SX(0)] * n
    for j in range(n):
        diagonal[j] = mass[j, j] - sum(low[j, k] ** 2 * diagonal[k] for k in range(j))
        for i in range(j + 1, n):
            rest = mass[i, j] - sum(low[i, k] * low[j, k] * diagonal[k] for k in range(j))
            low[i, j] = rest / diagonal[j]
    y = [ca.SX(0)] * n
    for i in range(n):
        y[i] = right[i] - sum(low[i, k] * y[k] for k in range(i))
    x = [y[i] / diagonal[i] for i in range(n)]
    for i in reversed(range(n)):
        x[i] = x[i] - sum(low[k, i] * x[k] for k in range(i + 1, n))
    return ca.vertcat(*x)


def gravity_in_s(q_slew: Any, p: Namespace) -> ca.SX:
    """Gravity vector in the slewing frame for a base standing on a slope.

    `slope_pitch` (nose down, about y) and `slope_roll` (right side down, about x) tilt the base, rad.
    """
    x = p.gravity * ca.sin(p.slope_pitch)
    y = -p.gravity * ca.sin(p.slope_roll) * ca.cos(p.slope_pitch)
    z = -p.gravity * ca.cos(p.slope_roll) * ca.cos(p.slope_pitch)
    c, s = ca.cos(q_slew), ca.sin(q_slew)
    return ca.vertcat(c * x + s * y, c * y - s * x, z)


def hanging(gravity: Any) -> tuple[Any, Any]:
    """(pitch, roll) of the tool at rest under `gravity` in S."""
    gx, gy, gz = gravity[0], gravity[1], gravity[2]
    return ca.atan2(-gx, -gz), ca.atan2(gy, ca.sqrt(gx**2 + gz**2))


def fixed(r: ca.SX, q: ca.SX, v: ca.SX) -> Vector:
    """A machine-fixed r(q) in S at joint rates `v`, its velocity and acceleration seen from the ground."""
    r = ca.SX(r)
    relative = ca.jacobian(r, q)
    rate = relative @ v
    spin = v[SLEW]
    jacobian = ca.horzcat(_cross_z(r), relative[:, 1:])
    bias = spin**2 * _cross_z(_cross_z(r)) + 2 * spin * _cross_z(rate) + ca.jtimes(rate, q, v)
    return Vector(r, jacobian, bias)


def _cross_z(r: ca.SX) -> ca.SX:
    """e_z x r."""
    return ca.vertcat(-r[1], r[0], 0)
