/* Scheduled execution: an FMU that computes only where its clocks tick, behind the functions of one that steps itself.
 *
 * A step passes the time and nothing else; a clock that is set activates its partition at the time that comes with it.
 * Partitions run one after the other, so no lock is ever waited for. */
#ifndef SLW_SCHEDULED_H
#define SLW_SCHEDULED_H

#include "fmu.h"

typedef slw_status (*slw_activation)(slw_fmu *, uint32_t vr, double time);

/* `text` is `scheduled` of slw_fmu_options: a line for each clock that a partition may announce, "countdown VR" (read
 * as a decimal), "fraction VR" (a countdown clock, read as a fraction) or "output VR".
 * false and a sentence where it is none of these, or without memory. */
bool slw_scheduled_wrap(slw_fmu *fmu, slw_activation activate, const char *text, char *error, size_t error_size);

/* FMI's callbacks: clocks that a partition announces are read within it; locks are counted. */
void slw_scheduled_update(void *environment);
void slw_scheduled_lock(void);
void slw_scheduled_unlock(void);

#endif
