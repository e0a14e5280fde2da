/* Time-based clocks of one block: when they tick, and what moves with a tick.
 *
 * A clock of the grid ticks at whole ticks that are known before the run. The others tick at times: periodic ones
 * every so often; fixed and tunable ones too, but as their FMU tells at the start (tunable ones again after each
 * event); changing ones at the time told after their last tick; countdown ones at the time told after any event, as
 * soon as it is known. Source: FMI 3.0.2, 2.2.8 and its table of allowed qualifiers. */
#include "plan.h"

#define ABSOLUTE 1e-9   /* of a step: times this close are one */
#define RELATIVE 1e-12
#define SMALLEST (1.0 / 1048576) /* of a step: no periodic clock ticks more often */
#define SHIFT (-1)               /* as qualifier */

bool slw_timed_near(const slw_core *core, double a, double b) {
  return slw_abs(a - b) <= ABSOLUTE * core->step_s + RELATIVE * slw_abs(a);
}

static double time_of(const slw_own_clock *c) { return c->next.base + (double)c->next.n * c->next.every; }

static bool passes(slw_core *core, slw_block *b, slw_status status, slw_what doing) {
  if (status == SLW_WARNING) b->count.warnings++;
  return status <= SLW_WARNING || slw_fail(core, doing, status, b, 0);
}

static bool refused(slw_core *core, const slw_block *b, slw_what what, const slw_own_clock *c, double time) {
  slw_fail(core, what, SLW_OK, b, 0);
  core->failure.clock = c ? c->vr : SLW_NO_CLOCK, core->failure.from = time;
  return false;
}

/* ---- what the FMU tells ---- */

static bool periodic(const slw_own_clock *c) { return c->kind < SLW_CHANGING; }

/* Whether a clock may tick after so many seconds: aperiodic ones at once, too. */
static bool sensible(const slw_core *core, const slw_own_clock *c, double seconds) {
  if (seconds - seconds != 0.0 || seconds < 0.0) return false;
  return !periodic(c) || seconds >= SMALLEST * core->step_s;
}

static bool bad(slw_core *core, const slw_block *b, const slw_own_clock *c, double time, int qualifier, double told) {
  refused(core, b, SLW_BAD_INTERVAL, c, time);
  core->failure.qualifier = qualifier, core->failure.told = told;
  return false;
}

/* Asks for the interval; `first`: it counts, even if it is told as unchanged. */
static bool ask(slw_core *core, slw_block *b, slw_own_clock *c, double time, bool first, slw_interval *found) {
  *found = (slw_interval){SLW_NOT_YET_KNOWN, 0.0};
  if (!passes(core, b, b->fmu->call->interval(b->fmu, c->vr, c->fraction, found), SLW_DOING_EVENT)) return false;
  const bool unknown = found->qualifier == SLW_NOT_YET_KNOWN;
  if (found->qualifier < SLW_NOT_YET_KNOWN || found->qualifier > SLW_CHANGED || (unknown && c->kind != SLW_COUNTDOWN))
    return bad(core, b, c, time, found->qualifier, found->seconds);
  const bool counts = found->qualifier == SLW_CHANGED || (first && !unknown);
  return !counts || sensible(core, c, found->seconds) || bad(core, b, c, time, found->qualifier, found->seconds);
}

static bool start_periodic(slw_core *core, slw_block *b, slw_own_clock *c) {
  slw_interval found;
  double shift = 0.0;
  if (!passes(core, b, b->fmu->call->shift(b->fmu, c->vr, c->fraction, &shift), SLW_DOING_INITIALISE)) return false;
  if (shift - shift != 0.0 || shift < 0.0) return bad(core, b, c, core->start_s, SHIFT, shift);
  if (!ask(core, b, c, core->start_s, true, &found)) return false;
  c->next = (slw_schedule){core->start_s + shift, found.seconds, 0, true};
  return true;
}

static bool start_aperiodic(slw_core *core, slw_block *b, slw_own_clock *c) {
  slw_interval found;
  if (!ask(core, b, c, core->start_s, true, &found)) return false;
  c->next = (slw_schedule){core->start_s, found.seconds, 1, found.qualifier != SLW_NOT_YET_KNOWN};
  return true;
}

bool slw_timed_start(slw_core *core, slw_block *b) {
  for (slw_own_clock *c = b->clocks; c < b->clocks + b->n_clocks; c++) {
    c->due = c->ticked = c->active = false;
    if (c->kind == SLW_PERIODIC) c->next.base = core->start_s + c->shift_s, c->next.n = 0, c->next.known = true;
    if (c->kind == SLW_FIXED || c->kind == SLW_TUNABLE) {
      if (!start_periodic(core, b, c)) return false;
    } else if (c->kind >= SLW_CHANGING && !start_aperiodic(core, b, c)) {
      return false;
    }
  }
  return true;
}

/* After an event: a tunable interval may have changed, a changing one has if the clock ticked, a countdown may be
 * known. */
static bool tell(slw_core *core, slw_block *b, slw_own_clock *c, double time) {
  slw_interval found;
  if (c->kind == SLW_CHANGING && !c->ticked) return true;
  if (!ask(core, b, c, time, false, &found)) return false;
  const double seconds = found.qualifier == SLW_CHANGED ? found.seconds : c->next.every;
  if (found.qualifier == SLW_CHANGED || c->kind == SLW_CHANGING) c->next = (slw_schedule){time, seconds, 1, true};
  if (found.qualifier == SLW_NOT_YET_KNOWN) c->next.known = false;
  c->ticked = false;
  return true;
}

static bool due_at(const slw_core *core, const slw_own_clock *c, double time) {
  return c->next.known && (time_of(c) <= time || slw_timed_near(core, time_of(c), time));
}

bool slw_timed_ask(slw_core *core, slw_block *b, double time) {
  if (!b->timed) return true;
  for (slw_own_clock *c = b->clocks; c < b->clocks + b->n_clocks; c++)
    if (c->kind >= SLW_TUNABLE && !tell(core, b, c, time)) return false;
  return true;
}

/* ---- ticks ---- */

static bool on_grid(const slw_own_clock *c, int64_t tick) {
  return tick >= c->shift && (tick - c->shift) % c->interval == 0;
}

bool slw_own_due(slw_core *core, slw_block *b, int64_t tick, double time) {
  bool any = false;
  for (slw_own_clock *c = b->clocks; c < b->clocks + b->n_clocks; c++) {
    if (c->kind == SLW_GRID) c->due = c->due || (tick >= 0 && on_grid(c, tick));
    else c->due = due_at(core, c, time);
    any = any || c->due;
  }
  return any;
}

static bool move(slw_core *core, slw_block *b, slw_group *groups, uint32_t n, bool set) {
  for (uint32_t i = 0; i < n; i++) {
    const slw_status status = set ? b->fmu->call->set(b->fmu, &groups[i]) : b->fmu->call->get(b->fmu, &groups[i]);
    if (!passes(core, b, status, set ? SLW_DOING_SET : SLW_DOING_GET)) return false;
  }
  return set || slw_groups_finite(core, b, groups, n);
}

static void ticked(slw_own_clock *c) {
  c->due = false, c->ticked = c->active = c->ever = true;
  if (periodic(c)) c->next.n++;
  else c->next.known = false;
}

bool slw_activate(slw_core *core, slw_block *b, uint32_t vr, double time) {
  slw_cell on[2] = {{.integer = 1}, {.real = time}};
  bool native[2] = {true, true};
  const slw_group group = {SLW_CLOCK, 1, 2, &vr, on, native, NULL, NULL};
  return passes(core, b, b->fmu->call->set(b->fmu, &group), SLW_DOING_EVENT);
}

static bool activate(slw_core *core, slw_block *b, slw_own_clock *c, double time) {
  if (!move(core, b, c->sets, c->n_sets, true)) return false;
  ticked(c);
  return slw_activate(core, b, c->vr, time);
}

bool slw_own_tick(slw_core *core, slw_block *b, double time) {
  slw_own_clock *const end = b->clocks + b->n_clocks;
  bool first = true;
  for (slw_own_clock *c = b->clocks; c < end; c++) c->active = false;
  for (slw_own_clock *c = b->clocks; c < end; c++) {
    if (!c->due || (b->fmu->scheduled && !first)) continue;
    if (!activate(core, b, c, time)) return false;
    first = false;
  }
  for (slw_own_clock *c = b->clocks; c < end; c++)
    if (c->active && !move(core, b, c->gets, c->n_gets, false)) return false;
  return true;
}

/* ---- steps that are divided ---- */

static const slw_own_clock *first_before(const slw_block *b, double end) {
  const slw_own_clock *first = NULL;
  for (const slw_own_clock *c = b->clocks; c < b->clocks + b->n_clocks; c++)
    if (c->next.known && time_of(c) < (first ? time_of(first) : end)) first = c;
  return first;
}

#define COUNTED 1e6 /* parts: more of them are told apart from whole ones by nothing */

static bool is_whole(double parts) {
  return parts > COUNTED || slw_abs(parts - (double)(int64_t)(parts + 0.5)) <= 1e-6 * slw_max(parts, 1.0);
}

bool slw_timed_endless(slw_core *core, slw_block *b, double time, double within_s) {
  const slw_own_clock *c = b->timed ? first_before(b, time + within_s + ABSOLUTE * core->step_s) : NULL;
  return refused(core, b, SLW_NO_PROGRESS, c, time);
}

bool slw_may_part(slw_core *core, slw_block *b, double t, double stop) {
  if (b->part_s == 0.0) return true;
  const double parts = (stop - t) / b->part_s;
  if (b->part_s > 0.0 && is_whole(parts)) return true;
  return refused(core, b, SLW_CLOCK_INSIDE, NULL, stop);
}

bool slw_timed_part(slw_core *core, slw_block *b, double t, double end, double *stop) {
  const slw_own_clock *c = b->timed ? first_before(b, end) : NULL;
  *stop = end;
  if (!c || slw_timed_near(core, time_of(c), end)) return true;
  *stop = slw_timed_near(core, time_of(c), t) ? t : slw_max(time_of(c), t);
  if (*stop == t || slw_may_part(core, b, t, *stop)) return true;
  core->failure.clock = c->vr;
  return false;
}
