/* The FMI 3.0 shell of the kit; exchange3.c has what model exchange has besides. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"
#include "kit.h"

static kit_instance *of(fmi3Instance c) { return (kit_instance *)c; }

const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)resources, (void)visible, (void)logging, (void)intermediate, (void)environment, (void)log;
  (void)update;
  if (strncmp(token, KIT_TOKEN, sizeof KIT_TOKEN - 1) != 0 || n_intermediate) return NULL;
  kit_instance *m = calloc(1, sizeof *m);
  if (!m) return NULL;
  m->events = event_mode, m->early = early_return;
  fmi3Reset(m);
  return m;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3Reset(fmi3Instance c) {
  const bool events = of(c)->events, early = of(c)->early;
  memset(c, 0, sizeof(kit_instance));
  of(c)->events = events, of(c)->early = early;
  kit_defaults((kit_cell *)of(c)->v);
  for (int i = 0; i < KIT_TEXTS; i++) of(c)->text[i] = kit_texts[i];
  return fmi3OK;
}
fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean with_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean with_stop, fmi3Float64 stop) {
  (void)with_tolerance, (void)tolerance, (void)with_stop, (void)stop;
  of(c)->time = start;
  of(c)->initialising = true;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  kit_outputs(of(c));
  of(c)->initialising = false;
  return fmi3OK;
}
#ifndef KIT_EXCHANGE
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return of(c)->events ? fmi3OK : fmi3Error; }
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return of(c)->events ? fmi3OK : fmi3Error; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *next_defined,
                                    fmi3Float64 *next) {
  kit_event(of(c));
  *more = *terminate = *nominals = *values = *next_defined = false;
  *next = 0.0;
  return fmi3OK;
}
#else
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return c ? fmi3Error : fmi3Fatal; }
#endif
fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }

/* ---- values: elements of all variables of a call, one after the other ---- */

/* What an active clock clocks is computed when it is read, or with the update after it. */
#if defined(KIT_sampler)
#define TICK(m) kit_event(m)
#else
#define TICK(m) ((void)(m))
#endif

#define ACCESS(name, kind, member, as_cell)                                                          \
  fmi3Status fmi3Get##name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##name value[], \
                           size_t n_values) {                                                        \
    size_t at = 0;                                                                                   \
    of(c)->v[KIT_TIME].real = of(c)->time;                                                           \
    if (of(c)->initialising) kit_outputs(of(c));                                                     \
    TICK(of(c));                                                                                     \
    for (size_t i = 0; i < n; i++) {                                                                 \
      const kit_variable *x = kit_find(vr[i], kind);                                                 \
      if (!x || at + kit_size(of(c), x) > n_values) return fmi3Error;                                \
      const kit_cell *cell = &of(c)->v[x->first];                                                    \
      for (size_t k = 0; k < kit_size(of(c), x); k++) value[at++] = (fmi3##name)cell[k].member;      \
    }                                                                                                \
    return at == n_values ? fmi3OK : fmi3Error;                                                      \
  }                                                                                                  \
  fmi3Status fmi3Set##name(fmi3Instance c, const fmi3ValueReference vr[], size_t n,                  \
                           const fmi3##name value[], size_t n_values) {                              \
    size_t at = 0;                                                                                   \
    for (size_t i = 0; i < n; i++) {                                                                 \
      const kit_variable *x = kit_find(vr[i], kind);                                                 \
      if (!x || at + kit_size(of(c), x) > n_values) return fmi3Error;                                \
      kit_cell *cell = &of(c)->v[x->first];                                                          \
      for (size_t k = 0; k < kit_size(of(c), x); k++) cell[k].member = (as_cell)value[at++];         \
    }                                                                                                \
    return at == n_values ? fmi3OK : fmi3Error;                                                      \
  }
#define WHOLE(name, kind) ACCESS(name, kind, whole, int64_t)
#define NATURAL(name, kind) ACCESS(name, kind, natural, uint64_t)
ACCESS(Float64, FLOAT64, real, double)
ACCESS(Float32, FLOAT32, real, double)
WHOLE(Int8, INT8)
WHOLE(Int16, INT16)
WHOLE(Int32, INT32)
WHOLE(Int64, INT64)
NATURAL(UInt8, UINT8)
NATURAL(UInt16, UINT16)
NATURAL(UInt32, UINT32)
NATURAL(UInt64, UINT64)
WHOLE(Boolean, BOOLEAN)

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String value[], size_t m) {
  if (of(c)->initialising) kit_outputs(of(c));
  for (size_t i = 0; i < n && i < m; i++) {
    const kit_variable *x = kit_find(vr[i], STRING);
    if (!x) return fmi3Error;
    value[i] = of(c)->text[x->first].data;
  }
  return n == m ? fmi3OK : fmi3Error;
}
static bool keep(kit_text *text, const void *data, size_t size) {
  if (size >= KIT_TEXT) return false;
  memcpy(text->data, data, size);
  text->data[size] = 0;
  text->size = size;
  return true;
}
fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String value[],
                         size_t m) {
  for (size_t i = 0; i < n && i < m; i++) {
    const kit_variable *x = kit_find(vr[i], STRING);
    if (!x || !keep(&of(c)->text[x->first], value[i], strlen(value[i]))) return fmi3Error;
  }
  return n == m ? fmi3OK : fmi3Error;
}
fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                         fmi3Binary value[], size_t m) {
  if (of(c)->initialising) kit_outputs(of(c));
  for (size_t i = 0; i < n && i < m; i++) {
    const kit_variable *x = kit_find(vr[i], BINARY);
    if (!x) return fmi3Error;
    value[i] = (fmi3Binary)of(c)->text[x->first].data;
    sizes[i] = of(c)->text[x->first].size;
  }
  return n == m ? fmi3OK : fmi3Error;
}
fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) {
    const kit_variable *x = kit_find(vr[i], BINARY);
    if (!x || !keep(&of(c)->text[x->first], value[i], sizes[i])) return fmi3Error;
  }
  return n == m ? fmi3OK : fmi3Error;
}
fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock value[]) {
  for (size_t i = 0; i < n; i++) {
    const kit_variable *x = kit_find(vr[i], CLOCK);
    if (!x) return fmi3Error;
    value[i] = of(c)->v[x->first].whole != 0;
  }
  return fmi3OK;
}
fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock value[]) {
  for (size_t i = 0; i < n; i++) {
    const kit_variable *x = kit_find(vr[i], CLOCK);
    if (!x) return fmi3Error;
    of(c)->v[x->first].whole = value[i];
  }
  return fmi3OK;
}

/* A clock that ticks every 0.2 s, told anew after each tick and after nothing else. */
fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
  for (size_t i = 0; i < n; i++) {
    if (!kit_find(vr[i], CLOCK)) return fmi3Error;
    intervals[i] = 0.2;
    qualifiers[i] = of(c)->told == of(c)->count + 1 ? fmi3IntervalUnchanged : fmi3IntervalChanged;
    of(c)->told = of(c)->count + 1;
  }
  return fmi3OK;
}

/* ---- stepping ---- */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_set_state, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
  kit_result result = {t, false, false, false};
  (void)no_set_state;
  const kit_status status = kit_step(of(c), t, h, &result);
  *event = result.event, *terminate = result.terminate, *early = result.early, *reached = result.reached;
  return (fmi3Status)status;
}

/* ---- state: the instance is flat, so a copy of it is one ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(kit_instance));
  if (!*state) return fmi3Error;
  memcpy(*state, c, sizeof(kit_instance));
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  memcpy(c, state, sizeof(kit_instance));
  return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return fmi3OK;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(kit_instance);
  return fmi3OK;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  (void)c;
  if (size < sizeof(kit_instance)) return fmi3Error;
  memcpy(bytes, state, sizeof(kit_instance));
  return fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  if (size != sizeof(kit_instance) || fmi3GetFMUState(c, state) != fmi3OK) return fmi3Error;
  memcpy(*state, bytes, size);
  return fmi3OK;
}
