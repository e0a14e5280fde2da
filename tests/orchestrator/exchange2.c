/* An FMI 2.0 FMU of model exchange; what it computes is in exchange.h. */
#include "fmi/fmi2Functions.h"

#include "exchange.h"

#define M ((model *)instance)
#define CHECKED(ok) return (ok) && !M->bad ? fmi2OK : fmi2Error

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  (void)name, (void)token, (void)resources, (void)callbacks, (void)visible, (void)logging;
  model *m = type == fmi2ModelExchange ? calloc(1, sizeof *m) : NULL;
  if (m) start(m);
  return m;
}
void fmi2FreeInstance(fmi2Component instance) { free(instance); }
fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean told, fmi2Real tolerance, fmi2Real begin,
                               fmi2Boolean ends, fmi2Real end) {
  (void)told, (void)tolerance, (void)ends, (void)end;
  M->time = begin;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component instance) {
  (void)instance;
  return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component instance) {
  initialise(M);
  return fmi2OK;
}
fmi2Status fmi2EnterEventMode(fmi2Component instance) {
  const bool was = M->continuous;
  M->continuous = false;
  CHECKED(was);
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component instance) {
  const bool was = M->continuous;
  M->continuous = true;
  CHECKED(!was);
}
fmi2Status fmi2NewDiscreteStates(fmi2Component instance, fmi2EventInfo *info) {
  bool more, changed;
  memset(info, 0, sizeof *info);
  info->nextEventTime = event(M, &more, &changed);
  info->nextEventTimeDefined = info->nextEventTime >= M->time || M->kind == PAST;
  info->newDiscreteStatesNeeded = more, info->valuesOfContinuousStatesChanged = changed;
  CHECKED(!M->continuous);
}
fmi2Status fmi2SetTime(fmi2Component instance, fmi2Real time) {
  set_time(M, time);
  CHECKED(true);
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component instance, fmi2Boolean no_way_back, fmi2Boolean *event_mode,
                                       fmi2Boolean *terminate) {
  (void)no_way_back;
  *event_mode = *terminate = fmi2False;
  completed(M);
  CHECKED(M->continuous);
}
fmi2Status fmi2GetContinuousStates(fmi2Component instance, fmi2Real *x, size_t n) {
  memcpy(x, M->x, n * sizeof *x);
  CHECKED(n == 2);
}
fmi2Status fmi2SetContinuousStates(fmi2Component instance, const fmi2Real *x, size_t n) {
  memcpy(M->x, x, n * sizeof *x);
  CHECKED(n == 2 && M->continuous);
}
fmi2Status fmi2GetDerivatives(fmi2Component instance, fmi2Real *dx, size_t n) {
  rates(M, dx);
  CHECKED(n == 2);
}
fmi2Status fmi2GetEventIndicators(fmi2Component instance, fmi2Real *z, size_t n) {
  *z = indicator(M);
  CHECKED(n == 1);
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component instance, fmi2Real *nominals, size_t n) {
  nominals[0] = nominals[1] = 1.0;
  CHECKED(n == 2);
}
fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference *vr, size_t n, fmi2Real *values) {
  for (size_t i = 0; i < n; i++) values[i] = value(M, vr[i]);
  CHECKED(true);
}
fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference *vr, size_t n, const fmi2Real *values) {
  for (size_t i = 0; i < n; i++) *settable(M, vr[i]) = values[i];
  CHECKED(!M->continuous);
}
fmi2Status fmi2GetInteger(fmi2Component instance, const fmi2ValueReference *vr, size_t n, fmi2Integer *values) {
  for (size_t i = 0; i < n; i++) values[i] = vr[i] == 8 ? M->kind : M->count;
  CHECKED(true);
}
fmi2Status fmi2SetInteger(fmi2Component instance, const fmi2ValueReference *vr, size_t n,
                          const fmi2Integer *values) {
  for (size_t i = 0; i < n; i++) M->kind = values[i];
  CHECKED(vr[0] == 8);
}
fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(model));
  memcpy(*state, M, sizeof(model));
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate state) {
  memcpy(M, state, sizeof(model));
  return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate *state) {
  (void)instance;
  free(*state);
  *state = NULL;
  return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component instance) {
  (void)instance;
  return fmi2OK;
}
