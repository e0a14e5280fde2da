/* An FMI 2.0 FMU that takes every value reference and gives numbers that follow from it, so that whatever a
 * mutated description says can be run. Value references from 0xF000 on fail in turn with each status. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi2Functions.h"

typedef struct {
  double time;
} Sponge;

static fmi2Status status(const fmi2ValueReference vr[], size_t n) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= 0xF000 && vr[i] < 0xF005) return (fmi2Status)(vr[i] - 0xF000);
  }
  return fmi2OK;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi2OK;
}
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  (void)type, (void)resources, (void)visible, (void)logging;
  callbacks->logger(callbacks->componentEnvironment, name, fmi2OK, "", "%s is here", guid);
  return calloc(1, sizeof(Sponge));
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) {
  (void)a, (void)b, (void)d, (void)e;
  ((Sponge *)c)->time = start;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Reset(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

#define BOTH(Name, Type, expression)                                                                        \
  fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const Type value[]) {  \
    (void)c, (void)value;                                                                                   \
    return status(vr, n);                                                                                   \
  }                                                                                                         \
  fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, Type value[]) {        \
    (void)c;                                                                                                \
    for (size_t i = 0; i < n; i++) value[i] = expression;                                                   \
    return status(vr, n);                                                                                   \
  }
BOTH(Real, fmi2Real, 0.5 * (double)vr[i] + ((Sponge *)c)->time)
BOTH(Integer, fmi2Integer, (int)(vr[i] % 4))
BOTH(Boolean, fmi2Boolean, (int)(vr[i] % 2))
BOTH(String, fmi2String, "\xc3\xa4 word")

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean keep) {
  (void)keep;
  ((Sponge *)c)->time = time + h;
  return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(Sponge));
  memcpy(*state, c, sizeof(Sponge));
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  memcpy(c, state, sizeof(Sponge));
  return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return fmi2OK;
}
