/* An FMI 3.0 FMU whose input clocks tick at times that it tells: co-simulation and scheduled execution in one.
 *
 * Parameters: 1 interval and 2 growth (k's first interval, and what each tick adds), 3 shift (of k), 4 go (k is not
 * known before the end of that many steps, or ticks of p in scheduled execution; it counts from there), 5 qualifier
 * (-1: as the standard has it, else given after the first tick), 6 fault (1: the first tick leaves a lock; 2: a
 * discarded partition; 3, 4: the interval is no number, infinite), 7 period (tunable: the interval of k from now on; 0: as told).
 * Clocks: 10 k and 20 p in, 12 o out (ticks with k), 21 i in, triggered.
 * 11 u in (by k), 13 y out (by o: ticks of k), 22 w in (by i).
 * Outputs: 30 ticks, 31 last (time of k's last tick), 32 seen (u then), 33 order (which clocks ticked since the last
 * step or change of time, a digit each: 1 k, 2 p, 3 i), 34 heard (w at i's last tick), 35 heard_at, 36 pticks,
 * 37 x (integral of 1). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

typedef struct {
  double v[8], u, w, ticks, last, seen, order, heard, heard_at, pticks, x, time, interval, ordered_at;
  long steps;
  int k, p, i, o, fresh, known, scheduled;
} State;

typedef struct {
  State s;
  fmi3InstanceEnvironment environment;
  fmi3ClockUpdateCallback update;
  fmi3LockPreemptionCallback lock, unlock;
} Beats;

enum { INTERVAL = 1, GROWTH, SHIFT, GO, QUALIFIER, FAULT, PERIOD };

static Beats *made(void) {
  Beats *b = calloc(1, sizeof *b);
  if (b) b->s.interval = 0.01, b->s.v[INTERVAL] = 0.01, b->s.v[QUALIFIER] = -1.0, b->s.ordered_at = -1.0;
  return b;
}

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)intermediate, (void)n_intermediate;
  (void)environment, (void)log, (void)update, (void)early_return;
  return event_mode ? made() : NULL;
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)log;
  Beats *b = made();
  if (b) b->environment = environment, b->update = update, b->lock = lock, b->unlock = unlock, b->s.scheduled = 1;
  return b;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
  State *s = &((Beats *)c)->s;
  (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
  s->time = start, s->interval = s->v[INTERVAL];
  s->known = s->fresh = s->v[GO] == 0.0;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }

static void start_counting(State *s) { s->known = s->fresh = 1; }

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  State *s = &((Beats *)c)->s;
  (void)no_set_state;
  *event = *terminate = *early = fmi3False, *last = s->time = time + step;
  s->x += step, s->steps++;
  if (s->v[GO] > 0.0 && s->steps == (long)s->v[GO]) start_counting(s), *event = fmi3True;
  return fmi3OK;
}
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }

static void order(State *s, int digit) {
  if (s->ordered_at != s->time) s->ordered_at = s->time, s->order = 0.0;
  s->order = 10.0 * s->order + digit;
}

static void beat_k(State *s) {
  s->ticks += 1.0, s->last = s->time, s->seen = s->u;
  s->interval += s->v[GROWTH], s->fresh = 1;
  order(s, 1);
}
static void beat_i(State *s) { s->heard = s->w, s->heard_at = s->time, order(s, 3); }
static void beat_p(State *s) { s->pticks += 1.0, order(s, 2); }

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
  State *s = &((Beats *)c)->s;
  *more = *terminate = *nominals = *values = *defined = fmi3False, *next = 0.0;
  s->k = s->p = s->i = s->o = 0;
  return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock v[]) {
  State *s = &((Beats *)c)->s;
  if (s->scheduled) return fmi3Error;
  for (size_t j = 0; j < n; j++) {
    if (!v[j]) continue;
    if (vr[j] == 10) s->k = s->o = 1, beat_k(s);
    else if (vr[j] == 20) s->p = 1, beat_p(s);
    else if (vr[j] == 21) s->i = 1, beat_i(s);
    else return fmi3Error;
  }
  return fmi3OK;
}
fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock v[]) {
  State *s = &((Beats *)c)->s;
  for (size_t j = 0; j < n; j++) {
    v[j] = vr[j] == 12 && s->o;
    if (s->scheduled) s->o = 0; /* told once */
  }
  return fmi3OK;
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference vr, fmi3Float64 time) {
  Beats *b = c;
  b->s.time = time;
  b->lock();
  if (vr == 10) {
    beat_k(&b->s), b->s.o = 1;
    if (b->s.v[FAULT] == 1.0 && b->s.ticks == 1.0) b->lock();
  } else if (vr == 20) {
    beat_p(&b->s);
    if (b->s.v[GO] > 0.0 && b->s.pticks == b->s.v[GO]) start_counting(&b->s);
  } else if (vr == 21) {
    beat_i(&b->s);
  }
  b->unlock();
  if (vr == 10 || b->s.fresh) b->update(b->environment);
  return b->s.v[FAULT] == 2.0 ? fmi3Discard : fmi3OK;
}

/* The interval as it stands: of a countdown clock it is told once. */
static fmi3IntervalQualifier qualify(State *s) {
  if (s->v[QUALIFIER] >= 0.0 && s->ticks > 0.0) return (fmi3IntervalQualifier)s->v[QUALIFIER];
  if (!s->known) return fmi3IntervalNotYetKnown;
  const int fresh = s->fresh;
  s->fresh = 0;
  return fresh ? fmi3IntervalChanged : fmi3IntervalUnchanged;
}
static double interval(const State *s) {
  if (s->v[FAULT] >= 3.0) return s->v[FAULT] == 3.0 ? NAN : INFINITY;
  return s->v[PERIOD] > 0.0 ? s->v[PERIOD] : s->interval;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
  State *s = &((Beats *)c)->s;
  for (size_t j = 0; j < n; j++) {
    if (vr[j] != 10) return fmi3Error;
    intervals[j] = interval(s), qualifiers[j] = qualify(s);
  }
  return fmi3OK;
}
fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
  State *s = &((Beats *)c)->s;
  for (size_t j = 0; j < n; j++) {
    if (vr[j] != 10) return fmi3Error;
    resolutions[j] = 1000, counters[j] = (fmi3UInt64)(interval(s) * 1000.0 + 0.5), qualifiers[j] = qualify(s);
  }
  return fmi3OK;
}
fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[]) {
  for (size_t j = 0; j < n; j++) {
    if (vr[j] != 10) return fmi3Error;
    shifts[j] = ((Beats *)c)->s.v[SHIFT];
  }
  return fmi3OK;
}
fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
  for (size_t j = 0; j < n; j++) {
    if (vr[j] != 10) return fmi3Error;
    resolutions[j] = 1000, counters[j] = (fmi3UInt64)(((Beats *)c)->s.v[SHIFT] * 1000.0 + 0.5);
  }
  return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 v[], size_t nv) {
  const State *s = &((Beats *)c)->s;
  for (size_t j = 0; j < n && j < nv; j++) switch (vr[j]) {
      case 13: v[j] = s->ticks; break;
      case 30: v[j] = s->ticks; break;
      case 31: v[j] = s->last; break;
      case 32: v[j] = s->seen; break;
      case 33: v[j] = s->order; break;
      case 34: v[j] = s->heard; break;
      case 35: v[j] = s->heard_at; break;
      case 36: v[j] = s->pticks; break;
      case 37: v[j] = s->x; break;
      default:
        if (vr[j] < 1 || vr[j] > 7) return fmi3Error;
        v[j] = s->v[vr[j]];
    }
  return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 v[], size_t nv) {
  State *s = &((Beats *)c)->s;
  for (size_t j = 0; j < n && j < nv; j++) {
    if (vr[j] == 11) s->u = v[j];
    else if (vr[j] == 22) s->w = v[j];
    else if (vr[j] < 1 || vr[j] > 7) return fmi3Error;
    else s->v[vr[j]] = v[j];
    if (vr[j] == PERIOD) s->fresh = 1;
  }
  return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(State));
  memcpy(*state, &((Beats *)c)->s, sizeof(State));
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  memcpy(&((Beats *)c)->s, state, sizeof(State));
  return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  free(*state), *state = NULL;
  return fmi3OK;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(State);
  return fmi3OK;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  (void)c;
  memcpy(bytes, state, size);
  return fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  (void)c;
  if (size != sizeof(State)) return fmi3Error;
  *state = malloc(sizeof(State));
  memcpy(*state, bytes, size);
  return fmi3OK;
}
