/* What the FMI 2.0 shell has besides for model exchange. */
#include <string.h>

#include "fmi/fmi2Functions.h"
#include "kit.h"

static kit_instance *of(fmi2Component c) { return (kit_instance *)c; }
static fmi2Status two(size_t n) { return n == 2 ? fmi2OK : fmi2Error; }

fmi2Status fmi2EnterEventMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
  memset(info, 0, sizeof *info);
  info->valuesOfContinuousStatesChanged = kit_happens(of(c), &info->nextEventTime);
  info->nextEventTimeDefined = info->nextEventTime > of(c)->time;
  kit_outputs(of(c));
  return fmi2OK;
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_way_back, fmi2Boolean *event,
                                       fmi2Boolean *terminate) {
  (void)no_way_back;
  *event = *terminate = fmi2False;
  return c ? fmi2OK : fmi2Error;
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
  of(c)->time = time;
  kit_outputs(of(c));
  return fmi2OK;
}
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
  if (n == 2) x[0] = of(c)->x, x[1] = of(c)->x2;
  return two(n);
}
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
  if (n == 2) of(c)->x = x[0], of(c)->x2 = x[1];
  kit_outputs(of(c));
  return two(n);
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real dx[], size_t n) {
  if (n == 2) kit_rates(of(c), dx);
  return two(n);
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
  if (n == 1) z[0] = kit_indicator(of(c));
  return n == 1 ? fmi2OK : fmi2Error;
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t n) {
  (void)c;
  if (n == 2) nominals[0] = nominals[1] = 1.0;
  return two(n);
}
