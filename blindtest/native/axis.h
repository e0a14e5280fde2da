/* What every driven axis has: the chain from command to drive, forces, and the chain to the recording.
 *
 * An effect is absent when its parameter is 0 (a limit: infinite).  Order of the input chain: crosstalk,
 * offset, asymmetric gain, backlash, hysteresis, dead zone, curve, saturation (all at the samples, where
 * the command is held), then delay, rate limit, lag in continuous time.
 */
#ifndef BT_AXIS_H
#define BT_AXIS_H

/* name, value when absent */
#define BT_AXIS_PARAMETERS(X)                                                                           \
  X(in_crosstalk, 0)                                                                                    \
  X(in_offset, 0)                                                                                       \
  X(in_asymmetry, 0)                                                                                    \
  X(in_backlash, 0)       /* full gap */                                                                \
  X(in_hysteresis, 0)     /* full width of the widest of two plays */                                   \
  X(in_dead_zone, 0)      /* half width */                                                              \
  X(in_curve, 0)          /* u (1 - c + c |u| / travel) */                                              \
  X(in_travel, 1)                                                                                       \
  X(in_saturation, INFINITY)                                                                            \
  X(in_delay, 0)                                                                                        \
  X(in_rate, INFINITY)                                                                                  \
  X(in_lag, 0)                                                                                          \
  X(coulomb_plus, 0)                                                                                    \
  X(coulomb_minus, 0)                                                                                   \
  X(stribeck_excess, 0)   /* static minus Coulomb level */                                              \
  X(stribeck_speed, 1)                                                                                  \
  X(viscous_plus, 0)                                                                                    \
  X(viscous_minus, 0)                                                                                   \
  X(load_friction, 0)     /* dry friction per unit of transmitted force */                              \
  X(drag, 0)              /* v |v| */                                                                   \
  X(wind_drag, 0)         /* (w - v) |w - v| */                                                         \
  X(wind_speed, 0)                                                                                      \
  X(dahl_force, 0)                                                                                      \
  X(dahl_stiffness, 1)                                                                                  \
  X(load, 0)                                                                                            \
  X(gravity, 0)           /* g sin q */                                                                 \
  X(slope_sin, 0)                                                                                       \
  X(slope_cos, 0)                                                                                       \
  X(stiffness, 0)                                                                                       \
  X(cubic, 0)                                                                                           \
  X(ripple_sin, 0)                                                                                      \
  X(ripple_cos, 0)                                                                                      \
  X(ripple_order, 1)                                                                                    \
  X(stop_position, INFINITY)                                                                            \
  X(stop_stiffness, 0)                                                                                  \
  X(stop_damping, 0)                                                                                    \
  X(pose_inertia, 0)      /* J (1 + a cos q) */                                                         \
  X(shaft_stiffness, 0)   /* 0: rigid; else the drive is a mass of its own */                           \
  X(shaft_damping, 0)                                                                                   \
  X(shaft_share, 0.3)     /* of the inertia that the drive's mass has */                                \
  X(shaft_gap, 0)         /* full gap */                                                                \
  X(out_scale, 0)         /* of q */                                                                    \
  X(out_scale_v, 0)                                                                                     \
  X(out_bias_q, 0)                                                                                      \
  X(out_bias_v, 0)                                                                                      \
  X(out_drift, 0)         /* of q, a second */                                                          \
  X(out_delay_q, 0)                                                                                     \
  X(out_delay_v, 0)                                                                                     \
  X(out_lag_q, 0)                                                                                       \
  X(out_lag_v, 0)                                                                                       \
  X(out_clock, 0)         /* its logger falls behind, s a second (difference equations and slew) */       \
  X(out_backlash, 0)      /* of q, full gap */                                                          \
  X(x_shoulder, 0)        /* outside the catalogue: see README.md */                                    \
  X(x_place_friction, 0)                                                                                \
  X(x_gain_drift, 0)                                                                                    \
  X(x_half_wave, 0)

typedef struct {
#define X(name, absent) double name;
  BT_AXIS_PARAMETERS(X)
#undef X
} Axis;

/* The memory of the chain at the samples. */
typedef struct {
  double backlash, wide, narrow;
} Chain;

/* A command sample through everything that happens at the samples; `other`: the crosstalking command. */
double bt_chain(const Axis *a, Chain *memory, double command, double other);

/* A command that is held: what it comes to behind a rate limit, where that came from, and since when. */
typedef struct {
  double target, from, since;
} Held;

/* A held command behind the rate limit, which acts between samples, at t. */
double bt_limited(const Axis *a, const Held *held, double t);

/* Rate of what follows a value by a lag; 0 without one. */
double bt_lagging(double value, double behind, double lag);

double bt_play(double *held, double value, double gap);

/* Dry friction (without sign) while moving in the direction `sign` at `v`; at v = 0 the static level. */
double bt_dry(const Axis *a, double sign, double q, double v, double transmitted);

/* All forces of the block but dry friction and drive. */
double bt_forces(const Axis *a, double q, double v, double dahl);

double bt_dahl_rate(const Axis *a, double v, double dahl);

int bt_has_dry(const Axis *a);

#endif
