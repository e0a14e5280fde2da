/* FMI 3.0 in this process, co-simulation and model exchange. Source of the interface: FMI 3.0.2, chapters 2.2 and 4. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "binding.h"
#include "fmi/fmi3FunctionTypes.h"
#include "me.h"
#include "scheduled.h"

/* The standard demands more than REQUIRED; what a run does not need may be missing. */
#define REQUIRED(X) X(FreeInstance) X(EnterInitializationMode) X(ExitInitializationMode)
#define STEPPING(X) X(InstantiateCoSimulation) X(DoStep)
#define EXCHANGE(X)                                                                               \
  X(InstantiateModelExchange) X(EnterContinuousTimeMode) X(SetTime) X(CompletedIntegratorStep)    \
  X(GetContinuousStates) X(SetContinuousStates) X(GetContinuousStateDerivatives)                  \
  X(GetEventIndicators) X(GetNominalsOfContinuousStates)
#define SCHEDULED(X) X(InstantiateScheduledExecution) X(ActivateModelPartition)
#define OPTIONAL(X)                                                                               \
  X(SetDebugLogging) X(Terminate) X(Reset) X(EnterConfigurationMode) X(ExitConfigurationMode) X(EnterEventMode)      \
  X(UpdateDiscreteStates) X(EnterStepMode) X(GetFMUState) X(SetFMUState) X(FreeFMUState)          \
  X(SerializedFMUStateSize) X(SerializeFMUState) X(DeserializeFMUState)                           \
  X(GetDirectionalDerivative) X(GetBinary) X(SetBinary) X(GetClock) X(SetClock)                   \
  X(GetIntervalDecimal) X(GetIntervalFraction) X(GetShiftDecimal) X(GetShiftFraction)
#define NUMBERS(X)                                                                                \
  X(Float64) X(Float32) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) \
  X(Boolean) X(String)
#define DECLARE(name) fmi3##name##TYPE *name;
#define DECLARE_BOTH(name) fmi3Get##name##TYPE *Get##name; fmi3Set##name##TYPE *Set##name;

typedef struct {
  slw_fmu fmu; /* first: a pointer to one is a pointer to the other */
  void *library;
  REQUIRED(DECLARE)
  STEPPING(DECLARE)
  EXCHANGE(DECLARE)
  SCHEDULED(DECLARE)
  OPTIONAL(DECLARE)
  NUMBERS(DECLARE_BOTH)
} slw_fmi3;

static slw_fmi3 *self(slw_fmu *fmu) { return (slw_fmi3 *)fmu; }

/* Calls a function of the FMU if it is there and still may be called. */
#define GUARDED(f, name, call)                                        \
  ((f)->fmu.fatal ? SLW_FATAL                                         \
   : (f)->name    ? slw_status_of(&(f)->fmu, (int)(call), "fmi3" #name) \
                  : slw_missing(&(f)->fmu, "fmi3" #name))
#define CALL(f, name, ...) GUARDED(f, name, (f)->name((f)->fmu.instance, __VA_ARGS__))
#define CALL0(f, name) GUARDED(f, name, (f)->name((f)->fmu.instance))

static void logger(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                   fmi3String message) {
  (void)status, (void)category;
  if (environment) slw_fmu_log(environment, message); /* some FMUs forget it */
}

static slw_status enter_configuration(slw_fmu *fmu) { return CALL0(self(fmu), EnterConfigurationMode); }
static slw_status exit_configuration(slw_fmu *fmu) { return CALL0(self(fmu), ExitConfigurationMode); }

static slw_status enter_initialisation(slw_fmu *fmu, double start, bool stop_defined, double stop,
                                       double tolerance) {
  return CALL(self(fmu), EnterInitializationMode, tolerance > 0.0, tolerance, start, stop_defined, stop);
}

static slw_status exit_initialisation(slw_fmu *fmu) { return CALL0(self(fmu), ExitInitializationMode); }

/* Where the cells are the FMU's own form, they are passed themselves. */
static void *values_of(const slw_group *g) { return g->native ? g->native : (void *)g->cells; }

#define SET_CASE(wire, name) \
  case wire: return CALL(f, Set##name, g->vr, g->n_vr, (const fmi3##name *)values_of(g), g->n);
#define GET_CASE(wire, name) \
  case wire: status = CALL(f, Get##name, g->vr, g->n_vr, (fmi3##name *)values_of(g), g->n); break;
#define CASES(X)                                                                                         \
  X(SLW_FLOAT64, Float64) X(SLW_FLOAT32, Float32) X(SLW_INT8, Int8) X(SLW_UINT8, UInt8)                  \
  X(SLW_INT16, Int16) X(SLW_UINT16, UInt16) X(SLW_INT32, Int32) X(SLW_UINT32, UInt32)                    \
  X(SLW_INT64, Int64) X(SLW_UINT64, UInt64) X(SLW_BOOLEAN, Boolean) X(SLW_STRING, String)

static size_t *sizes(const slw_group *g) { return (size_t *)((void **)g->native + g->n); }

static slw_status set(slw_fmu *fmu, const slw_group *g) {
  slw_fmi3 *f = self(fmu);
  if (!slw_to_native(fmu, g)) return SLW_ERROR;
  switch (g->type) {
    CASES(SET_CASE)
    case SLW_BINARY: return CALL(f, SetBinary, g->vr, g->n_vr, sizes(g), (const fmi3Binary *)g->native, g->n);
    case SLW_CLOCK: return CALL(f, SetClock, g->vr, g->n_vr, (const fmi3Clock *)g->native);
    default: return SLW_ERROR;
  }
}

static slw_status get(slw_fmu *fmu, const slw_group *g) {
  slw_fmi3 *f = self(fmu);
  slw_status status;
  switch (g->type) {
    CASES(GET_CASE)
    case SLW_BINARY:
      status = CALL(f, GetBinary, g->vr, g->n_vr, sizes(g), (fmi3Binary *)g->native, g->n);
      break;
    case SLW_CLOCK: status = CALL(f, GetClock, g->vr, g->n_vr, (fmi3Clock *)g->native); break;
    default: status = SLW_ERROR;
  }
  return status > SLW_WARNING || slw_from_native(fmu, g) ? status : SLW_ERROR;
}

static slw_status step(slw_fmu *fmu, double time, double h, slw_step_result *result) {
  slw_fmi3 *f = self(fmu);
  result->event = result->terminate = result->early = false;
  slw_untold(&result->reached);
  /* True only where no step is taken back; nobody knows that here. */
  const slw_status status = CALL(f, DoStep, time, h, fmi3False, &result->event, &result->terminate,
                                 &result->early, &result->reached);
  result->reached = slw_told(result->reached, status <= SLW_WARNING && !result->early, time, h);
  return status;
}

static slw_status after_discard(slw_fmu *fmu, slw_step_result *result) {
  (void)fmu, (void)result; /* FMI 3 tells with the step itself */
  return SLW_OK;
}

static slw_status enter_event(slw_fmu *fmu) { return CALL0(self(fmu), EnterEventMode); }
static slw_status enter_step(slw_fmu *fmu) { return CALL0(self(fmu), EnterStepMode); }

static slw_status update_discrete(slw_fmu *fmu, slw_event_result *result) {
  bool nominals = false, values = false;
  memset(result, 0, sizeof *result);
  return CALL(self(fmu), UpdateDiscreteStates, &result->more, &result->terminate, &nominals, &values,
              &result->next_event_defined, &result->next_event);
}

/* Of a clock: as a fraction it is counter / resolution. */
static slw_status interval(slw_fmu *fmu, uint32_t vr, bool fraction, slw_interval *result) {
  fmi3IntervalQualifier qualifier = fmi3IntervalNotYetKnown;
  fmi3UInt64 counter = 0, resolution = 1;
  slw_status status;
  result->seconds = 0.0;
  if (fraction) {
    status = CALL(self(fmu), GetIntervalFraction, &vr, 1, &counter, &resolution, &qualifier);
    if (qualifier != fmi3IntervalNotYetKnown) result->seconds = (double)counter / (double)resolution;
  } else {
    status = CALL(self(fmu), GetIntervalDecimal, &vr, 1, &result->seconds, &qualifier);
  }
  result->qualifier = (int)qualifier;
  return status;
}

static slw_status shift(slw_fmu *fmu, uint32_t vr, bool fraction, double *seconds) {
  fmi3UInt64 counter = 0, resolution = 1;
  if (!fraction) return CALL(self(fmu), GetShiftDecimal, &vr, 1, seconds);
  const slw_status status = CALL(self(fmu), GetShiftFraction, &vr, 1, &counter, &resolution);
  *seconds = (double)counter / (double)resolution;
  return status;
}

static slw_status get_state(slw_fmu *fmu, void **state) { return CALL(self(fmu), GetFMUState, state); }
static slw_status set_state(slw_fmu *fmu, void *state) { return CALL(self(fmu), SetFMUState, state); }
static slw_status free_state(slw_fmu *fmu, void **state) {
  const slw_status status = CALL(self(fmu), FreeFMUState, state);
  *state = NULL;
  return status;
}
static slw_status serialized_size(slw_fmu *fmu, void *state, size_t *size) {
  return CALL(self(fmu), SerializedFMUStateSize, state, size);
}
static slw_status serialize(slw_fmu *fmu, void *state, char *bytes, size_t size) {
  return CALL(self(fmu), SerializeFMUState, state, (fmi3Byte *)bytes, size);
}
static slw_status deserialize(slw_fmu *fmu, const char *bytes, size_t size, void **state) {
  return CALL(self(fmu), DeserializeFMUState, (const fmi3Byte *)bytes, size, state);
}

static slw_status directional(slw_fmu *fmu, const uint32_t *unknowns, size_t n_unknowns,
                              const uint32_t *knowns, size_t n_knowns, const double *seed, size_t n_seed,
                              double *result, size_t n_result) {
  return CALL(self(fmu), GetDirectionalDerivative, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed,
              result, n_result);
}

/* An FMU that lacks it has nothing to do there. */
static slw_status terminate(slw_fmu *fmu) { return self(fmu)->Terminate ? CALL0(self(fmu), Terminate) : SLW_OK; }
static slw_status reset(slw_fmu *fmu) { return CALL0(self(fmu), Reset); }

/* After a fatal error all stays: nothing in the library may run, its own clean-up included, and what of it
 * runs in a thread may still log. */
static void free_fmu(slw_fmu *fmu) {
  slw_fmi3 *f = self(fmu);
  if (fmu->fatal) return;
  if (fmu->instance) f->FreeInstance(fmu->instance);
  if (f->library) slw_library_close(f->library);
  free(f);
}

static const slw_fmu_functions functions = {
    .enter_configuration = enter_configuration, .exit_configuration = exit_configuration,
    .enter_initialisation = enter_initialisation, .exit_initialisation = exit_initialisation,
    .set = set, .get = get, .step = step, .after_discard = after_discard,
    .enter_event = enter_event, .update_discrete = update_discrete, .enter_step = enter_step,
    .interval = interval, .shift = shift, .get_state = get_state, .set_state = set_state, .free_state = free_state,
    .serialized_size = serialized_size, .serialize = serialize, .deserialize = deserialize,
    .directional = directional, .terminate = terminate, .reset = reset, .free = free_fmu};

/* ---- model exchange ---- */

static slw_status set_time(slw_fmu *fmu, double t) { return CALL(self(fmu), SetTime, t); }
static slw_status get_states(slw_fmu *fmu, double *x, size_t n) {
  return CALL(self(fmu), GetContinuousStates, x, n);
}
static slw_status set_states(slw_fmu *fmu, const double *x, size_t n) {
  return CALL(self(fmu), SetContinuousStates, x, n);
}
static slw_status derivatives(slw_fmu *fmu, double *dx, size_t n) {
  return CALL(self(fmu), GetContinuousStateDerivatives, dx, n);
}
static slw_status indicators(slw_fmu *fmu, double *z, size_t n) {
  return CALL(self(fmu), GetEventIndicators, z, n);
}
static slw_status nominals(slw_fmu *fmu, double *values, size_t n) {
  return CALL(self(fmu), GetNominalsOfContinuousStates, values, n);
}
static slw_status enter_continuous(slw_fmu *fmu) { return CALL0(self(fmu), EnterContinuousTimeMode); }
static slw_status completed(slw_fmu *fmu, bool *event, bool *terminate) {
  return CALL(self(fmu), CompletedIntegratorStep, fmi3True, event, terminate);
}

static const slw_me_calls exchange_calls = {
    .set_time = set_time, .get_states = get_states, .set_states = set_states, .derivatives = derivatives,
    .indicators = indicators, .nominals = nominals, .enter_event = enter_event, .update = update_discrete,
    .enter_continuous = enter_continuous, .completed = completed};

/* ---- scheduled execution ---- */

static slw_status activate(slw_fmu *fmu, uint32_t vr, double time) {
  return CALL(self(fmu), ActivateModelPartition, vr, time);
}

/* ---- loading ---- */

static bool bind(slw_fmi3 *f, const slw_fmu_options *o, char *error, size_t error_size) {
#define NEED(name)                                                            \
  if (!slw_library_symbol(f->library, "fmi3" #name, &f->name)) {              \
    snprintf(error, error_size, "its library lacks the function fmi3" #name); \
    return false;                                                             \
  }
#define MAY(name) (void)slw_library_symbol(f->library, "fmi3" #name, &f->name);
#define MAY_BOTH(name) MAY(Get##name) MAY(Set##name)
  REQUIRED(NEED)
  if (o->exchange) {
    NEED(InstantiateModelExchange)
    EXCHANGE(MAY)
  } else if (o->scheduled) {
    SCHEDULED(NEED)
  } else {
    STEPPING(NEED)
  }
  OPTIONAL(MAY)
  NUMBERS(MAY_BOTH)
  fmi3GetVersionTYPE *version;
  return !slw_library_symbol(f->library, "fmi3GetVersion", &version) ||
         slw_version_is("3.", version(), error, error_size);
}

/* Tells the log categories of `log` (see fmu.h). */
static bool tell_log(slw_fmi3 *f, const char *log, char *error, size_t error_size) {
  slw_lines names;
  if (!log) return true;
  if (!slw_lines_of(log, &names)) return snprintf(error, error_size, "no memory"), false;
  const slw_status status = CALL(f, SetDebugLogging, fmi3True, names.n, names.list);
  slw_lines_free(&names);
  if (status <= SLW_WARNING) return true;
  const char *why = slw_fmu_message(&f->fmu, 0);
  snprintf(error, error_size, "it refuses the log categories%s%s", *why ? ": " : "", why);
  return false;
}

static slw_fmu *refused(slw_fmi3 *f) {
  free_fmu(&f->fmu);
  return NULL;
}

slw_fmu *slw_fmi3_load(const slw_fmu_options *o, char *error, size_t error_size) {
  slw_fmi3 *f = calloc(1, sizeof *f);
  if (!f) {
    snprintf(error, error_size, "no memory");
    return NULL;
  }
  f->fmu.call = &functions, f->fmu.fmi_version = 3, f->fmu.local = true;
  f->library = slw_library_open(o->library, error, error_size);
  if (!f->library || !bind(f, o, error, error_size)) return refused(f);
  if (o->exchange)
    f->fmu.instance = f->InstantiateModelExchange(o->name, o->token, o->resources, fmi3False, fmi3False, &f->fmu,
                                                  logger);
  else if (o->scheduled)
    f->fmu.instance =
        f->InstantiateScheduledExecution(o->name, o->token, o->resources, fmi3False, fmi3False, &f->fmu, logger,
                                         slw_scheduled_update, slw_scheduled_lock, slw_scheduled_unlock);
  else
    f->fmu.instance = f->InstantiateCoSimulation(o->name, o->token, o->resources, fmi3False, fmi3False,
                                                 o->event_mode, o->early_return, NULL, 0, &f->fmu, logger,
                                                 NULL);
  if (!f->fmu.instance) {
    snprintf(error, error_size, "%s", f->fmu.n_messages ? slw_fmu_message(&f->fmu, 0) : "it gave no reason");
    return refused(f);
  }
  if (!tell_log(f, o->log, error, error_size)) return refused(f);
  if (o->exchange) {
    if (slw_me_wrap(&f->fmu, &exchange_calls, o->exchange, error, error_size)) return &f->fmu;
    f->fmu.call->free(&f->fmu);
    return NULL;
  }
  if (o->scheduled) {
    if (slw_scheduled_wrap(&f->fmu, activate, o->scheduled, error, error_size)) return &f->fmu;
    f->fmu.call->free(&f->fmu);
    return NULL;
  }
  if (f->GetFloat64 && f->SetFloat64) {
    f->fmu.fast.fmi3.get = (slw_fmi3_get_float64)f->GetFloat64;
    f->fmu.fast.fmi3.set = (slw_fmi3_set_float64)f->SetFloat64;
    f->fmu.fast.fmi3.do_step = (slw_fmi3_do_step)f->DoStep;
  }
  return &f->fmu;
}
