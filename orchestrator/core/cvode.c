/* CVODE by function pointers: nothing is linked, so that a system without model exchange needs no CasADi.
 *
 * CasADi's library leaves out CVODE's dense solver: its Krylov solver gets our LU factors of I - gamma J as
 * preconditioner and our J for products, which comes to the same: one iteration, no further derivatives. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "binding.h"
#include "cvode.h"

#define BDF 2
#define NEWTON 2
#define ONE_STEP 2
#define ROOT_RETURN 2
#define LEFT 1
#define NO_STOP 1e300
#define ROOT_OF_ROUNDING 1.4901161193847656e-08

static double size_of(double x) { return x < 0.0 ? -x : x; }

typedef void *vector;
typedef int right_side(double, vector, vector, void *);
typedef int root_side(double, vector, double *, void *);
typedef void handler(int, const char *, const char *, char *, void *);
typedef int set_up(double, vector, vector, int, int *, double, void *, vector, vector, vector);
typedef int solve(double, vector, vector, vector, vector, double, double, int, void *, vector);
typedef int times(vector, vector, double, vector, vector, void *, vector);

struct slw_cvode {
  void *library, *memory;
  vector y, absolute, dense;
  size_t n;
  double *x, *tolerances, *between, *jacobian, *factors, *moved, *rates_there;
  size_t *pivots;
  slw_rates *rates, *roots;
  void *context;
  char message[256];
  /* of the library */
  vector (*make)(long, double *);
  void (*destroy)(vector);
  double *(*data)(vector);
  void *(*create)(int, int);
  int (*init)(void *, right_side *, double, vector);
  int (*reinit)(void *, double, vector);
  int (*tolerate)(void *, double, vector);
  int (*root_init)(void *, int, root_side *);
  int (*user_data)(void *, void *);
  int (*error_handler)(void *, handler *, void *);
  int (*no_root_warning)(void *);
  int (*stop_time)(void *, double);
  int (*advance)(void *, double, vector, double *, int);
  int (*interpolate)(void *, double, int, vector);
  int (*krylov)(void *, int, int);
  int (*preconditioner)(void *, set_up *, solve *);
  int (*products)(void *, times *);
  void (*release)(void **);
};

static int right(double t, vector y, vector result, void *user) {
  slw_cvode *c = user;
  return c->rates(c->context, t, c->data(y), c->data(result));
}

static int root(double t, vector y, double *result, void *user) {
  slw_cvode *c = user;
  return c->roots(c->context, t, c->data(y), result);
}

static void on_error(int code, const char *module, const char *function, char *text, void *user) {
  slw_cvode *c = user;
  (void)module, (void)function;
  if (code < 0) snprintf(c->message, sizeof c->message, "%s", text);
}

/* ---- the Jacobian and its factors ---- */

static int differentiate(slw_cvode *c, double t, const double *x, const double *rates) {
  const size_t n = c->n;
  memcpy(c->moved, x, n * sizeof *x);
  for (size_t j = 0; j < n; j++) {
    const double least = 1e-3 * c->tolerances[j], own = ROOT_OF_ROUNDING * size_of(x[j]);
    const double d = own > least ? own : least;
    c->moved[j] = x[j] + d;
    const int status = c->rates(c->context, t, c->moved, c->rates_there);
    const double step = c->moved[j] - x[j];
    c->moved[j] = x[j];
    if (status != 0) return status;
    for (size_t i = 0; i < n; i++) c->jacobian[i * n + j] = (c->rates_there[i] - rates[i]) / step;
  }
  return 0;
}

/* LU with row pivots; false: singular. */
static bool factorise(slw_cvode *c) {
  const size_t n = c->n;
  double *a = c->factors;
  for (size_t k = 0; k < n; k++) {
    size_t pivot = k;
    for (size_t i = k + 1; i < n; i++)
      if (size_of(a[i * n + k]) > size_of(a[pivot * n + k])) pivot = i;
    c->pivots[k] = pivot;
    if (!(size_of(a[pivot * n + k]) > 0.0)) return false;
    for (size_t j = 0; pivot != k && j < n; j++) {
      const double swapped = a[k * n + j];
      a[k * n + j] = a[pivot * n + j], a[pivot * n + j] = swapped;
    }
    for (size_t i = k + 1; i < n; i++) {
      const double f = a[i * n + k] /= a[k * n + k];
      for (size_t j = k + 1; f != 0.0 && j < n; j++) a[i * n + j] -= f * a[k * n + j];
    }
  }
  return true;
}

static int prepare(double t, vector y, vector rates, int jacobian_is_good, int *jacobian_is_new, double gamma,
                   void *user, vector a, vector b, vector d) {
  slw_cvode *c = user;
  const size_t n = c->n;
  (void)a, (void)b, (void)d;
  *jacobian_is_new = !jacobian_is_good;
  if (!jacobian_is_good) {
    const int status = differentiate(c, t, c->data(y), c->data(rates));
    if (status != 0) return status;
  }
  for (size_t i = 0; i < n * n; i++) c->factors[i] = -gamma * c->jacobian[i];
  for (size_t i = 0; i < n; i++) c->factors[i * n + i] += 1.0;
  return factorise(c) ? 0 : 1;
}

static int precondition(double t, vector y, vector rates, vector right_hand, vector result, double gamma,
                        double delta, int side, void *user, vector scratch) {
  slw_cvode *c = user;
  const size_t n = c->n;
  const double *a = c->factors;
  double *z = c->data(result);
  (void)t, (void)y, (void)rates, (void)gamma, (void)delta, (void)side, (void)scratch;
  memcpy(z, c->data(right_hand), n * sizeof *z);
  for (size_t k = 0; k < n; k++) {
    const double swapped = z[k];
    z[k] = z[c->pivots[k]], z[c->pivots[k]] = swapped;
  }
  for (size_t i = 0; i < n; i++)
    for (size_t j = 0; j < i; j++) z[i] -= a[i * n + j] * z[j];
  for (size_t i = n; i-- > 0;) {
    for (size_t j = i + 1; j < n; j++) z[i] -= a[i * n + j] * z[j];
    z[i] /= a[i * n + i];
  }
  return 0;
}

static int product(vector v, vector result, double t, vector y, vector rates, void *user, vector scratch) {
  slw_cvode *c = user;
  const double *from = c->data(v);
  double *to = c->data(result);
  (void)t, (void)y, (void)rates, (void)scratch;
  for (size_t i = 0; i < c->n; i++) {
    double sum = 0.0;
    for (size_t j = 0; j < c->n; j++) sum += c->jacobian[i * c->n + j] * from[j];
    to[i] = sum;
  }
  return 0;
}

/* ---- life ---- */

static bool bind(slw_cvode *c, const char *path, char *error, size_t error_size) {
  const struct {
    const char *name;
    void *function;
  } functions[] = {{"N_VMake_Serial", &c->make}, {"N_VDestroy", &c->destroy},
                   {"N_VGetArrayPointer", &c->data}, {"CVodeCreate", &c->create},
                   {"CVodeInit", &c->init}, {"CVodeReInit", &c->reinit},
                   {"CVodeSVtolerances", &c->tolerate}, {"CVodeRootInit", &c->root_init},
                   {"CVodeSetUserData", &c->user_data}, {"CVodeSetErrHandlerFn", &c->error_handler},
                   {"CVodeSetNoInactiveRootWarn", &c->no_root_warning}, {"CVodeSetStopTime", &c->stop_time},
                   {"CVode", &c->advance}, {"CVodeGetDky", &c->interpolate}, {"CVSpgmr", &c->krylov},
                   {"CVSpilsSetPreconditioner", &c->preconditioner},
                   {"CVSpilsSetJacTimesVecFn", &c->products}, {"CVodeFree", &c->release}};
  c->library = slw_library_open(path, error, error_size);
  for (size_t i = 0; c->library && i < sizeof functions / sizeof *functions; i++)
    if (!slw_library_symbol(c->library, functions[i].name, functions[i].function)) {
      snprintf(error, error_size, "the solver's library lacks the function %s", functions[i].name);
      return false;
    }
  return c->library != NULL;
}

static bool room(slw_cvode *c, size_t n) {
  c->n = n;
  c->x = calloc(4 * n, sizeof *c->x), c->jacobian = calloc(2 * n * n + n, sizeof *c->jacobian);
  c->pivots = calloc(n, sizeof *c->pivots);
  if (!c->x || !c->jacobian || !c->pivots) return false;
  c->tolerances = c->x + n, c->between = c->x + 2 * n, c->moved = c->x + 3 * n;
  c->factors = c->jacobian + n * n, c->rates_there = c->jacobian + 2 * n * n;
  c->y = c->make((long)n, c->x), c->absolute = c->make((long)n, c->tolerances);
  c->dense = c->make((long)n, c->between);
  return c->y && c->absolute && c->dense;
}

static bool configure(slw_cvode *c, size_t n_roots) {
  for (size_t i = 0; i < c->n; i++) c->tolerances[i] = 1.0;
  return c->error_handler(c->memory, on_error, c) == 0 && c->init(c->memory, right, 0.0, c->y) == 0 &&
         c->tolerate(c->memory, 1e-6, c->absolute) == 0 && c->user_data(c->memory, c) == 0 &&
         (n_roots == 0 || c->root_init(c->memory, (int)n_roots, root) == 0) &&
         c->no_root_warning(c->memory) == 0 && c->krylov(c->memory, LEFT, 0) == 0 &&
         c->preconditioner(c->memory, prepare, precondition) == 0 && c->products(c->memory, product) == 0;
}

slw_cvode *slw_cvode_new(const char *library, size_t n, size_t n_roots, slw_rates *rates, slw_rates *roots,
                         void *context, char *error, size_t error_size) {
  slw_cvode *c = calloc(1, sizeof *c);
  if (!c) {
    snprintf(error, error_size, "no memory");
    return NULL;
  }
  c->rates = rates, c->roots = roots, c->context = context;
  if (bind(c, library, error, error_size)) {
    c->memory = room(c, n) ? c->create(BDF, NEWTON) : NULL;
    if (c->memory && configure(c, n_roots)) return c;
    snprintf(error, error_size, "the solver cannot be set up: %s", *c->message ? c->message : "no memory");
  }
  slw_cvode_free(c);
  return NULL;
}

void slw_cvode_free(slw_cvode *c) {
  if (!c) return;
  const vector vectors[3] = {c->y, c->absolute, c->dense};
  if (c->memory) c->release(&c->memory);
  for (int i = 0; i < 3; i++)
    if (vectors[i]) c->destroy(vectors[i]);
  free(c->x), free(c->jacobian), free(c->pivots);
  if (c->library) slw_library_close(c->library);
  free(c);
}

/* ---- stepping ---- */

bool slw_cvode_restart(slw_cvode *c, double t, const double *x, const double *nominals, double relative) {
  memcpy(c->x, x, c->n * sizeof *x);
  for (size_t i = 0; i < c->n; i++) c->tolerances[i] = relative * nominals[i];
  *c->message = 0;
  return c->reinit(c->memory, t, c->y) == 0 && c->tolerate(c->memory, relative, c->absolute) == 0;
}

slw_solver_end slw_cvode_step(slw_cvode *c, double aim, double stop, double *reached) {
  if (c->stop_time(c->memory, stop < NO_STOP ? stop : NO_STOP) < 0) return SLW_SOLVER_FAILED;
  const int flag = c->advance(c->memory, aim, c->y, reached, ONE_STEP);
  if (flag < 0) return SLW_SOLVER_FAILED;
  return flag == ROOT_RETURN ? SLW_SOLVER_ROOT : SLW_SOLVER_STEP;
}

const double *slw_cvode_states(const slw_cvode *c) { return c->x; }

bool slw_cvode_at(slw_cvode *c, double t, double *x) {
  if (c->interpolate(c->memory, t, 0, c->dense) < 0) return false;
  memcpy(x, c->between, c->n * sizeof *x);
  return true;
}

const char *slw_cvode_message(const slw_cvode *c) { return c->message; }
