/* See fault.h. */
#include "fault.h"

#include <stdlib.h>
#include <string.h>

#define SLW_MATH_KEEP_NAMES
#include "slw_math.h"

#define GAMMA UINT64_C(0x9e3779b97f4a7c15)
#define TWO_PI 6.28318530717958647693
#define EXACT 2251799813685248.0 /* 2^51: from here on rounding to whole numbers changes nothing */

/* One block of memory, so that a snapshot is one copy. */
typedef struct {
  int64_t accepted;          /* the last accepted tick + 1; 0: none yet */
  int64_t lost, lost_before; /* dropout: whether that tick was lost, and the one before it */
  int64_t holds;             /* there is a value in `held` */
  double held;               /* stuck: the value kept; dropout: the last good one */
  double line[];             /* delay: what was sent at tick k stands at k % length */
} state;

struct slw_fault {
  slw_fault_kind kind;
  int64_t from, to;
  double a, b, step_s;
  uint64_t seed;
  int64_t length; /* of the delay line: ticks of delay + 1 */
  size_t size;    /* of the state */
  state *state;
};

/* ---- random numbers: SplitMix64 as a counter, `word` 0 or 1 of a tick ---- */

static uint64_t random_bits(const slw_fault *f, int64_t tick, uint64_t word) {
  uint64_t z = f->seed + (2 * (uint64_t)tick + word + 1) * GAMMA;
  z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
  z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
  return z ^ (z >> 31);
}

/* 0 <= u < 1 */
static double uniform(const slw_fault *f, int64_t tick, uint64_t word) {
  return (double)(random_bits(f, tick, word) >> 11) * 0x1p-53;
}

/* Box and Muller; the logarithm's argument is above 0 and at most 1. */
static double normal(const slw_fault *f, int64_t tick) {
  const double radius = slw_sqrt(-2.0 * slw_log(1.0 - uniform(f, tick, 0)));
  return radius * slw_cos(TWO_PI * uniform(f, tick, 1));
}

/* ---- the kinds that need more than a line ---- */

static double stuck(const slw_fault *f, double x) {
  if (f->b == 1.0) return f->a;
  return f->state->holds ? f->state->held : x;
}

static double delayed(const slw_fault *f, int64_t tick, double x) {
  if (!f->state->accepted) return x;
  return f->state->line[(tick + 1) % f->length]; /* the oldest one */
}

/* Gilbert's channel: losses begin with probability a and last b ticks on average; b 0: each tick alone. */
static bool is_lost(const slw_fault *f, int64_t tick) {
  const bool accepted = tick < f->state->accepted;
  const double goes_on = f->b > 0.0 ? 1.0 - 1.0 / f->b : f->a;
  return uniform(f, tick, 0) < ((accepted ? f->state->lost_before : f->state->lost) ? goes_on : f->a);
}

static double with_dropout(const slw_fault *f, int64_t tick, double x) {
  return f->state->holds && is_lost(f, tick) ? f->state->held : x;
}

static double with_spike(const slw_fault *f, int64_t tick, double x) {
  if (!(uniform(f, tick, 0) < f->a)) return x;
  return random_bits(f, tick, 1) >> 63 ? x - f->b : x + f->b;
}

static double quantised(double x, double step) {
  const double steps = x / step;
  return slw_fabs(steps) < EXACT ? step * slw_round_even(steps) : x;
}

/* No number stays none, so that it is noticed. */
static double saturated(double x, double low, double high) {
  if (x < low) return low;
  return x > high ? high : x;
}

static bool acts(const slw_fault *f, int64_t tick) { return tick >= f->from && tick < f->to; }

double slw_fault_apply(const slw_fault *f, int64_t tick, double x) {
  if (!acts(f, tick)) return x;
  switch (f->kind) {
  case SLW_STUCK: return stuck(f, x);
  case SLW_BIAS: return x + f->a;
  case SLW_DRIFT: return x + f->a * ((double)(tick - f->from) * f->step_s);
  case SLW_NOISE: return x + f->a * normal(f, tick);
  case SLW_DELAY: return delayed(f, tick, x);
  case SLW_DROPOUT: return with_dropout(f, tick, x);
  case SLW_SPIKE: return with_spike(f, tick, x);
  case SLW_QUANTISE: return quantised(x, f->a);
  case SLW_SCALE: return f->a * x;
  case SLW_SATURATE: return saturated(x, f->a, f->b);
  case SLW_N_FAULTS: break;
  }
  return x;
}

/* ---- memory ---- */

static void keep(state *s, double x) {
  s->held = x;
  s->holds = 1;
}

static void put_in_line(slw_fault *f, int64_t tick, double x) {
  if (!f->state->accepted)
    for (int64_t i = 0; i < f->length; i++) f->state->line[i] = x;
  f->state->line[tick % f->length] = x;
}

static void pass_or_lose(slw_fault *f, int64_t tick, double x) {
  const bool lost = acts(f, tick) && is_lost(f, tick);
  f->state->lost_before = f->state->lost;
  f->state->lost = lost;
  if (!lost || !f->state->holds) keep(f->state, x);
}

void slw_fault_accept(slw_fault *f, int64_t tick, double x) {
  if (!f->state || tick < f->state->accepted) return;
  if (f->kind == SLW_STUCK && acts(f, tick) && !f->state->holds) keep(f->state, x);
  if (f->kind == SLW_DELAY) put_in_line(f, tick, x);
  if (f->kind == SLW_DROPOUT) pass_or_lose(f, tick, x);
  f->state->accepted = tick + 1;
}

bool slw_fault_remembers(const slw_fault *f) { return f->size > 0; }

void slw_fault_reset(slw_fault *f) {
  if (f->state) memset(f->state, 0, f->size);
}

size_t slw_fault_state_size(const slw_fault *f) { return f->size; }

void slw_fault_save(const slw_fault *f, char *bytes) {
  if (f->size) memcpy(bytes, f->state, f->size);
}

void slw_fault_restore(slw_fault *f, const char *bytes) {
  if (f->size) memcpy(f->state, bytes, f->size);
}

/* ---- setting up ---- */

static bool is_probability(double p) { return p > 0.0 && p <= 1.0; }

static bool is_valid(slw_fault_kind kind, double a, double b) {
  if (!slw_is_finite(a) || !slw_is_finite(b)) return false;
  switch (kind) {
  case SLW_DROPOUT: return is_probability(a) && (b == 0.0 || b >= 1.0);
  case SLW_SPIKE: return is_probability(a);
  case SLW_QUANTISE: return a > 0.0;
  case SLW_SATURATE: return a <= b;
  case SLW_DELAY: return a >= 0.0;
  default: return (unsigned)kind < SLW_N_FAULTS;
  }
}

/* Ticks of delay, or -1 where that is no whole number or too many. */
static int64_t whole_ticks(double delay_s, double step_s) {
  const double ticks = delay_s / step_s, whole = slw_floor(ticks + 0.5);
  if (!(whole < SLW_FAULT_MAX_DELAY) || slw_fabs(ticks - whole) > 1e-6) return -1;
  return (int64_t)whole;
}

static bool make_room(slw_fault *f) {
  if (f->kind == SLW_DELAY) {
    const int64_t ticks = whole_ticks(f->a, f->step_s);
    if (ticks < 0) return false;
    f->length = ticks + 1;
  }
  if (f->kind == SLW_STUCK || f->kind == SLW_DELAY || f->kind == SLW_DROPOUT)
    f->size = sizeof(state) + (size_t)f->length * sizeof(double);
  if (f->size) f->state = calloc(1, f->size);
  return !f->size || f->state;
}

slw_fault *slw_fault_new(slw_fault_kind kind, int64_t from, int64_t to, double a, double b, uint64_t seed,
                         double step_s) {
  slw_fault *f;
  if (!is_valid(kind, a, b) || from < 0 || to <= from || !(step_s > 0.0)) return NULL;
  f = calloc(1, sizeof *f);
  if (!f) return NULL;
  *f = (slw_fault){.kind = kind, .from = from, .to = to, .a = a, .b = b, .step_s = step_s, .seed = seed};
  if (make_room(f)) return f;
  slw_fault_free(f);
  return NULL;
}

void slw_fault_free(slw_fault *f) {
  if (!f) return;
  free(f->state);
  free(f);
}
