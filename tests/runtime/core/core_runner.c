/* Runs a control core over recorded input images: core_runner LIBRARY [EVERY [from]] < inputs > answers.
 *
 * Answers are the outputs and the last state; with EVERY the state also before every tick that EVERY divides.
 * `from`: the input begins with a state to go on from.
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#include "slr.h"

typedef size_t Size(void);
typedef const char *Text(void);
typedef void Reset(SlrState *);
typedef void Restart(SlrState *, int32_t, int32_t, double);
typedef int Observe(const SlrInput *, const SlrState *, double *);
typedef void Ladder(const SlrInput *, const SlrState *, int64_t *);
typedef void Limit(SlrState *, const double *);
typedef void Step(const SlrInput *, SlrState *, int64_t, SlrOutput *);

int main(int argc, char **argv) {
  void *library = argc > 1 ? dlopen(argv[1], RTLD_NOW) : NULL;
  if (!library) {
    fprintf(stderr, "%s\n", argc > 1 ? dlerror() : "which library?");
    return 1;
  }
  Size *size = (Size *)dlsym(library, "slr_state_size");
  Reset *reset = (Reset *)dlsym(library, "slr_reset");
  Step *step = (Step *)dlsym(library, "slr_step");
  Text *layout = (Text *)dlsym(library, "slr_layout"), *identity = (Text *)dlsym(library, "slr_identity");
  Size *in_size = (Size *)dlsym(library, "slr_input_size"), *out_size = (Size *)dlsym(library, "slr_output_size");
  fprintf(stderr, "core %s, images %s\n", identity(), layout());
  if (in_size() != sizeof(SlrInput) || out_size() != sizeof(SlrOutput)) {
    fprintf(stderr, "other images than this program's\n");
    return 1;
  }
  SlrState *state = malloc(size());
  Observe *observe = (Observe *)dlsym(library, "slr_observe");
  Ladder *ladder = (Ladder *)dlsym(library, "slr_ladder");
  double board[SLR_BOARD];
  int64_t told[SLR_LADDER];
  SlrInput in;
  SlrOutput out;
  Limit *limit = (Limit *)dlsym(library, "slr_limit");
  ((Restart *)dlsym(library, "slr_restart"))(state, SLR_FAULT_EMERGENCY_STOP, 0, 1.0); /* nothing is left of it */
  reset(state);
  limit(state, (double[SLR_AUTHORITY]){1.0, 1.0, 1.0, 1.0, 1.0}); /* all, as after a reset */
  const int64_t every = argc > 2 ? atoll(argv[2]) : 0;
  if (argc > 3 && fread(state, size(), 1, stdin) != 1) return 1;
  while (fread(&in, sizeof in, 1, stdin) == 1) {
    if (every > 0 && in.tick % every == 0) fwrite(state, size(), 1, stdout);
    observe(&in, state, board); /* leaves the state as it is */
    step(&in, state, in.tick, &out);
    ladder(&in, state, told); /* likewise */
    fwrite(&out, sizeof out, 1, stdout);
  }
  fwrite(state, size(), 1, stdout);
  free(state);
  return 0;
}
