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
  f->tick = core->failure.tick, f->clock = SLW_NO_CLOCK;
  f->time = core->start_s + (f->tick < 0 ? 0.0 : (double)f->tick * core->step_s);
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

/* A value as `told` notes it: of a text a number over its content. */
static int64_t noted(const slw_group *g, size_t i) {
  const slw_blob *text = g->blobs ? &g->blobs[g->cells[i].integer] : NULL;
  return text ? (int64_t)slw_hashed(text->size, text->data, text->size) : g->cells[i].integer;
}

static bool set_group(slw_core *core, slw_block *b, slw_group *g) {
  for (size_t i = 0; g->told && i < g->n; i++) g->told[i] = noted(g, i);
  return passes(core, b, b->fmu->call->set(b->fmu, g), SLW_DOING_SET);
}

bool slw_block_set(slw_core *core, slw_block *b) {
  for (uint32_t i = 0; i < b->n_sets; i++)
    if (!set_group(core, b, &b->sets[i])) return false;
  return true;
}

/* Whether a discrete input is another than was set last. */
static bool has_news(const slw_block *b) {
  for (const slw_group *g = b->sets; g < b->sets + b->n_sets; g++)
    for (size_t i = 0; g->told && i < g->n; i++)
      if (g->told[i] != noted(g, i)) return true;
  return false;
}

bool slw_groups_finite(slw_core *core, const slw_block *b, const slw_group *groups, uint32_t n) {
  for (uint32_t i = 0; i < n; i++) {
    const slw_group *g = &groups[i];
    if (g->type > SLW_FLOAT32) continue;
    for (size_t k = 0; k < g->n; k++)
      if (((uint64_t)g->cells[k].integer & SLW_EXPONENT) == SLW_EXPONENT)
        return slw_fail(core, SLW_NOT_FINITE, SLW_OK, b, (uint32_t)(g->cells + k - core->cells));
  }
  return true;
}

bool slw_check_finite(slw_core *core, const slw_block *b) {
  return slw_groups_finite(core, b, b->gets, b->n_gets);
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

/* In event mode: discrete states, and the clocks whose times that may have changed. */
static bool settle(slw_core *core, slw_block *b, double time) {
  return update_discrete(core, b) && slw_timed_ask(core, b, time);
}

static bool enter(slw_core *core, slw_block *b) {
  b->count.events++;
  return passes(core, b, b->fmu->call->enter_event(b->fmu), SLW_DOING_EVENT);
}

static bool leave(slw_core *core, slw_block *b) {
  return passes(core, b, b->fmu->call->enter_step(b->fmu), SLW_DOING_EVENT);
}

static bool handle_event(slw_core *core, slw_block *b, double time) {
  return enter(core, b) && settle(core, b, time) && leave(core, b);
}

/* An FMU with event mode leaves initialisation in it. Clocks of tick 0 tick with the first step. */
bool slw_block_initial_events(slw_core *core, slw_block *b) {
  b->in_event = b->connected; /* clocks.c goes on */
  if (b->connected) return true;
  return !b->event_mode || (settle(core, b, core->start_s) && leave(core, b));
}

/* The clocks that are due, and those that a tick makes due at once. */
static bool tick_due(slw_core *core, slw_block *b, double time) {
  for (uint32_t i = 0; i < MAX_EVENT_ITERATIONS + b->n_clocks; i++) {
    if (!slw_own_tick(core, b, time) || !settle(core, b, time)) return false;
    if (!slw_own_due(core, b, SLW_INSIDE, time)) return true;
  }
  return slw_timed_endless(core, b, time, 0.0);
}

/* In step mode only continuous inputs may be set (FMI 3.0, 2.2.9): a discrete one that changed is an event. */
bool slw_block_inputs(slw_core *core, slw_block *b, double t, bool clocks) {
  const bool ticks = clocks && b->n_clocks && !b->connected && slw_own_due(core, b, core->tick, t);
  if (ticks) return enter(core, b) && slw_block_set(core, b) && tick_due(core, b, t) && leave(core, b);
  if (has_news(b)) return enter(core, b) && slw_block_set(core, b) && settle(core, b, t) && leave(core, b);
  for (uint32_t i = 0; i < b->n_sets; i++)
    if (!b->sets[i].told && !set_group(core, b, &b->sets[i])) return false;
  return true;
}

bool slw_block_parameter(slw_core *core, slw_block *b, const slw_group *group) {
  const bool event = b->timed || (b->event_mode && !b->connected);
  if (event && !enter(core, b)) return false;
  if (!passes(core, b, b->fmu->call->set(b->fmu, group), SLW_DOING_SET)) return false;
  return !event || (settle(core, b, slw_time(core)) && leave(core, b));
}

/* ---- stepping ---- */

/* How far from where it should be a time may be: FMUs add up their own. */
static double slack(double t, double h) { return 1e-6 * h + 1e-9 * (slw_abs(t) + h); }

bool slw_time_told(slw_core *core, const slw_block *b, bool whole, double t, double h, double told) {
  const double end = t + h, close = slack(t, h);
  if (told >= (whole ? end : t) - close && told <= end + close) return true;
  slw_fail(core, SLW_BAD_TIME, SLW_OK, b, 0);
  core->failure.told = told, core->failure.from = t, core->failure.to = end;
  return false;
}

/* A discarded step is tried again in halves from where the FMU got to; its inputs stay. */
static bool discarded(slw_core *core, slw_block *b, double t, double *h, double reached) {
  b->count.discards++;
  if (reached > t) return true;
  *h *= 0.5;
  return *h > core->step_s * SMALLEST_PART || slw_fail(core, SLW_DOING_STEP, SLW_DISCARD, b, 0);
}

/* What one doStep from t came to, whose status lets the run go on or is Discard. */
static bool judge_step(slw_core *core, slw_block *b, double t, double *h, slw_status status,
                       const slw_step_result *r) {
  const bool part = r->early || r->terminate || status == SLW_DISCARD;
  if (!slw_time_told(core, b, !part, t, *h, r->reached)) return false;
  if (status == SLW_WARNING) b->count.warnings++;
  if (r->terminate) {
    slw_end(core, b);
    return true;
  }
  if (status == SLW_DISCARD) return discarded(core, b, t, h, r->reached);
  if (r->early && !b->early_return) return slw_fail(core, SLW_RETURNED_EARLY, SLW_OK, b, 0);
  if (r->early) b->count.early_returns++;
  if (!(r->event && b->event_mode)) return true;
  if (!b->connected) return handle_event(core, b, r->early ? r->reached : t + *h);
  b->event_due = true;
  return true;
}

/* One doStep from t; *reached is where it got to, and *h the step to try next if that is t still. */
static bool try_step(slw_core *core, slw_block *b, double t, double *h, double *reached) {
  const double asked = *h;
  slw_step_result r = {t + asked, false, false, false};
  const slw_status status = b->fmu->call->step(b->fmu, t, asked, &r);
  b->count.steps++;
  if (status > SLW_DISCARD) return slw_fail(core, SLW_DOING_STEP, status, b, 0);
  *reached = r.early || status == SLW_DISCARD ? r.reached : t + asked;
  return judge_step(core, b, t, h, status, &r);
}

/* Clocks that tick inside a step: at once if the time has come, else *h ends where the next one ticks. */
static bool meet_clocks(slw_core *core, slw_block *b, double t, double *h, double end) {
  double stop = end;
  if (!slw_timed_part(core, b, t, end, &stop)) return false;
  for (uint32_t i = 0; stop < end && slw_timed_near(core, stop, t); i++) {
    if (i == MAX_EVENT_ITERATIONS) return slw_timed_endless(core, b, t, 0.0);
    slw_own_due(core, b, SLW_INSIDE, t);
    if (!enter(core, b) || !tick_due(core, b, t) || !leave(core, b)) return false;
    if (!slw_timed_part(core, b, t, end, &stop)) return false;
  }
  if (*h > stop - t) *h = stop - t;
  return true;
}

static bool step_to(slw_core *core, slw_block *b, double t, double h, double end) {
  const double close = ROUNDING * (slw_abs(end) + (end - t)), least = core->step_s * SMALLEST_PART;
  const bool divided = b->timed && !b->connected;
  double reached = t;
  for (int idle = 0; idle < MAX_IDLE;) {
    if (divided && !meet_clocks(core, b, t, &h, end)) return false;
    if (!try_step(core, b, t, &h, &reached)) return false;
    if (core->ended || reached >= end - close) return true;
    idle = reached > t + least ? 0 : idle + 1;
    if (reached > t) t = reached, h = end - t;
  }
  return slw_timed_endless(core, b, t, least);
}

bool slw_block_step(slw_core *core, slw_block *b, double t, double h) {
  if (core->tick >= b->fails_at) return slw_fail(core, SLW_INJECTED, SLW_ERROR, b, 0);
  return step_to(core, b, t, h, t + h);
}

bool slw_block_finish_step(slw_core *core, slw_block *b, slw_status status, const slw_step_result *r) {
  const double t = slw_time(core), end = t + core->step_s;
  const bool part = r->early || status == SLW_DISCARD;
  double h = core->step_s;
  if (!judge_step(core, b, t, &h, status, r)) return false;
  if (core->ended || !part || r->reached >= end - ROUNDING * (slw_abs(end) + h)) return true;
  return r->reached > t ? step_to(core, b, r->reached, end - r->reached, end) : step_to(core, b, t, h, end);
}

bool slw_block_finish_discarded(slw_core *core, slw_block *b) {
  slw_step_result r = {slw_time(core), false, false, false};
  const slw_status status = b->fmu->call->after_discard(b->fmu, &r);
  if (status > SLW_WARNING) return slw_fail(core, SLW_DOING_STEP, status, b, 0);
  return slw_block_finish_step(core, b, SLW_DISCARD, &r);
}

/* ---- state ---- */

/* What discrete inputs were set to, from one of the three places in `told` to another. */
static void keep_told(slw_block *b, size_t from, size_t to) {
  for (slw_group *g = b->sets; g < b->sets + b->n_sets; g++)
    if (g->told) memcpy(g->told + to * g->n, g->told + from * g->n, g->n * sizeof *g->told);
}

bool slw_block_save(slw_core *core, slw_block *b, int slot) {
  if (b->timed && !b->kept[slot]) return slw_fail(core, SLW_DOING_STATE, SLW_ERROR, b, 0);
  for (uint32_t i = 0; b->timed && i < b->n_clocks; i++) b->kept[slot][i] = b->clocks[i].next;
  keep_told(b, 0, (size_t)slot + 1);
  return passes(core, b, b->fmu->call->get_state(b->fmu, &b->state[slot]), SLW_DOING_STATE);
}

bool slw_block_restore(slw_core *core, slw_block *b, int slot) {
  b->count.rollbacks++;
  for (uint32_t i = 0; b->timed && i < b->n_clocks; i++) b->clocks[i].next = b->kept[slot][i];
  keep_told(b, (size_t)slot + 1, 0);
  return passes(core, b, b->fmu->call->set_state(b->fmu, b->state[slot]), SLW_DOING_STATE);
}
