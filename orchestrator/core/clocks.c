/* Clocks connected between FMUs: one instant of events, after every tick and at the start.
 *
 * Iteration by iteration: the clocks that tick others are read of every block in event mode, and the variables that
 * are clocked by those that are active; these go to where they are connected, and the clocks there are activated;
 * then discrete states are updated. What an update activates belongs to the next iteration. In each of these parts
 * blocks and clocks come in the order in which they were added. */
#include "plan.h"

#define MAX_EVENT_ITERATIONS 1000

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

static bool activate(slw_core *core, slw_block *b, uint32_t vr) {
  slw_cell on = {.integer = 1};
  bool native = true;
  const slw_group group = {SLW_CLOCK, 1, 1, &vr, &on, &native, NULL};
  return passes(core, b, b->fmu->call->set(b->fmu, &group));
}

static bool ticks(const slw_source_clock *c, int64_t tick) {
  return c->interval && tick >= c->shift && (tick - c->shift) % c->interval == 0;
}

/* Who is in event mode at this instant from its begin on. */
static bool begin(slw_core *core, slw_block *b, int64_t tick) {
  bool due = b->event_due;
  b->event_due = false;
  b->takes_part = false;
  for (uint32_t i = 0; i < b->n_sources; i++) due = due || ticks(&b->sources[i], tick);
  return !(due || b->in_event) || enter(core, b);
}

static bool read_clock(slw_core *core, slw_block *b, slw_source_clock *c) {
  slw_cell on = {.integer = 0};
  bool native = false;
  const slw_group group = {SLW_CLOCK, 1, 1, &c->vr, &on, &native, NULL};
  if (!passes(core, b, b->fmu->call->get(b->fmu, &group))) return false;
  c->active = on.integer != 0;
  return true;
}

static bool read_source(slw_core *core, slw_block *b, slw_source_clock *c, bool first, int64_t tick) {
  if (!c->interval) {
    if (!read_clock(core, b, c)) return false;
  } else {
    c->active = first && ticks(c, tick);
    if (c->active && !activate(core, b, c->vr)) return false;
  }
  for (uint32_t i = 0; c->active && i < c->n_gets; i++)
    if (!passes(core, b, b->fmu->call->get(b->fmu, &c->gets[i]))) return false;
  return true;
}

static bool read_sources(slw_core *core, bool first, int64_t tick) {
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++)
    for (uint32_t i = 0; i < b->n_sources; i++) {
      b->sources[i].active = false;
      if (b->takes_part && !read_source(core, b, &b->sources[i], first, tick)) return false;
    }
  return true;
}

static bool tick_target(slw_core *core, slw_target_clock *c) {
  slw_block *b = &core->blocks[c->block];
  if (!enter(core, b) || !slw_exchange_run(core, c->block, &c->in)) return false;
  for (uint32_t i = 0; i < c->n_sets; i++)
    if (!passes(core, b, b->fmu->call->set(b->fmu, &c->sets[i]))) return false;
  return activate(core, b, c->vr);
}

static bool tick_targets(slw_core *core) {
  for (slw_target_clock *c = core->targets; c < core->targets + core->n_targets; c++)
    if (core->blocks[c->source_block].sources[c->source].active && !tick_target(core, c)) return false;
  return true;
}

/* One update of every block that takes part; those that ask for more do so in the next iteration, too. */
static bool update(slw_core *core, bool *more) {
  *more = false;
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    slw_event_result result = {false, false, false, 0.0};
    if (!b->takes_part) continue;
    if (!passes(core, b, b->fmu->call->update_discrete(b->fmu, &result))) return false;
    if (result.terminate) slw_end(core, b);
    b->takes_part = result.more;
    *more = *more || result.more;
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

bool slw_clocks_run(slw_core *core, int64_t tick) {
  bool more = false;
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    if (!b->connected) continue;
    if (!begin(core, b, tick)) return false;
    more = more || b->takes_part;
  }
  for (int i = 0; more; i++) {
    if (i == MAX_EVENT_ITERATIONS) return slw_fail(core, SLW_NO_PROGRESS, SLW_OK, still_busy(core), 0);
    if (!read_sources(core, i == 0, tick) || !tick_targets(core) || !update(core, &more)) return false;
  }
  return leave(core);
}
