/* Frames through a library's wire.c: wire_runner LIBRARY < cases > images.
 *
 * A case is a number of ticks; a tick is its number, the time, a number of frames, and the frames, each copied to
 * memory of its own size, so that a sanitizer sees what is read past it.
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wire.h"

typedef size_t Size(void);
typedef void Reset(SlrWire *);
typedef void Receive(SlrWire *, const SlrFrame *, int, int64_t, int64_t, SlrInput *);
typedef int Send(SlrWire *, const SlrOutput *, int64_t, SlrFrame *);

static Receive *receive;
static Send *send_due;

/* What comes is sent as it is, too: any bits as values. */
static void turn(SlrWire *w, const int64_t head[3]) {
  const size_t bytes = (size_t)head[2] * sizeof(SlrFrame);
  SlrFrame *frames = malloc(bytes + 1);
  SlrInput *in = calloc(1, sizeof *in);
  SlrOutput *out = calloc(1, sizeof *out);
  SlrFrame *due = malloc(SLR_WIRE_OUT_MESSAGES * sizeof *due);
  if (fread(frames, 1, bytes, stdin) != bytes) exit(1);
  receive(w, frames, (int)head[2], head[0], head[1], in);
  fwrite(in, sizeof *in, 1, stdout);
  memcpy(out->value, frames, bytes < sizeof out->value ? bytes : sizeof out->value);
  send_due(w, out, head[0], due);
  free(due);
  free(out);
  free(in);
  free(frames);
}

int main(int argc, char **argv) {
  void *library = argc > 1 ? dlopen(argv[1], RTLD_NOW) : NULL;
  int64_t ticks, head[3];
  if (!library) return 1;
  receive = (Receive *)dlsym(library, "slr_wire_receive");
  send_due = (Send *)dlsym(library, "slr_wire_send");
  SlrWire *w = malloc(((Size *)dlsym(library, "slr_wire_size"))());
  while (fread(&ticks, sizeof ticks, 1, stdin) == 1) {
    ((Reset *)dlsym(library, "slr_wire_reset"))(w);
    for (; ticks > 0; ticks--) {
      if (fread(head, sizeof head, 1, stdin) != 1) return 1;
      turn(w, head);
    }
  }
  free(w);
  return 0;
}
