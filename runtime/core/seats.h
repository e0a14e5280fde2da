/* Who commands over OPC UA or ROS 2 (runtime/interfaces/port.py).  The cycle calls this in every tick, in C (scan.c)
 * and in Python; no clock, and not part of the core. */
#ifndef SLR_SEATS_H
#define SLR_SEATS_H

#include "scan_layout.h"
#include "slr.h"

SLR_EXPORT const char *slr_seats_layout(void);
SLR_EXPORT size_t slr_seats_size(void); /* of SlrSeats and SlrPageEnd */
/* Before anything else. */
SLR_EXPORT void slr_seats_prepare(void);
/* Decides at `now` [ns], and puts into the image the targets of the seat that has the right, as old as its client's
 * last sign of life.  `mode`: the core's after the last tick; `others`: the page commands, or a Modbus client has the
 * right to. */
SLR_EXPORT void slr_seats_receive(SlrSeats *s, SlrInput *in, int64_t now, int64_t mode, int64_t others);

/* ---- what the page's decision (page.c) and the cycle (exchange.c) need, too ---- */

/* Values of inputs that lie side by side. */
void slr_put(SlrInput *in, int first, int count, const double *value, int64_t age, SlrStatus status);
void slr_put_none(SlrInput *in, int first, int count);
int64_t slr_ticks_since(int64_t then, int64_t now);
/* Whether a planner is alive, over CAN or Modbus; `late`: ticks. */
int slr_is_planned(const SlrInput *in, int64_t late);
/* Whether the core goes after targets. */
int slr_follows(int64_t mode);

#endif
