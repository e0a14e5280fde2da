/* FMI 2.0 in this process, co-simulation and model exchange. Source of the interface: FMI 2.0.4, chapters 2.1 and 4.2. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "binding.h"
#include "fmi/fmi2FunctionTypes.h"
#include "me.h"

/* The standard demands more than REQUIRED; what a run does not need may be missing. */
#define REQUIRED(X) \
  X(Instantiate) X(FreeInstance) X(SetupExperiment) X(EnterInitializationMode) X(ExitInitializationMode)
#define STEPPING(X) X(DoStep)
#define EXCHANGE(X)                                                                            \
  X(EnterEventMode) X(NewDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) \
  X(SetTime) X(SetContinuousStates) X(GetDerivatives) X(GetEventIndicators)                    \
  X(GetContinuousStates) X(GetNominalsOfContinuousStates)
#define OPTIONAL(X)                                                                         \
  X(SetDebugLogging) X(Terminate) X(Reset) X(GetReal) X(GetInteger) X(GetBoolean) X(GetString)                 \
  X(SetReal) X(SetInteger) X(SetBoolean) X(SetString) X(GetFMUstate) X(SetFMUstate)         \
  X(FreeFMUstate) X(SerializedFMUstateSize) X(SerializeFMUstate) X(DeSerializeFMUstate)     \
  X(GetDirectionalDerivative) X(GetRealStatus) X(GetBooleanStatus)
#define DECLARE(name) fmi2##name##TYPE *name;

typedef struct {
  slw_fmu fmu; /* first: a pointer to one is a pointer to the other */
  void *library;
  fmi2CallbackFunctions callbacks;
  REQUIRED(DECLARE)
  STEPPING(DECLARE)
  EXCHANGE(DECLARE)
  OPTIONAL(DECLARE)
} slw_fmi2;

static slw_fmi2 *self(slw_fmu *fmu) { return (slw_fmi2 *)fmu; }

/* Calls a function of the FMU if it is there and still may be called. */
#define GUARDED(f, name, call)                                        \
  ((f)->fmu.fatal ? SLW_FATAL                                         \
   : (f)->name    ? slw_status_of(&(f)->fmu, (int)(call), "fmi2" #name) \
                  : slw_missing(&(f)->fmu, "fmi2" #name))
#define CALL(f, name, ...) GUARDED(f, name, (f)->name((f)->fmu.instance, __VA_ARGS__))
#define CALL0(f, name) GUARDED(f, name, (f)->name((f)->fmu.instance))

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String format, ...) {
  char text[SLW_MESSAGE_SIZE];
  va_list arguments;
  (void)name, (void)status, (void)category;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format ? format : "", arguments);
  va_end(arguments);
  if (environment) slw_fmu_log(environment, text); /* some FMUs forget it */
}

static slw_status not_in_fmi2(slw_fmu *fmu) {
  slw_fmu_log(fmu, "FMI 2 has no such mode");
  return SLW_ERROR;
}

static slw_status no_interval(slw_fmu *fmu, uint32_t vr, bool fraction, slw_interval *result) {
  (void)vr, (void)fraction, (void)result;
  return not_in_fmi2(fmu);
}

static slw_status no_shift(slw_fmu *fmu, uint32_t vr, bool fraction, double *seconds) {
  (void)vr, (void)fraction, (void)seconds;
  return not_in_fmi2(fmu);
}

static slw_status enter_initialisation(slw_fmu *fmu, double start, bool stop_defined, double stop,
                                       double tolerance) {
  slw_fmi2 *f = self(fmu);
  const slw_status status =
      CALL(f, SetupExperiment, tolerance > 0.0, tolerance, start, stop_defined, stop);
  if (status > SLW_WARNING) return status;
  const slw_status entered = CALL0(f, EnterInitializationMode);
  return entered > status ? entered : status;
}

static slw_status exit_initialisation(slw_fmu *fmu) { return CALL0(self(fmu), ExitInitializationMode); }

static slw_status set(slw_fmu *fmu, const slw_group *g) {
  slw_fmi2 *f = self(fmu);
  if (!slw_to_native(fmu, g)) return SLW_ERROR;
  switch (g->type) {
    case SLW_FLOAT64: return CALL(f, SetReal, g->vr, g->n_vr, &g->cells->real);
    case SLW_BOOLEAN: return CALL(f, SetBoolean, g->vr, g->n_vr, (const fmi2Boolean *)g->native);
    case SLW_STRING: return CALL(f, SetString, g->vr, g->n_vr, (const fmi2String *)g->native);
    default: return CALL(f, SetInteger, g->vr, g->n_vr, (const fmi2Integer *)g->native);
  }
}

static slw_status get(slw_fmu *fmu, const slw_group *g) {
  slw_fmi2 *f = self(fmu);
  slw_status status;
  switch (g->type) {
    case SLW_FLOAT64: return CALL(f, GetReal, g->vr, g->n_vr, &g->cells->real);
    case SLW_BOOLEAN: status = CALL(f, GetBoolean, g->vr, g->n_vr, (fmi2Boolean *)g->native); break;
    case SLW_STRING: status = CALL(f, GetString, g->vr, g->n_vr, (fmi2String *)g->native); break;
    default: status = CALL(f, GetInteger, g->vr, g->n_vr, (fmi2Integer *)g->native);
  }
  return status > SLW_WARNING || slw_from_native(fmu, g) ? status : SLW_ERROR;
}

/* Without these functions a discarded step got nowhere. */
static slw_status after_discard(slw_fmu *fmu, slw_step_result *result) {
  slw_fmi2 *f = self(fmu);
  fmi2Real reached = result->reached;
  fmi2Boolean terminated = fmi2False;
  if (f->GetBooleanStatus && f->GetBooleanStatus(fmu->instance, fmi2Terminated, &terminated) == fmi2OK)
    result->terminate = terminated != fmi2False;
  if (f->GetRealStatus && f->GetRealStatus(fmu->instance, fmi2LastSuccessfulTime, &reached) == fmi2OK)
    result->reached = reached;
  return SLW_OK;
}

static slw_status step(slw_fmu *fmu, double time, double h, slw_step_result *result) {
  slw_fmi2 *f = self(fmu);
  result->event = result->terminate = result->early = false;
  result->reached = time + h;
  const slw_status status = CALL(f, DoStep, time, h, fmi2False);
  if (status != SLW_DISCARD) return status;
  result->reached = time;
  after_discard(fmu, result);
  return status;
}

static slw_status update_discrete(slw_fmu *fmu, slw_event_result *result) {
  (void)result;
  return not_in_fmi2(fmu);
}

static slw_status get_state(slw_fmu *fmu, void **state) { return CALL(self(fmu), GetFMUstate, state); }
static slw_status set_state(slw_fmu *fmu, void *state) { return CALL(self(fmu), SetFMUstate, state); }
static slw_status free_state(slw_fmu *fmu, void **state) {
  const slw_status status = CALL(self(fmu), FreeFMUstate, state);
  *state = NULL;
  return status;
}
static slw_status serialized_size(slw_fmu *fmu, void *state, size_t *size) {
  return CALL(self(fmu), SerializedFMUstateSize, state, size);
}
static slw_status serialize(slw_fmu *fmu, void *state, char *bytes, size_t size) {
  return CALL(self(fmu), SerializeFMUstate, state, bytes, size);
}
static slw_status deserialize(slw_fmu *fmu, const char *bytes, size_t size, void **state) {
  return CALL(self(fmu), DeSerializeFMUstate, bytes, size, state);
}

static slw_status directional(slw_fmu *fmu, const uint32_t *unknowns, size_t n_unknowns,
                              const uint32_t *knowns, size_t n_knowns, const double *seed, size_t n_seed,
                              double *result, size_t n_result) {
  (void)n_seed, (void)n_result;
  return CALL(self(fmu), GetDirectionalDerivative, unknowns, n_unknowns, knowns, n_knowns, seed, result);
}

/* An FMU that lacks it has nothing to do there. */
static slw_status terminate(slw_fmu *fmu) { return self(fmu)->Terminate ? CALL0(self(fmu), Terminate) : SLW_OK; }
static slw_status reset(slw_fmu *fmu) { return CALL0(self(fmu), Reset); }

/* After a fatal error all stays: nothing in the library may run, its own clean-up included, and what of it
 * runs in a thread may still log. */
static void free_fmu(slw_fmu *fmu) {
  slw_fmi2 *f = self(fmu);
  if (fmu->fatal) return;
  if (fmu->instance) f->FreeInstance(fmu->instance);
  if (f->library) slw_library_close(f->library);
  free(f);
}

static const slw_fmu_functions functions = {
    .enter_configuration = not_in_fmi2, .exit_configuration = not_in_fmi2,
    .enter_initialisation = enter_initialisation, .exit_initialisation = exit_initialisation,
    .set = set, .get = get, .step = step, .after_discard = after_discard,
    .enter_event = not_in_fmi2, .update_discrete = update_discrete, .enter_step = not_in_fmi2,
    .interval = no_interval, .shift = no_shift, .get_state = get_state, .set_state = set_state, .free_state = free_state,
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
  return CALL(self(fmu), GetDerivatives, dx, n);
}
static slw_status indicators(slw_fmu *fmu, double *z, size_t n) {
  return CALL(self(fmu), GetEventIndicators, z, n);
}
static slw_status nominals(slw_fmu *fmu, double *values, size_t n) {
  return CALL(self(fmu), GetNominalsOfContinuousStates, values, n);
}
static slw_status enter_event(slw_fmu *fmu) { return CALL0(self(fmu), EnterEventMode); }
static slw_status update(slw_fmu *fmu, slw_event_result *result) {
  fmi2EventInfo found;
  memset(&found, 0, sizeof found);
  const slw_status status = CALL(self(fmu), NewDiscreteStates, &found);
  *result = (slw_event_result){found.newDiscreteStatesNeeded != fmi2False, found.terminateSimulation != fmi2False,
                               found.nextEventTimeDefined != fmi2False, found.nextEventTime};
  return status;
}
static slw_status enter_continuous(slw_fmu *fmu) { return CALL0(self(fmu), EnterContinuousTimeMode); }
static slw_status completed(slw_fmu *fmu, bool *event, bool *terminate) {
  fmi2Boolean events = fmi2False, ends = fmi2False;
  const slw_status status = CALL(self(fmu), CompletedIntegratorStep, fmi2True, &events, &ends);
  *event = events != fmi2False, *terminate = ends != fmi2False;
  return status;
}

static const slw_me_calls exchange_calls = {
    .set_time = set_time, .get_states = get_states, .set_states = set_states, .derivatives = derivatives,
    .indicators = indicators, .nominals = nominals, .enter_event = enter_event, .update = update,
    .enter_continuous = enter_continuous, .completed = completed};

/* ---- loading ---- */

static bool bind(slw_fmi2 *f, bool exchange, char *error, size_t error_size) {
#define NEED(name)                                                              \
  if (!slw_library_symbol(f->library, "fmi2" #name, &f->name)) {                \
    snprintf(error, error_size, "its library lacks the function fmi2" #name);   \
    return false;                                                               \
  }
#define MAY(name) (void)slw_library_symbol(f->library, "fmi2" #name, &f->name);
  REQUIRED(NEED)
  if (exchange) {
    NEED(NewDiscreteStates)
    EXCHANGE(MAY)
  } else {
    STEPPING(NEED)
  }
  OPTIONAL(MAY)
  return true;
}

static bool check_version(slw_fmi2 *f, char *error, size_t error_size) {
  fmi2GetVersionTYPE *version;
  fmi2GetTypesPlatformTYPE *platform;
  if (slw_library_symbol(f->library, "fmi2GetVersion", &version) &&
      !slw_version_is("2.", version(), error, error_size))
    return false;
  if (!slw_library_symbol(f->library, "fmi2GetTypesPlatform", &platform)) return true;
  const char *found = platform();
  if (found && strcmp(found, fmi2TypesPlatform) == 0) return true;
  snprintf(error, error_size, "its library uses the types '%.40s', not '%s'", found ? found : "",
           fmi2TypesPlatform);
  return false;
}

/* Tells the log categories of `log` (see fmu.h). */
static bool tell_log(slw_fmi2 *f, const char *log, char *error, size_t error_size) {
  slw_lines names;
  if (!log) return true;
  if (!slw_lines_of(log, &names)) return snprintf(error, error_size, "no memory"), false;
  const slw_status status = CALL(f, SetDebugLogging, fmi2True, names.n, names.list);
  slw_lines_free(&names);
  if (status <= SLW_WARNING) return true;
  const char *why = slw_fmu_message(&f->fmu, 0);
  snprintf(error, error_size, "it refuses the log categories%s%s", *why ? ": " : "", why);
  return false;
}

static slw_fmu *refused(slw_fmi2 *f) {
  free_fmu(&f->fmu);
  return NULL;
}

slw_fmu *slw_fmi2_load(const slw_fmu_options *o, char *error, size_t error_size) {
  slw_fmi2 *f = calloc(1, sizeof *f);
  if (!f) {
    snprintf(error, error_size, "no memory");
    return NULL;
  }
  f->fmu.call = &functions, f->fmu.fmi_version = 2, f->fmu.local = true;
  f->library = slw_library_open(o->library, error, error_size);
  if (!f->library || !bind(f, o->exchange != NULL, error, error_size) || !check_version(f, error, error_size)) return refused(f);
  const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, &f->fmu};
  memcpy(&f->callbacks, &callbacks, sizeof callbacks); /* its members are const */
  f->fmu.instance = f->Instantiate(o->name, o->exchange ? fmi2ModelExchange : fmi2CoSimulation, o->token, o->resources ? o->resources : "",
                                   &f->callbacks, fmi2False, fmi2False);
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
  if (f->GetReal && f->SetReal) {
    f->fmu.fast.fmi2.get_real = (slw_fmi2_get_real)f->GetReal;
    f->fmu.fast.fmi2.set_real = (slw_fmi2_set_real)f->SetReal;
    f->fmu.fast.fmi2.do_step = (slw_fmi2_do_step)f->DoStep;
  }
  return &f->fmu;
}
