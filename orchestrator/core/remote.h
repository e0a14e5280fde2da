/* An FMU in a process of its own: `slw_fmu_spawn` of fmu.h, and a step in one round trip. */
#ifndef SLW_REMOTE_H
#define SLW_REMOTE_H

#include "fmu.h"

/* What came of set, step and get in one round trip. */
typedef struct {
  slw_phase phase;      /* the last one that was done, which `status` is of */
  bool complete;        /* all that was asked for, outputs included */
  uint32_t warnings;    /* calls that warned */
  slw_step_result step; /* meaningful from SLW_AT_STEP on */
} slw_exchanged;

/* Set, step and get: begun, so that others may step meanwhile, and finished. After the first status worse than
 * a warning nothing more is called. */
slw_status slw_remote_begin(slw_fmu *fmu, const slw_group *sets, size_t n_sets, double time, double h,
                            const slw_group *gets, size_t n_gets);
slw_status slw_remote_finish(slw_fmu *fmu, const slw_group *gets, size_t n_gets, slw_exchanged *result);

#endif
