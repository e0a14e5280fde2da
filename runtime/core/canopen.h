/* PDOs of CANopen devices into the input image and out of the output image: no socket, no clock.
 *
 * Who a device is and how it is set up is another process's work (runtime/canopen/process.py).  It says by a number that
 * a device is `accepted`; that number holds until the device is lost, or starts anew.  Part of a bundle's library, not of
 * the core: its state is no part of a snapshot.
 */
#ifndef SLR_CANOPEN_H
#define SLR_CANOPEN_H

#include "canopen_layout.h"
#include "wire.h"

typedef struct {
  int64_t stamp; /* ns: of the last PDO of the signal that latency is counted from; 0: none */
  int64_t flags; /* SLR_FLAG_BUS_PASSIVE, SLR_FLAG_BUS_OFF, SLR_FLAG_OTHER_CONTROLLER: of this tick */
  SlrBus bus;
  int64_t wrong; /* PDOs that are too short */
  int64_t ours;  /* SYNCs and PDOs that only we send, and did not */
  int64_t accepted[SLR_CANOPEN_NODES]; /* as the other process says; 0: not */
  int64_t spent[SLR_CANOPEN_NODES];    /* the number that holds no more */
  int64_t state[SLR_CANOPEN_NODES];    /* of the last heartbeat */
  int64_t beat[SLR_CANOPEN_NODES];     /* tick of the last heartbeat; negative: never */
  int64_t error[SLR_CANOPEN_NODES];    /* emergency code that is not over; 0: none */
  int64_t doubt[SLR_CANOPEN_IN_PDOS];  /* that only one device sends the PDO: see doubt_after */
  int64_t heard[SLR_CANOPEN_IN_PDOS];  /* tick of the last one */
  int64_t came[SLR_IN_COUNT];          /* tick of the last PDO; negative: never */
  double value[SLR_IN_COUNT];
} SlrCanopen;

SLR_EXPORT const char *slr_canopen_layout(void);
SLR_EXPORT size_t slr_canopen_size(void);
SLR_EXPORT void slr_canopen_reset(SlrCanopen *c);
/* Take `count` frames that came until `now` [ns], and put the devices' signals into the image of `tick`. */
SLR_EXPORT void slr_canopen_receive(SlrCanopen *c, const SlrFrame *frames, int count, int64_t tick, int64_t now,
                                    SlrInput *in);
/* SYNC, then the PDOs of the devices that are there, at most 1 + SLR_CANOPEN_OUT_PDOS; how many. */
SLR_EXPORT int slr_canopen_send(const SlrCanopen *c, const SlrOutput *out, int64_t tick, SlrFrame *frames);

#endif
