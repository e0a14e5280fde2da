/* An FMI 3.0 FMU whose clocks tick others and are ticked.
 *
 * Parameters: 1 every (o ticks at the end of each so many-th step; 0: never), 2 echoes (when i has ticked, o ticks in
 * the next iteration of that instant: 1 once, 2 always). Clocks: 10 i in, 12 o out, 16 p in, periodic.
 * Clocked: 11 u in (by i), 13 y out (by o): 100 for each tick of o and the last u, 17 z out (by p): ticks of p.
 * Outputs: 14 seen (the last u), 15 times (ticks of i). */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

typedef struct {
  double every, echoes, u, seen, times, ticks, z;
  long steps;
  int i, o, p, due, echoed;
} Ticker;

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)intermediate, (void)n_intermediate;
  (void)environment, (void)log, (void)update;
  return event_mode && !early_return ? calloc(1, sizeof(Ticker)) : NULL;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e,
                                       fmi3Float64 f) {
  (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  Ticker *t = c;
  (void)no_set_state;
  t->steps++;
  t->due = t->every > 0.0 && t->steps % (long)t->every == 0;
  *event = t->due, *terminate = *early = fmi3False, *last = time + step;
  return fmi3OK;
}

static void raise_output(Ticker *t) { t->o = 1, t->ticks += 100.0; }

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  Ticker *t = c;
  t->echoed = 0;
  if (t->due) raise_output(t);
  return fmi3OK;
}
fmi3Status fmi3EnterStepMode(fmi3Instance c) {
  ((Ticker *)c)->due = 0;
  return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
  Ticker *t = c;
  const int ticked = t->i;
  *more = *terminate = *nominals = *values = *defined = fmi3False, *next = 0.0;
  if (t->i) t->times += 1.0, t->seen = t->u;
  t->i = t->o = t->p = 0;
  if (ticked && (t->echoes == 2.0 || (t->echoes == 1.0 && !t->echoed))) raise_output(t), t->echoed = 1, *more = fmi3True;
  return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 v[], size_t nv) {
  const Ticker *t = c;
  for (size_t k = 0; k < n && k < nv; k++) switch (vr[k]) {
      case 1: v[k] = t->every; break;
      case 2: v[k] = t->echoes; break;
      case 13: if (!t->o) return fmi3Error; v[k] = t->ticks + t->seen; break;
      case 14: v[k] = t->seen; break;
      case 15: v[k] = t->times; break;
      case 17: if (!t->p) return fmi3Error; v[k] = t->z; break;
      default: return fmi3Error;
    }
  return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 v[], size_t nv) {
  Ticker *t = c;
  for (size_t k = 0; k < n && k < nv; k++) {
    if (vr[k] == 1) t->every = v[k];
    else if (vr[k] == 2) t->echoes = v[k];
    else if (vr[k] == 11) t->u = v[k];
    else return fmi3Error;
  }
  return fmi3OK;
}
fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock v[]) {
  for (size_t k = 0; k < n; k++) v[k] = vr[k] == 12 && ((Ticker *)c)->o;
  return fmi3OK;
}
fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock v[]) {
  Ticker *t = c;
  for (size_t k = 0; k < n; k++) {
    if (vr[k] == 10) t->i = v[k];
    else if (vr[k] == 16) t->p = v[k], t->z += v[k];
    else return fmi3Error;
  }
  return fmi3OK;
}
