/* The trivial FMU of the benchmark's chain: a van der Pol oscillator driven by u, by Euler's rule.
 *
 * It does as little as an FMU can that never comes to rest: what is measured is the master, and what is
 * recorded does not compress to nothing. Value references: */
#ifndef SLW_LINK_H
#define SLW_LINK_H

#include <stddef.h>

enum { LINK_U, LINK_Y, LINK_RATE, LINK_TIME, LINK_N };

typedef struct {
  double v[LINK_N];
} link_t;

static inline void link_start(link_t *l) {
  l->v[LINK_U] = 0.5;
  l->v[LINK_Y] = l->v[LINK_RATE] = l->v[LINK_TIME] = 0.0;
}

static inline int link_get(const link_t *l, const unsigned *vr, size_t n, double *value) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= LINK_N) return 3;
    value[i] = l->v[vr[i]];
  }
  return 0;
}

static inline int link_set(link_t *l, const unsigned *vr, size_t n, const double *value) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] != LINK_U) return 3;
    l->v[LINK_U] = value[i];
  }
  return 0;
}

static inline int link_step(link_t *l, double time, double h) {
  const double y = l->v[LINK_Y], rate = l->v[LINK_RATE];
  l->v[LINK_RATE] = rate + h * ((1.0 - y * y) * rate - y + l->v[LINK_U]);
  l->v[LINK_Y] = y + h * l->v[LINK_RATE];
  l->v[LINK_TIME] = time + h;
  return 0;
}

#endif
