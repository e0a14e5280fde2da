/* Real time: waiting for the begin of each tick, and how late it was. */
#include "plan.h"

#include <errno.h>
#include <time.h>

#define LATE_S 1e-3
#define PER_OCTAVE 32
#define FIRST_S 1e-6

double slw_clock_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void wait_until(double deadline) {
#ifdef _WIN32
  while (slw_clock_s() < deadline) {}
#else
  struct timespec t = {(time_t)deadline, 0};
  t.tv_nsec = (long)((deadline - (double)t.tv_sec) * 1e9);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {}
#endif
}

/* Buckets on a grid of 32 equal parts of every power of two from 1 us on; the first takes all below. */
static int bucket(double late) {
  if (!(late >= FIRST_S)) return 0;
  int octave = 0;
  double x = late / FIRST_S;
  while (x >= 2.0) x *= 0.5, octave++;
  const int k = 1 + octave * PER_OCTAVE + (int)((x - 1.0) * PER_OCTAVE);
  return k < SLW_BUCKETS ? k : SLW_BUCKETS - 1;
}

static double upper_edge(int k) {
  if (k == 0) return FIRST_S;
  return FIRST_S * (double)(1ULL << ((k - 1) / PER_OCTAVE)) * (1.0 + (double)((k - 1) % PER_OCTAVE + 1) / PER_OCTAVE);
}

void slw_pace_wait(slw_core *core) {
  slw_pacing *p = core->pace;
  if (p->start_s == 0.0) p->start_s = slw_clock_s(), p->start_tick = core->tick;
  const double deadline = p->start_s + (double)(core->tick - p->start_tick) * core->step_s / p->factor;
  wait_until(deadline);
  const double late = slw_clock_s() - deadline;
  p->histogram[bucket(late)]++;
  p->late += late > LATE_S;
  p->max_s = slw_max(p->max_s, late);
}

static double quantile(const slw_pacing *p, double q) {
  uint64_t total = 0, seen = 0;
  for (int k = 0; k < SLW_BUCKETS; k++) total += p->histogram[k];
  for (int k = 0; k < SLW_BUCKETS; k++) {
    seen += p->histogram[k];
    if ((double)seen >= q * (double)total) return upper_edge(k) < p->max_s ? upper_edge(k) : p->max_s;
  }
  return 0.0;
}

void slw_core_statistics(const slw_core *core, slw_statistics *statistics) {
  *statistics = core->count;
  if (core->algorithm != SLW_ADAPTIVE) statistics->steps = (uint64_t)core->tick;
  statistics->waits = core->ring.waits;
  const slw_pacing *p = core->pace;
  if (!p) return;
  statistics->late = p->late, statistics->late_max_s = p->max_s;
  statistics->late_p50_s = quantile(p, 0.5), statistics->late_p99_s = quantile(p, 0.99);
  statistics->late_p999_s = quantile(p, 0.999);
}
