/* What a cycle exchanges with other processes of the runtime, through shared memory: parts of scan.c. */
#ifndef SLR_EXCHANGE_H
#define SLR_EXCHANGE_H

#include "memory.h"
#include "scan.h"

/* The planner's targets into the input image; whether it is there. */
void slr_hear_planner(SlrPlanner *p, SlrInput *in, int64_t now);
/* Commands of a policy outside into the input image. */
void slr_hear_outside(SlrOutside *o, SlrInput *in, int64_t now);
/* Both images, for whoever looks. */
void slr_show_images(const SlrPlanner *p, const SlrInput *in, const SlrOutput *out, int64_t now);

/* Who commands at the seats and the page, and what is forced. */
void slr_decide(SlrScan *s);
uint32_t slr_page_flags(const SlrScan *s);
/* Everything for the page, if it is time. */
void slr_show_page(SlrScan *s);

/* Whether the process at the other end of a queue has not worked for a second. */
int slr_is_lost(SlrWatch *w, const SlrRingEnd *ring, int64_t tick);
uint32_t slr_retain_flags(SlrPublished *p, int64_t tick);
void slr_publish(SlrScan *s);

uint32_t slr_record_flags(SlrRecord *r, int64_t tick);
/* Before the step: keep the state if a snapshot is due. */
void slr_keep_state(SlrScan *s);
void slr_record(SlrScan *s, int64_t latency);

#endif
