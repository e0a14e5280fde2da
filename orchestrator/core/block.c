/* One block: setting, stepping, getting, events and clocks, state; every status checked and counted. */
#include "plan.h"

#define MAX_EVENT_ITERATIONS 1000
#define MAX_IDLE 1000                 /* steps that do not advance */
#define SMALLEST_PART (1.0 / 1048576) /* of a step, that a discarded one is halved down to */
#define ROUNDING 1e-12 /* relative: an FMU that reaches the end of a step up to this has done it */

bool slw_fail(slw_core *core, slw_what what, slw_status status, const slw_block *b, uint32_t cell) {
  slw_failure *f = &core->failure;
  f->what = what, f->status = status, f->cell = cell;
  f->block = b ? (uint32_t)(b - core->blocks) : SLW_SINK;
  f->tick = core->failure.tick;
  f->time = f->tick < 0 ? 0.0 : (double)f->tick * core->step_s;
  return false;
}

void slw_end(slw_core *core, const slw_block *b) {
  if (!core->ended) core->failure.block = (uint32_t)(b - core->blocks);
  core->ended = true;
}

/* Whether a status lets the run go on; warnings are counted. */
static inline bool passes(slw_core *core, slw_block *b, slw_status status, slw_what doing) {
  if (status == SLW_OK) return true;
  if (status == SLW_WARNING) {
    b->count.warnings++;
    return true;
  }
  return slw_fail(core, doing, status, b, 0);
}

bool slw_block_set(slw_core *core, slw_block *b) {
  for (uint32_t i = 0; i < b->n_sets; i++)
    if (!passes(core, b, b->fmu->call->set(b->fmu, &b->sets[i]), SLW_DOING_SET)) return false;
  return true;
}

bool slw_check_finite(slw_core *core, const slw_block *b) {
  for (uint32_t i = 0; i < b->n_gets; i++) {
    const slw_group *g = &b->gets[i];
    if (g->type > SLW_FLOAT32) continue;
    for (size_t k = 0; k < g->n; k++)
      if (((uint64_t)g->cells[k].integer & SLW_EXPONENT) == SLW_EXPONENT)
        return slw_fail(core, SLW_NOT_FINITE, SLW_OK, b, (uint32_t)(g->cells + k - core->cells));
  }
  return true;
}

bool slw_block_get(slw_core *core, slw_block *b) {
  for (uint32_t i = 0; i < b->n_gets; i++)
    if (!passes(core, b, b->fmu->call->get(b->fmu, &b->gets[i]), SLW_DOING_GET)) return false;
  return slw_check_finite(core, b);
}

/* ---- events ---- */

static bool update_discrete(slw_core *core, slw_block *b) {
  for (int i = 0; i < MAX_EVENT_ITERATIONS; i++) {
    slw_event_result result = {false, false, false, 0.0};
    if (!passes(core, b, b->fmu->call->update_discrete(b->fmu, &result), SLW_DOING_EVENT)) return false;
    if (result.terminate) slw_end(core, b);
    if (!result.more) return true;
  }
  return slw_fail(core, SLW_NO_PROGRESS, SLW_OK, b, 0);
}

static bool handle_event(slw_core *core, slw_block *b) {
  b->count.events++;
  return passes(core, b, b->fmu->call->enter_event(b->fmu), SLW_DOING_EVENT) && update_discrete(core, b) &&
         passes(core, b, b->fmu->call->enter_step(b->fmu), SLW_DOING_EVENT);
}

static bool activate_clocks(slw_core *core, slw_block *b, int64_t tick) {
  for (uint32_t i = 0; i < b->n_clocks; i++) {
    const slw_periodic *c = &b->clocks[i];
    if (tick < c->shift || (tick - c->shift) % c->interval != 0) continue;
    slw_cell on = {.integer = 1};
    bool native = true;
    const slw_group group = {SLW_CLOCK, 1, 1, &c->vr, &on, &native, NULL};
    if (!passes(core, b, b->fmu->call->set(b->fmu, &group), SLW_DOING_EVENT)) return false;
  }
  return true;
}

static bool ticks_now(const slw_block *b, int64_t tick) {
  for (uint32_t i = 0; i < b->n_clocks; i++)
    if (tick >= b->clocks[i].shift && (tick - b->clocks[i].shift) % b->clocks[i].interval == 0) return true;
  return false;
}

/* An FMU with event mode leaves initialisation in it. Clocks of tick 0 tick with the first step. */
bool slw_block_initial_events(slw_core *core, slw_block *b) {
  return !b->event_mode || (update_discrete(core, b) &&
                            passes(core, b, b->fmu->call->enter_step(b->fmu), SLW_DOING_EVENT));
}

bool slw_block_tick_clocks(slw_core *core, slw_block *b) {
  if (!b->n_clocks || !ticks_now(b, core->tick)) return true;
  b->count.events++;
  return passes(core, b, b->fmu->call->enter_event(b->fmu), SLW_DOING_EVENT) && slw_block_set(core, b) &&
         activate_clocks(core, b, core->tick) && update_discrete(core, b) &&
         passes(core, b, b->fmu->call->enter_step(b->fmu), SLW_DOING_EVENT);
}

/* ---- stepping ---- */

/* A discarded step is tried again in halves from where the FMU got to; its inputs stay. */
static bool discarded(slw_core *core, slw_block *b, double t, double *h, double reached) {
  b->count.discards++;
  if (reached > t) return true;
  *h *= 0.5;
  return *h > core->step_s * SMALLEST_PART || slw_fail(core, SLW_DOING_STEP, SLW_DISCARD, b, 0);
}

/* One doStep from t; *reached is where it got to, and *h the step to try next if that is t still. */
static bool try_step(slw_core *core, slw_block *b, double t, double *h, double *reached) {
  slw_step_result r = {t + *h, false, false, false};
  const slw_status status = b->fmu->call->step(b->fmu, t, *h, &r);
  b->count.steps++;
  *reached = r.early || status == SLW_DISCARD ? r.reached : t + *h;
  if (r.terminate) {
    slw_end(core, b);
    return status <= SLW_DISCARD || slw_fail(core, SLW_DOING_STEP, status, b, 0);
  }
  if (status == SLW_DISCARD) return discarded(core, b, t, h, *reached);
  if (!passes(core, b, status, SLW_DOING_STEP)) return false;
  if (r.early && !b->early_return) return slw_fail(core, SLW_RETURNED_EARLY, SLW_OK, b, 0);
  if (r.early) b->count.early_returns++;
  return !(r.event && b->event_mode) || handle_event(core, b);
}

static bool step_to(slw_core *core, slw_block *b, double t, double h, double end) {
  const double close = ROUNDING * (slw_abs(end) + (end - t));
  double reached;
  for (int idle = 0; idle < MAX_IDLE;) {
    if (!try_step(core, b, t, &h, &reached)) return false;
    if (core->ended || reached >= end - close) return true;
    if (reached > t) {
      t = reached, h = end - t, idle = 0;
    } else {
      idle++;
    }
  }
  return slw_fail(core, SLW_NO_PROGRESS, SLW_OK, b, 0);
}

bool slw_block_step(slw_core *core, slw_block *b, double t, double h) {
  if (core->tick >= b->fails_at) return slw_fail(core, SLW_INJECTED, SLW_ERROR, b, 0);
  return step_to(core, b, t, h, t + h);
}

/* After a step from t that was discarded and got to `reached`: the rest of it. */
bool slw_block_continue(slw_core *core, slw_block *b, double t, double reached) {
  double h = core->step_s;
  const double end = t + h;
  if (!discarded(core, b, t, &h, reached)) return false;
  return reached > t ? step_to(core, b, reached, end - reached, end) : step_to(core, b, t, h, end);
}

bool slw_block_finish_discarded(slw_core *core, slw_block *b, double t) {
  slw_step_result r = {t, false, false, false};
  const slw_status status = b->fmu->call->after_discard(b->fmu, &r);
  if (!passes(core, b, status, SLW_DOING_STEP)) return false;
  if (r.terminate) slw_end(core, b);
  return r.terminate || slw_block_continue(core, b, t, r.reached);
}

/* ---- state ---- */

bool slw_block_save(slw_core *core, slw_block *b, int slot) {
  return passes(core, b, b->fmu->call->get_state(b->fmu, &b->state[slot]), SLW_DOING_STATE);
}

bool slw_block_restore(slw_core *core, slw_block *b, int slot) {
  b->count.rollbacks++;
  return passes(core, b, b->fmu->call->set_state(b->fmu, b->state[slot]), SLW_DOING_STATE);
}
