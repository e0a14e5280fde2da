/* The FMI 2.0 shell of the kit. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi2Functions.h"
#include "kit.h"

#ifdef KIT_EXCHANGE
#define KIT_TYPE fmi2ModelExchange /* exchange2.c has the rest */
#else
#define KIT_TYPE fmi2CoSimulation
#endif

static kit_instance *of(fmi2Component c) { return (kit_instance *)c; }

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
  (void)name, (void)resources, (void)functions, (void)visible, (void)logging;
  if (type != KIT_TYPE || strncmp(guid, KIT_TOKEN, sizeof KIT_TOKEN - 1) != 0) return NULL;
  kit_instance *m = calloc(1, sizeof *m);
  if (m) fmi2Reset(m);
  return m;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2Reset(fmi2Component c) {
  memset(c, 0, sizeof(kit_instance));
  kit_defaults((kit_cell *)of(c)->v);
  for (int i = 0; i < KIT_TEXTS; i++) of(c)->text[i] = kit_texts[i];
  return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean with_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean with_stop, fmi2Real stop) {
  (void)with_tolerance, (void)tolerance, (void)with_stop, (void)stop;
  of(c)->time = start;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  of(c)->initialising = true;
  return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  kit_outputs(of(c));
  of(c)->initialising = false;
  return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

/* ---- values ---- */

#define ACCESS(name, c_type, kind, member, cast)                                                             \
  fmi2Status fmi2Get##name(fmi2Component c, const fmi2ValueReference vr[], size_t n, c_type value[]) {       \
    if (of(c)->initialising) kit_outputs(of(c));                                                             \
    for (size_t i = 0; i < n; i++) {                                                                         \
      const kit_variable *x = kit_find(vr[i], kind);                                                         \
      if (!x) return fmi2Error;                                                                              \
      value[i] = (c_type)of(c)->v[x->first].member;                                                          \
    }                                                                                                        \
    return fmi2OK;                                                                                           \
  }                                                                                                          \
  fmi2Status fmi2Set##name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const c_type value[]) { \
    for (size_t i = 0; i < n; i++) {                                                                         \
      const kit_variable *x = kit_find(vr[i], kind);                                                         \
      if (!x) return fmi2Error;                                                                              \
      of(c)->v[x->first].member = cast value[i];                                                             \
    }                                                                                                        \
    return fmi2OK;                                                                                           \
  }
ACCESS(Real, fmi2Real, FLOAT64, real, )
ACCESS(Integer, fmi2Integer, INT32, whole, )
ACCESS(Boolean, fmi2Boolean, BOOLEAN, whole, !!)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
  if (of(c)->initialising) kit_outputs(of(c));
  for (size_t i = 0; i < n; i++) {
    const kit_variable *x = kit_find(vr[i], STRING);
    if (!x) return fmi2Error;
    value[i] = of(c)->text[x->first].data;
  }
  return fmi2OK;
}
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
  for (size_t i = 0; i < n; i++) {
    const kit_variable *x = kit_find(vr[i], STRING);
    if (!x || strlen(value[i]) >= KIT_TEXT) return fmi2Error;
    of(c)->text[x->first].size = strlen(value[i]);
    memcpy(of(c)->text[x->first].data, value[i], strlen(value[i]) + 1);
  }
  return fmi2OK;
}

/* ---- stepping ---- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_set_state) {
  kit_result result = {t, false, false, false};
  (void)no_set_state;
  const kit_status status = kit_step(of(c), t, h, &result);
  return result.terminate ? fmi2Discard : (fmi2Status)status; /* FMI 2 ends a simulation by discarding */
}
fmi2Status fmi2CancelStep(fmi2Component c) { return c ? fmi2Error : fmi2Fatal; }

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = of(c)->time;
  return fmi2OK;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
  if (kind != fmi2Terminated) return fmi2Discard;
  *value = of(c)->terminated;
  return fmi2OK;
}
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}

/* ---- state: the instance is flat, so a copy of it is one ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(kit_instance));
  if (!*state) return fmi2Error;
  memcpy(*state, c, sizeof(kit_instance));
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  memcpy(c, state, sizeof(kit_instance));
  return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(kit_instance);
  return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  (void)c;
  if (size < sizeof(kit_instance)) return fmi2Error;
  memcpy(bytes, state, sizeof(kit_instance));
  return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
  if (size != sizeof(kit_instance) || fmi2GetFMUstate(c, state) != fmi2OK) return fmi2Error;
  memcpy(*state, bytes, size);
  return fmi2OK;
}

/* ---- what no FMU of the kit offers, but some importers insist on finding ---- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n,
                                        const fmi2ValueReference knowns[], size_t m, const fmi2Real seed[],
                                        fmi2Real result[]) {
  (void)c, (void)unknowns, (void)n, (void)knowns, (void)m, (void)seed, (void)result;
  return fmi2Error;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  (void)c, (void)vr, (void)n, (void)order, (void)value;
  return fmi2Error;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
  (void)c, (void)vr, (void)n, (void)order, (void)value;
  return fmi2Error;
}
