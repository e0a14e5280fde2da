/* Frames of the CAN bus into the input image and out of the output image: no socket, no clock.
 *
 * What the control process does in every tick, by the tables of wire_layout.h; runtime/can/receive.py and
 * transmit.py say the same in Python, and a test holds one to the other.  Part of a bundle's library, not of the
 * core: its state is no part of a snapshot, for a recording begins with the input image.
 */
#ifndef SLR_WIRE_H
#define SLR_WIRE_H

#include "slr.h"
#include "wire_layout.h"

/* As between a node and the local bus; the first 16 bytes are Linux's struct can_frame. */
typedef struct {
  uint32_t identifier; /* with its flags */
  uint8_t length;
  uint8_t pad[3];
  uint8_t data[8];
  int64_t stamp; /* ns, monotonic: when it came */
} SlrFrame;

/* What a bus says of itself. */
typedef struct {
  int64_t passive;
  int64_t off;
  int64_t was_off; /* in this tick, if only for a moment */
  int64_t lost;    /* times that frames for us were lost */
} SlrBus;

typedef struct {
  int64_t stamp;   /* ns: of the last right frame of the message that latency is counted from; 0: none */
  int64_t flags;   /* SLR_FLAG_BUS_PASSIVE, SLR_FLAG_BUS_OFF: of this tick */
  SlrBus bus;
  int64_t wrong;   /* frames refused */
  int64_t ours;    /* frames that only we send, and did not */
  int64_t remote;  /* remote frames: they ask for data and have none */
  int64_t ignored[SLR_WIRE_IN_MESSAGES]; /* messages that something else stands for */
  int64_t count[SLR_WIRE_IN_MESSAGES];   /* last counter; -1: none */
  int64_t tick[SLR_WIRE_IN_MESSAGES];    /* of the last right frame */
  int64_t refused[SLR_WIRE_IN_MESSAGES];  /* frames refused so far, repeated ones among them */
  int64_t repeated[SLR_WIRE_IN_MESSAGES]; /* right but for their counter: one that came already */
  int64_t doubt[SLR_WIRE_IN_MESSAGES];    /* that only one node sends the message: see doubt_after */
  int64_t fresh[SLR_WIRE_IN_MESSAGES];    /* a right frame came since the last one with a wrong counter */
  int64_t next[SLR_WIRE_OUT_MESSAGES];   /* next counter */
  int64_t came[SLR_IN_COUNT];            /* tick in which the value came; negative: never */
  int64_t status[SLR_IN_COUNT];
  double value[SLR_IN_COUNT];
} SlrWire;

void slr_bus_error(SlrBus *bus, const SlrFrame *frame); /* an error frame came */
SLR_EXPORT const char *slr_wire_layout(void);
SLR_EXPORT size_t slr_wire_size(void);
SLR_EXPORT void slr_wire_reset(SlrWire *w);
/* Take `count` frames that came until `now` [ns], and put all values, ages and status into the image of `tick`. */
SLR_EXPORT void slr_wire_receive(SlrWire *w, const SlrFrame *frames, int count, int64_t tick, int64_t now,
                                 SlrInput *in);
/* The frames that are due in `tick`, at most SLR_WIRE_OUT_MESSAGES, the most urgent first; how many. */
SLR_EXPORT int slr_wire_send(SlrWire *w, const SlrOutput *out, int64_t tick, SlrFrame *frames);

#endif
