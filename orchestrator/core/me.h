/* Model exchange: an FMU whose states are integrated here, behind the functions of one that steps itself.
 *
 * The binding of an FMI version gives its functions for this kind; `slw_me_wrap` makes of them a table whose
 * `step` integrates with CVODE, finds state events, meets time events, and iterates events. */
#ifndef SLW_ME_H
#define SLW_ME_H

#include "fmu.h"

/* What FMI calls it, the same in both versions. */
typedef struct {
  slw_status (*set_time)(slw_fmu *, double t);
  slw_status (*get_states)(slw_fmu *, double *x, size_t n);
  slw_status (*set_states)(slw_fmu *, const double *x, size_t n);
  slw_status (*derivatives)(slw_fmu *, double *dx, size_t n);
  slw_status (*indicators)(slw_fmu *, double *z, size_t n);
  slw_status (*nominals)(slw_fmu *, double *nominals, size_t n);
  slw_status (*enter_event)(slw_fmu *);
  slw_status (*update)(slw_fmu *, slw_event_result *);
  slw_status (*enter_continuous)(slw_fmu *);
  slw_status (*completed)(slw_fmu *, bool *event, bool *terminate);
} slw_me_calls;

/* `exchange` is that of slw_fmu_options.  false and a sentence without a solver or memory. */
bool slw_me_wrap(slw_fmu *fmu, const slw_me_calls *calls, const char *exchange, char *error, size_t error_size);

#endif
