#include "axis.h"

#include <math.h>

#define EXPORT __attribute__((visibility("default")))

static const char *NAMES[] = {
#define X(name, absent) #name,
    BT_AXIS_PARAMETERS(X)
#undef X
};
static const double ABSENT[] = {
#define X(name, absent) absent,
    BT_AXIS_PARAMETERS(X)
#undef X
};

EXPORT const char *bt_axis_name(int i) {
  return i < (int)(sizeof NAMES / sizeof *NAMES) ? NAMES[i] : 0;
}
EXPORT double bt_axis_absent(int i) { return ABSENT[i]; }

EXPORT double bt_play(double *held, double value, double gap) {
  *held = fmin(fmax(*held, value - 0.5 * gap), value + 0.5 * gap);
  return *held;
}

static double shoulder(double u, double width) { /* narrower and rounder on the negative side */
  if (width <= 0.0) return u;
  const double side = u > 0.0 ? width : 0.4 * width;
  return u - side * tanh(u / side);
}

double bt_chain(const Axis *a, Chain *m, double command, double other) {
  double u = command + a->in_crosstalk * other + a->in_offset;
  u *= u > 0.0 ? 1.0 + a->in_asymmetry : 1.0 - a->in_asymmetry;
  if (a->in_backlash > 0.0) u = bt_play(&m->backlash, u, a->in_backlash);
  if (a->in_hysteresis > 0.0)
    u = 0.5 * u + 0.25 * bt_play(&m->wide, u, a->in_hysteresis) +
        0.25 * bt_play(&m->narrow, u, 0.5 * a->in_hysteresis);
  u = u > 0.0 ? fmax(u - a->in_dead_zone, 0.0) : fmin(u + a->in_dead_zone, 0.0);
  u = shoulder(u, a->x_shoulder);
  u *= 1.0 - a->in_curve + a->in_curve * fabs(u) / a->in_travel;
  u += a->x_half_wave * (u > 0.0 ? u * u : 0.0);
  return fmin(fmax(u, -a->in_saturation), a->in_saturation);
}

double bt_limited(const Axis *a, const Held *held, double t) {
  if (!isfinite(a->in_rate)) return held->target;
  const double most = a->in_rate * (t - held->since);
  return held->from + fmin(fmax(held->target - held->from, -most), most);
}

double bt_lagging(double value, double behind, double lag) { return lag > 0.0 ? (value - behind) / lag : 0.0; }

int bt_has_dry(const Axis *a) {
  return a->coulomb_plus > 0.0 || a->coulomb_minus > 0.0 || a->stribeck_excess > 0.0 ||
         a->load_friction > 0.0 || a->x_place_friction > 0.0;
}

double bt_dry(const Axis *a, double sign, double q, double v, double transmitted) {
  double level = sign > 0.0 ? a->coulomb_plus : a->coulomb_minus;
  level += a->load_friction * fabs(transmitted);
  if (a->stribeck_excess != 0.0) {
    const double ratio = v / a->stribeck_speed;
    level += a->stribeck_excess * exp(-ratio * ratio);
  }
  if (a->x_place_friction != 0.0) level += a->x_place_friction * (1.0 + sin(5.0 * q));
  return fmax(level, 0.0);
}

double bt_forces(const Axis *a, double q, double v, double dahl) {
  double f = a->load - (a->gravity != 0.0 ? a->gravity * sin(q) : 0.0) - a->stiffness * q - a->cubic * q * q * q;
  if (a->slope_sin != 0.0 || a->slope_cos != 0.0) f += a->slope_sin * sin(q) + a->slope_cos * cos(q);
  if (a->ripple_sin != 0.0 || a->ripple_cos != 0.0)
    f += a->ripple_sin * sin(a->ripple_order * q) + a->ripple_cos * cos(a->ripple_order * q);
  f -= (v > 0.0 ? a->viscous_plus : a->viscous_minus) * v + a->drag * v * fabs(v);
  if (a->wind_drag != 0.0) f += a->wind_drag * (a->wind_speed - v) * fabs(a->wind_speed - v);
  f -= a->dahl_force * dahl;
  const double depth = fabs(q) - a->stop_position;
  if (depth > 0.0) {
    const double side = q > 0.0 ? 1.0 : -1.0;
    f -= side * fmax(a->stop_stiffness * depth + a->stop_damping * side * v, 0.0);
  }
  return f;
}

/* Dahl's bristle, as a share of the Coulomb level: sigma/Fc v (1 - z sgn v). */
double bt_dahl_rate(const Axis *a, double v, double dahl) {
  if (a->dahl_force <= 0.0) return 0.0;
  const double sign = v > 0.0 ? 1.0 : -1.0;
  return a->dahl_stiffness / a->dahl_force * v * (1.0 - sign * dahl);
}
