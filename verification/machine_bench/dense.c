/* The step to compare with, in the place of the shim's integrator.c: ROS2 with a new Jacobian in every internal
 * step, written out with its zeros, and factorised with partial pivoting. */
#include "core.h"
#include "slw_math.h"

extern SlwFunction dense_f, dense_jac; /* (x, u, m, p) -> dx/dt; df/dx, column-major */

static const double GAMMA = 0.29289321881345248; /* 1 - 1/sqrt(2) */
static double a[SLW_NX * SLW_NX];
static int pivot[SLW_NX];

static int dense_evaluate(SlwCore *c, SlwFunction *function, const double *x, double *result) {
  static double w[DENSE_SZ_W];
  const double *arg[8] = {x, c->ud, c->s.m, c->s.p};
  double *res[8] = {result};
  return function(arg, res, c->iw, w, 0);
}

int slw_evaluate(SlwCore *c, SlwFunction *function, const double *x, double *result) {
  const double *arg[8] = {x, c->ud, c->s.m, c->s.p};
  double *res[8] = {result};
  return function(arg, res, c->iw, c->w, 0);
}

static int factorise(int n) {
  for (int k = 0; k < n; k++) {
    int best = k;
    for (int i = k + 1; i < n; i++)
      if (slw_fabs(a[i + k * n]) > slw_fabs(a[best + k * n])) best = i;
    pivot[k] = best;
    if (!(slw_fabs(a[best + k * n]) > 0.0)) return -1;
    if (best != k)
      for (int j = 0; j < n; j++) {
        const double t = a[k + j * n];
        a[k + j * n] = a[best + j * n];
        a[best + j * n] = t;
      }
    const double inverse = 1.0 / a[k + k * n];
    for (int i = k + 1; i < n; i++) a[i + k * n] *= inverse;
    for (int j = k + 1; j < n; j++) {
      const double t = a[k + j * n];
      if (t == 0.0) continue; /* most are */
      for (int i = k + 1; i < n; i++) a[i + j * n] -= a[i + k * n] * t;
    }
  }
  return 0;
}

static void solve(int n, double *b) {
  for (int k = 0; k < n; k++) { /* rows were swapped whole: swap all of b first */
    const double t = b[k];
    b[k] = b[pivot[k]];
    b[pivot[k]] = t;
  }
  for (int k = 0; k < n; k++)
    for (int i = k + 1; i < n; i++) b[i] -= a[i + k * n] * b[k];
  for (int k = n - 1; k >= 0; k--) {
    b[k] /= a[k + k * n];
    for (int i = 0; i < k; i++) b[i] -= a[i + k * n] * b[k];
  }
}

int slw_advance(SlwCore *c) {
  const int n = SLW_NX;
  const double h = SLW_STEP;
  if (dense_evaluate(c, dense_f, c->s.x, c->k1) || dense_evaluate(c, dense_jac, c->s.x, a)) return -1;
  for (int i = 0; i < n * n; i++) a[i] *= -GAMMA * h;
  for (int i = 0; i < n; i++) a[i + i * n] += 1.0;
  if (factorise(n)) return -1;
  solve(n, c->k1);
  for (int i = 0; i < n; i++) c->x1[i] = c->s.x[i] + h * c->k1[i];
  if (dense_evaluate(c, dense_f, c->x1, c->k2)) return -1;
  for (int i = 0; i < n; i++) c->k2[i] -= 2.0 * c->k1[i];
  solve(n, c->k2);
  for (int i = 0; i < n; i++) c->s.x[i] += h * (1.5 * c->k1[i] + 0.5 * c->k2[i]);
  return 0;
}
