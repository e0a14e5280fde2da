/* An FMI 2.0 FMU that behaves as badly as its parameter `trick` says, from t = 0.05 s on:
 * 0 not at all, 1 outputs NaN and says OK, 2 discards the step, 3 fatal, 4 warns.
 * It also passes an Integer and a Boolean through, to see that these are exchanged. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi2Functions.h"

typedef struct {
  int trick, count_in, flag_in;
  double level_in, level_out;
  int count_out, flag_out;
  const fmi2CallbackFunctions *callbacks;
} Liar;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  Liar *l = (Liar *)callbacks->allocateMemory(1, sizeof *l);
  (void)name, (void)type, (void)resources, (void)visible, (void)logging;
  if (strcmp(guid, "liar") != 0) return NULL;
  l->callbacks = callbacks;
  return l;
}
void fmi2FreeInstance(fmi2Component c) { ((Liar *)c)->callbacks->freeMemory(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) {
  (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  for (size_t i = 0; i < n; i++)
    if (vr[i] == 1) ((Liar *)c)->level_in = value[i];
  return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  for (size_t i = 0; i < n; i++) value[i] = vr[i] == 2 ? ((Liar *)c)->level_out : ((Liar *)c)->level_in;
  return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
  for (size_t i = 0; i < n; i++) *(vr[i] == 3 ? &((Liar *)c)->trick : &((Liar *)c)->count_in) = value[i];
  return fmi2OK;
}
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
  for (size_t i = 0; i < n; i++) value[i] = vr[i] == 5 ? ((Liar *)c)->count_out : ((Liar *)c)->trick;
  return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
  for (size_t i = 0; i < n; i++) ((Liar *)c)->flag_in = value[i] + 0 * (int)vr[i];
  return fmi2OK;
}
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
  for (size_t i = 0; i < n; i++) value[i] = ((Liar *)c)->flag_out + 0 * (int)vr[i];
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state) {
  Liar *l = (Liar *)c;
  (void)step, (void)no_set_state;
  l->level_out = l->level_in + 1.0;
  l->count_out = l->count_in + 1;
  l->flag_out = !l->flag_in;
  if (time < 0.0499) return fmi2OK;
  if (l->trick == 1) l->level_out = NAN;
  if (l->trick >= 2)
    l->callbacks->logger(l->callbacks->componentEnvironment, "liar", fmi2Error, "", "%s", "I do not want to");
  return l->trick == 2 ? fmi2Discard : l->trick == 3 ? fmi2Fatal : l->trick == 4 ? fmi2Warning : fmi2OK;
}
