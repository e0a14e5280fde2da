/* To tick 0: outputs of all FMUs in initialisation mode propagated in order; algebraic loops solved.
 *
 * A loop's members are swept until their outputs stand still. Where that does not converge, Newton's method
 * with differences finds the inputs z at which what the members give back is z. */
#include "plan.h"

#define MAX_UNKNOWNS 64
#define DIFFERENCE 1e-7 /* relative to the nominal value: about the square root of a double's precision */
#define MAX_NEWTON 30

/* What a clock of the block clocks: only here it is set and read without a tick. */
static bool clocked(slw_core *core, slw_block *b, bool set) {
  for (const slw_own_clock *c = b->clocks; c < b->clocks + b->n_clocks; c++)
    for (uint32_t i = 0; i < (set ? c->n_sets : c->n_gets); i++) {
      const slw_status status =
          set ? b->fmu->call->set(b->fmu, &c->sets[i]) : b->fmu->call->get(b->fmu, &c->gets[i]);
      if (status > SLW_WARNING) return slw_fail(core, set ? SLW_DOING_SET : SLW_DOING_GET, status, b, 0);
    }
  return true;
}

static bool evaluate(slw_core *core, slw_block *b) {
  return slw_block_set(core, b) && clocked(core, b, true) && slw_block_get(core, b) && clocked(core, b, false);
}

static bool refresh(slw_core *core, uint32_t position) {
  const uint32_t i = core->order[position];
  return slw_exchange_run(core, i, &core->blocks[i].in) && evaluate(core, &core->blocks[i]);
}

/* Largest change of real outputs of the blocks order[first, end), in tolerances; whole numbers count 2. */
static double change(slw_core *core, uint32_t first, uint32_t end, const slw_cell *old) {
  double worst = 0.0;
  for (uint32_t p = first; p < end; p++) {
    const slw_block *b = &core->blocks[core->order[p]];
    for (uint32_t i = 0; i < b->n_gets; i++)
      for (size_t k = 0; k < b->gets[i].n; k++) {
        const uint32_t at = (uint32_t)(b->gets[i].cells + k - core->cells);
        const bool real = b->gets[i].type <= SLW_FLOAT32;
        const bool differs = old[at].integer != core->cells[at].integer;
        worst = slw_max(worst, real ? slw_distance(core, at, old[at].real, core->cells[at].real)
                                    : (differs ? 2.0 : 0.0));
      }
  }
  return worst;
}

/* Without direct feedthrough values stand still, to the bit, after as many sweeps as there are members. */
static bool sweeps(slw_core *core, uint32_t first, uint32_t end, bool *converged) {
  slw_cell *old = core->scratch;
  const size_t size = core->n_cells * sizeof *old;
  *converged = false;
  for (uint32_t n = 0; n < core->max_iterations && !*converged; n++) {
    memcpy(old, core->cells, size);
    for (uint32_t p = first; p < end; p++)
      if (!refresh(core, p)) return false;
    const bool enough = n > end - first && change(core, first, end, old) <= 1.0;
    *converged = enough || memcmp(old, core->cells, size) == 0;
  }
  return true;
}

/* ---- Newton ---- */

typedef struct {
  uint32_t n, first, end;
  uint32_t cell[MAX_UNKNOWNS];
  double z[MAX_UNKNOWNS], residual[MAX_UNKNOWNS], jacobian[MAX_UNKNOWNS * MAX_UNKNOWNS];
} slw_newton;

/* The unknowns: real inputs of the loop's members; false when there are none or too many. */
static bool unknowns(slw_core *core, slw_newton *s) {
  s->n = 0;
  for (uint32_t p = s->first; p < s->end; p++) {
    const slw_block *b = &core->blocks[core->order[p]];
    for (uint32_t i = 0; i < b->n_sets; i++)
      for (size_t k = 0; k < b->sets[i].n && b->sets[i].type <= SLW_FLOAT32; k++) {
        if (s->n == MAX_UNKNOWNS) return false;
        s->cell[s->n] = (uint32_t)(b->sets[i].cells + k - core->cells);
        s->z[s->n] = core->cells[s->cell[s->n]].real;
        s->n++;
      }
  }
  return s->n > 0;
}

/* residual = what the members give back for the inputs z, minus z. */
static bool residual(slw_core *core, slw_newton *s, double *result) {
  for (uint32_t i = 0; i < s->n; i++) core->cells[s->cell[i]].real = s->z[i];
  for (uint32_t p = s->first; p < s->end; p++)
    if (!evaluate(core, &core->blocks[core->order[p]])) return false;
  for (uint32_t p = s->first; p < s->end; p++)
    if (!slw_exchange_run(core, core->order[p], &core->blocks[core->order[p]].in)) return false;
  for (uint32_t i = 0; i < s->n; i++) result[i] = core->cells[s->cell[i]].real - s->z[i];
  return true;
}

static bool differences(slw_core *core, slw_newton *s) {
  double moved[MAX_UNKNOWNS];
  for (uint32_t j = 0; j < s->n; j++) {
    const double z = s->z[j], d = DIFFERENCE * slw_max(slw_abs(z), core->nominal[s->cell[j]]);
    s->z[j] = z + d;
    const bool done = residual(core, s, moved);
    s->z[j] = z;
    if (!done) return false;
    for (uint32_t i = 0; i < s->n; i++) s->jacobian[i * s->n + j] = (moved[i] - s->residual[i]) / d;
  }
  return true;
}

/* Gaussian elimination with pivots, in place: the solution of jacobian * x = residual is left in residual. */
static bool solve(slw_newton *s) {
  const uint32_t n = s->n;
  for (uint32_t c = 0; c < n; c++) {
    uint32_t pivot = c;
    for (uint32_t r = c + 1; r < n; r++)
      if (slw_abs(s->jacobian[r * n + c]) > slw_abs(s->jacobian[pivot * n + c])) pivot = r;
    if (!(slw_abs(s->jacobian[pivot * n + c]) > 0.0)) return false;
    for (uint32_t k = 0; k < n; k++) {
      const double swapped = s->jacobian[c * n + k];
      s->jacobian[c * n + k] = s->jacobian[pivot * n + k], s->jacobian[pivot * n + k] = swapped;
    }
    const double swapped = s->residual[c];
    s->residual[c] = s->residual[pivot], s->residual[pivot] = swapped;
    for (uint32_t r = c + 1; r < n; r++) {
      const double f = s->jacobian[r * n + c] / s->jacobian[c * n + c];
      for (uint32_t k = c; k < n; k++) s->jacobian[r * n + k] -= f * s->jacobian[c * n + k];
      s->residual[r] -= f * s->residual[c];
    }
  }
  for (uint32_t c = n; c-- > 0;) {
    for (uint32_t k = c + 1; k < n; k++) s->residual[c] -= s->jacobian[c * n + k] * s->residual[k];
    s->residual[c] /= s->jacobian[c * n + c];
  }
  return true;
}

static bool newton(slw_core *core, uint32_t first, uint32_t end, bool *converged) {
  slw_newton *s = calloc(1, sizeof *s);
  bool done = s != NULL;
  *converged = false;
  if (s) s->first = first, s->end = end;
  if (!s || !unknowns(core, s)) {
    free(s);
    return done;
  }
  for (int n = 0; n < MAX_NEWTON && done && !*converged; n++) {
    done = residual(core, s, s->residual) && differences(core, s) && residual(core, s, s->residual);
    if (!done || !solve(s)) break;
    double worst = 0.0;
    for (uint32_t i = 0; i < s->n; i++) {
      worst = slw_max(worst, slw_distance(core, s->cell[i], s->z[i], s->z[i] - s->residual[i]));
      s->z[i] -= s->residual[i];
    }
    *converged = worst <= 1.0;
  }
  done = done && residual(core, s, s->residual);
  free(s);
  return done;
}

/* ---- the whole ---- */

static bool solve_loop(slw_core *core, uint32_t first, uint32_t end) {
  bool converged;
  slw_cell *before = core->scratch + core->n_cells;
  memcpy(before, core->cells, core->n_cells * sizeof *before);
  if (sweeps(core, first, end, &converged) && converged) return true;
  memcpy(core->cells, before, core->n_cells * sizeof *before);
  if (!newton(core, first, end, &converged)) return false;
  if (converged) return true;
  core->failure.loop = core->loop[first];
  return slw_fail(core, SLW_NO_CONVERGENCE, SLW_OK, &core->blocks[core->order[first]], 0);
}

static bool propagate(slw_core *core) {
  for (uint32_t p = 0; p < core->n_blocks;) {
    uint32_t end = p + 1;
    if (core->loop[p] == 0) {
      if (!refresh(core, p)) return false;
    } else {
      while (end < core->n_blocks && core->loop[end] == core->loop[p]) end++;
      if (!solve_loop(core, p, end)) return false;
    }
    p = end;
  }
  return true;
}

static bool leave(slw_core *core) {
  for (slw_block *b = core->blocks; b < core->blocks + core->n_blocks; b++) {
    if (b->timed && !slw_timed_start(core, b)) return false;
    const slw_status status = b->fmu->call->exit_initialisation(b->fmu);
    if (status > SLW_WARNING) return slw_fail(core, SLW_DOING_INITIALISE, status, b, 0);
    if (!slw_block_initial_events(core, b) || !slw_block_get(core, b)) return false;
  }
  return !core->n_targets || slw_clocks_run(core, 0, core->start_s);
}

slw_outcome slw_core_initialise(slw_core *core) {
  core->failure.tick = -1;
  slw_finish_plan(core);
  if (!core->order || !core->loop) return slw_fail(core, SLW_DOING_INITIALISE, SLW_ERROR, NULL, 0), SLW_FAILED;
  if (!slw_apply_changes(core, 0, false) || !propagate(core) || !leave(core)) return SLW_FAILED;
  slw_exchange_forget(core);
  return core->ended ? SLW_ENDED : SLW_DONE;
}
