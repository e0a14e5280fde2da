/* The life of an FMU of scheduled execution. See scheduled.h. Source: FMI 3.0.2, chapter 5. */
#include "scheduled.h"

#include <stdio.h>
#include <stdlib.h>

#include "binding.h"

/* A clock that a partition may announce: a countdown clock with its interval, or an output clock. */
typedef struct {
  uint32_t vr;
  bool output, fraction;
  bool fresh; /* announced, and not yet read */
  slw_interval interval;
} announced;

/* When a partition ran last: it may run once at a time. */
typedef struct {
  uint32_t vr;
  double time;
} activated;

typedef struct slw_scheduled {
  slw_fmu_functions table;
  const slw_fmu_functions *base;
  slw_activation activate;
  announced *clocks;
  size_t n_clocks;
  activated *last;
  size_t n_last;
  bool running, news; /* news: output clocks were announced since the last update */
  slw_status worst;   /* met while clocks were read in a callback */
} slw_scheduled;

static slw_scheduled *of(slw_fmu *fmu) { return fmu->partitions; }

/* ---- callbacks ---- */

static _Thread_local int locks; /* of the partition that runs in this thread */

void slw_scheduled_lock(void) { locks++; }
void slw_scheduled_unlock(void) { locks--; }

static slw_status read_output(slw_fmu *fmu, announced *c) {
  slw_cell on = {.integer = 0};
  bool native = false;
  const slw_group group = {SLW_CLOCK, 1, 1, &c->vr, &on, &native, NULL, NULL};
  const slw_status status = of(fmu)->base->get(fmu, &group);
  if (status <= SLW_WARNING && on.integer) c->fresh = of(fmu)->news = true;
  return status;
}

static slw_status read_countdown(slw_fmu *fmu, announced *c) {
  slw_interval found = {SLW_NOT_YET_KNOWN, 0.0};
  const slw_status status = of(fmu)->base->interval(fmu, c->vr, c->fraction, &found);
  const bool unchanged = found.qualifier == SLW_UNCHANGED || found.qualifier == SLW_NOT_YET_KNOWN;
  if (status <= SLW_WARNING && !unchanged) c->fresh = true, c->interval = found;
  return status;
}

void slw_scheduled_update(void *environment) {
  slw_fmu *fmu = environment;
  slw_scheduled *s = fmu ? of(fmu) : NULL; /* some FMUs forget it, or call while they are made */
  for (announced *c = s ? s->clocks : NULL; s && c < s->clocks + s->n_clocks; c++) {
    const slw_status status = c->output ? read_output(fmu, c) : read_countdown(fmu, c);
    if (status > s->worst) s->worst = status;
  }
}

/* ---- the table ---- */

static slw_status exit_initialisation(slw_fmu *fmu) {
  const slw_status status = of(fmu)->base->exit_initialisation(fmu);
  of(fmu)->running = status <= SLW_WARNING;
  return status;
}

/* Notes that a partition runs; false: it has run at this time. */
static bool note(slw_fmu *fmu, uint32_t vr, double time) {
  slw_scheduled *s = of(fmu);
  size_t k = 0;
  while (k < s->n_last && s->last[k].vr != vr) k++;
  if (k < s->n_last && !(s->last[k].time < time)) {
    slw_fmu_logf(fmu, "the clock of value reference %u ticks twice at t = %.9g s, which scheduled execution does not allow",
                 vr, time);
    return false;
  }
  if (k == s->n_last) {
    activated *more = realloc(s->last, (k + 1) * sizeof *more);
    if (!more) return false;
    s->last = more, s->n_last++;
  }
  s->last[k] = (activated){vr, time};
  return true;
}

static slw_status run_partition(slw_fmu *fmu, uint32_t vr, double time) {
  slw_scheduled *s = of(fmu);
  if (!note(fmu, vr, time)) return SLW_ERROR;
  locks = 0, s->worst = SLW_OK;
  slw_status status = s->activate(fmu, vr, time);
  if (s->worst > status) status = s->worst;
  if (status == SLW_DISCARD) status = SLW_ERROR;
  if (locks == 0) return status;
  slw_fmu_logf(fmu, "the partition of the clock of value reference %u ends at t = %.9g s with %d preemption locks %s",
               vr, time, locks > 0 ? locks : -locks, locks > 0 ? "held" : "too few");
  return status > SLW_WARNING ? status : SLW_WARNING;
}

static slw_status set(slw_fmu *fmu, const slw_group *g) {
  if (g->type != SLW_CLOCK) return of(fmu)->base->set(fmu, g);
  return g->n > g->n_vr ? run_partition(fmu, g->vr[0], g->cells[g->n_vr].real) : SLW_ERROR;
}

/* In a run a clock is known from the callback only: the FMU tells of it once, there. */
static slw_status get(slw_fmu *fmu, const slw_group *g) {
  slw_scheduled *s = of(fmu);
  if (g->type != SLW_CLOCK || !s->running) return s->base->get(fmu, g);
  for (size_t i = 0; i < g->n_vr; i++) {
    g->cells[i].integer = 0;
    for (announced *c = s->clocks; c < s->clocks + s->n_clocks; c++)
      if (c->output && c->vr == g->vr[i] && c->fresh) g->cells[i].integer = 1, c->fresh = false;
  }
  return SLW_OK;
}

static slw_status interval(slw_fmu *fmu, uint32_t vr, bool fraction, slw_interval *result) {
  slw_scheduled *s = of(fmu);
  for (announced *c = s->clocks; s->running && c < s->clocks + s->n_clocks; c++)
    if (!c->output && c->vr == vr) {
      *result = c->interval;
      if (!c->fresh) result->qualifier = SLW_UNCHANGED;
      c->fresh = false;
      return SLW_OK;
    }
  return s->base->interval(fmu, vr, fraction, result);
}

static slw_status step(slw_fmu *fmu, double time, double h, slw_step_result *result) {
  *result = (slw_step_result){time + h, false, false, false};
  return fmu->fatal ? SLW_FATAL : SLW_OK;
}

static slw_status stay(slw_fmu *fmu) { return fmu->fatal ? SLW_FATAL : SLW_OK; }

/* Once more where output clocks were announced, so that they are read; what nobody reads is over then. */
static slw_status update_discrete(slw_fmu *fmu, slw_event_result *result) {
  slw_scheduled *s = of(fmu);
  *result = (slw_event_result){s->news, false, false, 0.0};
  for (announced *c = s->clocks; !s->news && c < s->clocks + s->n_clocks; c++)
    if (c->output) c->fresh = false;
  s->news = false;
  return SLW_OK;
}

static void forget(slw_scheduled *s) {
  s->n_last = 0, s->news = false;
  for (announced *c = s->clocks; c < s->clocks + s->n_clocks; c++) c->fresh = false;
}

static slw_status set_state(slw_fmu *fmu, void *state) {
  forget(of(fmu));
  return of(fmu)->base->set_state(fmu, state);
}

static slw_status reset(slw_fmu *fmu) {
  forget(of(fmu));
  of(fmu)->running = false;
  return of(fmu)->base->reset(fmu);
}

static void free_fmu(slw_fmu *fmu) {
  slw_scheduled *s = of(fmu);
  const slw_fmu_functions *base = s->base;
  fmu->call = base, fmu->partitions = NULL;
  free(s->clocks), free(s->last), free(s);
  base->free(fmu);
}

/* ---- making it ---- */

static bool read(slw_scheduled *s, const char *text) {
  slw_lines lines;
  if (!slw_lines_of(text, &lines)) return false;
  s->clocks = calloc(lines.n + 1, sizeof *s->clocks);
  bool done = s->clocks != NULL;
  for (size_t i = 0; done && i < lines.n; i++) {
    char kind[16];
    announced *c = &s->clocks[i];
    done = sscanf(lines.list[i], "%15s %u", kind, &c->vr) == 2;
    c->output = done && strcmp(kind, "output") == 0, c->fraction = done && strcmp(kind, "fraction") == 0;
    c->interval.qualifier = SLW_UNCHANGED;
  }
  s->n_clocks = done ? lines.n : 0;
  slw_lines_free(&lines);
  return done;
}

bool slw_scheduled_wrap(slw_fmu *fmu, slw_activation activate, const char *text, char *error, size_t error_size) {
  slw_scheduled *s = calloc(1, sizeof *s);
  snprintf(error, error_size, "its scheduled execution is not described");
  if (!s) return false;
  s->base = fmu->call, s->table = *fmu->call, s->activate = activate;
  s->table.exit_initialisation = exit_initialisation, s->table.set = set, s->table.get = get, s->table.step = step;
  s->table.enter_event = s->table.enter_step = stay, s->table.update_discrete = update_discrete;
  s->table.interval = interval, s->table.set_state = set_state, s->table.reset = reset, s->table.free = free_fmu;
  fmu->partitions = s, fmu->call = &s->table, fmu->scheduled = true;
  return read(s, text);
}
