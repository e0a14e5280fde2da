/* Everybody on the controller's bus but the controller: machine, IMUs, operator and planner in one.
 *
 * The very code with which the controller reads and sends its frames (runtime/core/wire.c), by tables in which what
 * the controller sends is read and what it reads is sent. Plain values, PEER_WORDS of 8 bytes. */
#ifndef PEER_H
#define PEER_H

#include <stdint.h>

#include "operations.h"

enum { PEER_WORDS = 320, PEER_FRAMES = 32 };

void peer_reset(void *peer);
/* The frames of a tick of 20 ms; `values`: of the controller's inputs in their order. How many. */
int peer_send(void *peer, const double *values, int64_t tick, NwFrame *frames);
/* Frames of the controller that came by `tick`; then the age of all is that of `tick`. */
void peer_receive(void *peer, const NwFrame *frames, int count, int64_t tick);
/* The last right value of one of the controller's outputs, and whether it is still to be relied on. */
double peer_value(const void *peer, int output);
int peer_right(const void *peer, int output);

#endif
