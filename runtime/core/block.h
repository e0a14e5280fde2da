/* A controller's equations as the core runs them: the code of its FMU, behind one interface for all.
 *
 * A board is an array of doubles: the usable input signals (SLR_IN_...), then the core's own signals
 * (SLR_OWN(SLR_OUT_...)).  A block reads its inputs from it and writes its outputs to it.
 */
#ifndef SLR_BLOCK_H
#define SLR_BLOCK_H

#include <stddef.h>

#include "image_layout.h"

#define SLR_OWN(output) (SLR_IN_COUNT + (output))
enum { SLR_BOARD = SLR_IN_COUNT + SLR_OUT_COUNT };

typedef struct {
  const char *name;
  int period; /* base ticks between its steps */
  int n_inputs;
  const int *inputs; /* places on the board */
  size_t size;       /* of its state: values only, a whole number of 8 bytes */
  void (*initialise)(void *state, double *board); /* its first outputs are on the board then */
  int (*step)(void *state, double *board);        /* 0, or -1: a state is not finite */
} SlrBlock;

#endif
