/* Frames through wire, control core and wire again, and which edges that took: edge_runner LIBRARY < cases > edges.
 *
 * A case is as wire_runner.c has it, from a core and a wire that are new.  After each the numbers of the edges that no
 * case before it took are written: how many, then each (uint32).  LIBRARY is compiled with -fsanitize-coverage=trace-pc,
 * which calls us at every basic block.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

#include "slr.h"
#include "wire.h"

#define EDGES (1u << 18)

typedef size_t Size(void);
typedef void ResetWire(SlrWire *);
typedef void ResetCore(SlrState *);
typedef void Receive(SlrWire *, const SlrFrame *, int, int64_t, int64_t, SlrInput *);
typedef int Send(SlrWire *, const SlrOutput *, int64_t, SlrFrame *);
typedef void Step(const SlrInput *, SlrState *, int64_t, SlrOutput *);

static uintptr_t base, before;
static unsigned char seen[EDGES];
static uint32_t found[EDGES], count;

__attribute__((visibility("default"))) void __sanitizer_cov_trace_pc(void);

void __sanitizer_cov_trace_pc(void) {
  const uintptr_t at = (uintptr_t)__builtin_return_address(0) - base;
  const uint32_t edge = (uint32_t)((at * 0x9E3779B1u) ^ before) % EDGES;
  before = (at * 0x9E3779B1u) >> 1;
  if (seen[edge]) return;
  seen[edge] = 1;
  found[count++] = edge;
}

static Receive *receive;
static Send *send_due;
static Step *step;

/* Every array in memory of its own size, so that a sanitizer sees what is read past it. */
static void turn(SlrWire *w, SlrState *state, const int64_t head[3]) {
  const size_t bytes = (size_t)head[2] * sizeof(SlrFrame);
  SlrFrame *frames = malloc(bytes + 1), *due = malloc(SLR_WIRE_OUT_MESSAGES * sizeof *due);
  SlrInput *in = calloc(1, sizeof *in);
  SlrOutput *out = calloc(1, sizeof *out);
  if (fread(frames, 1, bytes, stdin) != bytes) exit(1);
  receive(w, frames, (int)head[2], head[0], head[1], in);
  in->tick = head[0];
  in->flags = (uint32_t)w->flags;
  step(in, state, head[0], out);
  send_due(w, out, head[0], due);
  free(due);
  free(out);
  free(in);
  free(frames);
}

int main(int argc, char **argv) {
  void *library = argc > 1 ? dlopen(argv[1], RTLD_NOW) : NULL;
  int64_t ticks, head[3];
  Dl_info where;
  if (!library) {
    fprintf(stderr, "%s\n", argc > 1 ? dlerror() : "which library?");
    return 1;
  }
  receive = (Receive *)dlsym(library, "slr_wire_receive");
  send_due = (Send *)dlsym(library, "slr_wire_send");
  step = (Step *)dlsym(library, "slr_step");
  if (!dladdr((void *)step, &where)) return 1;
  base = (uintptr_t)where.dli_fbase;
  SlrWire *w = malloc(((Size *)dlsym(library, "slr_wire_size"))());
  SlrState *state = malloc(((Size *)dlsym(library, "slr_state_size"))());
  while (fread(&ticks, sizeof ticks, 1, stdin) == 1) {
    count = 0;
    before = 0;
    ((ResetWire *)dlsym(library, "slr_wire_reset"))(w);
    ((ResetCore *)dlsym(library, "slr_reset"))(state);
    for (; ticks > 0; ticks--) {
      if (fread(head, sizeof head, 1, stdin) != 1) return 1;
      turn(w, state, head);
    }
    fwrite(&count, sizeof count, 1, stdout);
    fwrite(found, sizeof found[0], count, stdout);
    fflush(stdout);
  }
  free(state);
  free(w);
  return 0;
}
