/* The machine's end of the bus: the state of machine_io.c. */
#ifndef MACHINE_IO_H
#define MACHINE_IO_H

#include "peer.h"

typedef struct {
  int64_t beat; /* the next one */
  int64_t followed;
  int64_t peer[PEER_WORDS];
} NwState;

#endif
