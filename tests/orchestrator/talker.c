/* An FMU of version FMI (2 or 3) that logs a sentence a step for each category it was told: `steps`, `values`.
 * It refuses the category `broken`. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if FMI == 2
#include "fmi/fmi2Functions.h"
#else
#include "fmi/fmi3Functions.h"
#endif

enum { OK = 0, ERROR = 3 };

typedef struct {
  int steps, values;
  void *environment;
#if FMI == 2
  fmi2CallbackLogger log;
#else
  fmi3LogMessageCallback log;
#endif
} Talker;

static void say(const Talker *t, const char *category, double time) {
  char text[100];
  snprintf(text, sizeof text, "%s at %g s", category, time);
#if FMI == 2
  t->log(t->environment, "talker", fmi2OK, category, "%s", text);
#else
  t->log(t->environment, fmi3OK, category, text);
#endif
}

static int set_log(Talker *t, size_t n, const char *const names[]) {
  t->steps = t->values = n == 0;
  for (size_t i = 0; i < n; i++) {
    if (strcmp(names[i], "broken") == 0) return ERROR;
    if (strcmp(names[i], "steps") == 0) t->steps = 1;
    if (strcmp(names[i], "values") == 0) t->values = 1;
  }
  return OK;
}

static int step(const Talker *t, double time) {
  if (t->steps) say(t, "steps", time);
  if (t->values) say(t, "values", time);
  return OK;
}

#if FMI == 2
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  Talker *t = calloc(1, sizeof *t);
  (void)name, (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
  t->environment = callbacks->componentEnvironment, t->log = callbacks->logger;
  return t;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
  return (fmi2Status)(on ? set_log(c, n, names) : OK);
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) {
  (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_set_state) {
  (void)h, (void)no_set_state;
  return (fmi2Status)step(c, t);
}
#else
const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  Talker *t = calloc(1, sizeof *t);
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
  (void)intermediate, (void)n_intermediate, (void)update;
  t->environment = environment, t->log = log;
  return t;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[]) {
  return (fmi3Status)(on ? set_log(c, n, names) : OK);
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e,
                                       fmi3Float64 f) {
  (void)a, (void)b, (void)d, (void)e, (void)f;
  return c ? fmi3OK : fmi3Error;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_set_state, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  (void)no_set_state;
  *event = *terminate = *early = false, *last = t + h;
  return (fmi3Status)step(c, t);
}
#endif
