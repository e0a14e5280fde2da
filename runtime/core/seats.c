#include "seats.h"

#include <string.h>

#include "memory.h"

#define START(name, vr, group, min, max, timeout, start) start,
static const double starts[SLR_IN_COUNT] = {SLR_INPUT_SIGNALS(START)};
enum { FIRST = SLR_SCAN_FIRST_TARGET, COUNT = SLR_SCAN_TARGETS };

const char *slr_seats_layout(void) { return SLR_SCAN_LAYOUT; }
size_t slr_seats_size(void) { return sizeof(SlrSeats) + sizeof(SlrPageEnd); }
void slr_seats_prepare(void) { slr_memory_prepare(); }

void slr_put(SlrInput *in, int first, int count, const double *value, int64_t age, SlrStatus status) {
  memcpy(in->value + first, value, (size_t)count * sizeof *value);
  for (int i = first; i < first + count; i++) {
    in->age[i] = (int32_t)age;
    in->status[i] = (uint8_t)status;
  }
}

void slr_put_none(SlrInput *in, int first, int count) {
  slr_put(in, first, count, starts + first, -1, SLR_STATUS_NEVER);
}

int64_t slr_ticks_since(int64_t then, int64_t now) { return now > then ? (now - then) / SLR_SCAN_PERIOD_NS : 0; }

int slr_is_planned(const SlrInput *in, int64_t late) {
  const int beat = SLR_IN_planner_heartbeat;
  return in->status[beat] == SLR_STATUS_OK && in->age[beat] >= 0 && in->age[beat] < late;
}

int slr_follows(int64_t mode) { return mode == SLR_MODE_AUTOMATIC || mode == SLR_MODE_HOLD; }

/* What is new in the seat's cell; whether anybody asks for anything there. */
static int look(SlrSeat *seat) {
  SlrTargets newest;
  if (!seat->cell.memory) return 0;
  const int64_t number = slr_cell_number(&seat->cell) == seat->seen ? 0 : slr_cell_read(&seat->cell, &newest);
  if (number) {
    seat->seen = number;
    seat->asked = newest;
  }
  return seat->asked.owner != 0;
}

static int is_alive(const SlrSeat *seat, int64_t now, int64_t late) {
  const SlrTargets *asked = &seat->asked;
  return asked->owner && asked->commits && slr_ticks_since(asked->heartbeat_ns, now) < late;
}

/* `who`: place from 1 on; 0: nobody. */
static void grant(SlrSeats *s, int64_t who) {
  s->who = who;
  s->owner = who ? s->seat[who - 1].asked.owner : 0;
  const uint32_t granted[] = {who ? (uint32_t)s->seat[who - 1].number : 0, (uint32_t)s->owner};
  const SlrPart part = {granted, sizeof granted};
  slr_cell_write(&s->granted, &part, 1);
}

/* The right of a claim that is over ends; while its targets are followed nothing counts, lest others slip in. */
static void end_what_is_over(SlrSeats *s, int64_t now) {
  if (!s->who) return;
  SlrSeat *holder = &s->seat[s->who - 1];
  if (is_alive(holder, now, s->late) && holder->asked.owner == s->owner) return;
  holder->ended = s->owner;
  s->draining = 1;
  grant(s, 0);
}

/* The first seat that asks for it anew has the right. */
static void give(SlrSeats *s, int64_t now) {
  for (int i = 0; i < SLR_SCAN_SEATS && !s->who; i++) {
    const SlrSeat *seat = &s->seat[i];
    if (is_alive(seat, now, s->late) && seat->asked.owner != seat->ended) grant(s, i + 1);
  }
}

void slr_seats_receive(SlrSeats *s, SlrInput *in, int64_t now, int64_t mode, int64_t others) {
  int asks = 0;
  for (int i = 0; i < SLR_SCAN_SEATS; i++) asks |= look(&s->seat[i]);
  if (!asks && !s->who && !s->draining) return;
  end_what_is_over(s, now);
  s->draining = s->draining && slr_follows(mode);
  if (!s->who && !s->draining && !others && !slr_is_planned(in, s->late)) give(s, now);
  if (s->who) {
    const SlrTargets *asked = &s->seat[s->who - 1].asked;
    slr_put(in, FIRST, COUNT, asked->value, slr_ticks_since(asked->heartbeat_ns, now), SLR_STATUS_OK);
  } else if (s->draining) {
    slr_put_none(in, FIRST, COUNT);
  }
}
