/* Frames through a library's wire.c: wire_runner LIBRARY < cases > images.
 *
 * A case is a number of ticks; a tick is its number, the time, a number of frames, and the frames, each copied to
 * memory of its own size, so that a sanitizer sees what is read past it.
 */
#include <dlfcn.h>
#include <string.h>

#include "turn.h"

static Receive *receive;
static Send *send_due;

/* What comes is sent as it is, too: any bits as values. */
static void turn(SlrWire *w, const int64_t head[3]) {
  Turn t = turn_begun(head[2]);
  receive(w, t.frames, (int)head[2], head[0], head[1], t.in);
  fwrite(t.in, sizeof *t.in, 1, stdout);
  memcpy(t.out->value, t.frames, t.bytes < sizeof t.out->value ? t.bytes : sizeof t.out->value);
  send_due(w, t.out, head[0], t.due);
  turn_ended(&t);
}

int main(int argc, char **argv) {
  void *library = argc > 1 ? dlopen(argv[1], RTLD_NOW) : NULL;
  int64_t ticks, head[3];
  if (!library) return 1;
  receive = (Receive *)dlsym(library, "slr_wire_receive");
  send_due = (Send *)dlsym(library, "slr_wire_send");
  SlrWire *w = malloc(((Size *)dlsym(library, "slr_wire_size"))());
  while (fread(&ticks, sizeof ticks, 1, stdin) == 1) {
    ((ResetWire *)dlsym(library, "slr_wire_reset"))(w);
    for (; ticks > 0; ticks--) {
      if (fread(head, sizeof head, 1, stdin) != 1) return 1;
      turn(w, head);
    }
  }
  free(w);
  return 0;
}
