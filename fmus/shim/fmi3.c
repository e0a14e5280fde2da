/* FMI 3.0 co-simulation over core.h: types, statuses and the log; no equation and no arithmetic here. */
#include "fmi/fmi3Functions.h"

#include <stdlib.h>
#include <string.h>

#include "core.h"

typedef struct {
  SlwCore core;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} Instance;

static Instance *cast(fmi3Instance c) { return (Instance *)c; }

static fmi3Status fail(Instance *i) {
  if (i->log) i->log(i->environment, fmi3Error, "logStatusError", i->core.message);
  return fmi3Error;
}

static fmi3Status fail_with(Instance *i, const char *message) {
  strncpy(i->core.message, message, sizeof i->core.message - 1);
  return fail(i);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi3OK;
}

/* ---- life cycle ---- */

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  Instance *i;
  (void)resources, (void)visible, (void)logging, (void)early_return, (void)intermediate, (void)update;
  if (!name || !token) return NULL;
  i = (Instance *)calloc(1, sizeof *i);
  if (!i) return NULL;
  i->environment = environment;
  i->log = log;
  slw_reset(&i->core);
  if (event_mode || n_intermediate > 0 || strcmp(token, SLW_TOKEN) != 0) {
    fail_with(i, event_mode           ? "event mode is not supported"
                 : n_intermediate > 0 ? "intermediate variables are not supported"
                                      : "the token is not that of this FMU's modelDescription.xml");
    free(i);
    return NULL;
  }
  return i;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging;
  if (log) log(environment, fmi3Error, "logStatusError", "only co-simulation is supported");
  return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock, (void)lock, (void)unlock;
  if (log) log(environment, fmi3Error, "logStatusError", "only co-simulation is supported");
  return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  if (cast(c)->core.phase != SLW_INSTANTIATED) return fail_with(cast(c), "initialisation mode: already initialised");
  cast(c)->core.s.start_time = start;
  cast(c)->core.phase = SLW_INITIALISING;
  return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  if (cast(c)->core.phase != SLW_INITIALISING) return fail_with(cast(c), "not in initialisation mode");
  if (cast(c)->core.stale) slw_initialise(&cast(c)->core);
  cast(c)->core.phase = SLW_STEPPING;
  return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
  cast(c)->core.phase = SLW_TERMINATED;
  return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
  slw_reset(&cast(c)->core);
  return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state_before,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time) {
  Instance *i = cast(c);
  int failed;
  (void)time, (void)no_set_state_before; /* time is an integer count inside */
  if (event_needed) *event_needed = fmi3False;
  if (terminate) *terminate = fmi3False;
  if (early_return) *early_return = fmi3False;
  if (i->core.phase != SLW_STEPPING) return fail_with(i, "fmi3DoStep outside step mode");
  failed = slw_step(&i->core, step);
  if (last_time) *last_time = i->core.s.start_time + (double)i->core.s.tick * SLW_STEP;
  if (!failed) return fmi3OK;
  i->core.phase = SLW_FAILED;
  return fail(i);
}

/* ---- variables: Float64, and Int32 for the noise seed ---- */

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t nv) {
  if (nv != n) return fail_with(cast(c), "fmi3GetFloat64: all variables are scalar");
  for (size_t k = 0; k < n; k++)
    if (slw_get(&cast(c)->core, vr[k], &value[k])) return fail(cast(c));
  return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 value[],
                          size_t nv) {
  if (nv != n) return fail_with(cast(c), "fmi3SetFloat64: all variables are scalar");
  for (size_t k = 0; k < n; k++)
    if (slw_set(&cast(c)->core, vr[k], value[k])) return fail(cast(c));
  return fmi3OK;
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 value[], size_t nv) {
  int64_t seed;
  for (size_t k = 0; k < n && k < nv; k++) {
    if (slw_get_seed(&cast(c)->core, vr[k], &seed)) return fail_with(cast(c), "not an Int32 variable");
    value[k] = (fmi3Int32)seed;
  }
  return fmi3OK;
}

fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 value[], size_t nv) {
  for (size_t k = 0; k < n && k < nv; k++)
    if (slw_set_seed(&cast(c)->core, vr[k], value[k])) return fail_with(cast(c), "not an Int32 variable");
  return fmi3OK;
}

#define NO_VARIABLES(type)                                                                                  \
  fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##type value[],     \
                           size_t nv) {                                                                     \
    (void)vr, (void)value, (void)nv;                                                                        \
    return n == 0 ? fmi3OK : fail_with(cast(c), "this FMU has no variable of type " #type);                 \
  }                                                                                                         \
  fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n,                         \
                           const fmi3##type value[], size_t nv) {                                           \
    (void)vr, (void)value, (void)nv;                                                                        \
    return n == 0 ? fmi3OK : fail_with(cast(c), "this FMU has no variable of type " #type);                 \
  }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

/* ---- state ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(SlwState));
  if (!*state) return fail_with(cast(c), "out of memory");
  if (cast(c)->core.stale && cast(c)->core.phase < SLW_STEPPING) slw_initialise(&cast(c)->core);
  memcpy(*state, &cast(c)->core.s, sizeof(SlwState));
  return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  if (!state) return fail_with(cast(c), "fmi3SetFMUState: no state");
  memcpy(&cast(c)->core.s, state, sizeof(SlwState));
  cast(c)->core.stale = 0;
  if (cast(c)->core.phase == SLW_FAILED) cast(c)->core.phase = SLW_STEPPING;
  return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  if (state) {
    free(*state);
    *state = NULL;
  }
  return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)c, (void)state;
  *size = slw_serialised_size();
  return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  if (size < slw_serialised_size()) return fail_with(cast(c), "fmi3SerializeFMUState: buffer too small");
  slw_serialise((const SlwState *)state, bytes);
  return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(SlwState));
  if (!*state) return fail_with(cast(c), "out of memory");
  if (slw_deserialise(bytes, size, (SlwState *)*state))
    return fail_with(cast(c), "the serialised state is not of this model and version");
  return fmi3OK;
}

/* ---- derivatives ---- */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknown[], size_t n_unknown,
                                        const fmi3ValueReference known[], size_t n_known, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
  if (n_seed != n_known || n_sensitivity != n_unknown)
    return fail_with(cast(c), "fmi3GetDirectionalDerivative: all variables are scalar");
  return slw_directional(&cast(c)->core, unknown, n_unknown, known, n_known, seed, sensitivity) ? fail(cast(c))
                                                                                                : fmi3OK;
}

/* ---- what a co-simulation FMU of this kind does not offer ---- */

#define UNSUPPORTED(name, ...)                                                        \
  fmi3Status name(fmi3Instance c, __VA_ARGS__) {                                      \
    return c ? fail_with(cast(c), #name " is not supported") : fmi3Error;             \
  }
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
typedef const fmi3ValueReference Vr;
UNSUPPORTED(fmi3GetBinary, Vr vr[], size_t n, size_t sizes[], fmi3Binary v[], size_t nv)
UNSUPPORTED(fmi3SetBinary, Vr vr[], size_t n, const size_t sizes[], const fmi3Binary v[], size_t nv)
UNSUPPORTED(fmi3GetClock, Vr vr[], size_t n, fmi3Clock v[])
UNSUPPORTED(fmi3SetClock, Vr vr[], size_t n, const fmi3Clock v[])
UNSUPPORTED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference vr, size_t *n)
UNSUPPORTED(fmi3GetVariableDependencies, fmi3ValueReference vr, size_t e[], fmi3ValueReference in[], size_t ei[],
            fmi3DependencyKind kinds[], size_t n)
UNSUPPORTED(fmi3GetAdjointDerivative, Vr u[], size_t nu, Vr k[], size_t nk, const fmi3Float64 s[], size_t ns,
            fmi3Float64 r[], size_t nr)
UNSUPPORTED(fmi3GetIntervalDecimal, Vr vr[], size_t n, fmi3Float64 v[], fmi3IntervalQualifier q[])
UNSUPPORTED(fmi3GetIntervalFraction, Vr vr[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier q[])
UNSUPPORTED(fmi3GetShiftDecimal, Vr vr[], size_t n, fmi3Float64 v[])
UNSUPPORTED(fmi3GetShiftFraction, Vr vr[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[])
UNSUPPORTED(fmi3SetIntervalDecimal, Vr vr[], size_t n, const fmi3Float64 v[])
UNSUPPORTED(fmi3SetIntervalFraction, Vr vr[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
UNSUPPORTED(fmi3SetShiftDecimal, Vr vr[], size_t n, const fmi3Float64 v[])
UNSUPPORTED(fmi3SetShiftFraction, Vr vr[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
UNSUPPORTED(fmi3UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e, fmi3Boolean *f,
            fmi3Float64 *g)
UNSUPPORTED(fmi3CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *d)
UNSUPPORTED(fmi3SetTime, fmi3Float64 t)
UNSUPPORTED(fmi3SetContinuousStates, const fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetContinuousStateDerivatives, fmi3Float64 d[], size_t n)
UNSUPPORTED(fmi3GetEventIndicators, fmi3Float64 z[], size_t n)
UNSUPPORTED(fmi3GetContinuousStates, fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetNumberOfEventIndicators, size_t *n)
UNSUPPORTED(fmi3GetNumberOfContinuousStates, size_t *n)
UNSUPPORTED(fmi3GetOutputDerivatives, Vr vr[], size_t n, const fmi3Int32 o[], fmi3Float64 v[], size_t nv)
UNSUPPORTED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 t)
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#define UNSUPPORTED_MODE(name) \
  fmi3Status name(fmi3Instance c) { return c ? fail_with(cast(c), #name " is not supported") : fmi3Error; }
UNSUPPORTED_MODE(fmi3EnterEventMode)
UNSUPPORTED_MODE(fmi3EnterConfigurationMode)
UNSUPPORTED_MODE(fmi3ExitConfigurationMode)
UNSUPPORTED_MODE(fmi3EvaluateDiscreteStates)
UNSUPPORTED_MODE(fmi3EnterContinuousTimeMode)
UNSUPPORTED_MODE(fmi3EnterStepMode)
