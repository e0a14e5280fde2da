/* An FMI 3.0 FMU that takes discrete inputs and tunable parameters in event mode only, as the standard has it.
 *
 * Inputs: 1 n (Int32), 2 word (String), 3 u (continuous). Parameter: 4 gain (tunable).
 * Outputs: 10 held (gain times n, as of the last event), 11 letters (of word then), 12 events, 13 x (integral of u),
 * 20 said (String: a letter for every 0.02 s). */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

typedef struct {
  double n, u, gain, held, letters, events, x, size;
  int in_event, running;
  char said[64];
} Careful;

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)intermediate, (void)n_intermediate;
  (void)environment, (void)log, (void)update, (void)early_return;
  Careful *i = event_mode ? calloc(1, sizeof *i) : NULL;
  if (i) i->gain = 1.0;
  return i;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e,
                                       fmi3Float64 f) {
  (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  Careful *i = c;
  return i->in_event = i->running = 1, fmi3OK;
}
fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  Careful *i = c;
  (void)no_set_state;
  i->x += i->u * step;
  memset(i->said, 'a', (size_t)((time + step) / 0.02 + 1e-6) % sizeof i->said);
  *event = *terminate = *early = fmi3False, *last = time + step;
  return i->in_event ? fmi3Error : fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  Careful *i = c;
  if (i->in_event) return fmi3Error;
  return i->in_event = 1, i->events += 1.0, fmi3OK;
}
fmi3Status fmi3EnterStepMode(fmi3Instance c) {
  Careful *i = c;
  return i->in_event = 0, fmi3OK;
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
  Careful *i = c;
  *more = *terminate = *nominals = *values = *defined = fmi3False, *next = 0.0;
  if (!i->in_event) return fmi3Error;
  i->held = i->gain * i->n, i->letters = i->size;
  return fmi3OK;
}

static int allowed(const Careful *i) { return !i->running || i->in_event; }

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 v[], size_t nv) {
  const Careful *i = c;
  const double outputs[] = {i->held, i->letters, i->events, i->x};
  for (size_t k = 0; k < n && k < nv; k++) {
    if (vr[k] < 10 || vr[k] > 13) return fmi3Error;
    v[k] = outputs[vr[k] - 10];
  }
  return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 v[], size_t nv) {
  Careful *i = c;
  for (size_t k = 0; k < n && k < nv; k++) {
    if (vr[k] == 3) i->u = v[k];
    else if (vr[k] == 4 && allowed(i)) i->gain = v[k];
    else return fmi3Error;
  }
  return fmi3OK;
}
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 v[], size_t nv) {
  Careful *i = c;
  for (size_t k = 0; k < n && k < nv; k++) {
    if (vr[k] != 1 || !allowed(i)) return fmi3Error;
    i->n = v[k];
  }
  return fmi3OK;
}
fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 v[], size_t nv) {
  for (size_t k = 0; k < n && k < nv; k++) {
    if (vr[k] != 1) return fmi3Error;
    v[k] = (fmi3Int32)((Careful *)c)->n;
  }
  return fmi3OK;
}
fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String v[], size_t nv) {
  Careful *i = c;
  for (size_t k = 0; k < n && k < nv; k++) {
    if (vr[k] != 2 || !allowed(i)) return fmi3Error;
    i->size = (double)strlen(v[k]);
  }
  return fmi3OK;
}
fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String v[], size_t nv) {
  for (size_t k = 0; k < n && k < nv; k++) {
    if (vr[k] != 20) return fmi3Error;
    v[k] = ((Careful *)c)->said;
  }
  return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state && !(*state = malloc(sizeof(Careful)))) return fmi3Error;
  return memcpy(*state, c, sizeof(Careful)), fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return memcpy(c, state, sizeof(Careful)), fmi3OK; }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  return free(*state), *state = NULL, fmi3OK;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)c, (void)state;
  return *size = sizeof(Careful), fmi3OK;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  (void)c;
  return memcpy(bytes, state, size), fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  (void)c;
  if (!*state && !(*state = malloc(sizeof(Careful)))) return fmi3Error;
  return memcpy(*state, bytes, size), fmi3OK;
}
