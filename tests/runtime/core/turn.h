/* What a tick of a fuzzed case takes, for wire_runner.c and edge_runner.c. */
#include <stdio.h>
#include <stdlib.h>

#include "wire.h"

typedef size_t Size(void);
typedef void ResetWire(SlrWire *);
typedef void Receive(SlrWire *, const SlrFrame *, int, int64_t, int64_t, SlrInput *);
typedef int Send(SlrWire *, const SlrOutput *, int64_t, SlrFrame *);

/* Every array in memory of its own size, so that a sanitizer sees what is read past it. */
typedef struct {
  size_t bytes;
  SlrFrame *frames, *due;
  SlrInput *in;
  SlrOutput *out;
} Turn;

/* Memory for a tick, and its frames from the input. */
static Turn turn_begun(int64_t count) {
  Turn t = {.bytes = (size_t)count * sizeof(SlrFrame)};
  t.frames = malloc(t.bytes + 1);
  t.due = malloc(SLR_WIRE_OUT_MESSAGES * sizeof *t.due);
  t.in = calloc(1, sizeof *t.in);
  t.out = calloc(1, sizeof *t.out);
  if (fread(t.frames, 1, t.bytes, stdin) != t.bytes) exit(1);
  return t;
}

static void turn_ended(Turn *t) {
  free(t->due);
  free(t->out);
  free(t->in);
  free(t->frames);
}
