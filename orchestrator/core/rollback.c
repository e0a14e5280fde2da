/* The algorithms that take steps back: iteration to a fixed point, and step doubling with error control.
 *
 * Both advance the system by one tick, so that records keep their grid; FMUs of other rates step beside them
 * as in Jacobi. Real values only count for tolerances; others take the newest value. */
#include "plan.h"

/* Every block that takes part: those that step every tick. */
#define EACH(b) for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) if (b->multiple == 1)

static bool save_all(slw_core *core, int slot) {
  EACH(b) if (!slw_block_save(core, b, slot)) return false;
  return true;
}

static bool restore_all(slw_core *core, int slot) {
  EACH(b) if (!slw_block_restore(core, b, slot)) return false;
  return true;
}

/* Strings and binaries, which no copy of the cells holds, as they were at the restored state. */
static bool reread_texts(slw_core *core) {
  EACH(b) for (uint32_t i = 0; i < b->n_gets; i++)
    if (b->gets[i].blobs) {
      const slw_status status = b->fmu->call->get(b->fmu, &b->gets[i]);
      if (status > SLW_WARNING) return slw_fail(core, SLW_DOING_GET, status, b, 0);
    }
  return true;
}

static bool exchange_all(slw_core *core) {
  EACH(b) if (!slw_exchange_run(core, (uint32_t)(b - core->blocks), &b->in)) return false;
  return true;
}

static bool finish(slw_core *core) {
  EACH(b) slw_exchange_accept(core, &b->in);
  return slw_slow_end(core);
}

static bool step_all(slw_core *core, double t, double h, bool clocks) {
  EACH(b) {
    const double before = core->timing ? slw_clock_s() : 0.0;
    if (!slw_block_inputs(core, b, t, clocks) || !slw_block_step(core, b, t, h) || !slw_block_get(core, b)) return false;
    if (core->timing) b->count.seconds += slw_clock_s() - before;
  }
  return true;
}

/* Largest change of a real output against the tolerance, and its cell. */
static double distance(slw_core *core, const slw_cell *old, uint32_t *cell) {
  double worst = 0.0;
  EACH(b) for (uint32_t i = 0; i < b->n_gets; i++) {
    if (b->gets[i].type > SLW_FLOAT32) continue;
    for (size_t k = 0; k < b->gets[i].n; k++) {
      const uint32_t at = (uint32_t)(b->gets[i].cells + k - core->cells);
      const double d = slw_distance(core, at, old[at].real, core->cells[at].real);
      if (d > worst) worst = d, *cell = at;
    }
  }
  return worst;
}

static size_t arena(const slw_core *core) { return core->n_cells * sizeof(slw_cell); }
static slw_cell *scratch(slw_core *core, int k) { return core->scratch + (size_t)k * core->n_cells; }

/* ---- iterate: inputs are the mean of their values at both ends of the step (trapezoidal, second order) ---- */

static void average_inputs(slw_core *core, const slw_cell *start) {
  EACH(b) for (uint32_t i = 0; i < b->n_sets; i++) {
    if (b->sets[i].type > SLW_FLOAT32) continue;
    for (size_t k = 0; k < b->sets[i].n; k++) {
      slw_cell *input = &b->sets[i].cells[k];
      input->real = 0.5 * (start[input - core->cells].real + input->real);
    }
  }
}

/* What clocks clock is set where they tick, at the begin of the step: each sweep finds it as it was there. */
static void clocked_inputs(slw_core *core, const slw_cell *start) {
  EACH(b) for (const slw_own_clock *c = b->clocks; c < b->clocks + b->n_clocks; c++)
    for (uint32_t i = 0; i < c->n_sets; i++)
      if (!c->sets[i].blobs)
        memcpy(c->sets[i].cells, start + (c->sets[i].cells - core->cells), c->sets[i].n * sizeof *start);
}

/* Every real input, as its cell's number `at`. */
#define EACH_INPUT(at)                                                                                  \
  EACH(b) for (uint32_t i_ = 0; i_ < b->n_sets; i_++) if (b->sets[i_].type <= SLW_FLOAT32)              \
      for (size_t k_ = 0, at = (size_t)(b->sets[i_].cells - core->cells); k_ < b->sets[i_].n; k_++, at++)

/* Largest difference of a real input to the one that was used, in tolerances; a whole number that differs: 2. */
static double residual(slw_core *core, const slw_cell *used, uint32_t *cell) {
  double worst = 0.0;
  EACH(b) for (uint32_t i = 0; i < b->n_sets; i++) {
    for (size_t k = 0; k < b->sets[i].n; k++) {
      const uint32_t at = (uint32_t)(b->sets[i].cells + k - core->cells);
      const bool real = b->sets[i].type <= SLW_FLOAT32, same = core->cells[at].integer == used[at].integer;
      const double d = real ? slw_distance(core, at, core->cells[at].real, used[at].real) : (same ? 0.0 : 2.0);
      if (d > worst) worst = d, *cell = at;
    }
  }
  return worst;
}

#define LEAST_FACTOR 0.01 /* of the residual, that an input moves by */
#define MOST_FACTOR 10.0

/* The next inputs: used + factor * residual, the factor after Aitken (Kuettler and Wall 2008, eq. 44): a loop
 * whose gain exceeds 1 converges too. `last` holds the residual of the sweep before, and then this one's. */
static double relax(slw_core *core, const slw_cell *used, slw_cell *last, double factor, bool first) {
  double along = 0.0, square = 0.0;
  EACH_INPUT(at) {
    const double r = (core->cells[at].real - used[at].real) / core->nominal[at];
    along += last[at].real * (r - last[at].real);
    square += (r - last[at].real) * (r - last[at].real);
    last[at].real = r;
  }
  if (!first && square > 0.0) {
    factor *= -along / square;
    const double size = slw_abs(factor);
    if (size < LEAST_FACTOR || size > MOST_FACTOR) factor = 1.0;
  }
  EACH_INPUT(at) core->cells[at].real = used[at].real + factor * (core->cells[at].real - used[at].real);
  return factor;
}

bool slw_iterate(slw_core *core) {
  slw_cell *start = scratch(core, 0), *used = scratch(core, 1), *last = scratch(core, 2);
  uint32_t worst = 0;
  double factor = 1.0;
  if (!slw_slow_begin(core) || !exchange_all(core) || !save_all(core, 0)) return false;
  memcpy(start, core->cells, arena(core));
  for (uint32_t i = 0; i < core->max_iterations; i++) {
    if (i > 0 && !restore_all(core, 0)) return false;
    memcpy(used, core->cells, arena(core));
    core->count.sweeps++;
    if (!step_all(core, slw_time(core), core->step_s, true)) return false;
    if (core->ended) return finish(core);
    if (!exchange_all(core)) return false;
    average_inputs(core, start);
    clocked_inputs(core, start);
    if (residual(core, used, &worst) <= 1.0) return finish(core);
    factor = relax(core, used, last, factor, i == 0);
  }
  return slw_fail(core, SLW_NO_CONVERGENCE, SLW_OK, NULL, worst);
}

/* ---- adaptive: one step against two of half the size ---- */

#define SAFE 0.2 /* a doubled step has four times the error, and some to spare */

static bool part(slw_core *core, double t, double h, bool first) {
  return exchange_all(core) && step_all(core, t, h, first);
}

/* From `at` (in units) on: a whole step, then two halves, whose result stays; *error is the difference. */
static bool attempt(slw_core *core, uint64_t at, uint64_t size, double unit, double *error, uint32_t *worst) {
  slw_cell *start = scratch(core, 0), *whole = scratch(core, 1);
  const double t = slw_time(core) + (double)at * unit, h = (double)size * unit;
  memcpy(start, core->cells, arena(core));
  if (!save_all(core, 0) || !part(core, t, h, at == 0)) return false;
  memcpy(whole, core->cells, arena(core));
  memcpy(core->cells, start, arena(core));
  if (!restore_all(core, 0) || !reread_texts(core) || !part(core, t, 0.5 * h, at == 0) ||
      !part(core, t + 0.5 * h, 0.5 * h, false))
    return false;
  *error = distance(core, whole, worst);
  return true;
}

static bool take_back(slw_core *core) {
  core->count.rejected++;
  memcpy(core->cells, scratch(core, 0), arena(core));
  return restore_all(core, 0) && reread_texts(core);
}

bool slw_adaptive(slw_core *core) {
  const uint64_t n = (uint64_t)2 << core->max_halvings; /* units in a tick; a step has an even number of them */
  const double unit = core->step_s / (double)n;
  if (!slw_slow_begin(core) || !exchange_all(core)) return false;
  for (uint64_t at = 0; at < n && !core->ended;) {
    uint64_t size = core->size;
    while (at % size != 0) size /= 2; /* steps stay on their own grid, so sizes may double again */
    double error = 0.0;
    uint32_t worst = 0;
    if (!attempt(core, at, size, unit, &error, &worst)) return false;
    if (!(error <= 1.0)) {
      if (size == 2) return slw_fail(core, SLW_STEP_TOO_SMALL, SLW_OK, NULL, worst);
      if (!take_back(core)) return false;
      core->size = size / 2;
      continue;
    }
    at += size, core->count.steps++;
    core->size = error < SAFE && size < n ? 2 * size : size;
  }
  return finish(core);
}
