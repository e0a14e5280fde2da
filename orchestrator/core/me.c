/* The life of an FMU of model exchange. See me.h.
 *
 * Between communication points inputs are constant. The solver chooses its own steps; where one ends beyond
 * the communication point, states there are interpolated (dense output), and the step is gone on with as long
 * as no input changes. Of a step the FMU is told when the time has come to its end, never before. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "binding.h"
#include "cvode.h"
#include "me.h"

#define MAX_ITERATIONS 1000 /* of one event */
#define MAX_EVENTS 50       /* in a row, each within CLOSE_EVENTS of the one before: they come without end */
#define CLOSE_EVENTS 1e-9   /* relative to the time, from 1 s on */
#define MAX_IDLE 50         /* steps of the solver in a row that do not advance */
#define ROUNDING 1e-13      /* relative: times up to this apart are one */
#define TOLERANCE 1e-6      /* relative, where neither the run nor the FMU says */

typedef enum { NOTHING, STEP_END, ROOT } ahead;

/* Inputs as they were set last: what has not changed is no event. */
typedef struct told {
  struct told *next;
  slw_type type;
  uint32_t vr;
  size_t n_vr, n;
  slw_cell cells[];
} told;

/* What a state of the FMU lacks. */
typedef struct {
  double t, next;
  bool timed, in_event;
} moment;

typedef struct {
  void *state;
  moment at;
} saved;

typedef struct slw_me {
  slw_fmu *fmu;
  slw_fmu_functions table;
  const slw_fmu_functions *base;
  const slw_me_calls *model;
  slw_cvode *solver;
  size_t n, n_indicators; /* states of the FMU: 0 counts as one that stands still */
  bool completes, running, restart, driven, terminate;
  double tolerance;
  moment at;
  ahead front_kind; /* what the solver found at `front`, at or beyond `at.t` */
  double front;
  double last_event;
  int events_in_a_row, idle;
  char complaint[300]; /* what the FMU gave that is no number; said if the solver finds no way around it */
  slw_status worst; /* met while the solver called */
  double *x, *nominals;
  told *told;
  char *names; /* of the derivatives, a line each */
} slw_me;

static slw_me *of(slw_fmu *fmu) { return fmu->me; }
static double magnitude(double x) { return x < 0.0 ? -x : x; }
static bool one_time(double a, double b) { return magnitude(a - b) <= ROUNDING * (magnitude(a) + magnitude(b)); }
static slw_status worse(slw_status a, slw_status b) { return a > b ? a : b; }

#define TRY(call)                                  \
  do {                                             \
    const slw_status tried = (call);               \
    if (tried > SLW_WARNING) return tried;         \
    worst = worse(worst, tried);                   \
  } while (0)

/* ---- what the solver asks ---- */

static void derivative_name(const slw_me *me, size_t i, char *name, size_t size) {
  const char *line = me->names;
  for (size_t k = 0; k < i && line; k++) line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL;
  if (line && *line) snprintf(name, size, "%.*s", (int)strcspn(line, "\n"), line);
  else snprintf(name, size, "derivative %zu", i + 1);
}

static bool all_finite(slw_me *me, double t, const double *values, size_t n, bool derivatives) {
  for (size_t i = 0; i < n; i++)
    if (values[i] - values[i] != 0.0) {
      char name[200];
      if (derivatives) derivative_name(me, i, name, sizeof name);
      else snprintf(name, sizeof name, "event indicator %zu", i + 1);
      snprintf(me->complaint, sizeof me->complaint, "%s is not a number at t = %.9g s", name, t);
      return false;
    }
  return true;
}

static int answer(slw_me *me, slw_status status) {
  if (status <= SLW_WARNING) return 0;
  me->worst = worse(me->worst, status);
  return status == SLW_DISCARD ? 1 : -1;
}

static slw_status move_to(slw_me *me, double t, const double *x) {
  const slw_status status = me->model->set_time(me->fmu, t);
  if (status > SLW_WARNING || me->n == 0) return status;
  return worse(status, me->model->set_states(me->fmu, x, me->n));
}

static int rates(void *context, double t, const double *x, double *result) {
  slw_me *me = context;
  if (me->n == 0) {
    *result = 0.0;
    return 0;
  }
  const slw_status status = move_to(me, t, x);
  const int gone = answer(me, status > SLW_WARNING ? status : me->model->derivatives(me->fmu, result, me->n));
  if (gone) return gone;
  return all_finite(me, t, result, me->n, true) ? 0 : 1;
}

static int indicators(void *context, double t, const double *x, double *result) {
  slw_me *me = context;
  const slw_status status = move_to(me, t, x);
  if (answer(me, status > SLW_WARNING ? status : me->model->indicators(me->fmu, result, me->n_indicators)))
    return -1;
  return all_finite(me, t, result, me->n_indicators, false) ? 0 : -1;
}

/* ---- events ---- */

/* In event mode: iterate, and go on with continuous time. */
static slw_status iterate(slw_me *me) {
  slw_status worst = SLW_OK;
  slw_event_result result = {true, false, false, 0.0};
  for (int i = 0; result.more; i++) {
    if (i == MAX_ITERATIONS) {
      slw_fmu_logf(me->fmu, "the event at t = %.9g s never ends: after %d iterations it wants another", me->at.t, i);
      return SLW_ERROR;
    }
    TRY(me->model->update(me->fmu, &result));
    if (result.terminate) {
      me->terminate = true;
      return worst;
    }
  }
  me->at.timed = result.next_event_defined, me->at.next = result.next_event;
  me->at.in_event = false, me->restart = true;
  TRY(me->model->enter_continuous(me->fmu));
  return worst;
}

/* Events that come ever faster have no end (Zeno). */
static bool without_end(slw_me *me) {
  const double scale = magnitude(me->at.t) > 1.0 ? magnitude(me->at.t) : 1.0;
  const bool close = me->at.t - me->last_event <= CLOSE_EVENTS * scale;
  me->events_in_a_row = close ? me->events_in_a_row + 1 : 0;
  me->last_event = me->at.t;
  if (me->events_in_a_row < MAX_EVENTS) return false;
  if (me->at.timed && me->at.next < me->at.t && !one_time(me->at.next, me->at.t)) {
    slw_fmu_logf(me->fmu, "the next event is to be at t = %.9g s, which has passed, also after %d events at t = %.9g s",
                 me->at.next, MAX_EVENTS, me->at.t);
    return true;
  }
  slw_fmu_logf(me->fmu, "events without end (Zeno): %d in a row less than %g s apart at t = %.9g s", MAX_EVENTS,
               CLOSE_EVENTS * scale, me->at.t);
  return true;
}

static slw_status handle(slw_me *me) {
  slw_status worst = SLW_OK;
  if (without_end(me)) return SLW_ERROR;
  TRY(me->model->enter_event(me->fmu));
  TRY(iterate(me));
  return worst;
}

/* ---- integration ---- */

static slw_status begin_anew(slw_me *me) {
  slw_status worst = SLW_OK;
  if (me->n) {
    TRY(me->model->get_states(me->fmu, me->x, me->n));
    TRY(me->model->nominals(me->fmu, me->nominals, me->n));
  }
  for (size_t i = 0; i < me->n; i++) {
    const double size = magnitude(me->nominals[i]);
    me->nominals[i] = size > 0.0 && size - size == 0.0 ? size : 1.0;
  }
  me->restart = false, me->front_kind = NOTHING;
  if (slw_cvode_restart(me->solver, me->at.t, me->x, me->nominals, me->tolerance)) return worst;
  slw_fmu_logf(me->fmu, "the solver cannot begin at t = %.9g s: %s", me->at.t, slw_cvode_message(me->solver));
  return SLW_ERROR;
}

/* What the FMU gave that is no number is the better reason. */
static slw_status give_up(slw_me *me, const char *why) {
  if (*me->complaint) slw_fmu_log(me->fmu, me->complaint);
  else slw_fmu_logf(me->fmu, "the solver gives up at t = %.9g s: %s", me->at.t, why);
  return me->worst > SLW_DISCARD ? me->worst : SLW_ERROR;
}

static slw_status solver_step(slw_me *me, double aim) {
  me->worst = SLW_OK;
  /* With inputs that change at each communication point a step beyond it is for nothing. */
  const double stop = me->driven ? aim : me->at.timed ? me->at.next : 1e300;
  const slw_solver_end end = slw_cvode_step(me->solver, aim, stop, &me->front);
  if (end == SLW_SOLVER_FAILED) return give_up(me, slw_cvode_message(me->solver));
  if (me->front > me->at.t && !one_time(me->front, me->at.t)) me->idle = 0, *me->complaint = 0;
  else if (++me->idle == MAX_IDLE) return give_up(me, "its steps no longer advance");
  me->front_kind = end == SLW_SOLVER_ROOT ? ROOT : STEP_END;
  return me->worst == SLW_WARNING ? SLW_WARNING : SLW_OK;
}

/* The time has come to the front: what the solver found there happens. */
static slw_status arrive(slw_me *me) {
  slw_status worst = SLW_OK;
  bool event = me->front_kind == ROOT;
  bool asked = false;
  TRY(move_to(me, me->front, slw_cvode_states(me->solver)));
  me->at.t = me->front, me->front_kind = NOTHING;
  if (me->completes) TRY(me->model->completed(me->fmu, &asked, &me->terminate));
  event = event || asked;
  if (event && !me->terminate) TRY(handle(me));
  return worst;
}

static slw_status interpolate(slw_me *me, double t) {
  if (!slw_cvode_at(me->solver, t, me->x)) {
    slw_fmu_logf(me->fmu, "no states at t = %.9g s: %s", t, slw_cvode_message(me->solver));
    return SLW_ERROR;
  }
  me->at.t = t;
  return move_to(me, t, me->x);
}

/* One event, one step of the solver, or up to `end`. */
static slw_status advance(slw_me *me, double end) {
  slw_status worst = SLW_OK;
  if (me->at.timed && (me->at.next <= me->at.t || one_time(me->at.next, me->at.t))) return handle(me);
  const double limit = me->at.timed && me->at.next < end ? me->at.next : end;
  if (me->restart) TRY(begin_anew(me));
  if (me->front_kind == NOTHING) TRY(solver_step(me, limit));
  if (me->front <= limit || one_time(me->front, limit)) return worse(worst, arrive(me));
  return worse(worst, interpolate(me, limit));
}

static bool due(const slw_me *me, double end) {
  if (me->at.t < end && !one_time(me->at.t, end)) return true;
  return me->at.timed && (me->at.next <= end || one_time(me->at.next, end));
}

static slw_status step(slw_fmu *fmu, double time, double h, slw_step_result *result) {
  slw_me *me = of(fmu);
  const double end = time + h;
  slw_status worst = SLW_OK;
  *result = (slw_step_result){time, false, false, false};
  me->driven = me->at.in_event;
  if (me->at.in_event) TRY(iterate(me));
  while (!me->terminate && due(me, end)) TRY(advance(me, end));
  result->terminate = me->terminate;
  result->reached = me->terminate ? me->at.t : end;
  return worst;
}

/* ---- life ---- */

static slw_status enter_initialisation(slw_fmu *fmu, double start, bool stop_defined, double stop,
                                       double tolerance) {
  slw_me *me = of(fmu);
  me->at.t = start, me->last_event = start - 1.0;
  if (tolerance > 0.0) me->tolerance = tolerance;
  return me->base->enter_initialisation(fmu, start, stop_defined, stop, me->tolerance);
}

static slw_status exit_initialisation(slw_fmu *fmu) {
  slw_me *me = of(fmu);
  slw_status worst = SLW_OK;
  TRY(me->base->exit_initialisation(fmu));
  TRY(iterate(me));
  me->running = true;
  return worst;
}

static void forget(slw_me *me) {
  while (me->told) {
    told *next = me->told->next;
    free(me->told);
    me->told = next;
  }
}

/* Whether the values differ from those last set; notes them. */
static bool news(slw_me *me, const slw_group *g) {
  told *found = me->told;
  if (g->type == SLW_STRING || g->type == SLW_BINARY || !g->n) return true;
  while (found && !(found->type == g->type && found->vr == *g->vr && found->n_vr == g->n_vr && found->n == g->n))
    found = found->next;
  if (found && memcmp(found->cells, g->cells, g->n * sizeof *g->cells) == 0) return false;
  if (!found && (found = malloc(sizeof *found + g->n * sizeof *g->cells))) {
    *found = (told){me->told, g->type, *g->vr, g->n_vr, g->n};
    me->told = found;
  }
  if (found) memcpy(found->cells, g->cells, g->n * sizeof *g->cells);
  return true;
}

/* A changed input is an event: the rates jump, and only in event mode may a discrete one be set. */
static slw_status set(slw_fmu *fmu, const slw_group *g) {
  slw_me *me = of(fmu);
  slw_status worst = SLW_OK;
  const bool changed = news(me, g);
  if (me->running && !changed) return SLW_OK;
  if (me->running && !me->at.in_event && !me->terminate) {
    TRY(me->model->enter_event(fmu));
    me->at.in_event = true;
  }
  TRY(me->base->set(fmu, g));
  return worst;
}

static slw_status get_state(slw_fmu *fmu, void **state) {
  slw_me *me = of(fmu);
  saved *s = *state ? *state : calloc(1, sizeof *s);
  if (!s) return SLW_ERROR;
  *state = s, s->at = me->at;
  return me->base->get_state(fmu, &s->state);
}

static slw_status set_state(slw_fmu *fmu, void *state) {
  slw_me *me = of(fmu);
  const saved *s = state;
  me->at = s->at, me->restart = true, me->terminate = false, me->running = true;
  me->events_in_a_row = 0, me->last_event = s->at.t - 1.0;
  forget(me);
  return me->base->set_state(fmu, s->state);
}

static slw_status free_state(slw_fmu *fmu, void **state) {
  saved *s = *state;
  *state = NULL;
  const slw_status status = s ? of(fmu)->base->free_state(fmu, &s->state) : SLW_OK;
  free(s);
  return status;
}

static slw_status serialized_size(slw_fmu *fmu, void *state, size_t *size) {
  const slw_status status = of(fmu)->base->serialized_size(fmu, ((saved *)state)->state, size);
  *size += sizeof(moment);
  return status;
}

static slw_status serialize(slw_fmu *fmu, void *state, char *bytes, size_t size) {
  if (size < sizeof(moment)) return SLW_ERROR;
  memcpy(bytes, &((saved *)state)->at, sizeof(moment));
  return of(fmu)->base->serialize(fmu, ((saved *)state)->state, bytes + sizeof(moment), size - sizeof(moment));
}

static slw_status deserialize(slw_fmu *fmu, const char *bytes, size_t size, void **state) {
  if (size < sizeof(moment)) return SLW_ERROR;
  saved *s = *state ? *state : calloc(1, sizeof *s);
  if (!s) return SLW_ERROR;
  memcpy(&s->at, bytes, sizeof(moment));
  *state = s;
  return of(fmu)->base->deserialize(fmu, bytes + sizeof(moment), size - sizeof(moment), &s->state);
}

static slw_status reset(slw_fmu *fmu) {
  slw_me *me = of(fmu);
  me->running = me->terminate = false, me->at = (moment){0.0, 0.0, false, false};
  me->front_kind = NOTHING;
  forget(me);
  return me->base->reset(fmu);
}

static void free_fmu(slw_fmu *fmu) {
  slw_me *me = of(fmu);
  const slw_fmu_functions *base = me->base;
  fmu->call = base, fmu->me = NULL;
  slw_cvode_free(me->solver);
  forget(me);
  free(me->x), free(me->nominals), free(me->names), free(me);
  base->free(fmu);
}

/* "states indicators completes tolerance" in one line, the solver's library in one, a line for each derivative. */
static bool read(slw_me *me, const char *text, char *error, size_t error_size) {
  int completes = 0, length = 0;
  char path[4096];
  if (sscanf(text, "%zu %zu %d %lf\n%4095[^\n]%n", &me->n, &me->n_indicators, &completes, &me->tolerance, path,
             &length) != 5) {
    snprintf(error, error_size, "its model exchange is not described");
    return false;
  }
  const char *names = text + length + (text[length] == '\n');
  me->completes = completes != 0;
  if (!(me->tolerance > 0.0)) me->tolerance = TOLERANCE;
  const size_t n = me->n ? me->n : 1;
  me->names = malloc(strlen(names) + 1), me->x = calloc(n, sizeof *me->x), me->nominals = calloc(n, sizeof *me->x);
  if (!me->names || !me->x || !me->nominals) return false;
  memcpy(me->names, names, strlen(names) + 1);
  me->nominals[0] = 1.0;
  me->solver = slw_cvode_new(path, n, me->n_indicators, rates, indicators, me, error, error_size);
  return me->solver != NULL;
}

bool slw_me_wrap(slw_fmu *fmu, const slw_me_calls *calls, const char *exchange, char *error, size_t error_size) {
  slw_me *me = calloc(1, sizeof *me);
  snprintf(error, error_size, "no memory");
  if (!me) return false;
  me->fmu = fmu, me->base = fmu->call, me->model = calls, me->table = *fmu->call, me->restart = true;
  me->table.enter_initialisation = enter_initialisation, me->table.exit_initialisation = exit_initialisation;
  me->table.set = set, me->table.step = step, me->table.free = free_fmu, me->table.reset = reset;
  me->table.get_state = get_state, me->table.set_state = set_state, me->table.free_state = free_state;
  me->table.serialized_size = serialized_size, me->table.serialize = serialize;
  me->table.deserialize = deserialize;
  fmu->me = me, fmu->call = &me->table;
  return read(me, exchange, error, error_size);
}
