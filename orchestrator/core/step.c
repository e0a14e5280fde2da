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

/* The functions that the fast path calls, by slw_what. */
static const char *const calls[2][3] = {{"fmi2SetReal", "fmi2DoStep", "fmi2GetReal"},
                                        {"fmi3SetFloat64", "fmi3DoStep", "fmi3GetFloat64"}};

/* What a status other than OK comes to that an FMU here gave; our own numbers are not FMI's. */
static bool note(slw_core *core, slw_block *b, int given, slw_what doing) {
  const slw_status status = slw_status_of(b->fmu, given, calls[b->fmu->fmi_version - 2][doing]);
  if (status != SLW_WARNING) return slw_fail(core, doing, status, b, 0);
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

static bool unusual_step2(slw_core *core, const slw_fast *f, int status) {
  if (status == SLW_DISCARD) return slw_block_finish_discarded(core, f->block);
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
  if (!LIKELY(status == SLW_OK) && !unusual_step2(core, f, status)) return false;
  if (!LIKELY(f->n_get)) return true;
  status = f->fmi2.get_real(f->instance, f->get_vr, f->n_get, &f->get_cells->real);
  return LIKELY(status == SLW_OK) || unusual(core, f, status, SLW_DOING_GET);
}

/* What an FMI 3 step says; all false before every call. */
typedef struct {
  bool event, terminate, early;
} slw_flags;

/* A step that is not just done, or did not tell its end to the bit. */
static __attribute__((noinline)) bool unusual_step3(slw_core *core, const slw_fast *f, double reached, int given,
                                                    slw_flags *flags) {
  slw_block *b = f->block;
  slw_step_result r = {reached, flags->event, flags->terminate, flags->early};
  *flags = (slw_flags){false, false, false};
  const slw_status status = slw_status_of(b->fmu, given, calls[1][SLW_DOING_STEP]);
  if (status > SLW_DISCARD) return slw_fail(core, SLW_DOING_STEP, status, b, 0);
  r.reached = slw_told(r.reached, status <= SLW_WARNING && !r.early, slw_time(core), core->step_s);
  return slw_block_finish_step(core, b, status, &r);
}

static ALWAYS_INLINE bool fast3(slw_core *core, const slw_fast *f, double t, double h, slw_flags *flags) {
  int status;
  if (LIKELY(f->n_set)) {
    status = f->fmi3.set(f->instance, f->set_vr, f->n_set_vr, &f->set_cells->real, f->n_set);
    if (!LIKELY(status == SLW_OK) && !unusual(core, f, status, SLW_DOING_SET)) return false;
  }
  double reached;
  slw_untold(&reached);
  status = f->fmi3.do_step(f->instance, t, h, false, &flags->event, &flags->terminate, &flags->early,
                           &reached);
  if (!LIKELY(status == SLW_OK && !flags->terminate && !flags->early && reached == t + h) &&
      !unusual_step3(core, f, reached, status, flags))
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
  const double h = core->step_s, t = slw_time(core);
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
  const slw_status status =
      slw_remote_begin(b->fmu, b->sets, b->n_sets, slw_time(core), core->step_s, b->gets, b->n_gets);
  return status == SLW_OK || slw_fail(core, SLW_DOING_STEP, status, b, 0);
}

/* The same as in this process: only a step may be discarded. */
static bool finish_apart(slw_core *core, slw_block *b) {
  static const slw_what doing[] = {SLW_DOING_SET, SLW_DOING_STEP, SLW_DOING_GET};
  slw_exchanged done;
  const slw_status status = slw_remote_finish(b->fmu, b->gets, b->n_gets, &done);
  const bool discarded = status == SLW_DISCARD && done.phase == SLW_AT_STEP;
  b->count.warnings += done.warnings;
  if (status > SLW_WARNING && !discarded) return slw_fail(core, doing[done.phase], status, b, 0);
  const slw_status stepped = discarded ? SLW_DISCARD : SLW_OK; /* its warnings are counted */
  if (!slw_block_finish_step(core, b, stepped, &done.step)) return false;
  return done.complete ? slw_check_finite(core, b) : slw_block_get(core, b);
}

static bool advance(slw_core *core, slw_block *b) {
  const double t = slw_time(core);
  const slw_fast *f = &core->fast[b - core->blocks];
  slw_flags flags = {false, false, false};
  if (b->path == SLW_FAST2) return fast2(core, f, t, core->step_s) && finite(core, f);
  if (b->path == SLW_FAST3) return fast3(core, f, t, core->step_s, &flags) && finite(core, f);
  if (slw_due(core, b)) {
    const double h = core->step_s * b->multiple;
    if (!slw_block_inputs(core, b, t, true) || !slw_block_step(core, b, t, h)) return false;
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

/* Connected by clocks, of which some may tick inside a step: these blocks step side by side. */
static bool together(const slw_core *core, const slw_block *b) { return core->timed_instants && b->connected; }

bool slw_jacobi(slw_core *core) {
  slw_block *const end = core->blocks + core->n_blocks;
  for (slw_block *b = core->blocks; b < end; b++)
    if (!begin(core, b)) return false;
  for (slw_block *b = core->blocks; b < end; b++)
    if (b->path == SLW_APART && !begin_apart(core, b)) return false;
  for (slw_block *b = core->blocks; b < end; b++)
    if (b->path != SLW_APART && !together(core, b) && !timed_advance(core, b)) return false;
  if (core->timed_instants && !slw_clocks_advance(core)) return false;
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
