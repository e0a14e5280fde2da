/* Frames through wire, control core and wire again, and which edges that took: edge_runner LIBRARY < cases > edges.
 *
 * A case is as wire_runner.c has it, from a core and a wire that are new.  After each the numbers of the edges that no
 * case before it took are written: how many, then each (uint32).  LIBRARY is compiled with -fsanitize-coverage=trace-pc,
 * which calls us at every basic block.
 */
#define _GNU_SOURCE
#include <dlfcn.h>

#include "slr.h"
#include "turn.h"

#define EDGES (1u << 18)

typedef void ResetCore(SlrState *);
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

static void turn(SlrWire *w, SlrState *state, const int64_t head[3]) {
  Turn t = turn_begun(head[2]);
  receive(w, t.frames, (int)head[2], head[0], head[1], t.in);
  t.in->tick = head[0];
  t.in->flags = (uint32_t)w->flags;
  step(t.in, state, head[0], t.out);
  send_due(w, t.out, head[0], t.due);
  turn_ended(&t);
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
