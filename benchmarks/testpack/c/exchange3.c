/* What the FMI 3.0 shell has besides for model exchange. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"
#include "kit.h"

static kit_instance *of(fmi3Instance c) { return (kit_instance *)c; }
static fmi3Status two(size_t n) { return n == 2 ? fmi3OK : fmi3Error; }

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
  (void)name, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
  if (strncmp(token, KIT_TOKEN, sizeof KIT_TOKEN - 1) != 0) return NULL;
  kit_instance *m = calloc(1, sizeof *m);
  if (m) fmi3Reset(m);
  return m;
}
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *next_defined,
                                    fmi3Float64 *next) {
  *more = *terminate = *nominals = false;
  *values = kit_happens(of(c), next);
  *next_defined = *next > of(c)->time;
  kit_outputs(of(c));
  return fmi3OK;
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_way_back, fmi3Boolean *event,
                                       fmi3Boolean *terminate) {
  (void)no_way_back;
  *event = *terminate = false;
  return c ? fmi3OK : fmi3Error;
}
fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
  of(c)->time = time;
  kit_outputs(of(c));
  return fmi3OK;
}
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
  if (n == 2) x[0] = of(c)->x, x[1] = of(c)->x2;
  return two(n);
}
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
  if (n == 2) of(c)->x = x[0], of(c)->x2 = x[1];
  kit_outputs(of(c));
  return two(n);
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 dx[], size_t n) {
  if (n == 2) kit_rates(of(c), dx);
  return two(n);
}
fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n) {
  if (n == 1) z[0] = kit_indicator(of(c));
  return n == 1 ? fmi3OK : fmi3Error;
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t n) {
  (void)c;
  if (n == 2) nominals[0] = nominals[1] = 1.0;
  return two(n);
}
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
  *n = 1;
  return c ? fmi3OK : fmi3Error;
}
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
  *n = 2;
  return c ? fmi3OK : fmi3Error;
}
