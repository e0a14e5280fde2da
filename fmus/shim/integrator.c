/* One internal step of the states.
 *
 * Continuous models: ROS2 of Verwer, Spee, Blom and Hundsdorfer, "A second-order Rosenbrock method applied
 * to photochemical dispersion problems", SIAM J. Sci. Comput. 20 (1999) 1456-1480: two stages, one
 * factorisation, L-stable with gamma = 1 - 1/sqrt(2); inputs and modes are held over the step.
 */
#include "core.h"
#include "slw_math.h"

int slw_evaluate(SlwCore *c, SlwFunction *function, const double *x, double *result) {
  const double *arg[8] = {x, c->ud, c->s.m, c->s.p};
  double *res[8] = {result};
  return function(arg, res, c->iw, c->w, 0);
}

#if SLW_CONTINUOUS

static const double GAMMA = 0.29289321881345248; /* 1 - 1/sqrt(2) */

/* ---- linear algebra: LU with partial pivoting, column-major ---- */

static int factorise(double *a, int *pivot, int n) {
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
      if (t == 0.0) continue; /* the Jacobians here are sparse */
      for (int i = k + 1; i < n; i++) a[i + j * n] -= a[i + k * n] * t;
    }
  }
  return 0;
}

static void solve(const double *a, const int *pivot, int n, double *b) {
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

/* ---- one internal step ---- */

int slw_advance(SlwCore *c) {
  const int n = SLW_NX;
  const double h = SLW_STEP;
  if (slw_evaluate(c, slw_f, c->s.x, c->k1) || slw_evaluate(c, slw_jac, c->s.x, c->a)) return -1;
  for (int i = 0; i < n * n; i++) c->a[i] *= -GAMMA * h;
  for (int i = 0; i < n; i++) c->a[i + i * n] += 1.0;
  if (factorise(c->a, c->pivot, n)) return -1;
  solve(c->a, c->pivot, n, c->k1);
  for (int i = 0; i < n; i++) c->x1[i] = c->s.x[i] + h * c->k1[i];
  if (slw_evaluate(c, slw_f, c->x1, c->k2)) return -1;
  for (int i = 0; i < n; i++) c->k2[i] -= 2.0 * c->k1[i];
  solve(c->a, c->pivot, n, c->k2);
  for (int i = 0; i < n; i++) c->s.x[i] += h * (1.5 * c->k1[i] + 0.5 * c->k2[i]);
  return 0;
}
#else
int slw_advance(SlwCore *c) {
  if (slw_evaluate(c, slw_f, c->s.x, c->x1)) return -1;
  memcpy(c->s.x, c->x1, sizeof c->s.x);
  return 0;
}
#endif
