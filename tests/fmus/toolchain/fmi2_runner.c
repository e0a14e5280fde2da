/* Loads an FMI 2.0 co-simulation library, drives its inputs with a fixed pattern and prints every output
 * after every step as bits: runner LIBRARY GUID STEPS N_IN VR... N_OUT VR...   A test helper. */
#include <dlfcn.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

static void quiet(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c, fmi2String m, ...) {
  va_list arguments;
  (void)e, (void)n, (void)s, (void)c;
  va_start(arguments, m);
  vfprintf(stderr, m, arguments);
  va_end(arguments);
}

#define LOAD(name)                                          \
  name##TYPE *name = (name##TYPE *)dlsym(library, #name);   \
  if (!name) return fprintf(stderr, "no " #name "\n"), 1

int main(int argc, char **argv) {
  const fmi2CallbackFunctions callbacks = {quiet, calloc, free, NULL, NULL};
  void *library = dlopen(argv[1], RTLD_NOW);
  int k = 4;
  if (!library) return fprintf(stderr, "%s\n", dlerror()), 1;
  LOAD(fmi2Instantiate);
  LOAD(fmi2SetupExperiment);
  LOAD(fmi2EnterInitializationMode);
  LOAD(fmi2ExitInitializationMode);
  LOAD(fmi2SetReal);
  LOAD(fmi2GetReal);
  LOAD(fmi2DoStep);
  LOAD(fmi2FreeInstance);
  fmi2Component c = fmi2Instantiate("runner", fmi2CoSimulation, argv[2], "", &callbacks, fmi2False, fmi2False);
  fmi2ValueReference in[64], out[512];
  int n_in = 0, n_out = 0;
  for (n_in = 0; n_in < atoi(argv[4]); n_in++) in[n_in] = (fmi2ValueReference)atoi(argv[++k]);
  for (k++; k + n_out + 1 < argc; n_out++) out[n_out] = (fmi2ValueReference)atoi(argv[k + n_out + 1]);
  if (!c || fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) || fmi2EnterInitializationMode(c)) return 1;
  if (fmi2ExitInitializationMode(c)) return 1;
  for (int step = 0; step < atoi(argv[3]); step++) {
    for (int i = 0; i < n_in; i++) { /* a pattern without libm: a triangle of its own period for each input */
      const int period = 40 + 14 * i, phase = step % period;
      const double value = (phase < period / 2 ? phase : period - phase) / (double)period * 2.0 - 0.5;
      if (fmi2SetReal(c, &in[i], 1, &value)) return 1;
    }
    if (fmi2DoStep(c, step * 0.02, 0.02, fmi2True)) return 1;
    for (int i = 0; i < n_out; i++) {
      double value;
      uint64_t bits;
      if (fmi2GetReal(c, &out[i], 1, &value)) return 1;
      memcpy(&bits, &value, sizeof bits);
      printf("%016" PRIx64 "%c", bits, i + 1 < n_out ? ' ' : '\n');
    }
  }
  fmi2FreeInstance(c);
  return argc > 0 ? 0 : 1;
}
