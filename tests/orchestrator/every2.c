/* An FMI 2.0 FMU with variables of every type, for tests of the binding; see every.h. */
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "every.h"
#include "fmi/fmi2Functions.h"

#ifndef VERSION
#define VERSION "2.0"
#endif
#ifndef PLATFORM
#define PLATFORM "default"
#endif

typedef struct {
  double real[2];
  int integer[2], boolean[2];
  char string[2][TEXT];
  int trick;
  double reached;
  bool ended;
} Values;

typedef struct {
  Values values;
  bool initialising, fatal;
  const fmi2CallbackFunctions *callbacks;
  char shown[2][TEXT]; /* strings given away, valid until the next call */
} Every;

static void say(const Every *e, const char *text) {
  e->callbacks->logger(e->callbacks->componentEnvironment, "every", fmi2Error, "test", "%s (%d)", text, 42);
}

static Every *at(fmi2Component c) {
  Every *e = (Every *)c;
  if (e->fatal) every_after_fatal++;
  memset(e->shown, 'x', sizeof e->shown);
  return e;
}

#ifndef NO_VERSION
const char *fmi2GetTypesPlatform(void) { return PLATFORM; }
const char *fmi2GetVersion(void) { return VERSION; }
#endif

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
  (void)name, (void)visible, (void)logging;
  if (strcmp(guid, "every") != 0 || type != fmi2CoSimulation || strncmp(resources, "file:", 5) != 0) {
#ifndef MUTE
    callbacks->logger(callbacks->componentEnvironment, name, fmi2Error, "", "wrong\ttoken\n'%s'", guid);
#endif
    return NULL;
  }
  Every *e = (Every *)callbacks->allocateMemory(1, sizeof *e);
  e->callbacks = callbacks;
  every_live++;
  return e;
}
void fmi2FreeInstance(fmi2Component c) {
  every_live--;
  at(c)->callbacks->freeMemory(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean with_tolerance, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean with_stop, fmi2Real stop) {
  (void)with_tolerance, (void)tolerance, (void)start, (void)with_stop, (void)stop;
  return at(c)->values.trick == WARN_SETUP ? fmi2Warning : fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  at(c)->initialising = true;
  return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  Every *e = at(c);
  if (!e->initialising) say(e, "not in initialisation mode");
  return e->initialising ? (e->initialising = false, fmi2OK) : fmi2Error;
}
fmi2Status fmi2Terminate(fmi2Component c) { return at(c) ? fmi2OK : fmi2Error; }
fmi2Status fmi2Reset(fmi2Component c) {
  memset(&at(c)->values, 0, sizeof(Values));
  return fmi2OK;
}

/* ---- values ---- */

static fmi2Status unknown(const Every *e, unsigned vr) {
  char text[40];
  snprintf(text, sizeof text, "no variable %u", vr);
  say(e, text);
  return fmi2Error;
}

#define SET(Name, T, type, store)                                                                           \
  fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const T value[]) {     \
    Every *e = at(c);                                                                                       \
    for (size_t i = 0; i < n; i++) {                                                                        \
      if (vr[i] == TRICK && type == 6) e->values.trick = *(const int *)(const void *)&value[i];             \
      else if (vr[i] == 10 * type + 1) store;                                                               \
      else return unknown(e, vr[i]);                                                                        \
    }                                                                                                       \
    return fmi2OK;                                                                                          \
  }
#define GET(Name, T, type, expression)                                                                      \
  fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, T value[]) {           \
    Every *e = at(c);                                                                                       \
    for (size_t i = 0; i < n; i++) {                                                                        \
      const unsigned k = vr[i] - 10 * type - 1;                                                             \
      if (k > 1) return unknown(e, vr[i]);                                                                  \
      value[i] = expression;                                                                                \
    }                                                                                                       \
    return e->values.trick == FAIL_GET ? fmi2Error : e->values.trick == WARN_GET ? fmi2Warning : fmi2OK;    \
  }

SET(Real, fmi2Real, 0, e->values.real[IN] = value[i])
GET(Real, fmi2Real, 0, e->values.real[k])
SET(Integer, fmi2Integer, 6, e->values.integer[IN] = value[i])
GET(Integer, fmi2Integer, 6, e->values.integer[k])
SET(Boolean, fmi2Boolean, 10, e->values.boolean[IN] = value[i])
GET(Boolean, fmi2Boolean, 10, e->values.boolean[k] ? 7 : 0) /* true is what is not 0 */
#ifndef NO_STRINGS
SET(String, fmi2String, 11, snprintf(e->values.string[IN], TEXT, "%s", value[i]))
GET(String, fmi2String, 11, memcpy(e->shown[k], e->values.string[k], TEXT))
#endif

/* ---- states ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  Every *e = at(c);
  if (!*state) *state = e->callbacks->allocateMemory(1, sizeof(Values));
  memcpy(*state, &e->values, sizeof(Values));
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  memcpy(&at(c)->values, state, sizeof(Values));
  return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  at(c)->callbacks->freeMemory(*state);
  *state = NULL;
  return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(Values);
  return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  if (!at(c) || size < sizeof(Values)) return fmi2Error;
  memcpy(bytes, state, sizeof(Values));
  return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *state) {
  Every *e = at(c);
  if (size != sizeof(Values)) {
    say(e, "no state of mine");
    return fmi2Error;
  }
  if (!*state) *state = e->callbacks->allocateMemory(1, sizeof(Values));
  memcpy(*state, bytes, size);
  return fmi2OK;
}

/* Of real.out = real.in. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n,
                                        const fmi2ValueReference knowns[], size_t m, const fmi2Real seed[],
                                        fmi2Real result[]) {
  for (size_t i = 0; i < n; i++) {
    result[i] = 0.0;
    for (size_t k = 0; k < m; k++) result[i] += unknowns[i] == 2 && knowns[k] == 1 ? seed[k] : 0.0;
  }
  return at(c) ? fmi2OK : fmi2Error;
}

/* ---- steps ---- */

static fmi2Status trick(Every *e) {
  static char text[5001];
  switch (e->values.trick) {
    case EARLY: case EVENT: case WARN_GET: case FAIL_GET: case WARN_SETUP: return fmi2OK;
    case END: e->values.ended = true; return fmi2Discard;
    case LONG: memset(text, 'm', 5000), say(e, text); return fmi2Error;
    case MANY:
      for (int i = 0; i < 30; i++) snprintf(text, sizeof text, "number %d", i), say(e, text);
      return fmi2Error;
    case UGLY: say(e, "one\ntwo\r\n\x1b[31mthree"); return fmi2Error;
    case UNKNOWN: return (fmi2Status)17;
    default: break;
  }
  if (e->values.trick) say(e, "as you wish");
  e->fatal = e->values.trick == FATAL || e->values.trick == PENDING;
  return (fmi2Status)e->values.trick;
}

#ifndef NO_DOSTEP
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_set_state) {
  Every *e = at(c);
  Values *v = &e->values;
  (void)no_set_state;
  v->reached = time + h / 4.0;
  v->real[OUT] = v->real[IN], v->integer[OUT] = v->integer[IN], v->boolean[OUT] = v->boolean[IN];
  memcpy(v->string[OUT], v->string[IN], TEXT);
  return trick(e);
}
#endif
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  *value = at(c)->values.reached;
  return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
  *value = at(c)->values.ended;
  return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}
