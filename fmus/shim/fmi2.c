/* FMI 2.0 co-simulation over core.h: types, statuses and the log; no equation and no arithmetic here. */
#include "fmi/fmi2Functions.h"

#include <stdlib.h>
#include <string.h>

#include "core.h"

typedef struct {
  SlwCore core;
  fmi2CallbackFunctions callbacks;
  char name[128];
} Instance;

static Instance *cast(fmi2Component c) { return (Instance *)c; }

static fmi2Status fail(Instance *i) {
  if (i->callbacks.logger)
    i->callbacks.logger(i->callbacks.componentEnvironment, i->name, fmi2Error, "logStatusError", "%s",
                        i->core.message);
  return fmi2Error;
}

static fmi2Status fail_with(Instance *i, const char *message) {
  strncpy(i->core.message, message, sizeof i->core.message - 1);
  return fail(i);
}

static fmi2Status unsupported(fmi2Component c, const char *what) {
  return c ? fail_with(cast(c), what) : fmi2Error;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi2OK;
}

/* ---- life cycle ---- */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
  Instance *i;
  (void)resources, (void)visible, (void)logging;
  if (!functions || !name || !guid) return NULL;
  i = (Instance *)calloc(1, sizeof *i);
  if (!i) return NULL;
  i->callbacks = *functions;
  strncpy(i->name, name, sizeof i->name - 1);
  slw_reset(&i->core);
  if (type != fmi2CoSimulation || strcmp(guid, SLW_TOKEN) != 0) {
    fail_with(i, type != fmi2CoSimulation ? "only co-simulation is supported"
                                          : "the GUID is not that of this FMU's modelDescription.xml");
    free(i);
    return NULL;
  }
  return i;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  cast(c)->core.s.start_time = start;
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  if (cast(c)->core.phase != SLW_INSTANTIATED) return fail_with(cast(c), "initialisation mode: already initialised");
  cast(c)->core.phase = SLW_INITIALISING;
  return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  if (cast(c)->core.phase != SLW_INITIALISING) return fail_with(cast(c), "not in initialisation mode");
  if (cast(c)->core.stale) slw_initialise(&cast(c)->core);
  cast(c)->core.phase = SLW_STEPPING;
  return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
  cast(c)->core.phase = SLW_TERMINATED;
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
  slw_reset(&cast(c)->core);
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state_before) {
  Instance *i = cast(c);
  (void)time, (void)no_set_state_before; /* time is an integer count inside */
  if (i->core.phase != SLW_STEPPING) return fail_with(i, "fmi2DoStep outside step mode");
  if (slw_step(&i->core, step) == 0) return fmi2OK;
  i->core.phase = SLW_FAILED;
  return fail(i);
}

fmi2Status fmi2CancelStep(fmi2Component c) { return unsupported(c, "fmi2CancelStep: steps are synchronous"); }

/* ---- variables ---- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  for (size_t k = 0; k < n; k++)
    if (slw_get(&cast(c)->core, vr[k], &value[k])) return fail(cast(c));
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  for (size_t k = 0; k < n; k++)
    if (slw_set(&cast(c)->core, vr[k], value[k])) return fail(cast(c));
  return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
  int64_t seed;
  for (size_t k = 0; k < n; k++) {
    if (slw_get_seed(&cast(c)->core, vr[k], &seed)) return fail_with(cast(c), "not an Integer variable");
    value[k] = (fmi2Integer)seed;
  }
  return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
  for (size_t k = 0; k < n; k++)
    if (slw_set_seed(&cast(c)->core, vr[k], value[k])) return fail_with(cast(c), "not an Integer variable");
  return fmi2OK;
}

#define NO_VARIABLES(name, type, mutability)                                                              \
  fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t n, mutability type value[]) {    \
    (void)vr, (void)value;                                                                                \
    return n == 0 ? fmi2OK : unsupported(c, #name ": this FMU has no variable of that type");             \
  }
NO_VARIABLES(fmi2GetBoolean, fmi2Boolean, )
NO_VARIABLES(fmi2SetBoolean, fmi2Boolean, const)
NO_VARIABLES(fmi2GetString, fmi2String, )
NO_VARIABLES(fmi2SetString, fmi2String, const)

/* ---- state ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(SlwState));
  if (!*state) return fail_with(cast(c), "out of memory");
  if (cast(c)->core.stale && cast(c)->core.phase < SLW_STEPPING) slw_initialise(&cast(c)->core);
  memcpy(*state, &cast(c)->core.s, sizeof(SlwState));
  return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  if (!state) return fail_with(cast(c), "fmi2SetFMUstate: no state");
  memcpy(&cast(c)->core.s, state, sizeof(SlwState));
  cast(c)->core.stale = 0;
  if (cast(c)->core.phase == SLW_FAILED) cast(c)->core.phase = SLW_STEPPING;
  return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  (void)c;
  if (state) {
    free(*state);
    *state = NULL;
  }
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
  (void)c, (void)state;
  *size = slw_serialised_size();
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  if (size < slw_serialised_size()) return fail_with(cast(c), "fmi2SerializeFMUstate: buffer too small");
  slw_serialise((const SlwState *)state, (unsigned char *)bytes);
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(SlwState));
  if (!*state) return fail_with(cast(c), "out of memory");
  if (slw_deserialise((const unsigned char *)bytes, size, (SlwState *)*state))
    return fail_with(cast(c), "the serialised state is not of this model and version");
  return fmi2OK;
}

/* ---- derivatives, status ---- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real seed[],
                                        fmi2Real sensitivity[]) {
  return slw_directional(&cast(c)->core, unknown, n_unknown, known, n_known, seed, sensitivity) ? fail(cast(c))
                                                                                                : fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  (void)vr, (void)n, (void)order, (void)value;
  return unsupported(c, "inputs are held over a step: input derivatives are not supported");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
  (void)vr, (void)n, (void)order, (void)value;
  return unsupported(c, "output derivatives are not supported");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
  (void)kind, (void)value;
  return unsupported(c, "fmi2GetStatus: steps are synchronous");
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  if (kind != fmi2LastSuccessfulTime) return unsupported(c, "fmi2GetRealStatus: unknown kind");
  *value = cast(c)->core.s.start_time + (double)cast(c)->core.s.tick * SLW_STEP;
  return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
  (void)kind, (void)value;
  return unsupported(c, "fmi2GetIntegerStatus: steps are synchronous");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
  if (kind != fmi2Terminated) return unsupported(c, "fmi2GetBooleanStatus: unknown kind");
  *value = fmi2False;
  return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
  (void)kind, (void)value;
  return unsupported(c, "fmi2GetStringStatus: steps are synchronous");
}
