/* One tick of the explicit algorithms.
 *
 * Jacobi: all inputs from the outputs of the last tick, then every FMU steps.
 * Gauss-Seidel: in order of dependency, each FMU on the newest outputs.
 * An FMU that steps once in m ticks takes its inputs at the begin of its step and shows its outputs at the end. */
#include "binding.h"
#include "plan.h"
#include "remote.h"

/* ---- the fast path: nothing but set, step and get of real variables of FMUs in this process ---- */

#define ALWAYS_INLINE inline __attribute__((always_inline))
#define LIKELY(x) __builtin_expect(!!(x), 1)

/* What a status other than OK comes to. */
static bool note(slw_core *core, slw_block *b, int status, slw_what doing) {
  static const char *const calls[] = {"set", "doStep", "get"};
  if (b->fmu->local) status = (int)slw_status_of(b->fmu, status, calls[doing]); /* our own numbers are not FMI's */
  if (status != SLW_WARNING) return slw_fail(core, doing, (slw_status)status, b, 0);
  b->count.warnings++;
  return true;
}

/* An exponent of all ones, with its lowest bit added once more, carries into the sign. */
static ALWAYS_INLINE uint64_t carry(slw_cell c) {
  return ((uint64_t)c.integer & SLW_EXPONENT) + SLW_EXPONENT_ONE;
}

static ALWAYS_INLINE bool all_finite(const slw_cell *cells, size_t n) {
  uint64_t carried = 0;
  size_t i = 0;
  for (; i + 4 <= n; i += 4)
    carried |= (carry(cells[i]) | carry(cells[i + 1])) | (carry(cells[i + 2]) | carry(cells[i + 3]));
  for (; i < n; i++) carried |= carry(cells[i]);
  return (int64_t)carried >= 0;
}

/* The same, off the fast path. */
static __attribute__((noinline)) bool unusual(slw_core *core, const slw_fast *f, int status, slw_what doing) {
  return note(core, f->block, status, doing);
}

static bool unusual_step2(slw_core *core, const slw_fast *f, double t, int status) {
  if (status == SLW_DISCARD) return slw_block_finish_discarded(core, f->block, t);
  return note(core, f->block, status, SLW_DOING_STEP);
}

/* Set, step and get. */
static ALWAYS_INLINE bool fast2(slw_core *core, const slw_fast *f, double t, double h) {
  int status;
  if (LIKELY(f->n_set)) {
    status = f->fmi2.set_real(f->instance, f->set_vr, f->n_set, &f->set_cells->real);
    if (!LIKELY(status == SLW_OK) && !unusual(core, f, status, SLW_DOING_SET)) return false;
  }
  status = f->fmi2.do_step(f->instance, t, h, 0);
  if (!LIKELY(status == SLW_OK) && !unusual_step2(core, f, t, status)) return false;
  if (!LIKELY(f->n_get)) return true;
  status = f->fmi2.get_real(f->instance, f->get_vr, f->n_get, &f->get_cells->real);
  return LIKELY(status == SLW_OK) || unusual(core, f, status, SLW_DOING_GET);
}

/* What an FMI 3 step says; all false before every call. */
typedef struct {
  bool event, terminate, early;
} slw_flags;

/* A step that is not just done. */
static bool unusual_step3(slw_core *core, const slw_fast *f, double t, double reached, int status,
                          slw_flags *flags) {
  slw_block *b = f->block;
  const slw_flags said = *flags;
  *flags = (slw_flags){false, false, false};
  if (said.terminate && status <= SLW_DISCARD) {
    slw_end(core, b);
    return true;
  }
  if (status == SLW_DISCARD) return slw_block_continue(core, b, t, reached);
  if (status != SLW_OK && !note(core, b, status, SLW_DOING_STEP)) return false;
  return !said.early || slw_fail(core, SLW_RETURNED_EARLY, SLW_OK, b, 0);
}

static ALWAYS_INLINE bool fast3(slw_core *core, const slw_fast *f, double t, double h, slw_flags *flags) {
  int status;
  if (LIKELY(f->n_set)) {
    status = f->fmi3.set(f->instance, f->set_vr, f->n_set_vr, &f->set_cells->real, f->n_set);
    if (!LIKELY(status == SLW_OK) && !unusual(core, f, status, SLW_DOING_SET)) return false;
  }
  double reached = t;
  status = f->fmi3.do_step(f->instance, t, h, false, &flags->event, &flags->terminate, &flags->early,
                           &reached);
  if (!LIKELY(status == SLW_OK && !flags->terminate && !flags->early) &&
      !unusual_step3(core, f, t, reached, status, flags))
    return false;
  if (!LIKELY(f->n_get)) return true;
  status = f->fmi3.get(f->instance, f->get_vr, f->n_get_vr, &f->get_cells->real, f->n_get);
  return LIKELY(status == SLW_OK) || unusual(core, f, status, SLW_DOING_GET);
}

static ALWAYS_INLINE bool finite(slw_core *core, const slw_fast *f) {
  return LIKELY(all_finite(f->get_cells, f->n_get)) || slw_check_finite(core, f->block);
}

/* Ticks from here on that need nothing but rows and steps. */
static int64_t plain_ticks(const slw_core *core, int64_t until) {
  if (core->pace || core->sink_works || core->tick >= core->next_change_tick) return 0;
  const int64_t ticks = (until < core->next_change_tick ? until : core->next_change_tick) - core->tick;
  const int64_t room = core->logs ? (int64_t)slw_ring_straight(&core->ring) : ticks;
  return ticks < room ? ticks : room;
}

/* The begin of one of these (`straight`: its row goes behind the last one), or of one that needs more. */
static ALWAYS_INLINE bool plain_begin(slw_core *core, bool straight, slw_cell **row) {
  if (!straight) return slw_begin_tick(core);
  core->failure.tick = core->tick;
  if (!*row) return true;
  slw_write_row(core, *row);
  slw_ring_commit(&core->ring);
  *row += core->ring.width;
  return true;
}

static bool find_infinite(slw_core *core) {
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (!slw_check_finite(core, &core->blocks[i])) return false;
  return true;
}

/* `fmi_version`: of all blocks; 0: mixed. */
static ALWAYS_INLINE bool plain_tick(slw_core *core, slw_flags *flags, int fmi_version) {
  const slw_fast *const end = core->fast + core->n_blocks;
  const double h = core->step_s, t = (double)core->tick * h;
  slw_cell *const cells = core->cells;
  const slw_copy *const copies_end = core->copies + core->n_copies;
  for (const slw_copy *c = core->copies; c < copies_end; c++) cells[c->target] = cells[c->source];
  for (uint32_t i = 0; i < core->whole.n_moves; i++) slw_move_run(cells, &core->whole.moves[i]);
  for (const slw_fast *f = core->fast; f < end; f++) {
    if (fmi_version == 2 || (!fmi_version && f->path == SLW_FAST2)) {
      if (!fast2(core, f, t, h)) return false;
    } else if (!fast3(core, f, t, h, flags)) {
      return false;
    }
  }
  return LIKELY(all_finite(core->outputs, core->n_outputs)) || find_infinite(core);
}

static ALWAYS_INLINE slw_outcome run_plain(slw_core *core, int64_t until, int fmi_version) {
  slw_flags flags = {false, false, false};
  while (core->tick < until) {
    int64_t n = plain_ticks(core, until);
    const bool straight = n > 0;
    slw_cell *row = straight && core->logs ? slw_ring_row(&core->ring) : NULL;
    do {
      if (!plain_begin(core, straight, &row) || !plain_tick(core, &flags, fmi_version)) return SLW_FAILED;
      core->tick++;
      if (core->ended) return SLW_ENDED;
    } while (--n > 0);
  }
  return SLW_DONE;
}

/* slw_core_run for systems that need nothing else: the same in one loop, so that all of it is inlined. */
slw_outcome slw_run_plain(slw_core *core, int64_t until) {
  if (core->fmi_version == 2) return run_plain(core, until, 2);
  if (core->fmi_version == 3) return run_plain(core, until, 3);
  return run_plain(core, until, 0);
}

/* ---- the general path ---- */

/* Inputs and step of a block that begins one in this tick; faults see every tick. */
static bool begin(slw_core *core, slw_block *b) {
  const bool due = slw_due(core, b);
  if (!due && !b->in.n_injections) return true;
  if (!slw_exchange_run(core, (uint32_t)(b - core->blocks), &b->in)) return false;
  slw_exchange_accept(core, &b->in);
  return true;
}

/* ---- FMUs in processes of their own ---- */

static bool begin_apart(slw_core *core, slw_block *b) {
  const double t = (double)core->tick * core->step_s;
  const slw_status status =
      slw_remote_begin(b->fmu, b->sets, b->n_sets, t, core->step_s, b->gets, b->n_gets);
  return status == SLW_OK || note(core, b, (int)status, SLW_DOING_STEP);
}

static bool finish_apart(slw_core *core, slw_block *b) {
  const double t = (double)core->tick * core->step_s;
  slw_step_result r = {t, false, false, false};
  bool stepped;
  const slw_status status = slw_remote_finish(b->fmu, b->gets, b->n_gets, &r, &stepped);
  if (status != SLW_OK && status != SLW_DISCARD && !note(core, b, (int)status, SLW_DOING_STEP)) return false;
  if (stepped) return slw_check_finite(core, b);
  if (r.terminate) {
    slw_end(core, b);
  } else if (status == SLW_DISCARD) {
    if (!slw_block_continue(core, b, t, r.reached)) return false;
  } else if (r.early) {
    return slw_fail(core, SLW_RETURNED_EARLY, SLW_OK, b, 0);
  }
  return slw_block_get(core, b);
}

static bool advance(slw_core *core, slw_block *b) {
  const double t = (double)core->tick * core->step_s;
  const slw_fast *f = &core->fast[b - core->blocks];
  slw_flags flags = {false, false, false};
  if (b->path == SLW_FAST2) return fast2(core, f, t, core->step_s) && finite(core, f);
  if (b->path == SLW_FAST3) return fast3(core, f, t, core->step_s, &flags) && finite(core, f);
  if (slw_due(core, b)) {
    const double h = core->step_s * b->multiple;
    if (!slw_block_set(core, b) || !slw_block_tick_clocks(core, b) || !slw_block_step(core, b, t, h)) return false;
  }
  return !slw_ready(core, b) || slw_block_get(core, b);
}

static bool timed_advance(slw_core *core, slw_block *b) {
  if (!core->timing) return advance(core, b);
  const double before = slw_clock_s();
  const bool done = advance(core, b);
  b->count.seconds += slw_clock_s() - before;
  return done;
}

bool slw_jacobi(slw_core *core) {
  slw_block *const end = core->blocks + core->n_blocks;
  for (slw_block *b = core->blocks; b < end; b++)
    if (!begin(core, b)) return false;
  for (slw_block *b = core->blocks; b < end; b++)
    if (b->path == SLW_APART && !begin_apart(core, b)) return false;
  for (slw_block *b = core->blocks; b < end; b++)
    if (b->path != SLW_APART && !timed_advance(core, b)) return false;
  for (slw_block *b = core->blocks; b < end; b++)
    if (b->path == SLW_APART && !finish_apart(core, b)) return false;
  return true;
}

bool slw_gauss_seidel(slw_core *core) {
  for (uint32_t i = 0; i < core->n_blocks; i++) {
    slw_block *b = &core->blocks[core->order[i]];
    if (!begin(core, b)) return false;
    if (b->path == SLW_APART ? !begin_apart(core, b) || !finish_apart(core, b) : !timed_advance(core, b))
      return false;
  }
  return true;
}

/* ---- blocks of other rates beside the implicit algorithms: explicit, as in Jacobi ---- */

bool slw_slow_begin(slw_core *core) {
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (core->blocks[i].multiple != 1 && !begin(core, &core->blocks[i])) return false;
  return true;
}

bool slw_slow_end(slw_core *core) {
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (core->blocks[i].multiple != 1 && !timed_advance(core, &core->blocks[i])) return false;
  return true;
}
