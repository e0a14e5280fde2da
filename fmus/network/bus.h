/* A CAN bus: the state of bus.c. */
#ifndef NW_BUS_H
#define NW_BUS_H

enum { BUS_QUEUE = 64, BUS_FLYING = 64 };

typedef struct {
  NwFrame frame;
  int64_t since; /* ns: when it came */
} BusQueued;

/* What a node has told, and what it waits to send, in the order in which it came. */
typedef struct {
  BusQueued queue[BUS_QUEUE];
  int32_t queued, discards, off, pad;
  int64_t baudrate; /* 0: none told */
} BusNode;

/* A frame that was sent and is on its way to the others. */
typedef struct {
  NwFrame frame;
  int32_t from, pad;
  int64_t at;
} BusFlying;

typedef struct {
  BusNode node[NW_PORTS];
  BusFlying flying[BUS_FLYING];
  int32_t n_flying, sender; /* of the frame on the wire; -1: none */
  int32_t place, pad;       /* in its queue */
  int64_t begun, ends, idle, busy;
  int64_t rate;             /* bit/s */
  uint64_t random;
} NwState;

#endif
