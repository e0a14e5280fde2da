/* The two loops that are timed: an FMU's doStep, and the bare functions that CasADi generated for the same model.
 *
 * Compiled together with model.c; the FMU is the packed library, reached by its function pointer.
 */
#include <string.h>

#include "core.h"

typedef int DoStep(void *component, double time, double step, int no_set_state_prior);

static double x[SLW_NX], x1[SLW_NX], y[SLW_NY], u[SLW_NU], m[SLW_LEN(SLW_NM)], p[SLW_NP];
static double w[SLW_LEN(SLW_SZ_W)];
static long long iw[SLW_LEN(SLW_SZ_IW)];

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Start of the bare model: parameters at their start values, inputs and modes as given. */
EXPORT void bare_start(const double *inputs, const double *modes) {
  const double *arg[1] = {p};
  double *res[1] = {x};
  memcpy(p, slw_start_p, sizeof p);
  memcpy(u, inputs, sizeof u);
  memcpy(m, modes, SLW_NM * sizeof m[0]);
  slw_x0(arg, res, iw, w, 0);
}

/* Next state alone, `steps` times. */
EXPORT void bare_steps(long long steps) {
  for (long long i = 0; i < steps; i++) {
    const double *arg[4] = {x, u, m, p};
    double *res[1] = {x1};
    slw_f(arg, res, iw, w, 0);
    memcpy(x, x1, sizeof x);
  }
}

EXPORT void bare_outputs(double *outputs) {
  const double *arg[4] = {x, u, m, p};
  double *res[1] = {y};
  slw_h(arg, res, iw, w, 0);
  memcpy(outputs, y, sizeof y);
}

/* doStep, `steps` times from tick `tick`; the status of the last. */
EXPORT int fmu_steps(DoStep *do_step, void *component, long long tick, long long steps) {
  int status = 0;
  for (long long i = 0; i < steps; i++)
    status = do_step(component, (double)(tick + i) * SLW_STEP, SLW_STEP, 1);
  return status;
}
