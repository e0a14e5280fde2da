/* One internal step of the states.
 *
 * Continuous models: ROS2 of Verwer, Spee, Blom and Hundsdorfer, "A second-order Rosenbrock method applied
 * to photochemical dispersion problems", SIAM J. Sci. Comput. 20 (1999) 1456-1480: two stages, one
 * factorisation, L-stable with gamma = 1 - 1/sqrt(2); inputs and modes are held over the step.
 *
 * It is of order two with any matrix in the Jacobian's place, so the factors of I - gamma h J serve up to
 * SLW_SERVES internal steps.  They are part of the state: a restored one goes on with the same bits.
 */
#include "core.h"
#include "slw_math.h"

int slw_evaluate(SlwCore *c, SlwFunction *function, const double *x, double *result) {
  const double *arg[8] = {x, c->ud, c->s.m, c->s.p};
  double *res[8] = {result};
  return function(arg, res, c->iw, c->w, 0);
}

#if SLW_CONTINUOUS

/* dx/dt into f and new factors, at the present point; -1 when a pivot was zero. */
static int factorise(SlwCore *c) {
  SlwState *s = &c->s;
  const double *arg[8] = {s->x, c->ud, s->m, c->q};
  double *res[8] = {c->f, s->factors};
  if (slw_factors(arg, res, c->iw, c->w, 0)) return -1;
  for (int i = 0; i < SLW_NF; i++)
    if (!slw_is_finite(s->factors[i])) return -1;
  memcpy(s->served_u, c->ud, sizeof s->served_u);
  memcpy(s->served_m, s->m, sizeof s->served_m);
  s->serves = SLW_SERVES;
  return 0;
}

/* Whether the factors still serve: an input or mode that jumped wants new ones. */
static int serving(const SlwCore *c) {
  return c->s.serves > 0 && memcmp(c->s.served_u, c->ud, sizeof c->ud) == 0 &&
         memcmp(c->s.served_m, c->s.m, sizeof c->s.m) == 0;
}

static int solve(SlwCore *c, const double *b, double *result) {
  const double *arg[8] = {c->s.factors, b};
  double *res[8] = {result};
  return slw_solve(arg, res, c->iw, c->w, 0);
}

int slw_advance(SlwCore *c) {
  const int n = SLW_NX;
  const double h = SLW_STEP;
  if (serving(c) ? slw_rates(c, c->s.x, c->f) : factorise(c)) return -1;
  c->s.serves -= 1;
  if (solve(c, c->f, c->k1)) return -1;
  for (int i = 0; i < n; i++) c->x1[i] = c->s.x[i] + h * c->k1[i];
  if (slw_rates(c, c->x1, c->f)) return -1;
  for (int i = 0; i < n; i++) c->f[i] -= 2.0 * c->k1[i];
  if (solve(c, c->f, c->k2)) return -1;
  for (int i = 0; i < n; i++) c->s.x[i] += h * (1.5 * c->k1[i] + 0.5 * c->k2[i]);
  return 0;
}
#else
int slw_advance(SlwCore *c) {
  if (slw_rates(c, c->s.x, c->x1)) return -1;
  memcpy(c->s.x, c->x1, sizeof c->s.x);
  return 0;
}
#endif
