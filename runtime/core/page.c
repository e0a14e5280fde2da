#include "page.h"

#include <string.h>

#include "memory.h"
#include "seats.h"

enum { FIRST = SLR_SCAN_FIRST_TARGET, COUNT = SLR_SCAN_TARGETS };
enum { NOBODY = SLR_SCAN_NOBODY, PLANNER = SLR_SCAN_PLANNER, PAGE = SLR_SCAN_PAGE };

static int is_asked(const SlrPageEnd *p) { return p->newest.targets.owner || p->newest.force_number; }

static void take(SlrPageEnd *p) {
  SlrHmi newest; /* not at once into its place: what cannot be read whole leaves the last one */
  const int64_t number = slr_cell_number(&p->asked) == p->taken ? 0 : slr_cell_read(&p->asked, &newest);
  if (!number) return;
  p->taken = number;
  p->newest = newest;
  p->quiet = p->quiet && !is_asked(p);
}

/* Others are told what has changed only. */
static void tell(SlrPageEnd *p, SlrGrant next) {
  if (!memcmp(&next, &p->granted, sizeof next)) return;
  p->granted = next;
  const SlrPart part = {&p->granted, sizeof p->granted};
  slr_cell_write(&p->grant, &part, 1);
}

static int is_alive(const SlrPageEnd *p, int64_t now) {
  const SlrTargets *asked = &p->newest.targets;
  const int beats = asked->heartbeat_ns <= now && slr_ticks_since(asked->heartbeat_ns, now) < p->late;
  return asked->owner && asked->owner != p->ended && beats;
}

/* Nobody who is alive is displaced.  When the page's right ends while its targets are followed, nothing counts until
 * automatic operation has ended, lest others slip in. */
static SlrGrant decided(SlrPageEnd *p, const SlrInput *in, int64_t now, int64_t mode, int64_t others) {
  SlrGrant next = p->granted;
  const uint32_t owner = p->newest.targets.owner;
  const int alive = is_alive(p, now);
  if (next.writer == PAGE && !(alive && owner == next.owner)) {
    p->ended = next.owner;
    p->draining = 1;
    next.writer = NOBODY;
  }
  p->draining = p->draining && slr_follows(mode);
  if (next.writer != PAGE) {
    const int other = others || slr_is_planned(in, p->late);
    next.writer = other ? PLANNER : alive && !p->draining ? PAGE : NOBODY;
  }
  next.owner = next.writer == PAGE ? owner : 0;
  return next;
}

static void command(SlrPageEnd *p, SlrInput *in, int64_t now, int64_t mode, int64_t others) {
  const SlrTargets *asked = &p->newest.targets;
  tell(p, decided(p, in, now, mode, others));
  const int writes = p->granted.writer == PAGE;
  if (writes && asked->commits)
    slr_put(in, FIRST, COUNT, asked->value, slr_ticks_since(asked->heartbeat_ns, now), SLR_STATUS_OK);
  else if (writes || p->draining)
    slr_put_none(in, FIRST, COUNT);
}

static void put_forced(const SlrHmi *asked, SlrInput *in) {
  for (int i = 0; i < SLR_IN_COUNT; i++) {
    if (!asked->forced[i] || !slr_is_forceable(i)) continue;
    slr_put(in, i, 1, asked->value + i, 0, SLR_STATUS_FORCED);
  }
}

static void force(SlrPageEnd *p, SlrInput *in, int64_t now, int64_t mode) {
  const uint32_t number = p->newest.force_number;
  SlrGrant next = p->granted;
  if (!number && !next.forcing) return;
  const int stale = now - p->newest.targets.stamp_ns > p->late * SLR_SCAN_PERIOD_NS;
  const int ended = number && (number == next.force_ended || stale || mode != SLR_MODE_STANDBY);
  next.forcing = ended ? 0 : number;
  if (ended) next.force_ended = number; /* it does not come back with STANDBY: a new one must be asked for */
  tell(p, next);
  if (!ended) put_forced(&p->newest, in);
}

int slr_page_commands(const SlrPageEnd *p) { return p->granted.writer == PAGE || p->draining; }

void slr_page_receive(SlrPageEnd *p, SlrInput *in, int64_t now, int64_t mode, int64_t others) {
  for (int i = 0; i < SLR_SCAN_HEARD; i++) p->frames[i] += in->age[p->heard[i]] == 0;
  take(p);
  if (p->quiet) return;
  command(p, in, now, mode, others);
  force(p, in, now, mode);
  p->quiet = !(slr_page_commands(p) || p->granted.forcing || is_asked(p));
}

void slr_page_settle(SlrPageEnd *p, const SlrInput *in, int64_t others) {
  SlrGrant next = p->granted;
  if (!p->quiet) return;
  next.writer = others || slr_is_planned(in, p->late) ? PLANNER : NOBODY;
  tell(p, next);
}
