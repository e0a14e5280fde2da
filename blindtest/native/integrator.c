#include "integrator.h"

#include <math.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

static void step(const BtFlow *f, double t, double h, const double *x, double *next) {
  double k[4][BT_STATES], at[BT_STATES];
  static const double share[4] = {0.0, 0.5, 0.5, 1.0};
  for (int s = 0; s < 4; s++) {
    for (int i = 0; i < f->states; i++) at[i] = x[i] + (s ? share[s] * h * k[s - 1][i] : 0.0);
    f->rhs(f->who, t + share[s] * h, at, k[s]);
  }
  for (int i = 0; i < f->states; i++)
    next[i] = x[i] + h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
}

static int violated(const BtFlow *f, double t, const double *x) {
  double g[BT_GUARDS] = {0.0};
  if (f->guards == 0) return -1;
  f->guard(f->who, t, x, g);
  int worst = -1;
  for (int i = 0; i < f->guards; i++)
    if (g[i] < 0.0 && (worst < 0 || g[i] < g[worst])) worst = i;
  return worst;
}

/* Jumps until no guard is violated: at the start of a stretch an input may have jumped too. */
static int settle(const BtFlow *f, double t, double *x) {
  for (int events = 0; events < BT_EVENTS_AT_ONCE; events++) {
    const int which = violated(f, t, x);
    if (which < 0) return events;
    f->jump(f->who, t, x, which);
  }
  return -1;
}

/* The shortest step, within h/2^48, at whose end a guard is violated; its end goes to `next`. */
static double locate(const BtFlow *f, double t, double h, const double *x, double *next) {
  double before = 0.0, beyond = h, trial[BT_STATES];
  for (int i = 0; i < 48 && beyond - before > 1e-13 * (1.0 + fabs(t)); i++) {
    const double middle = 0.5 * (before + beyond);
    step(f, t, middle, x, trial);
    if (violated(f, t + middle, trial) >= 0)
      beyond = middle;
    else
      before = middle;
  }
  step(f, t, beyond, x, next);
  return beyond;
}

EXPORT int bt_advance(const BtFlow *f, double t0, double t1, double *x) {
  double t = t0, next[BT_STATES];
  const size_t size = (size_t)f->states * sizeof(double);
  int events = 0, since = 0;
  while (t < t1) {
    const int jumps = settle(f, t, x);
    if (jumps < 0 || since > 100000) return -1;
    events += jumps;
    since += jumps;
    const double count = ceil((t1 - t) / f->step - 1e-9);
    double h = (t1 - t) / fmax(count, 1.0);
    const int last = count <= 1.0;
    step(f, t, h, x, next);
    const int hit = violated(f, t + h, next) >= 0;
    if (hit) h = locate(f, t, h, x, next);
    memcpy(x, next, size);
    t = (last && !hit) ? t1 : t + h;
    if (f->after) f->after(f->who, t, x);
  }
  const int jumps = settle(f, t1, x);
  return jumps < 0 ? -1 : events + jumps;
}
