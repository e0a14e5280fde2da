/* The end of a CAN bus: many frames with one call, in and out; nothing waits.  Linux only. */
#ifndef SLR_BUS_H
#define SLR_BUS_H

#include "scan_layout.h"

/* ns of CLOCK_MONOTONIC, of the time of day, and of this thread's processor time. */
int64_t slr_now(void);
int64_t slr_day(void);
int64_t slr_cpu(void);
/* Before the frames of a tick are taken. */
void slr_bus_begin(SlrBusEnd *bus);
/* Takes what waits behind the frames that are in `came` already; how many, or -1 if the bus is gone. */
int slr_bus_take(SlrBusEnd *bus);
/* Sends the first `count` frames of `going`; those for which there is no room are dropped and counted. */
void slr_bus_give(SlrBusEnd *bus, int count);

#endif
