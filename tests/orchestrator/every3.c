/* An FMI 3.0 FMU with variables of every type, arrays and clocks, for tests of the binding; see every.h. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "every.h"
#include "fmi/fmi3Functions.h"

#ifndef VERSION
#define VERSION "3.0"
#endif

typedef enum { INSTANTIATED, CONFIGURATION, INITIALISATION, EVENT_MODE, STEP_MODE } Mode;

typedef struct {
  _Alignas(8) unsigned char number[15][N_ROLES][MOST * 8]; /* of each type its own form */
  char string[N_ROLES][MOST][TEXT];
  unsigned char binary[N_ROLES][MOST][TEXT];
  size_t binary_size[N_ROLES][MOST];
  bool clock[2];
  uint64_t size;
  int trick, events, ticks, updates;
} Values;

typedef struct {
  Values values;
  Mode mode;
  bool event_mode, early, fatal;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
  char shown[MOST][TEXT]; /* strings and binaries given away, valid until the next call */
} Every;

static fmi3Status say(const Every *e, const char *text) {
  e->log(e->environment, fmi3Error, "test", text);
  return fmi3Error;
}

static Every *at(fmi3Instance c) {
  Every *e = (Every *)c;
  if (e->fatal) every_after_fatal++;
  memset(e->shown, 'x', sizeof e->shown);
  return e;
}

static fmi3Status to(fmi3Instance c, Mode from, Mode mode, const char *message) {
  Every *e = at(c);
  if (e->mode != from) return say(e, message);
  e->mode = mode;
  return fmi3OK;
}

#ifndef NO_VERSION
const char *fmi3GetVersion(void) { return VERSION; }
#endif

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)resources, (void)visible, (void)logging, (void)intermediate, (void)n_intermediate;
  (void)update;
  if (strcmp(token, "every") != 0) {
#ifndef MUTE
    log(environment, fmi3Error, "", "wrong token");
#endif
    return NULL;
  }
  Every *e = calloc(1, sizeof *e);
  e->environment = environment, e->log = log, e->event_mode = event_mode, e->early = early_return;
  e->values.size = 3;
  every_live++;
  return e;
}
void fmi3FreeInstance(fmi3Instance c) {
  every_live--;
  free(at(c));
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
  return to(c, INSTANTIATED, CONFIGURATION, "not instantiated just now");
}
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
  return to(c, CONFIGURATION, INSTANTIATED, "not in configuration mode");
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean with_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean with_stop, fmi3Float64 stop) {
  (void)with_tolerance, (void)tolerance, (void)start, (void)with_stop, (void)stop;
  return to(c, INSTANTIATED, INITIALISATION, "not instantiated just now");
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  const Mode next = ((Every *)c)->event_mode ? EVENT_MODE : STEP_MODE;
  return to(c, INITIALISATION, next, "not in initialisation mode");
}
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return to(c, STEP_MODE, EVENT_MODE, "not in step mode"); }
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return to(c, EVENT_MODE, STEP_MODE, "not in event mode"); }
fmi3Status fmi3Terminate(fmi3Instance c) { return at(c) ? fmi3OK : fmi3Error; }
fmi3Status fmi3Reset(fmi3Instance c) {
  Every *e = at(c);
  memset(&e->values, 0, sizeof e->values);
  e->values.size = 3, e->mode = INSTANTIATED;
  return fmi3OK;
}

/* Two iterations for each event; the second one ends it and names the next. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *next_defined,
                                    fmi3Float64 *next) {
  Every *e = at(c);
  Values *v = &e->values;
  if (e->mode != EVENT_MODE) return say(e, "not in event mode");
  v->ticks += v->clock[IN], v->clock[OUT] = v->clock[IN], v->clock[IN] = false;
  *more = ++v->updates % 2 == 1;
  *terminate = *nominals = *values = false;
  *next_defined = !*more;
  *next = 12.5;
  if (!*more) v->events++;
  return fmi3OK;
}

/* ---- values ---- */

/* Role and number of elements of a variable of type `type`; 0 elements: there is none. */
static size_t find(const Every *e, fmi3ValueReference vr, unsigned type, unsigned *role) {
  *role = vr - 10 * type - 1;
  return *role >= N_ROLES ? 0 : *role < ARRAY_IN ? 1 : (size_t)e->values.size;
}

static fmi3Status unknown(const Every *e, fmi3ValueReference vr) {
  char text[40];
  snprintf(text, sizeof text, "no variable %u", vr);
  return say(e, text);
}

static fmi3Status got(const Every *e) {
  return e->values.trick == FAIL_GET ? fmi3Error : e->values.trick == WARN_GET ? fmi3Warning : fmi3OK;
}

/* Calls `move` for every variable, with its `role`, size `n` and the place `to` of its first value. */
#define EACH(type, move)                                                         \
  size_t place = 0;                                                              \
  for (size_t i = 0; i < n_vr; i++) {                                            \
    unsigned role;                                                               \
    const size_t n = find(e, vr[i], type, &role);                                \
    if (!n) return unknown(e, vr[i]);                                            \
    if (place + n > n_values) return say(e, "too few values");                   \
    move;                                                                        \
    place += n;                                                                  \
  }                                                                              \
  if (place != n_values) return say(e, "too many values")

static fmi3Status copy_in(Every *e, unsigned type, const fmi3ValueReference vr[], size_t n_vr,
                          const void *values, size_t n_values, size_t width) {
  EACH(type, memcpy(e->values.number[type][role], (const char *)values + place * width, n * width));
  return fmi3OK;
}
static fmi3Status copy_out(const Every *e, unsigned type, const fmi3ValueReference vr[], size_t n_vr,
                           void *values, size_t n_values, size_t width) {
  EACH(type, memcpy((char *)values + place * width, e->values.number[type][role], n * width));
  return got(e);
}

#define NUMBER(Name, type)                                                                                  \
  fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr,                      \
                           const fmi3##Name values[], size_t n_values) {                                    \
    return copy_in(at(c), type, vr, n_vr, values, n_values, sizeof *values);                                \
  }                                                                                                         \
  fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, fmi3##Name values[], \
                           size_t n_values) {                                                               \
    return copy_out(at(c), type, vr, n_vr, values, n_values, sizeof *values);                               \
  }
NUMBER(Float64, 0)
NUMBER(Float32, 1)
NUMBER(Int8, 2)
NUMBER(UInt8, 3)
NUMBER(Int16, 4)
NUMBER(UInt16, 5)
NUMBER(UInt32, 7)
NUMBER(Boolean, 10)

/* Trick and counters are of this type. */
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, const fmi3Int32 values[],
                        size_t n_values) {
  Every *e = at(c);
  if (n_vr == 1 && vr[0] == TRICK) return e->values.trick = values[0], fmi3OK;
  return copy_in(e, 6, vr, n_vr, values, n_values, sizeof *values);
}
fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, fmi3Int32 values[],
                        size_t n_values) {
  Every *e = at(c);
  if (n_vr == 1 && vr[0] == EVENTS) return values[0] = e->values.events, fmi3OK;
  if (n_vr == 1 && vr[0] == TICKS) return values[0] = e->values.ticks, fmi3OK;
  return copy_out(e, 6, vr, n_vr, values, n_values, sizeof *values);
}
/* An enumeration is of the same type in the C interface. */
fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, const fmi3Int64 values[],
                        size_t n_values) {
  size_t place = 0;
  for (size_t i = 0; i < n_vr; i++) {
    const unsigned type = vr[i] > 140 ? 14 : 8;
    unsigned role;
    const size_t n = find(at(c), vr[i], type, &role);
    if (place + n > n_values) return say(at(c), "too few values");
    if (copy_in(at(c), type, &vr[i], 1, values + place, n, sizeof *values) != fmi3OK) return fmi3Error;
    place += n;
  }
  return fmi3OK;
}
fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, fmi3Int64 values[],
                        size_t n_values) {
  size_t place = 0;
  for (size_t i = 0; i < n_vr; i++) {
    const unsigned type = vr[i] > 140 ? 14 : 8;
    unsigned role;
    const size_t n = find(at(c), vr[i], type, &role);
    if (place + n > n_values) return say(at(c), "too few values");
    if (copy_out(at(c), type, &vr[i], 1, values + place, n, sizeof *values) > fmi3Warning) return fmi3Error;
    place += n;
  }
  return got(at(c));
}
/* The size of the arrays is of this type. */
fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr,
                         const fmi3UInt64 values[], size_t n_values) {
  Every *e = at(c);
  if (n_vr != 1 || vr[0] != SIZE) return copy_in(e, 9, vr, n_vr, values, n_values, sizeof *values);
  if (e->mode != CONFIGURATION || values[0] > MOST) return say(e, "size: not now, or too large");
  e->values.size = values[0];
  return fmi3OK;
}
fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, fmi3UInt64 values[],
                         size_t n_values) {
  Every *e = at(c);
  if (n_vr == 1 && vr[0] == SIZE) return values[0] = e->values.size, fmi3OK;
  return copy_out(e, 9, vr, n_vr, values, n_values, sizeof *values);
}

#ifndef NO_STRINGS
fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr,
                         const fmi3String values[], size_t n_values) {
  Every *e = at(c);
  EACH(11, for (size_t k = 0; k < n; k++)
               snprintf(e->values.string[role][k], TEXT, "%s", values[place + k]));
  return fmi3OK;
}
fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, fmi3String values[],
                         size_t n_values) {
  Every *e = at(c);
  if (n_values > MOST) return say(e, "too many at once");
  EACH(11, for (size_t k = 0; k < n; k++) values[place + k] =
               memcpy(e->shown[place + k], e->values.string[role][k], TEXT));
  return got(e);
}
#endif

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, const size_t sizes[],
                         const fmi3Binary values[], size_t n_values) {
  Every *e = at(c);
  for (size_t i = 0; i < n_values; i++)
    if (sizes[i] > TEXT) return say(e, "binary too long");
  EACH(12, for (size_t k = 0; k < n; k++) {
    memcpy(e->values.binary[role][k], values[place + k], sizes[place + k]);
    e->values.binary_size[role][k] = sizes[place + k];
  });
  return fmi3OK;
}
fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, size_t sizes[],
                         fmi3Binary values[], size_t n_values) {
  Every *e = at(c);
  if (n_values > MOST) return say(e, "too many at once");
  EACH(12, for (size_t k = 0; k < n; k++) {
    const size_t size = e->values.binary_size[role][k];
    sizes[place + k] = size;
    values[place + k] = size ? memcpy(e->shown[place + k], e->values.binary[role][k], size) : NULL;
  });
  return got(e);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr,
                        const fmi3Clock values[]) {
  Every *e = at(c);
  if (n_vr != 1 || vr[0] != 131) return unknown(e, vr[0]);
  if (e->mode != EVENT_MODE) return say(e, "clocks tick in event mode");
  e->values.clock[IN] = values[0];
  return fmi3OK;
}
fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n_vr, fmi3Clock values[]) {
  Every *e = at(c);
  for (size_t i = 0; i < n_vr; i++) values[i] = e->values.clock[(vr[i] - 131) & 1];
  return fmi3OK;
}

/* ---- states ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(Values));
  memcpy(*state, &at(c)->values, sizeof(Values));
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  memcpy(&at(c)->values, state, sizeof(Values));
  return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  free(*state);
  *state = NULL;
  return at(c) ? fmi3OK : fmi3Error;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)state;
  *size = sizeof(Values);
  return at(c) ? fmi3OK : fmi3Error;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  if (size < sizeof(Values)) return say(at(c), "too few bytes");
  memcpy(bytes, state, sizeof(Values));
  return fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  if (size != sizeof(Values)) return say(at(c), "no state of mine");
  if (!*state) *state = malloc(sizeof(Values));
  memcpy(*state, bytes, size);
  return fmi3OK;
}

/* Of float64.out = float64.in and, element by element, of the arrays. */
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n,
                                        const fmi3ValueReference knowns[], size_t m, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 result[], size_t n_result) {
  const Every *e = at(c);
  const size_t size = unknowns[0] > 2 ? (size_t)e->values.size : 1;
  if (n != 1 || m != 1 || unknowns[0] != knowns[0] + 1 || n_seed != size || n_result != size)
    return say(e, "only of an output by its input");
  memcpy(result, seed, size * sizeof *seed);
  return fmi3OK;
}

/* ---- steps ---- */

static void copy(Values *v) {
  for (int role = IN; role <= ARRAY_IN; role += 2) {
    for (int type = 0; type < 15; type++)
      memcpy(v->number[type][role + 1], v->number[type][role], sizeof v->number[type][role]);
    memcpy(v->string[role + 1], v->string[role], sizeof v->string[role]);
    memcpy(v->binary[role + 1], v->binary[role], sizeof v->binary[role]);
    memcpy(v->binary_size[role + 1], v->binary_size[role], sizeof v->binary_size[role]);
  }
}

static fmi3Status failing(Every *e) {
  static char text[5001];
  switch (e->values.trick) {
    case LONG: memset(text, 'm', 5000); return say(e, text);
    case MANY:
      for (int i = 0; i < 30; i++) snprintf(text, sizeof text, "number %d", i), say(e, text);
      return fmi3Error;
    case UGLY: return say(e, "one\ntwo\r\n\x1b[31mthree");
    case UNKNOWN: return (fmi3Status)17;
    default: break;
  }
  say(e, "as you wish");
  e->fatal = e->values.trick == FATAL;
  return (fmi3Status)e->values.trick;
}

#ifndef NO_DOSTEP
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean no_set_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  Every *e = at(c);
  const int trick = e->values.trick;
  (void)no_set_state;
  if (e->mode != STEP_MODE) return say(e, "not in step mode");
  copy(&e->values);
  *event = trick == EVENT && e->event_mode;
  *terminate = trick == END;
  *early = trick == EARLY && e->early;
  *last = *early ? time + h / 2.0 : trick == (int)fmi3Discard ? time + h / 4.0 : time + h;
  return trick == 0 || (trick >= EARLY && trick <= END) || trick >= WARN_GET ? fmi3OK : failing(e);
}
#endif
