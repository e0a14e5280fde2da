#include "exchange.h"

#include <math.h> /* NAN: no function of it */
#include <string.h>

#include "bus.h"
#include "page.h"
#include "seats.h"

#if defined(__linux__)
enum { FIRST = SLR_SCAN_FIRST_TARGET, COMMANDED = SLR_SCAN_FIRST_COMMAND, FRAMES_BYTES = SLR_SCAN_HEARD * 8 };

/* ---- the planner (runtime/modbus/port.py) ---- */

/* What one writer began no other one goes on with, however quickly they follow each other: for one tick there is no
 * target, and automatic operation ends.  Whether the writer is another one. */
static int take_targets(SlrPlanner *p) {
  SlrTargets newest;
  const int64_t number = slr_cell_number(&p->targets) == p->seen ? 0 : slr_cell_read(&p->targets, &newest);
  if (!number) return 0;
  const int handed_over = p->commits && p->owner != newest.owner;
  p->seen = number;
  p->stamp = newest.stamp_ns, p->heartbeat = newest.heartbeat_ns;
  p->commits = newest.commits, p->owner = newest.owner;
  memcpy(p->value, newest.value, sizeof p->value);
  return handed_over;
}

void slr_hear_planner(SlrPlanner *p, SlrInput *in, int64_t now) {
  const int handed_over = take_targets(p);
  p->lost = now - (p->stamp ? p->stamp : p->started) > p->late * SLR_SCAN_PERIOD_NS;
  if (!p->commits || !p->heartbeat || handed_over) {
    slr_put_none(in, FIRST, SLR_SCAN_TARGETS);
    return;
  }
  const int64_t age = slr_ticks_since(p->heartbeat, now);
  slr_put(in, FIRST, SLR_SCAN_TARGETS, p->value, age, age >= p->late ? SLR_STATUS_TIMEOUT : SLR_STATUS_OK);
}

/* ---- the policy outside (runtime/interfaces/outside.py) ---- */

/* As with targets, nobody goes on with what another one began: for one tick there are no commands. */
static int take_commands(SlrOutside *o) {
  SlrCommand newest;
  const int64_t number = slr_cell_number(&o->commands) == o->seen ? 0 : slr_cell_read(&o->commands, &newest);
  if (!number) return 0;
  const int handed_over = o->owner && o->owner != newest.owner;
  o->seen = number;
  o->made = newest.made_ns, o->owner = newest.owner;
  memcpy(o->value, newest.value, sizeof o->value);
  return handed_over;
}

void slr_hear_outside(SlrOutside *o, SlrInput *in, int64_t now) {
  const int handed_over = take_commands(o);
  const int64_t age = slr_ticks_since(o->made, now);
  const SlrStatus status = age >= o->late ? SLR_STATUS_TIMEOUT : SLR_STATUS_OK;
  if (!o->owner || handed_over)
    slr_put_none(in, COMMANDED, SLR_SCAN_COMMANDS);
  else
    slr_put(in, COMMANDED, SLR_SCAN_COMMANDS, o->value, age, status);
}

void slr_show_images(const SlrPlanner *p, const SlrInput *in, const SlrOutput *out, int64_t now) {
  const SlrPart parts[] = {{&now, sizeof now}, {in, sizeof *in}, {out, sizeof *out}};
  slr_cell_write(&p->image, parts, 3);
}

/* ---- seats and page (seats.c, page.c) ---- */

static int is_claimed(const SlrPlanner *p) { return p->present && p->owner && !p->lost; }
static int is_seated(const SlrScan *s) { return s->seats && ((const SlrSeats *)s->seats)->who; }

void slr_decide(SlrScan *s) {
  if (!s->seats && !s->page) return;
  const int claimed = is_claimed(&s->planner); /* by a Modbus client that may not have written yet */
  const int64_t now = slr_now(), mode = (int64_t)((const SlrOutput *)s->outputs)->value[SLR_OUT_control_mode];
  if (s->seats) slr_seats_receive(s->seats, s->inputs, now, mode, claimed || (s->page && slr_page_commands(s->page)));
  if (s->page) slr_page_receive(s->page, s->inputs, now, mode, claimed || is_seated(s));
}

uint32_t slr_page_flags(const SlrScan *s) {
  return s->page && ((const SlrPageEnd *)s->page)->granted.forcing ? SLR_FLAG_FORCED : 0;
}

static void write_page(const SlrScan *s) {
  const SlrPageEnd *p = s->page;
  const SlrScanCounts *c = s->counts;
  const SlrTimes *late = s->lateness, *policy = s->policy_work, *other = s->other_work;
  const int64_t worst = other->largest > policy->largest ? other->largest : policy->largest;
  const int64_t unrecorded = s->record.ring.words ? slr_ring_lost(&s->record.ring) : 0;
  const int64_t head[] = {slr_now(), slr_day(), p->granted.writer, p->granted.forcing, c->ticks, c->overruns,
                          c->stolen, c->skipped, unrecorded, late->largest, worst};
  int64_t told[SLR_LADDER];
  slr_ladder(s->inputs, s->core, told);
  const SlrPart parts[] = {{head, sizeof head},
                           {late->coarse, sizeof late->coarse},
                           {policy->coarse, sizeof policy->coarse},
                           {other->coarse, sizeof other->coarse},
                           {p->frames, FRAMES_BYTES},
                           {p->refused, 2 * FRAMES_BYTES},
                           {told, sizeof told},
                           {s->inputs, sizeof(SlrInput)},
                           {s->outputs, sizeof(SlrOutput)}};
  slr_cell_write(&p->seen, parts, sizeof parts / sizeof *parts);
}

void slr_show_page(SlrScan *s) {
  SlrPageEnd *p = s->page;
  const int64_t tick = s->tick.number, every = SLR_SCAN_PAGE_EVERY;
  if (!p || tick < p->next) return;
  const int64_t since = ((tick - SLR_SCAN_PAGE_PHASE) % every + every) % every; /* not 0 where ticks were skipped */
  p->next = tick + every - since;
  slr_page_settle(p, s->inputs, is_claimed(&s->planner) || is_seated(s));
  write_page(s);
}

/* ---- what is published once a second, and kept (runtime/control_process.py: Publisher) ---- */

int slr_is_lost(SlrWatch *w, const SlrRingEnd *ring, int64_t tick) {
  const int64_t beat = slr_ring_beat(ring);
  if (beat != w->beat) w->beat = beat, w->tick = tick;
  return tick - w->tick > SLR_SCAN_DEAD_TICKS;
}

uint32_t slr_retain_flags(SlrPublished *p, int64_t tick) {
  if (!p->retain.words) return 0;
  const int lost = slr_is_lost(&p->watch, &p->retain, tick);
  return lost || slr_ring_note(&p->retain) & SLR_SCAN_SAVE_FAILED ? SLR_FLAG_RETAIN_LOST : 0;
}

static void keep_values(const SlrScan *s) {
  const SlrPublished *p = &s->published;
  const SlrOutput *out = s->outputs;
  const double ticks = (double)((const SlrScanCounts *)s->counts)->ticks;
  double kept[SLR_OUT_COUNT];
  for (int64_t i = 0; i < p->kept; i++) { /* what is not known is not kept */
    const int64_t place = p->places[i];
    kept[i] = out->status[place] == SLR_STATUS_OK ? out->value[place] : NAN;
  }
  const SlrPart parts[] = {{&ticks, sizeof ticks}, {kept, (size_t)p->kept * sizeof *kept}};
  slr_ring_put(&p->retain, SLR_SCAN_VALUES, parts, 2);
}

void slr_publish(SlrScan *s) {
  SlrPublished *p = &s->published;
  const SlrOutput *out = s->outputs;
  const SlrScanCounts *c = s->counts;
  const int64_t tick = s->tick.number, off = out->flags & SLR_FLAG_BUS_OFF;
  if (!p->present || (tick % SLR_SCAN_PUBLISH_EVERY && off == p->off)) return; /* that a bus is gone is said at once */
  p->off = off;
  const int64_t counts[] = {c->ticks, c->overruns, c->stolen, c->skipped, c->flags_seen,
                            (int64_t)out->value[SLR_OUT_control_mode], (int64_t)out->value[SLR_OUT_fault_code], tick,
                            off};
  const SlrPart part = {counts, sizeof counts};
  slr_cell_write(&p->counts, &part, 1);
  if (p->retain.words) keep_values(s);
}

/* ---- the recorder (runtime/recorder/feed.py) ---- */

uint32_t slr_record_flags(SlrRecord *r, int64_t tick) {
  if (!r->ring.words) return 0;
  const uint32_t full = slr_ring_note(&r->ring) & SLR_SCAN_DISK_FULL ? SLR_FLAG_DISK_FULL : 0;
  return full | (slr_is_lost(&r->watch, &r->ring, tick) ? SLR_FLAG_RECORDER_LOST : 0);
}

void slr_keep_state(SlrScan *s) {
  SlrRecord *r = &s->record;
  if (!r->ring.words || s->tick.number < r->due) return;
  memcpy(r->kept, s->core, slr_state_size());
  r->keeps = 1;
}

/* The state before this tick, if it was kept; whether the tick can follow. */
static int put_state(SlrRecord *r, int64_t tick, int64_t day) {
  if (!r->keeps) return 1;
  const int64_t head[] = {tick, day};
  const SlrPart parts[] = {{head, sizeof head}, {r->kept, slr_state_size()}};
  if (!slr_ring_put(&r->ring, SLR_SCAN_SNAPSHOT, parts, 2)) return 0;
  r->keeps = 0;
  r->due = tick + r->every;
  return 1;
}

void slr_record(SlrScan *s, int64_t latency) {
  SlrRecord *r = &s->record;
  const SlrScanTick *t = &s->tick;
  if (!r->ring.words) return;
  r->count += 1; /* ticks that are lost, too: a gap in a recording shows */
  const int64_t day = t->deadline + r->day;
  if (!put_state(r, t->number, day)) return;
  const int64_t timing[] = {day, r->count, slr_day(), t->deadline, t->woke - t->deadline, t->sent - t->woke, t->used,
                            latency};
  const SlrPart parts[] = {{timing, sizeof timing}, {s->inputs, sizeof(SlrInput)}, {s->outputs, sizeof(SlrOutput)}};
  if (!slr_ring_put(&r->ring, SLR_SCAN_TICK, parts, 3)) r->due = t->number + 1;
}
#endif
