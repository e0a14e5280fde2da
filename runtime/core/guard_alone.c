/* The guard without a core around it, for runs in which something else drives.  Not part of a bundle's core. */
#include <string.h>

#include "slr.h"

SLR_EXPORT size_t slr_alone_size(void);
SLR_EXPORT double slr_alone_start(SlrGuardPast *past, const double *seen);
SLR_EXPORT int slr_alone_step(SlrGuardPast *past, const double *seen, double *wanted);

size_t slr_alone_size(void) { return sizeof(SlrGuardPast); }

/* Angles of slew, boom, stick; slew rate; the tool's pitch and roll, and their rates. */
static SlrGuardView view_of(const double *seen) {
  return (SlrGuardView){.angle = {seen[0], seen[1], seen[2]},
                        .slew_rate = seen[3],
                        .swing = {seen[4], seen[5]},
                        .swing_rate = {seen[6], seen[7]}};
}

/* It has stood still long enough to be known; the room that standing on leaves, m. */
double slr_alone_start(SlrGuardPast *past, const double *seen) {
  const double neutral[SLR_AXES] = {0.0, 0.0, 0.0};
  const SlrGuardView view = view_of(seen);
  SlrSweep sweep;
  int part;
  memset(past, 0, sizeof *past);
  for (int tick = 0; tick < SLR_GUARD_SENT; tick++) slr_guard_remember(past, &view, 1, neutral);
  slr_guard_foresee(&slr_guard_limits, &slr_guard_body, &view, past, neutral, &sweep);
  return slr_guard_room(&slr_guard_limits, &slr_guard_body, slr_zones, &sweep, -1e3, &part);
}

/* One tick of automatic operation with all sensors there; the part of the machine for which it stepped in. */
int slr_alone_step(SlrGuardPast *past, const double *seen, double *wanted) {
  const SlrGuardView view = view_of(seen);
  const int part = slr_guard(&slr_guard_limits, &slr_guard_body, slr_zones, &view, past, wanted);
  slr_guard_remember(past, &view, 1, wanted);
  return part;
}
