/* The arithmetic of one fault (slw_fault_kind, core.h): what arrives instead of x.
 *
 * A step may be computed any number of times (iteration, rollback), so `apply` changes nothing: random
 * numbers are a function of seed and tick, and what a fault remembers (the value it is stuck at, the last
 * good one, the delay line) is written by `accept`, when a tick is final; a second time it does nothing, and
 * `apply` gives the same after it.  The same bits come out on every platform. */
#ifndef SLW_FAULT_H
#define SLW_FAULT_H

#include "core.h"

#define SLW_FAULT_MAX_DELAY (1 << 24) /* ticks: 128 MB of delay line */

typedef struct slw_fault slw_fault;

/* A fault that acts from tick `from` on, before tick `to`; a delay is a whole number of steps.
 * NULL for values that make no sense (is_valid in fault.c), or without memory. */
slw_fault *slw_fault_new(slw_fault_kind kind, int64_t from, int64_t to, double a, double b, uint64_t seed,
                         double step_s);
void slw_fault_free(slw_fault *fault);

/* What arrives in the step from `tick` on when x was sent; x itself outside from ... to. */
double slw_fault_apply(const slw_fault *fault, int64_t tick, double x);

/* The step from `tick` on is final, and x was sent at its begin.  Every tick, also those before `from`: a
 * delay and a loss need what came before. */
void slw_fault_accept(slw_fault *fault, int64_t tick, double x);

/* Whether `accept` does anything: stuck, delay and dropout only. */
bool slw_fault_remembers(const slw_fault *fault);

/* As new. */
void slw_fault_reset(slw_fault *fault);

/* What it remembers, as bytes, for a snapshot; 0 where it remembers nothing. */
size_t slw_fault_state_size(const slw_fault *fault);
void slw_fault_save(const slw_fault *fault, char *bytes);
void slw_fault_restore(slw_fault *fault, const char *bytes);

#endif
