/* Van der Pol's oscillator as an FMI 3.0 FMU of model exchange: no more than integrating it needs. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

typedef struct {
  double t, x[2];
} oscillator;
#define O ((oscillator *)instance)

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
  oscillator *made = calloc(1, sizeof *made);
  if (made) made->x[0] = 2.0;
  return made;
}
void fmi3FreeInstance(fmi3Instance instance) { free(instance); }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *more, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *changed, fmi3Boolean *timed,
                                    fmi3Float64 *next) {
  (void)instance;
  *more = *terminate = *nominals = *changed = *timed = false, *next = 0.0;
  return fmi3OK;
}
fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 t) {
  O->t = t;
  return fmi3OK;
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean final, fmi3Boolean *event,
                                       fmi3Boolean *terminate) {
  (void)instance, (void)final;
  *event = *terminate = false;
  return fmi3OK;
}
fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 *x, size_t n) {
  memcpy(x, O->x, n * sizeof *x);
  return fmi3OK;
}
fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 *x, size_t n) {
  memcpy(O->x, x, n * sizeof *x);
  return fmi3OK;
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 *dx, size_t n) {
  (void)n;
  dx[0] = O->x[1];
  dx[1] = (1.0 - O->x[0] * O->x[0]) * O->x[1] - O->x[0];
  return fmi3OK;
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 *nominals, size_t n) {
  (void)instance;
  for (size_t i = 0; i < n; i++) nominals[i] = 1.0;
  return fmi3OK;
}
fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference *vr, size_t n, fmi3Float64 *values,
                          size_t n_values) {
  const double all[] = {O->t, O->x[0], O->x[1], O->x[1], (1.0 - O->x[0] * O->x[0]) * O->x[1] - O->x[0]};
  (void)n_values;
  for (size_t i = 0; i < n; i++) values[i] = all[vr[i] % 5];
  return fmi3OK;
}
