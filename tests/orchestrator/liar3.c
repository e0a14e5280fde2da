/* An FMI 3.0 FMU that behaves as badly as its parameter `trick` says, from t = 0.05 s on:
 * 0 not at all, 1 outputs infinity and says OK, 2 returns early, 3 asks to terminate.
 * It also passes an Int32, a Boolean and a Float32 through, to see that these are exchanged. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

typedef struct {
  int32_t trick, count_in, count_out;
  bool flag_in, flag_out;
  float level_in, level_out;
} Liar;

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
  (void)intermediate, (void)n_intermediate, (void)update;
  if (strcmp(token, "liar") == 0) return calloc(1, sizeof(Liar));
  log(environment, fmi3Error, "", "wrong token");
  return NULL;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e,
                                       fmi3Float64 f) {
  (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }

fmi3Status fmi3SetFloat32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float32 value[],
                          size_t m) {
  if (n == 1 && m == 1 && vr[0] == 1) ((Liar *)c)->level_in = value[0];
  return fmi3OK;
}
fmi3Status fmi3GetFloat32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float32 value[], size_t m) {
  if (n == 1 && m == 1 && vr[0] == 2) value[0] = ((Liar *)c)->level_out;
  return fmi3OK;
}
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) *(vr[i] == 3 ? &((Liar *)c)->trick : &((Liar *)c)->count_in) = value[i];
  return fmi3OK;
}
fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) value[i] = vr[i] == 5 ? ((Liar *)c)->count_out : ((Liar *)c)->trick;
  return fmi3OK;
}
fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Boolean value[],
                          size_t m) {
  if (n == 1 && m == 1 && vr[0] == 6) ((Liar *)c)->flag_in = value[0];
  return fmi3OK;
}
fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Boolean value[], size_t m) {
  if (n == 1 && m == 1 && vr[0] == 7) value[0] = ((Liar *)c)->flag_out;
  return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  Liar *l = (Liar *)c;
  (void)no_set_state;
  l->level_out = l->level_in + 1.0f;
  l->count_out = l->count_in + 1;
  l->flag_out = !l->flag_in;
  *event = false;
  *terminate = l->trick == 3 && time >= 0.0499;
  *early = l->trick == 2 && time >= 0.0499;
  *last = time + step;
  if (l->trick == 1 && time >= 0.0499) l->level_out = INFINITY;
  return fmi3OK;
}
