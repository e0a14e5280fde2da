/* An FMI 3.0 FMU with moods: see moody.h. */
#include "fmi/fmi3Functions.h"
#include "moody.h"

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
  (void)intermediate, (void)n_intermediate, (void)environment, (void)log, (void)update;
  return made();
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e,
                                       fmi3Float64 f) {
  (void)a, (void)b, (void)d, (void)e, (void)f;
  return (fmi3Status)mood(c, ENTER);
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return (fmi3Status)mood(c, LEAVE); }
fmi3Status fmi3Terminate(fmi3Instance c) { return (fmi3Status)mood(c, TERMINATE); }

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 value[],
                          size_t m) {
  for (size_t i = 0; i < n && i < m; i++) *real(c, vr[i]) = value[i];
  return (fmi3Status)mood(c, SET);
}
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) value[i] = *real(c, vr[i]);
  return (fmi3Status)mood(c, GET);
}
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) *whole(c, vr[i]) = value[i];
  return fmi3OK;
}
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return (fmi3Status)mood(c, ENTER_EVENT); }
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return (fmi3Status)mood(c, ENTER_STEP); }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *defined,
                                    fmi3Float64 *next) {
  *more = *terminate = *nominals = *values = *defined = false, *next = 0.0;
  return (fmi3Status)mood(c, UPDATE);
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_set_state, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  Moody *m = c;
  const int before = m->fired, status = step(m, t, h);
  (void)no_set_state;
  *terminate = false, *event = m->function >= ENTER_EVENT && m->function <= ENTER_STEP;
  *early = m->early && m->fired && !before;
  if (m->kind != UNTOLD) *last = m->told;
  return (fmi3Status)status;
}
fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(Moody));
  if (*state) memcpy(*state, c, sizeof(Moody));
  return (fmi3Status)mood(c, GET_STATE);
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  const int fired = ((Moody *)c)->fired;
  memcpy(c, state, sizeof(Moody));
  ((Moody *)c)->fired = fired;
  return (fmi3Status)mood(c, SET_STATE);
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  free(*state);
  *state = NULL;
  return c ? fmi3OK : fmi3Error;
}
