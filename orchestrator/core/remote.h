/* An FMU in a process of its own: `slw_fmu_spawn` of fmu.h, and a step in one round trip. */
#ifndef SLW_REMOTE_H
#define SLW_REMOTE_H

#include "fmu.h"

/* Set, step and get: begun, so that others may step meanwhile, and finished. The status is the worst of the
 * three; of a step that was not OK (nothing was got then) *stepped is false. */
slw_status slw_remote_begin(slw_fmu *fmu, const slw_group *sets, size_t n_sets, double time, double h,
                            const slw_group *gets, size_t n_gets);
slw_status slw_remote_finish(slw_fmu *fmu, const slw_group *gets, size_t n_gets, slw_step_result *result,
                             bool *stepped);

#endif
