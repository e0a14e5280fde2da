/* An FMI 3.0 FMU that takes every value reference and gives numbers that follow from it, so that whatever a
 * mutated description says can be run. Value references from 0xF000 on fail in turn with each status; clocks of
 * 0xE000 on give each qualifier in turn. Co-simulation and scheduled execution. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

typedef struct {
  double time;
  unsigned events;
  fmi3InstanceEnvironment environment;
  fmi3ClockUpdateCallback update;
} Sponge;

static fmi3Status status(const fmi3ValueReference vr[], size_t n) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= 0xF000 && vr[i] < 0xF005) return (fmi3Status)(vr[i] - 0xF000);
  }
  return fmi3OK;
}

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
  (void)intermediate, (void)n_intermediate, (void)update;
  log(environment, fmi3OK, "", token);
  return calloc(1, sizeof(Sponge));
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)log;
  lock(), unlock();
  Sponge *const sponge = calloc(1, sizeof *sponge);
  if (sponge) sponge->environment = environment, sponge->update = update;
  update(environment);
  return sponge;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }

#define CALL(Name) \
  fmi3Status fmi3##Name(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
CALL(EnterConfigurationMode)
CALL(ExitConfigurationMode)
CALL(ExitInitializationMode)
CALL(EnterEventMode)
CALL(EnterStepMode)
CALL(Terminate)
CALL(Reset)

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 start, fmi3Boolean e,
                                       fmi3Float64 f) {
  (void)a, (void)b, (void)e, (void)f;
  ((Sponge *)c)->time = start;
  return fmi3OK;
}

/* All elements that the caller asks for: it must have made room for as many as it says. */
#define BOTH(Name, Type, expression)                                                                        \
  fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const Type value[],     \
                           size_t m) {                                                                      \
    Type sum;                                                                                               \
    (void)c;                                                                                                \
    for (size_t i = 0; i < m; i++) memcpy(&sum, value + i, sizeof sum);                                     \
    return status(vr, n);                                                                                   \
  }                                                                                                         \
  fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, Type value[], size_t m) { \
    (void)c;                                                                                                \
    for (size_t i = 0; i < m; i++) value[i] = (Type)(expression);                                           \
    return status(vr, n);                                                                                   \
  }
#define FIRST (n ? vr[i < n ? i : n - 1] : 0)
BOTH(Float64, fmi3Float64, 0.5 * (double)FIRST + ((Sponge *)c)->time)
BOTH(Float32, fmi3Float32, 0.5 * (double)FIRST)
BOTH(Int8, fmi3Int8, FIRST % 4)
BOTH(UInt8, fmi3UInt8, FIRST % 4)
BOTH(Int16, fmi3Int16, FIRST % 4)
BOTH(UInt16, fmi3UInt16, FIRST % 4)
BOTH(Int32, fmi3Int32, FIRST % 4)
BOTH(UInt32, fmi3UInt32, FIRST % 4)
BOTH(Int64, fmi3Int64, FIRST % 4)
BOTH(UInt64, fmi3UInt64, FIRST % 4)
BOTH(Boolean, fmi3Boolean, FIRST % 2)
BOTH(String, fmi3String, "\xc3\xa4 word")

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary value[], size_t m) {
  unsigned sum = 0;
  (void)c;
  for (size_t i = 0; i < m; i++) {
    for (size_t k = 0; k < sizes[i]; k++) sum += value[i][k];
  }
  return sum == 0xFFFFFFFFu ? fmi3Error : status(vr, n);
}
fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[], fmi3Binary value[],
                         size_t m) {
  static const fmi3Byte content[3] = {0, 255, 'A'};
  (void)c;
  for (size_t i = 0; i < m; i++) {
    value[i] = content;
    sizes[i] = n ? vr[i < n ? i : n - 1] % 4 : 0;
  }
  return status(vr, n);
}
fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock value[]) {
  (void)c, (void)value;
  return status(vr, n);
}
fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock value[]) {
  (void)c;
  for (size_t i = 0; i < n; i++) value[i] = vr[i] % 2;
  return status(vr, n);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference vr, fmi3Float64 time) {
  Sponge *const sponge = c;
  sponge->time = time;
  sponge->update(sponge->environment);
  return status(&vr, 1);
}

static fmi3IntervalQualifier qualifier(fmi3ValueReference vr) {
  return vr >= 0xE000 && vr < 0xE005 ? (fmi3IntervalQualifier)(vr - 0xE000) : fmi3IntervalChanged;
}
fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
  (void)c;
  for (size_t i = 0; i < n; i++) intervals[i] = 0.004 * (vr[i] % 8), qualifiers[i] = qualifier(vr[i]);
  return status(vr, n);
}
fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
  (void)c;
  for (size_t i = 0; i < n; i++)
    counters[i] = vr[i] % 8, resolutions[i] = 250 * (vr[i] % 5), qualifiers[i] = qualifier(vr[i]);
  return status(vr, n);
}
fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[]) {
  (void)c;
  for (size_t i = 0; i < n; i++) shifts[i] = 0.004 * (vr[i] % 8);
  return status(vr, n);
}
fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
  (void)c;
  for (size_t i = 0; i < n; i++) counters[i] = vr[i] % 8, resolutions[i] = 250 * (vr[i] % 5);
  return status(vr, n);
}

/* Asks twice for another round after every event. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *more, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
  Sponge *const sponge = c;
  *more = ++sponge->events % 3 != 0;
  *end = *nominals = *values = false;
  *defined = true;
  *next = sponge->time + 0.005;
  return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *reached) {
  (void)keep;
  ((Sponge *)c)->time = *reached = time + h;
  *event = *end = *early = false;
  return fmi3OK;
}
fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(Sponge));
  memcpy(*state, c, sizeof(Sponge));
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  memcpy(c, state, sizeof(Sponge));
  return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return fmi3OK;
}
