/* CVODE, from the library that CasADi's wheels carry, behind the few calls that model exchange needs.
 *
 * BDF, Newton's method with a dense Jacobian by differences. Source: Hindmarsh et al., SUNDIALS: Suite of
 * Nonlinear and Differential/Algebraic Equation Solvers, ACM TOMS 31 (2005); CVODES 2.8, user guide. */
#ifndef SLW_CVODE_H
#define SLW_CVODE_H

#include <stdbool.h>
#include <stddef.h>

/* 0: done; > 0: not at this point, a smaller step may do; < 0: no way on. */
typedef int slw_rates(void *context, double t, const double *x, double *result);

typedef struct slw_cvode slw_cvode;

typedef enum { SLW_SOLVER_FAILED, SLW_SOLVER_STEP, SLW_SOLVER_ROOT } slw_solver_end;

/* `n` states (at least 1), `n_roots` functions whose signs are watched. NULL and a sentence when it fails. */
slw_cvode *slw_cvode_new(const char *library, size_t n, size_t n_roots, slw_rates *rates, slw_rates *roots,
                         void *context, char *error, size_t error_size);
/* Begin anew at `t`; absolute tolerances are `relative` times `nominals`. */
bool slw_cvode_restart(slw_cvode *c, double t, const double *x, const double *nominals, double relative);
/* One step of the solver's own choice towards `aim`, never beyond `stop`; *reached may lie beyond `aim`. */
slw_solver_end slw_cvode_step(slw_cvode *c, double aim, double stop, double *reached);
/* The states at the end of the last step, and at any time within it (dense output). */
const double *slw_cvode_states(const slw_cvode *c);
bool slw_cvode_at(slw_cvode *c, double t, double *x);
/* What the solver said last. */
const char *slw_cvode_message(const slw_cvode *c);
void slw_cvode_free(slw_cvode *c);

#endif
