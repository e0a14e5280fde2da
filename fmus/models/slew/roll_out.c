/* Rolls a model out over a sampled command and carries the sensitivities of its states along.
 *
 * Compiled together with generated equations: slw_guards and
 *   slw_next      (x, u, m, p) -> next x
 *   slw_next_sens (x, u, m, p) -> next x, d/dx, d/dp (fitted parameters only), d/du[0]; dense, column-major
 * One step does what a step of the FMU's shim does, with one difference: the transport delay of input 0 is
 * not rounded to whole steps.  A step that the delayed command changes in sees its mean over the step, so
 * that the result is differentiable by the delay.
 */
#include <stdint.h>
#include <string.h>

#include "roll_out.h" /* generated: NX, NU, NP, NFIT, SZ_W, SZ_IW */

typedef int Function(const double **arg, double **res, long long *iw, double *w, int mem);
Function slw_next, slw_next_sens, slw_guards;

typedef struct {
  const double *command; /* row k holds on (k period, (k + 1) period] */
  int rows, first;       /* simulate from row `first` on */
  double period;         /* of the rows, s */
  int steps;             /* in one period */
  double delay;          /* of input 0, s */
  int delay_seed;        /* which fitted parameter the delay is, -1: none */
  double mode;           /* the only mode, at the start */
  int mode_on, mode_off; /* steps for which a guard must hold */
  int held;              /* steps for which the present guard has held at the start */
  const double *varying; /* null, or the inputs from 1 on, NU - 1 a row: row k holds on (k period, (k + 1) period] */
  const double *known;   /* null, or states, NX a row, that the run takes over at that row; NaN where it goes on */
} RollOut;

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

static double at(const RollOut *r, double position) {
  int k = (int)position;
  if (position < 0.0) k = 0;
  if (k > r->rows - 1) k = r->rows - 1;
  return r->command[k];
}

/* Mean of the delayed command over [t, t + h] and its derivative by the delay. */
static double delayed(const RollOut *r, double t, double h, double *slope) {
  const double start = (t - r->delay) / r->period, end = (t + h - r->delay) / r->period;
  const double before = at(r, start), after = at(r, end);
  double share = ((double)(int)end - start) / (end - start); /* of the step before the change */
  *slope = 0.0;
  if (before == after || end < 0.0) return after;
  if (share < 0.0) share = 0.0;
  if (share > 1.0) share = 1.0;
  *slope = (before - after) / h;
  return share * before + (1.0 - share) * after;
}

static void switch_mode(const RollOut *r, const double *x, const double *u, const double *p, double *m, int *held,
                        long long *iw, double *w) {
  double on, off;
  const double *arg[4] = {x, u, m, p};
  double *res[2] = {&on, &off};
  slw_guards(arg, res, iw, w, 0);
  *held = (*m > 0.5 ? off : on) > 0.0 ? *held + 1 : 0;
  if (*held > (*m > 0.5 ? r->mode_off : r->mode_on)) {
    *m = 1.0 - *m;
    *held = 0;
  }
}

static void carry(double *s, const double *dx, const double *dp, const double *du, int delay_seed, double slope) {
  double next[NX * NFIT];
  for (int c = 0; c < NFIT; c++)
    for (int i = 0; i < NX; i++) {
      double sum = dp[c * NX + i];
      for (int k = 0; k < NX; k++) sum += dx[k * NX + i] * s[c * NX + k];
      if (c == delay_seed) sum += du[i] * slope;
      next[c * NX + i] = sum;
    }
  memcpy(s, next, sizeof next);
}

/* Takes over what is known at a row: from there on it depends on no parameter. */
static void take_over(const double *known, double *x, double *s) {
  for (int i = 0; i < NX; i++) {
    if (known[i] != known[i]) continue;
    x[i] = known[i];
    for (int c = 0; c < NFIT; c++) s[c * NX + i] = 0.0;
  }
}

/* States of rows first .. rows-1 into `states` (NX a row) and, unless null, d states / d fitted parameters into
 * `sens` (NFIT x NX a row); `inputs` holds all inputs, those other than 0 constant unless they vary by row.
 * Returns 0. */
EXPORT int roll_out(const RollOut *r, const double *x0, const double *inputs, const double *p, double *states,
                    double *sens) {
  static double w[SZ_W];
  static long long iw[SZ_IW];
  double x[NX], xn[NX], u[NU], m = r->mode, slope, s[NX * NFIT] = {0.0};
  static double dx[NX * NX], dp[NX * NFIT], du[NX];
  const double h = r->period / r->steps;
  int held = r->held;
  memcpy(x, x0, sizeof x);
  memcpy(u, inputs, sizeof u);
  for (int row = r->first;; row++) {
    if (r->known) take_over(r->known + row * NX, x, s);
    memcpy(states + (row - r->first) * NX, x, sizeof x);
    if (sens) memcpy(sens + (row - r->first) * NX * NFIT, s, sizeof s);
    if (row == r->rows - 1) return 0;
    if (r->varying) memcpy(u + 1, r->varying + (row + 1) * (NU - 1), (NU - 1) * sizeof *u);
    for (int k = 0; k < r->steps; k++) {
      const double *arg[4] = {x, u, &m, p};
      double *res[4] = {xn, dx, dp, du};
      u[0] = delayed(r, (row + 1) * r->period + k * h, h, &slope);
      switch_mode(r, x, u, p, &m, &held, iw, w);
      if (sens) {
        slw_next_sens(arg, res, iw, w, 0);
        carry(s, dx, dp, du, r->delay_seed, slope);
      } else {
        slw_next(arg, res, iw, w, 0);
      }
      memcpy(x, xn, sizeof x);
    }
  }
}
