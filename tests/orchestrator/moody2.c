/* An FMI 2.0 FMU with moods: see moody.h. */
#include "fmi/fmi2Functions.h"
#include "moody.h"

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
  return made();
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) {
  (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return (fmi2Status)mood(c, ENTER); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return (fmi2Status)mood(c, LEAVE); }
fmi2Status fmi2Terminate(fmi2Component c) { return (fmi2Status)mood(c, TERMINATE); }

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  for (size_t i = 0; i < n; i++) *real(c, vr[i]) = value[i];
  return (fmi2Status)mood(c, SET);
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  for (size_t i = 0; i < n; i++) value[i] = *real(c, vr[i]);
  return (fmi2Status)mood(c, GET);
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
  for (size_t i = 0; i < n; i++) *whole(c, vr[i]) = value[i];
  return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_set_state) {
  (void)no_set_state;
  return (fmi2Status)step(c, t, h);
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  if (kind != fmi2LastSuccessfulTime || ((Moody *)c)->kind == UNTOLD) return fmi2Discard;
  *value = ((Moody *)c)->told;
  return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(Moody));
  if (*state) memcpy(*state, c, sizeof(Moody));
  return (fmi2Status)mood(c, GET_STATE);
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  const int fired = ((Moody *)c)->fired;
  memcpy(c, state, sizeof(Moody));
  ((Moody *)c)->fired = fired;
  return (fmi2Status)mood(c, SET_STATE);
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  free(*state);
  *state = NULL;
  return c ? fmi2OK : fmi2Error;
}
