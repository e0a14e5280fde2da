/* What is timed: the machine's step, driven with moving joysticks; compiled with one of the integrators. */
#include "core.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

static SlwCore core;
static long long now; /* samples so far */

EXPORT void bench_start(void) {
  slw_reset(&core);
  slw_initialise(&core);
  core.phase = SLW_STEPPING;
  now = 0;
}

/* A triangle between -0.6 and 0.6, of its own period for each joystick. */
static double joystick(int i) {
  const long long period = 300 + 112 * i, phase = (now + period / 4) % period;
  return 2.4 * (double)(phase < period / 2 ? phase : period - phase) / (double)period - 0.6;
}

EXPORT int bench_samples(long long samples) {
  for (long long k = 0; k < samples; k++) {
    for (int i = 0; i < 3; i++) core.s.u[i] = joystick(i);
    if (slw_step(&core, SLW_SAMPLE_TIME)) return -1;
    now++;
  }
  return 0;
}

EXPORT const double *bench_states(void) { return core.s.x; }
