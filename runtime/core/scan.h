/* A cycle of the control process in one call: image in, core, gate, image out, the recorder's queue.  Linux only.
 *
 * No allocation, no lock; nothing waits but for the deadline.  runtime/scan.py says the same in Python, with the ports
 * of runtime/can, runtime/canopen, runtime/modbus, runtime/hmi, runtime/interfaces and the feed of runtime/recorder;
 * tests/runtime/test_native_scan.py holds one to the other.  Part of a bundle's library, not of the core.
 */
#ifndef SLR_SCAN_H
#define SLR_SCAN_H

#include "scan_layout.h"
#include "slr.h"

/* Counts of times, as runtime/statistics.py has them. */
typedef struct {
  int64_t unit; /* ns */
  int64_t count;
  int64_t largest; /* ns */
  int64_t coarse[SLR_SCAN_TIMES_COARSE]; /* bin k: below 2^k units */
  int64_t bins[SLR_SCAN_TIMES_TOP + 1];  
} SlrTimes;

/* What Python has to do before the cycle goes on. */
enum {
  SLR_ATTEND_ALWAYS = 1, /* SlrScan.attends */
  SLR_ATTEND_BUS = 2,    /* a bus is gone: join it again */
};

SLR_EXPORT const char *slr_scan_layout(void);
SLR_EXPORT size_t slr_scan_size(void);
/* Before the first cycle. */
SLR_EXPORT void slr_scan_prepare(void);
/* The cycle of a tick that is due at `deadline` [ns]; 0, or SLR_ATTEND_...: then Python does that, and calls
 * slr_scan_rest. */
SLR_EXPORT int64_t slr_scan(SlrScan *s, int64_t tick, int64_t deadline);
SLR_EXPORT void slr_scan_rest(SlrScan *s);
/* Who made a tick late that ended at `end`, after `used` ns of processor time and, if so, a wait of its own will: a
 * part of slr_scan_rest. */
SLR_EXPORT void slr_scan_account(SlrScan *s, int64_t end, int64_t used, int64_t own_wait);

#endif
