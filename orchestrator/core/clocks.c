/* Clocks connected between FMUs: one instant of events, after every tick, at the start, and inside a tick wherever a
 * clock ticks at a time of its own.
 *
 * Iteration by iteration: time-based clocks that are due tick; the clocks that tick others are read of every block in
 * event mode, and the variables that are clocked by those that are active; these go to where they are connected, and
 * the clocks there are activated; then discrete states are updated. What an update activates belongs to the next
 * iteration. In each of these parts blocks and clocks come in the order in which they were added. */
#include "plan.h"

#define MAX_EVENT_ITERATIONS 1000
#define MAX_INSTANTS 100000 /* of one tick */

static bool passes(slw_core *core, slw_block *b, slw_status status) {
  if (status == SLW_WARNING) b->count.warnings++;
  return status <= SLW_WARNING || slw_fail(core, SLW_DOING_EVENT, status, b, 0);
}

static bool enter(slw_core *core, slw_block *b) {
  b->takes_part = true;
  if (b->in_event) return true;
  b->in_event = true;
  b->count.events++;
  return passes(core, b, b->fmu->call->enter_event(b->fmu));
}

static bool linked(const slw_block *b, uint32_t own) {
  for (uint32_t i = 0; i < b->n_sources; i++)
    if (b->sources[i].own == (int32_t)own) return true;
  return false;
}

/* Where a clock ticks that is not there for others alone, the block's inputs are those of the instant, too. */
static bool inputs(slw_core *core, slw_block *b) {
  bool own = false;
  for (uint32_t i = 0; i < b->n_clocks; i++) own = own || (b->clocks[i].due && !linked(b, i));
  return !own || (slw_exchange_run(core, (uint32_t)(b - core->blocks), &b->in) && slw_block_set(core, b));
}

/* Who is in event mode at this instant from its begin on. */
static bool begin(slw_core *core, slw_block *b, int64_t tick, double time) {
  const bool ticks = slw_own_due(core, b, tick, time), due = b->event_due || ticks;
  b->event_due = false;
  b->takes_part = false;
  if (!due && !b->in_event) return true;
  return enter(core, b) && (tick == SLW_INSIDE || inputs(core, b));
}

static bool read_clock(slw_core *core, slw_block *b, slw_source_clock *c) {
  slw_cell on = {.integer = 0};
  bool native = false;
  const slw_group group = {SLW_CLOCK, 1, 1, &c->vr, &on, &native, NULL, NULL};
  if (!passes(core, b, b->fmu->call->get(b->fmu, &group))) return false;
  c->active = on.integer != 0;
  return true;
}

static bool read_source(slw_core *core, slw_block *b, slw_source_clock *c) {
  if (c->own >= 0) c->active = b->clocks[c->own].active;
  else if (!read_clock(core, b, c)) return false;
  for (uint32_t i = 0; c->active && i < c->n_gets; i++)
    if (!passes(core, b, b->fmu->call->get(b->fmu, &c->gets[i]))) return false;
  return true;
}

/* Own clocks tick, and the clocks that tick others are read. */
static bool read_sources(slw_core *core, double time) {
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    if (b->takes_part && !slw_own_tick(core, b, time)) return false;
    for (uint32_t i = 0; i < b->n_sources; i++) {
      b->sources[i].active = false;
      if (b->takes_part && !read_source(core, b, &b->sources[i])) return false;
    }
  }
  return true;
}

static bool tick_target(slw_core *core, slw_target_clock *c, double time) {
  slw_block *b = &core->blocks[c->block];
  if (!enter(core, b) || !slw_exchange_run(core, c->block, &c->in)) return false;
  for (uint32_t i = 0; i < c->n_sets; i++)
    if (!passes(core, b, b->fmu->call->set(b->fmu, &c->sets[i]))) return false;
  return slw_activate(core, b, c->vr, time);
}

static bool tick_targets(slw_core *core, double time) {
  for (slw_target_clock *c = core->targets; c < core->targets + core->n_targets; c++)
    if (core->blocks[c->source_block].sources[c->source].active && !tick_target(core, c, time))
      return false;
  return true;
}

/* One update of every block that takes part; those that ask for more, or have a clock that ticks at once, do so in the
 * next iteration, too. */
static bool update(slw_core *core, double time, bool *more) {
  *more = false;
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    slw_event_result result = {false, false, false, 0.0};
    if (!b->takes_part) continue;
    if (!passes(core, b, b->fmu->call->update_discrete(b->fmu, &result))) return false;
    if (result.terminate) slw_end(core, b);
    if (!result.more && !slw_timed_ask(core, b, time)) return false;
    b->takes_part = slw_own_due(core, b, SLW_INSIDE, time) || result.more;
    *more = *more || b->takes_part;
  }
  return true;
}

static bool leave(slw_core *core) {
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    if (!b->in_event) continue;
    b->in_event = false;
    if (!passes(core, b, b->fmu->call->enter_step(b->fmu)) || !slw_block_get(core, b)) return false;
  }
  return true;
}

static slw_block *still_busy(slw_core *core) {
  slw_block *b = core->blocks;
  while (!b->takes_part) b++;
  return b;
}

/* False: names a clock that ticked others in the last iteration, else one of a block that wants another. */
static bool endless(slw_core *core, double time) {
  slw_timed_endless(core, still_busy(core), time, 0.0);
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++)
    for (uint32_t i = 0; i < b->n_sources; i++)
      if (b->sources[i].active) {
        core->failure.block = (uint32_t)(b - core->blocks), core->failure.clock = b->sources[i].vr;
        return false;
      }
  return false;
}

bool slw_clocks_run(slw_core *core, int64_t tick, double time) {
  bool more = false;
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    if (!b->connected) continue;
    if (!begin(core, b, tick, time)) return false;
    more = more || b->takes_part;
  }
  for (int i = 0; more; i++) {
    if (i == MAX_EVENT_ITERATIONS) return endless(core, time);
    if (!read_sources(core, time) || !tick_targets(core, time) || !update(core, time, &more)) return false;
  }
  return leave(core);
}

/* ---- a tick with instants inside it ---- */

#define EACH(b) for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) if (b->connected)

/* The first instant between t and `end` at which a clock of any connected block ticks (`first`'s, if there is one);
 * all of them step to it. */
static bool next_instant(slw_core *core, double t, double end, double *stop, slw_block **first) {
  *stop = end;
  EACH(b) {
    double own = end;
    if (!slw_timed_part(core, b, t, end, &own)) return false;
    if (own < *stop) *stop = own, *first = b;
  }
  return true;
}

static bool step_together(slw_core *core, double t, double stop, double end) {
  EACH(b) {
    if (stop < end && !slw_may_part(core, b, t, stop)) return false;
    const double before = core->timing ? slw_clock_s() : 0.0;
    if (!slw_block_step(core, b, t, stop - t)) return false;
    if (core->timing) b->count.seconds += slw_clock_s() - before;
  }
  return true;
}

bool slw_clocks_advance(slw_core *core) {
  const double end = slw_time_of(core, core->tick + 1);
  double t = slw_time(core), stop;
  slw_block *first = NULL;
  EACH(b) if (!slw_block_set(core, b)) return false;
  for (uint32_t i = 0; !core->ended; i++) {
    if (!next_instant(core, t, end, &stop, &first)) return false;
    if (i == MAX_INSTANTS && stop < end) return slw_timed_endless(core, first, t, stop - t);
    if (stop > t && !step_together(core, t, stop, end)) return false;
    if (stop >= end) break;
    if (!slw_clocks_run(core, SLW_INSIDE, stop)) return false;
    t = stop;
  }
  EACH(b) if (!slw_block_get(core, b)) return false;
  return true;
}
