/* What the operator's page commands and forces (runtime/hmi/port.py); as seats.h. */
#ifndef SLR_PAGE_H
#define SLR_PAGE_H

#include "scan_layout.h"
#include "slr.h"

/* Decides at `now` [ns], after the seats, and puts into the image what counts of that for which the page asks.
 * `mode`: the core's after the last tick; `others`: a seat or a Modbus client has the right to command. */
SLR_EXPORT void slr_page_receive(SlrPageEnd *p, SlrInput *in, int64_t now, int64_t mode, int64_t others);
/* While nobody asks for anything: says whether a planner is there. */
SLR_EXPORT void slr_page_settle(SlrPageEnd *p, const SlrInput *in, int64_t others);
/* Whether a page commands, or what it commanded is still followed. */
SLR_EXPORT int slr_page_commands(const SlrPageEnd *p);

#endif
