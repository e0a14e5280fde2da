/* The control core on the bus: the state of controller.c. */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include "peer.h"
#include "wire.h"

enum { INBOX = 64 };

typedef struct {
  int64_t cycle; /* the next one */
  int64_t followed, count;
  SlrFrame inbox[INBOX];
  SlrWire wire;
  int64_t peer[PEER_WORDS]; /* the other end, of plain signals */
  int64_t core[SLR_EXTRA];
} NwState;

#endif
