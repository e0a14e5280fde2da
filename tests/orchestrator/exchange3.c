/* An FMI 3.0 FMU of model exchange; what it computes is in exchange.h. */
#include "fmi/fmi3Functions.h"

#include "exchange.h"

#define M ((model *)instance)
#define CHECKED(ok) return (ok) && !M->bad ? fmi3OK : fmi3Error

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
  model *m = calloc(1, sizeof *m);
  if (m) start(m);
  return m;
}
void fmi3FreeInstance(fmi3Instance instance) { free(instance); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean told, fmi3Float64 tolerance,
                                       fmi3Float64 begin, fmi3Boolean ends, fmi3Float64 end) {
  (void)told, (void)tolerance, (void)ends, (void)end;
  M->time = begin;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
  initialise(M);
  return fmi3OK;
}
fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
  const bool was = M->continuous;
  M->continuous = false;
  CHECKED(was);
}
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
  const bool was = M->continuous;
  M->continuous = true;
  CHECKED(!was);
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *more, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *changed, fmi3Boolean *timed,
                                    fmi3Float64 *next) {
  *terminate = *nominals = false;
  *next = event(M, more, changed);
  *timed = *next >= M->time || M->kind == PAST;
  CHECKED(!M->continuous);
}
fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
  set_time(M, time);
  CHECKED(true);
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_way_back, fmi3Boolean *event_mode,
                                       fmi3Boolean *terminate) {
  (void)no_way_back;
  *event_mode = *terminate = false;
  completed(M);
  CHECKED(M->continuous);
}
fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 *x, size_t n) {
  memcpy(x, M->x, n * sizeof *x);
  CHECKED(n == 2);
}
fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 *x, size_t n) {
  memcpy(M->x, x, n * sizeof *x);
  CHECKED(n == 2 && M->continuous);
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 *dx, size_t n) {
  rates(M, dx);
  CHECKED(n == 2);
}
fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 *z, size_t n) {
  *z = indicator(M);
  CHECKED(n == 1);
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 *nominals, size_t n) {
  nominals[0] = nominals[1] = 1.0;
  CHECKED(n == 2);
}
fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference *vr, size_t n, fmi3Float64 *values,
                          size_t n_values) {
  for (size_t i = 0; i < n; i++) values[i] = value(M, vr[i]);
  CHECKED(n == n_values);
}
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference *vr, size_t n, const fmi3Float64 *values,
                          size_t n_values) {
  for (size_t i = 0; i < n; i++) *settable(M, vr[i]) = values[i];
  CHECKED(n == n_values && !M->continuous);
}
fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference *vr, size_t n, fmi3Int32 *values,
                        size_t n_values) {
  for (size_t i = 0; i < n; i++) values[i] = vr[i] == 8 ? M->kind : M->count;
  CHECKED(n == n_values);
}
fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference *vr, size_t n, const fmi3Int32 *values,
                        size_t n_values) {
  for (size_t i = 0; i < n; i++) M->kind = values[i];
  CHECKED(n == n_values && vr[0] == 8);
}
fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(model));
  memcpy(*state, M, sizeof(model));
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
  memcpy(M, state, sizeof(model));
  return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
  (void)instance;
  free(*state);
  *state = NULL;
  return fmi3OK;
}
fmi3Status fmi3Terminate(fmi3Instance instance) {
  (void)instance;
  return fmi3OK;
}
