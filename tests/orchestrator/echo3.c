/* An FMI 3.0 FMU that shows its parameters and passes its inputs on, for values of every type.
 *
 * Value references: 10 k for a parameter, 10 k + 1 for an output with its value; 10 k + 2 for an input,
 * 10 k + 3 for an output with its value; from k = 20 on they are arrays of three.
 * Reference 5 is an output of type Int32: the length of the string and of the binary that came in, and their
 * first bytes, so that a record of numbers tells whether they arrived. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/fmi3Functions.h"

enum { PLACES = 60, ELEMENTS = 3, ROOM = 64 };
typedef struct {
  double real[PLACES][ELEMENTS];
  int64_t whole[PLACES][ELEMENTS];
  char text[PLACES][ROOM];
  size_t size[PLACES];
} Echo;

static size_t place(fmi3ValueReference vr) { return (vr / 10 * 2 + vr % 10 / 2) % PLACES; }
static size_t elements(fmi3ValueReference vr) { return vr >= 200 ? ELEMENTS : 1; }
static int length(const Echo *echo) {
  int sum = 0;
  for (size_t i = 0; i < PLACES; i++) {
    if (i % 2 == 1 && echo->size[i]) sum += (int)echo->size[i] + 1000 * (unsigned char)echo->text[i][0];
  }
  return sum;
}

const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                         fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                         fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                         size_t n_intermediate, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
  (void)intermediate, (void)n_intermediate, (void)environment, (void)log, (void)update;
  return calloc(1, sizeof(Echo));
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 d, fmi3Boolean e,
                                       fmi3Float64 f) {
  (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
  return fmi3OK;
}
#define CALL(Name) \
  fmi3Status fmi3##Name(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
CALL(ExitInitializationMode)
CALL(EnterConfigurationMode)
CALL(ExitConfigurationMode)
CALL(Terminate)
CALL(Reset)

#define BOTH(Name, Type, store, Stored, special)                                                              \
  fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const Type value[],       \
                           size_t m) {                                                                        \
    size_t k = 0;                                                                                             \
    for (size_t i = 0; i < n; i++) {                                                                          \
      for (size_t j = 0; j < elements(vr[i]) && k < m; j++) {                                                 \
        ((Echo *)c)->store[place(vr[i])][j] = (Stored)value[k++];                                             \
      }                                                                                                       \
    }                                                                                                         \
    return k == m ? fmi3OK : fmi3Error;                                                                       \
  }                                                                                                           \
  fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t n, Type value[], size_t m) { \
    size_t k = 0;                                                                                             \
    for (size_t i = 0; i < n; i++) {                                                                          \
      for (size_t j = 0; j < elements(vr[i]) && k < m; j++) {                                                 \
        value[k++] = (Type)(special ? length(c) : ((Echo *)c)->store[place(vr[i])][j]);                       \
      }                                                                                                       \
    }                                                                                                         \
    return k == m ? fmi3OK : fmi3Error;                                                                       \
  }
BOTH(Float64, fmi3Float64, real, double, 0)
BOTH(Float32, fmi3Float32, real, double, 0)
BOTH(Int8, fmi3Int8, whole, int64_t, 0)
BOTH(UInt8, fmi3UInt8, whole, int64_t, 0)
BOTH(Int16, fmi3Int16, whole, int64_t, 0)
BOTH(UInt16, fmi3UInt16, whole, int64_t, 0)
BOTH(Int32, fmi3Int32, whole, int64_t, vr[i] == 5)
BOTH(UInt32, fmi3UInt32, whole, int64_t, 0)
BOTH(Int64, fmi3Int64, whole, int64_t, 0)
BOTH(UInt64, fmi3UInt64, whole, int64_t, 0)
BOTH(Boolean, fmi3Boolean, whole, int64_t, 0)

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String value[],
                         size_t m) {
  for (size_t i = 0; i < n && i < m; i++) {
    Echo *const echo = c;
    echo->size[place(vr[i])] = strlen(value[i]);
    strncpy(echo->text[place(vr[i])], value[i], ROOM - 1);
  }
  return fmi3OK;
}
fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) value[i] = ((Echo *)c)->text[place(vr[i])];
  return fmi3OK;
}
fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) {
    Echo *const echo = c;
    echo->size[place(vr[i])] = sizes[i];
    memcpy(echo->text[place(vr[i])], value[i], sizes[i] < ROOM ? sizes[i] : ROOM);
  }
  return fmi3OK;
}
fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                         fmi3Binary value[], size_t m) {
  for (size_t i = 0; i < n && i < m; i++) {
    sizes[i] = ((Echo *)c)->size[place(vr[i])];
    value[i] = (fmi3Binary)((Echo *)c)->text[place(vr[i])];
  }
  return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *reached) {
  (void)c, (void)keep;
  *event = *end = *early = false;
  *reached = time + h;
  return fmi3OK;
}
