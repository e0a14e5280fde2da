/* The slew drive: two chambers, torque-limited supply, crossport relief and stop valves, brake.
 *
 *   s'   = s_max tanh((u - s) / (T s_max))                  o = opening beyond the overlap
 *   V/b p_a' = in(o+, p_a) - out(o-, p_a) + suck(p_a) - D w - Ci (p_a - p_b) - Ce (p_a - p_0) - Q_x
 *   V/b p_b' = in(o-, p_b) - out(o+, p_b) + suck(p_b) + D w + Ci (p_a - p_b) - Ce (p_b - p_0) + Q_x
 *   (I + I_0) w' = D (p_a - p_b) - L (b w + T_c tanh(w/w_c)) - brake - I' w + forces - dry friction
 *
 * Base friction and edges are rounded as the plain model has them: that is its definition.  What is hidden
 * beside it (axis.h and Extra) is not.
 */
#include <math.h>
#include <string.h>

#include "discrete.h"
#include "integrator.h"

#define EXPORT __attribute__((visibility("default")))

static const double ROUNDING = 0.02, LAMINAR = 10e5, KNEE = 10e5, REFERENCE = 100e5;
/* Inertia by squared radius of the arm's tip, as the plain model (fmus/models/slew) states it: kg m2, kg. */
static const double REACH_INERTIA = 41.6e3, REACH_MASS = 3506.0;

typedef struct { /* specs/parameters/slew.toml, in its order */
  double delay, dead_band, spool_lag, spool_rate, inlet_flow, inlet_curve, outlet_flow, cut_off_low,
      cut_off_high, cut_off_scale, displacement, volume, bulk, leak_internal, leak_external, boost, suction,
      relief_pressure, relief_flow, relief_lag, stop_pressure, stop_flow, stop_spool, viscous, dry, dry_knee,
      friction_load, inertia_reference, inertia_extra, brake_static, brake_kinetic, brake_decay, brake_knee,
      brake_threshold, release_time, engage_time;
} Base;

typedef struct { /* hidden, beside the axis's effects; 0: absent */
  double sag;         /* the cut-off falls with the opening: p_c (1 - s o) */
  double shared;      /* inlet less by this share while the arm moves at |I'| = 30 t m2/s */
  double warming;     /* viscous friction falls by this share with a time constant of 15 s */
  double counterbalance; /* Pa, to be overcome at the outlet */
  double air;         /* Pa: bulk / (1 + air / pressure) */
  double brake_lag;   /* s, of the released brake's torque */
  double one_relief;  /* Pa below the base's cracking pressure at which side a is relieved */
  double payload;     /* kg at the tip, not in the recorded inertia */
  double bias_a, bias_b; /* Pa, of the pressure sensors */
} Extra;

enum { Q, W, P_A, P_B, SPOOL, RELIEF, DAHL, COMMAND, LAG_Q, LAG_W, STATES };

typedef struct {
  Base b;
  Extra e;
  Axis a;
  double inertia, inertia_rate, disturbance, drift;
  Held held; /* the command */
  int released, dry, slide;
  double released_at;
  double cut_off_whole; /* what the exponential of the cut-off comes to at full opening */
} Slew;

/* The command behind its rate limit, and behind its lag: they act between samples, too. */
static double command(const Slew *s, double t, const double *x) {
  return s->a.in_lag > 0.0 ? x[COMMAND] : bt_limited(&s->a, &s->held, t);
}

static double ramp(double x, double width) { /* 0, a parabola, x - width / 2 */
  if (x <= 0.0) return 0.0;
  return x < width ? x * x / (2.0 * width) : x - 0.5 * width;
}

static double turbulent(double size, double drop) {
  if (size == 0.0) return 0.0;
  return size * drop / sqrt(sqrt(drop * drop + LAMINAR * LAMINAR) * REFERENCE);
}

static double quadratic(double size, double over) {
  const double r = ramp(over, KNEE) / REFERENCE;
  return size * r * r;
}

static double inlet(const Slew *s, double o, double p) {
  const Base *b = &s->b;
  double limit = b->cut_off_low + (b->cut_off_high - b->cut_off_low) * (1.0 - exp(-o / b->cut_off_scale)) /
                                      s->cut_off_whole;
  limit *= 1.0 - s->e.sag * o;
  const double left = 1.0 - s->e.shared * fmin(fabs(s->inertia_rate) / 30e3, 1.0);
  const double size = b->inlet_flow * o * (1.0 + b->inlet_curve * (1.0 - o)) * left * s->drift;
  return turbulent(size, ramp(limit - p, LAMINAR));
}

static double outlet(const Slew *s, double o, double p) {
  double drop = p - s->b.boost;
  if (s->e.counterbalance > 0.0) drop = fmax(drop - s->e.counterbalance, fmin(drop, 0.0));
  return turbulent(s->b.outlet_flow * o, drop);
}

static double cross(const Slew *s, double o, double r) {
  const Base *b = &s->b;
  const double main = quadratic(b->relief_flow, r - b->relief_pressure) -
                      quadratic(b->relief_flow, -r - b->relief_pressure);
  const double soft =
      quadratic(b->stop_flow, r - b->stop_pressure) - quadratic(b->stop_flow, -r - b->stop_pressure);
  const double share = o / b->stop_spool;
  double whole = main + soft / (1.0 + share * share);
  if (s->e.one_relief > 0.0) {
    const double over = fmax(r - (b->relief_pressure - s->e.one_relief), 0.0) / REFERENCE;
    whole += b->relief_flow * over * over;
  }
  return whole;
}

static double inertia(const Slew *s) {
  const double radius2 = fmax(s->inertia - REACH_INERTIA, 0.0) / REACH_MASS;
  return s->inertia + s->b.inertia_extra + s->e.payload * radius2;
}

static double brake(const Slew *s, double t, double w) {
  double on = s->released ? 0.0 : 1.0;
  if (s->released && s->e.brake_lag > 0.0) on = exp(-(t - s->released_at) / s->e.brake_lag);
  if (on < 1e-9) return 0.0;
  const Base *b = &s->b;
  const double ratio = w / b->brake_decay;
  const double level = b->brake_kinetic + (b->brake_static - b->brake_kinetic) * exp(-ratio * ratio);
  return on * level * tanh(w / b->brake_knee);
}

/* Torque without the hidden dry friction. */
static double torque(const Slew *s, double t, const double *x) {
  const Base *b = &s->b;
  const double load = 1.0 + b->friction_load * (1.0 - b->inertia_reference / s->inertia);
  const double warm = s->e.warming == 0.0 ? 1.0 : 1.0 - s->e.warming * (1.0 - exp(-t / 15.0));
  const double base = load * (b->viscous * warm * x[W] + b->dry * tanh(x[W] / b->dry_knee));
  const double rate = s->inertia_rate * (1.0 + s->e.payload / REACH_MASS);
  return b->displacement * (x[P_A] - x[P_B]) - base - brake(s, t, x[W]) - rate * x[W] + s->disturbance +
         bt_forces(&s->a, x[Q], x[W], x[DAHL]);
}

static double stiffness(const Slew *s, double p) {
  const double air = s->e.air > 0.0 ? 1.0 + s->e.air / fmax(p, 2e5) : 1.0;
  return s->b.bulk / s->b.volume / air;
}

static void rhs(void *who, double t, const double *x, double *rate) {
  const Slew *s = who;
  const Base *b = &s->b;
  const double band = b->dead_band, whole = 1.0 - band - 0.5 * ROUNDING;
  const double left = ramp(x[SPOOL] - band, ROUNDING) / whole;
  const double right = ramp(-x[SPOOL] - band, ROUNDING) / whole;
  const double q_x = cross(s, left - right, x[RELIEF]), inner = b->leak_internal * (x[P_A] - x[P_B]);
  const double swept = b->displacement * x[W];
  const double in_a = left > 0.0 ? inlet(s, left, x[P_A]) : 0.0;
  const double in_b = right > 0.0 ? inlet(s, right, x[P_B]) : 0.0;
  const double flow_a = in_a - outlet(s, right, x[P_A]) + b->suction * ramp(b->boost - x[P_A], KNEE) - q_x -
                        swept - inner - b->leak_external * (x[P_A] - b->boost);
  const double flow_b = in_b - outlet(s, left, x[P_B]) + b->suction * ramp(b->boost - x[P_B], KNEE) + q_x +
                        swept + inner - b->leak_external * (x[P_B] - b->boost);
  double drive = torque(s, t, x);
  const int sticks = s->dry && !s->slide;
  if (s->dry && s->slide) drive -= s->slide * bt_dry(&s->a, s->slide, x[Q], x[W], 0.0);
  rate[Q] = sticks ? 0.0 : x[W];
  rate[W] = sticks ? 0.0 : drive / inertia(s);
  rate[P_A] = stiffness(s, x[P_A]) * flow_a;
  rate[P_B] = stiffness(s, x[P_B]) * flow_b;
  rate[SPOOL] = b->spool_rate * tanh((command(s, t, x) - x[SPOOL]) / (b->spool_lag * b->spool_rate));
  rate[RELIEF] = (x[P_A] - x[P_B] - x[RELIEF]) / b->relief_lag;
  rate[DAHL] = bt_dahl_rate(&s->a, rate[Q], x[DAHL]);
  rate[COMMAND] = bt_lagging(bt_limited(&s->a, &s->held, t), x[COMMAND], s->a.in_lag);
  rate[LAG_Q] = bt_lagging(x[Q], x[LAG_Q], s->a.out_lag_q);
  rate[LAG_W] = bt_lagging(x[W], x[LAG_W], s->a.out_lag_v);
}

static void guard(void *who, double t, const double *x, double *g) {
  const Slew *s = who;
  g[0] = g[1] = 1.0;
  if (!s->dry) return;
  if (s->slide) {
    g[0] = s->slide * x[W];
    return;
  }
  const double force = torque(s, t, x);
  g[0] = bt_dry(&s->a, 1.0, x[Q], 0.0, 0.0) - force;
  g[1] = bt_dry(&s->a, -1.0, x[Q], 0.0, 0.0) + force;
}

static void jump(void *who, double t, double *x, int which) {
  Slew *s = who;
  const int slid = s->slide;
  x[W] = 0.0;
  if (!slid) {
    s->slide = which == 0 ? 1 : -1;
    return;
  }
  const double force = torque(s, t, x);
  s->slide = 0;
  if (force > bt_dry(&s->a, 1.0, x[Q], 0.0, 0.0)) s->slide = 1;
  if (-force > bt_dry(&s->a, -1.0, x[Q], 0.0, 0.0)) s->slide = -1;
}

/* Off neutral for long enough: released; in neutral for long enough: engaged.  Looked at where u may have moved. */
static void brake_mode(Slew *s, double t, const double *x, double *off_since, double *on_since) {
  const int off = fabs(command(s, t, x)) > s->b.brake_threshold;
  if (off && *off_since < 0.0) *off_since = t;
  if (!off) *off_since = -1.0;
  if (!off && *on_since < 0.0) *on_since = t;
  if (off) *on_since = -1.0;
  if (!s->released && off && t - *off_since > s->b.release_time - 1e-9) s->released = 1, s->released_at = t;
  if (s->released && !off && t - *on_since > s->b.engage_time - 1e-9) s->released = 0;
}

/* n samples; u [n][3]: joystick, inertia, its rate; the joystick is overwritten by a speed loop where `gains`
 * (kp, limit) and ref [n] are given.  disturbance [n] N.m; noise, y [n][4]: angle, speed, pressures; start [2].
 * Returns the number of events, -1 on failure. */
EXPORT int bt_slew(const double *base, const double *extra, const double *effects, int n, double dt,
                   double longest, double *u, const double *ref, const double *gains,
                   const double *disturbance, const double *noise, const double *start, double *y) {
  Slew s;
  AxisMemory memory;
  memset(&s, 0, sizeof s);
  memset(&memory, 0, sizeof memory);
  memcpy(&s.b, base, sizeof s.b);
  memcpy(&s.e, extra, sizeof s.e);
  memcpy(&s.a, effects, sizeof s.a);
  s.dry = bt_has_dry(&s.a);
  s.cut_off_whole = 1.0 - exp(-1.0 / s.b.cut_off_scale);
  double x[STATES] = {start[0], start[1], s.b.boost, s.b.boost};
  x[LAG_Q] = start[0];
  x[LAG_W] = start[1];
  const double before = bt_chain(&s.a, &memory.chain, 0.0, 0.0); /* no command, for as long as anything remembers */
  x[SPOOL] = x[COMMAND] = s.held.target = s.held.from = before;
  Axis shown = s.a; /* what its sensors add to what their lags leave */
  shown.out_lag_q = shown.out_lag_v = 0.0;
  s.slide = x[W] > 0.0 ? 1 : x[W] < 0.0 ? -1 : 0;
  double off_since = -1.0, on_since = -1.0;
  const double delay = s.b.delay + s.a.in_delay;
  const int late = (int)floor(delay / dt + 1e-9);
  const double rest = delay - late * dt, first = rest > 1e-9 && rest < dt - 1e-9 ? rest : 0.0;
  const int moves = isfinite(s.a.in_rate) || s.a.in_lag > 0.0; /* between samples */
  double line[BT_LINE] = {0.0};
  const BtFlow flow = {STATES, s.dry ? 2 : 0, longest, rhs, guard, jump, 0, &s};
  int events = 0;
  for (int k = 0; k < n; k++) {
    double *row = y + 4 * k;
    const double *shaken = noise + 4 * k;
    bt_sensors(&shown, &memory, k, s.a.out_lag_q > 0.0 ? x[LAG_Q] : x[Q], s.a.out_lag_v > 0.0 ? x[LAG_W] : x[W],
               dt, row, row + 1);
    row[2] = x[P_A] + s.e.bias_a;
    row[3] = x[P_B] + s.e.bias_b;
    for (int i = 0; i < 4; i++) row[i] += shaken[i];
    if (gains) u[3 * k] = fmin(fmax(gains[0] * (ref[k] - row[1]), -gains[1]), gains[1]);
    line[k % BT_LINE] = bt_chain(&s.a, &memory.chain, u[3 * k], 0.0);
    s.inertia = u[3 * k + 1];
    s.inertia_rate = u[3 * k + 2];
    s.disturbance = disturbance[k];
    const double t = k * dt;
    s.drift = 1.0 + s.a.x_gain_drift * (1.0 - exp(-t / 10.0));
    const double bounds[3] = {0.0, first, dt};
    for (int i = first > 0.0 ? 0 : 1; i < 2; i++) {
      const double from = first > 0.0 ? bounds[i] : 0.0;
      const int index = k - late - (first > 0.0 && i == 0 ? 1 : 0);
      const double begin = t + from, lasts = bounds[i + 1] - from;
      s.held = (Held){index < 0 ? before : line[index % BT_LINE], bt_limited(&s.a, &s.held, begin), begin};
      const int parts = moves ? (int)ceil(lasts / longest) : 1; /* the brake is looked at in each */
      for (int part = 0; part < parts; part++) {
        const double at = begin + lasts * part / parts;
        brake_mode(&s, at, x, &off_since, &on_since);
        const int found = bt_advance(&flow, at, begin + lasts * (part + 1) / parts, x);
        if (found < 0) return -1;
        events += found;
      }
    }
  }
  return events;
}
