/* A position servo: one axis, rigid or with a drive mass behind a shaft (spring with a gap).
 *
 *   J(q) q'' + 1/2 J'(q) q'^2 = K a - b q' - k q + forces - dry friction + disturbance
 *   a' = (u - a) / T   (T = 0: a = u)
 *
 * u is the command after the chain of axis.h.  Modes: direction of sliding -1, 1 or 0 (sticking); side of
 * the shaft's gap that touches; side of the end stop.
 */
#include <math.h>
#include <string.h>

#include "axis.h"
#include "integrator.h"

#define EXPORT __attribute__((visibility("default")))

typedef struct { /* base parameters */
  double inertia, gain, viscous, stiffness, actuator_lag;
} Base;

typedef struct { /* of one run; see simulate() in blindtest/systems/servo.py */
  double kp, ki, kd, limit;
} Controller;

enum { Q, V, LAG, ACTUATOR, DAHL, Q_DRIVE, V_DRIVE, LAG_Q, LAG_V, STATES };

typedef struct {
  Base b;
  Axis a;
  int slide, shaft, stop; /* modes */
  int dry;
  Held held;
  double disturbance, time;
  double play; /* of the encoder */
} Servo;

static double drive(const Servo *s, double t, const double *x) {
  double u = s->a.in_lag > 0.0 ? x[LAG] : bt_limited(&s->a, &s->held, t);
  if (s->b.actuator_lag > 0.0) u = x[ACTUATOR];
  return s->b.gain * (1.0 + s->a.x_gain_drift * (1.0 - exp(-t / 10.0))) * u;
}

static double shaft(const Servo *s, const double *x) {
  if (s->shaft == 0) return 0.0;
  const double twist = x[Q_DRIVE] - x[Q] - 0.5 * s->shaft * s->a.shaft_gap;
  return s->a.shaft_stiffness * twist + s->a.shaft_damping * (x[V_DRIVE] - x[V]);
}

static int soft(const Servo *s) { return s->a.shaft_stiffness > 0.0; }

/* Force on the axis without dry friction, and what the gear transmits. */
static double applied(const Servo *s, double t, const double *x, double *transmitted) {
  *transmitted = soft(s) ? shaft(s, x) : drive(s, t, x);
  const double centrifugal = 0.5 * s->b.inertia * s->a.pose_inertia * sin(x[Q]) * x[V] * x[V];
  return *transmitted - s->b.viscous * x[V] - s->b.stiffness * x[Q] + s->disturbance + centrifugal +
         bt_forces(&s->a, x[Q], x[V], x[DAHL]);
}

static void rhs(void *who, double t, const double *x, double *rate) {
  const Servo *s = who;
  double transmitted;
  double force = applied(s, t, x, &transmitted);
  const double share = soft(s) ? s->a.shaft_share : 0.0;
  const double inertia = (1.0 - share) * s->b.inertia * (1.0 + s->a.pose_inertia * cos(x[Q]));
  const int sticks = s->dry && s->slide == 0;
  if (s->dry && s->slide) force -= s->slide * bt_dry(&s->a, s->slide, x[Q], x[V], transmitted);
  const double u = bt_limited(&s->a, &s->held, t);
  rate[Q] = sticks ? 0.0 : x[V];
  rate[V] = sticks ? 0.0 : force / inertia;
  rate[LAG] = bt_lagging(u, x[LAG], s->a.in_lag);
  const double entering = s->a.in_lag > 0.0 ? x[LAG] : u;
  rate[ACTUATOR] = bt_lagging(entering, x[ACTUATOR], s->b.actuator_lag);
  rate[DAHL] = bt_dahl_rate(&s->a, rate[Q], x[DAHL]);
  rate[Q_DRIVE] = soft(s) ? x[V_DRIVE] : 0.0;
  rate[V_DRIVE] = soft(s) ? (drive(s, t, x) - shaft(s, x)) / (share * s->b.inertia) : 0.0;
  rate[LAG_Q] = bt_lagging(x[Q], x[LAG_Q], s->a.out_lag_q);
  rate[LAG_V] = bt_lagging(x[V], x[LAG_V], s->a.out_lag_v);
}

enum { SLIDE_PLUS, SLIDE_MINUS, SHAFT_PLUS, SHAFT_MINUS, STOP, GUARDS };

static void guard(void *who, double t, const double *x, double *g) {
  const Servo *s = who;
  for (int i = 0; i < GUARDS; i++) g[i] = 1.0;
  if (s->dry && s->slide) g[SLIDE_PLUS] = s->slide * x[V];
  if (s->dry && !s->slide) {
    double transmitted;
    const double force = applied(s, t, x, &transmitted);
    g[SLIDE_PLUS] = bt_dry(&s->a, 1.0, x[Q], 0.0, transmitted) - force;
    g[SLIDE_MINUS] = bt_dry(&s->a, -1.0, x[Q], 0.0, transmitted) + force;
  }
  if (soft(s) && s->a.shaft_gap > 0.0) {
    const double twist = x[Q_DRIVE] - x[Q], half = 0.5 * s->a.shaft_gap;
    g[SHAFT_PLUS] = s->shaft > 0 ? twist - half : half - twist;
    g[SHAFT_MINUS] = s->shaft < 0 ? -half - twist : half + twist;
  }
  if (isfinite(s->a.stop_position)) {
    const double depth = fabs(x[Q]) - s->a.stop_position;
    g[STOP] = s->stop ? depth : -depth;
  }
}

/* At v = 0: stick when the forces allow it, else slide where they push. */
static void stop_sliding(Servo *s, double t, double *x) {
  double transmitted;
  x[V] = 0.0;
  const double force = applied(s, t, x, &transmitted);
  s->slide = 0;
  if (force > bt_dry(&s->a, 1.0, x[Q], 0.0, transmitted)) s->slide = 1;
  if (-force > bt_dry(&s->a, -1.0, x[Q], 0.0, transmitted)) s->slide = -1;
}

static void jump(void *who, double t, double *x, int which) {
  Servo *s = who;
  (void)t;
  if (which == SLIDE_PLUS || which == SLIDE_MINUS) {
    if (s->slide)
      stop_sliding(s, t, x);
    else
      s->slide = which == SLIDE_PLUS ? 1 : -1;
  }
  if (which == SHAFT_PLUS) s->shaft = s->shaft > 0 ? 0 : 1;
  if (which == SHAFT_MINUS) s->shaft = s->shaft < 0 ? 0 : -1;
  if (which == STOP) s->stop = !s->stop;
}

static void after(void *who, double t, const double *x) {
  Servo *s = who;
  (void)t;
  bt_play(&s->play, s->a.out_lag_q > 0.0 ? x[LAG_Q] : x[Q], s->a.out_backlash);
}

/* Times (s after a sample) at which something has to be looked at, ascending, dt last. */
static int stretches(const Servo *s, double dt, double *at) {
  const double wanted[3] = {fmod(s->a.in_delay, dt), dt - fmod(s->a.out_delay_q, dt),
                            dt - fmod(s->a.out_delay_v, dt)};
  int n = 0;
  for (int i = 0; i < 3; i++)
    if (wanted[i] > 1e-12 && wanted[i] < dt - 1e-12) at[n++] = wanted[i];
  for (int i = 1; i < n; i++)
    for (int j = i; j > 0 && at[j] < at[j - 1]; j--) {
      const double swap = at[j];
      at[j] = at[j - 1];
      at[j - 1] = swap;
    }
  at[n++] = dt;
  return n;
}

static double reading(const Servo *s, const double *x, int channel) {
  if (channel == 1) return s->a.out_lag_v > 0.0 ? x[LAG_V] : x[V];
  return s->a.out_backlash > 0.0 ? s->play : s->a.out_lag_q > 0.0 ? x[LAG_Q] : x[Q];
}

static double recorded(const Servo *s, double value, double t, int channel) {
  if (channel == 1) return value * (1.0 + s->a.out_scale_v) + s->a.out_bias_v;
  return value * (1.0 + s->a.out_scale) + s->a.out_bias_q + s->a.out_drift * t;
}

/* What a delayed sensor shows at sample k, from what was read in earlier intervals. */
static double delayed(const double *history, double delay, double dt, int k, double start) {
  const int back = (int)floor(delay / dt + 1e-9), left = k - back - 1;
  return left < 0 ? start : history[2 * left];
}

/* n samples every dt.  u [n]: command, overwritten by the controller's when there is a `control`;
 * ref, disturbance [n], noise [n][2]; start: q, v.  y [n][2].  history [n][2] is scratch.
 * Returns the number of events, -1 on failure.  Sample k is taken before the command of k acts. */
EXPORT int bt_servo(const double *base, const double *axis, const double *control, int n, double dt,
                    double longest, double *u, const double *ref, const double *disturbance,
                    const double *noise, const double *start, double *y, double *held, double *history) {
  Servo s = {0};
  Controller c = {0};
  memcpy(&s.b, base, sizeof s.b);
  memcpy(&s.a, axis, sizeof s.a);
  const int closed = control != 0;
  if (closed) memcpy(&c, control, sizeof c);
  double x[STATES] = {0.0}, at[4], integral = 0.0;
  x[Q] = x[Q_DRIVE] = x[LAG_Q] = start[0];
  x[V] = x[V_DRIVE] = x[LAG_V] = start[1];
  s.play = start[0];
  s.dry = bt_has_dry(&s.a);
  s.slide = x[V] > 0.0 ? 1 : x[V] < 0.0 ? -1 : 0;
  s.shaft = soft(&s) && s.a.shaft_gap <= 0.0 ? 2 : 0; /* 2: always touching, without a gap */
  Chain chain = {0};
  const double before = bt_chain(&s.a, &chain, 0.0, 0.0); /* no command, for as long as anything remembers */
  x[LAG] = x[ACTUATOR] = s.held.target = s.held.from = before;
  const int parts = stretches(&s, dt, at);
  const int late = (int)floor(s.a.in_delay / dt + 1e-9);
  const double rest = fmod(s.a.in_delay, dt);
  const int whole = rest <= 1e-12 || rest >= dt - 1e-12;
  const BtFlow flow = {STATES, GUARDS, longest, rhs, guard, jump, after, &s};
  int events = 0;
  for (int k = 0; k < n; k++) {
    const double t = k * dt;
    double seen[2];
    for (int j = 0; j < 2; j++) {
      history[2 * k + j] = reading(&s, x, j);
      const double delay = j ? s.a.out_delay_v : s.a.out_delay_q;
      const double fresh = history[2 * k + j];
      const double value = delay > 0.0 ? delayed(history + 2 * n + j, delay, dt, k, start[j]) : fresh;
      seen[j] = recorded(&s, value, t, j) + noise[2 * k + j];
      y[2 * k + j] = seen[j];
    }
    if (closed) {
      const double error = ref[k] - seen[0];
      const double wanted = c.kp * error - c.kd * seen[1] + c.ki * integral;
      u[k] = fmin(fmax(wanted, -c.limit), c.limit);
      if (u[k] == wanted) integral += error * dt;
    }
    held[k] = bt_chain(&s.a, &chain, u[k], 0.0);
    s.disturbance = disturbance[k];
    double done = 0.0;
    for (int i = 0; i < parts; i++) {
      const int index = k - late - (!whole && done < rest - 1e-12 ? 1 : 0);
      const double target = index < 0 ? before : held[index];
      const double from = bt_limited(&s.a, &s.held, t + done);
      s.held = (Held){target, from, t + done};
      double reach = isfinite(s.a.in_rate) ? done + fabs(target - from) / s.a.in_rate : done;
      if (reach > done + 1e-9 && reach < at[i] - 1e-9) {
        const int found = bt_advance(&flow, t + done, t + reach, x);
        if (found < 0) return -1;
        events += found;
        done = reach;
      }
      const int found = bt_advance(&flow, t + done, t + at[i], x);
      if (found < 0) return -1;
      events += found;
      done = at[i];
      for (int j = 0; j < 2; j++) {
        const double delay = j ? s.a.out_delay_v : s.a.out_delay_q;
        const double back = fmod(delay, dt);
        if (delay > 0.0 && (back > 1e-12 && back < dt - 1e-12) && fabs(done - (dt - back)) < 1e-12)
          history[2 * n + 2 * k + j] = reading(&s, x, j);
      }
    }
    for (int j = 0; j < 2; j++) {
      const double delay = j ? s.a.out_delay_v : s.a.out_delay_q, back = fmod(delay, dt);
      if (!(back > 1e-12 && back < dt - 1e-12)) history[2 * n + 2 * k + j] = reading(&s, x, j);
    }
  }
  return events;
}
