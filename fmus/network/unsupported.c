/* What FMI 3.0 has and an FMU on a network does not offer. */
#include <stddef.h>

#include "fmi/fmi3Functions.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  if (log) log(environment, fmi3Error, "logStatusError", "only co-simulation is supported");
  return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
  if (log) log(environment, fmi3Error, "logStatusError", "only co-simulation is supported");
  return NULL;
}

typedef const fmi3ValueReference Vr;
#define NO_VARIABLES(type)                                                                                 \
  fmi3Status fmi3Get##type(fmi3Instance c, Vr vr[], size_t n, fmi3##type value[], size_t nv) {             \
    return n == 0 ? fmi3OK : fmi3Error;                                                                    \
  }                                                                                                        \
  fmi3Status fmi3Set##type(fmi3Instance c, Vr vr[], size_t n, const fmi3##type value[], size_t nv) {       \
    return n == 0 ? fmi3OK : fmi3Error;                                                                    \
  }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(String)

#define UNSUPPORTED(name, ...) \
  fmi3Status name(fmi3Instance c, __VA_ARGS__) { return fmi3Error; }
UNSUPPORTED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference vr, size_t *n)
UNSUPPORTED(fmi3GetVariableDependencies, fmi3ValueReference vr, size_t e[], fmi3ValueReference in[], size_t ei[],
            fmi3DependencyKind kinds[], size_t n)
UNSUPPORTED(fmi3GetDirectionalDerivative, Vr u[], size_t nu, Vr k[], size_t nk, const fmi3Float64 s[], size_t ns,
            fmi3Float64 r[], size_t nr)
UNSUPPORTED(fmi3GetAdjointDerivative, Vr u[], size_t nu, Vr k[], size_t nk, const fmi3Float64 s[], size_t ns,
            fmi3Float64 r[], size_t nr)
UNSUPPORTED(fmi3GetIntervalDecimal, Vr vr[], size_t n, fmi3Float64 v[], fmi3IntervalQualifier q[])
UNSUPPORTED(fmi3GetIntervalFraction, Vr vr[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier q[])
UNSUPPORTED(fmi3GetShiftDecimal, Vr vr[], size_t n, fmi3Float64 v[])
UNSUPPORTED(fmi3GetShiftFraction, Vr vr[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[])
UNSUPPORTED(fmi3SetIntervalDecimal, Vr vr[], size_t n, const fmi3Float64 v[])
UNSUPPORTED(fmi3SetIntervalFraction, Vr vr[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
UNSUPPORTED(fmi3SetShiftDecimal, Vr vr[], size_t n, const fmi3Float64 v[])
UNSUPPORTED(fmi3SetShiftFraction, Vr vr[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
UNSUPPORTED(fmi3CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *d)
UNSUPPORTED(fmi3SetTime, fmi3Float64 t)
UNSUPPORTED(fmi3SetContinuousStates, const fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetContinuousStateDerivatives, fmi3Float64 d[], size_t n)
UNSUPPORTED(fmi3GetEventIndicators, fmi3Float64 z[], size_t n)
UNSUPPORTED(fmi3GetContinuousStates, fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetNumberOfEventIndicators, size_t *n)
UNSUPPORTED(fmi3GetNumberOfContinuousStates, size_t *n)
UNSUPPORTED(fmi3GetOutputDerivatives, Vr vr[], size_t n, const fmi3Int32 o[], fmi3Float64 v[], size_t nv)
UNSUPPORTED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 t)
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return fmi3Error; }
