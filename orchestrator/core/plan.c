/* Building the plan: every function copies what it is given and refuses what is out of range. See core.h. */
#include "plan.h"

#include <stdio.h>

#define DEFAULT_TOLERANCE 1e-6
#define DEFAULT_ITERATIONS 50
#define DEFAULT_HALVINGS 16
#define MAX_HALVINGS 40
#define SCRATCH_ARENAS 3

static bool refuse(slw_core *core, const char *why, uint32_t number) {
  snprintf(core->error, sizeof core->error, "%s (%u)", why, number);
  return false;
}

/* Room for one more item at the end of an array; NULL when there is no memory. */
static void *grown(void *items, size_t count, size_t size) {
  /* Room doubles, so it is exactly full at powers of two. */
  if (count != 0 && (count & (count - 1)) != 0) return items;
  return realloc(items, (count == 0 ? 1 : 2 * count) * size);
}

#define APPEND(core, items, count)                                                    \
  do {                                                                                \
    void *more = grown((items), (count), sizeof *(items));                            \
    if (!more) return refuse((core), "no memory", 0);                                 \
    (items) = more;                                                                   \
    memset(&(items)[(count)], 0, sizeof *(items));                                    \
    (count)++;                                                                        \
  } while (0)

static void *copied(const void *data, size_t size) {
  void *copy = malloc(size ? size : 1);
  if (copy && size) memcpy(copy, data, size);
  return copy;
}

slw_core *slw_core_new(uint32_t n_cells, uint32_t n_blobs, double step_s, double start_s) {
  slw_core *core = calloc(1, sizeof *core);
  if (!core) return NULL;
  core->cells = calloc(n_cells + 1u, sizeof *core->cells);
  core->blobs = calloc(n_blobs + 1u, sizeof *core->blobs);
  core->nominal = calloc(n_cells + 1u, sizeof *core->nominal);
  core->scratch = calloc((size_t)SCRATCH_ARENAS * (n_cells + 1u), sizeof *core->scratch);
  core->n_cells = n_cells, core->n_blobs = n_blobs, core->step_s = step_s, core->start_s = start_s;
  core->tolerance = DEFAULT_TOLERANCE, core->max_iterations = DEFAULT_ITERATIONS;
  core->max_halvings = DEFAULT_HALVINGS, core->next_change_tick = SLW_NEVER;
  for (uint32_t i = 0; core->nominal && i < n_cells; i++) core->nominal[i] = 1.0;
  if (core->cells && core->blobs && core->nominal && core->scratch) return core;
  slw_core_free(core);
  return NULL;
}

static void free_exchange(slw_exchange *e) {
  for (uint32_t i = 0; i < e->n_moves; i++) {
    free(e->moves[i].source);
    free(e->moves[i].scale);
    free(e->moves[i].offset);
  }
  for (uint32_t i = 0; i < e->n_tables; i++) {
    free(e->tables[i].from);
    free(e->tables[i].to);
  }
  for (uint32_t i = 0; i < e->n_injections; i++) slw_fault_free(e->injections[i].fault);
  free(e->moves);
  free(e->tables);
  free(e->copies);
  free(e->injections);
}

static void free_groups(slw_group *groups, uint32_t n) {
  for (uint32_t i = 0; i < n; i++) {
    free((void *)(uintptr_t)groups[i].vr);
    free(groups[i].native);
    free(groups[i].told);
  }
  free(groups);
}

static void free_block(slw_block *b) {
  for (int slot = 0; slot < 2; slot++)
    if (b->state[slot]) b->fmu->call->free_state(b->fmu, &b->state[slot]);
  free_exchange(&b->in);
  free_groups(b->sets, b->n_sets);
  free_groups(b->gets, b->n_gets);
  for (uint32_t i = 0; i < b->n_clocks; i++) {
    free_groups(b->clocks[i].sets, b->clocks[i].n_sets);
    free_groups(b->clocks[i].gets, b->clocks[i].n_gets);
  }
  free(b->clocks);
  free(b->kept[0]);
  free(b->kept[1]);
  for (uint32_t i = 0; i < b->n_sources; i++) free_groups(b->sources[i].gets, b->sources[i].n_gets);
  free(b->sources);
}

static void free_targets(slw_core *core) {
  for (uint32_t i = 0; i < core->n_targets; i++) {
    free_exchange(&core->targets[i].in);
    free_groups(core->targets[i].sets, core->targets[i].n_sets);
  }
  free(core->targets);
}

void slw_core_free(slw_core *core) {
  if (!core) return;
  for (uint32_t i = 0; i < core->n_blocks; i++) free_block(&core->blocks[i]);
  free_targets(core);
  free_exchange(&core->sink);
  free_exchange(&core->whole);
  for (uint32_t i = 0; core->blobs && i < core->n_blobs; i++) free(core->blobs[i].data);
  if (core->logs) slw_ring_close(&core->ring);
  free(core->blocks);
  free(core->fast);
  free(core->copies);
  free(core->changes);
  free(core->order);
  free(core->loop);
  free(core->log_cells);
  free(core->pace);
  free(core->cells);
  free(core->blobs);
  free(core->nominal);
  free(core->scratch);
  free(core);
}

slw_cell *slw_core_cells(slw_core *core) { return core->cells; }
slw_blob *slw_core_blobs(slw_core *core) { return core->blobs; }
const char *slw_core_error(const slw_core *core) { return core->error; }
int64_t slw_core_tick(const slw_core *core) { return core->tick; }
const slw_failure *slw_core_failure(const slw_core *core) { return &core->failure; }

bool slw_core_block(slw_core *core, slw_fmu *fmu, uint32_t multiple, bool event_mode, bool early_return,
                    uint32_t *block) {
  if (!fmu || multiple == 0) return refuse(core, "a block needs an FMU and a multiple of at least 1", multiple);
  APPEND(core, core->blocks, core->n_blocks);
  *block = core->n_blocks - 1;
  slw_block *b = &core->blocks[*block];
  b->fmu = fmu, b->multiple = multiple, b->event_mode = event_mode;
  b->early_return = early_return, b->fails_at = SLW_NEVER, b->part_s = -1.0;
  return true;
}

static bool known(slw_core *core, uint32_t block) {
  return block < core->n_blocks || refuse(core, "no such block", block);
}

static bool inside(slw_core *core, uint64_t first, uint64_t n) {
  return (first <= core->n_cells && n <= core->n_cells - first) ||
         refuse(core, "cells out of range", (uint32_t)first);
}

/* The exchange of a block, of a target clock or of the sink; NULL for an unknown one. */
static slw_exchange *exchange_of(slw_core *core, uint32_t block) {
  if (block == SLW_SINK) return &core->sink;
  if (block >= SLW_TARGET && block - SLW_TARGET < core->n_targets) return &core->targets[block - SLW_TARGET].in;
  return known(core, block) ? &core->blocks[block].in : NULL;
}

/* A group of a block's variables, checked and with its own memory. */
static bool make_group(slw_core *core, uint32_t block, slw_type type, size_t n_vr, const uint32_t *vr, size_t n,
                       uint32_t first_cell, slw_group *group) {
  if (!known(core, block) || !inside(core, first_cell, n)) return false;
  if ((unsigned)type >= SLW_N_TYPES || n_vr == 0 || n < n_vr) return refuse(core, "a group without values", block);
  *group = (slw_group){type, n_vr, n, NULL, core->cells + first_cell, NULL, NULL, NULL};
  const size_t native = slw_native_size(core->blocks[block].fmu->fmi_version, type);
  if (type == SLW_STRING || type == SLW_BINARY) group->blobs = core->blobs;
  if (native && !(group->native = calloc(n, native))) return refuse(core, "no memory", 0);
  if ((group->vr = copied(vr, n_vr * sizeof *vr))) return true;
  free(group->native);
  return refuse(core, "no memory", 0);
}

bool slw_core_group(slw_core *core, uint32_t block, slw_direction direction, slw_type type, size_t n_vr,
                    const uint32_t *vr, size_t n, uint32_t first_cell) {
  slw_group group;
  if (!make_group(core, block, type, n_vr, vr, n, first_cell, &group)) return false;
  slw_block *b = &core->blocks[block];
  if (direction == SLW_GET) {
    APPEND(core, b->gets, b->n_gets);
    b->gets[b->n_gets - 1] = group;
    return true;
  }
  APPEND(core, b->sets, b->n_sets);
  slw_group *g = &b->sets[b->n_sets - 1];
  *g = group;
  return direction == SLW_SET || (g->told = calloc(3 * n, sizeof *g->told)) || refuse(core, "no memory", 0);
}

/* ---- clocks connected to each other ---- */

bool slw_core_source_clock(slw_core *core, uint32_t block, uint32_t vr) {
  if (!known(core, block)) return false;
  slw_block *b = &core->blocks[block];
  if (!b->event_mode || b->multiple != 1)
    return refuse(core, "a connected clock needs event mode and the system's step", vr);
  APPEND(core, b->sources, b->n_sources);
  slw_source_clock *c = &b->sources[b->n_sources - 1];
  c->vr = vr, c->own = -1;
  for (uint32_t i = 0; i < b->n_clocks; i++)
    if (b->clocks[i].vr == vr) c->own = (int32_t)i;
  b->connected = true;
  return true;
}

bool slw_core_target_clock(slw_core *core, uint32_t block, uint32_t vr, uint32_t source_block, uint32_t source_vr,
                           uint32_t *number) {
  if (!known(core, block) || !known(core, source_block)) return false;
  slw_block *b = &core->blocks[block];
  const slw_block *from = &core->blocks[source_block];
  uint32_t source = 0;
  while (source < from->n_sources && from->sources[source].vr != source_vr) source++;
  if (source == from->n_sources || !b->event_mode || b->multiple != 1)
    return refuse(core, "a connected clock needs its source, event mode and the system's step", vr);
  APPEND(core, core->targets, core->n_targets);
  *number = core->n_targets - 1;
  slw_target_clock *c = &core->targets[*number];
  c->block = block, c->vr = vr, c->source_block = source_block, c->source = source;
  b->connected = true;
  return true;
}

static bool own_group(slw_core *core, slw_own_clock *c, slw_direction direction, const slw_group *group) {
  if (direction == SLW_SET) {
    APPEND(core, c->sets, c->n_sets);
    c->sets[c->n_sets - 1] = *group;
  } else {
    APPEND(core, c->gets, c->n_gets);
    c->gets[c->n_gets - 1] = *group;
  }
  return true;
}

bool slw_core_clocked(slw_core *core, uint32_t block, slw_direction direction, uint32_t clock_vr, slw_type type,
                      size_t n_vr, const uint32_t *vr, size_t n, uint32_t first_cell) {
  slw_group group;
  if (!make_group(core, block, type, n_vr, vr, n, first_cell, &group)) return false;
  slw_block *b = &core->blocks[block];
  for (uint32_t i = 0; direction == SLW_GET && i < b->n_sources; i++)
    if (b->sources[i].vr == clock_vr) {
      APPEND(core, b->sources[i].gets, b->sources[i].n_gets);
      b->sources[i].gets[b->sources[i].n_gets - 1] = group;
      return true;
    }
  for (uint32_t i = 0; direction == SLW_SET && i < core->n_targets; i++)
    if (core->targets[i].block == block && core->targets[i].vr == clock_vr) {
      APPEND(core, core->targets[i].sets, core->targets[i].n_sets);
      core->targets[i].sets[core->targets[i].n_sets - 1] = group;
      return true;
    }
  for (uint32_t i = 0; i < b->n_clocks; i++)
    if (b->clocks[i].vr == clock_vr) return own_group(core, &b->clocks[i], direction, &group);
  free((void *)(uintptr_t)group.vr);
  free(group.native);
  return refuse(core, "no such clock", clock_vr);
}

/* ---- exchanges ---- */

bool slw_core_move(slw_core *core, uint32_t block, size_t n, const uint32_t *source, uint32_t first,
                   const double *scale, const double *offset) {
  slw_exchange *e = exchange_of(core, block);
  if (!e || !inside(core, first, n)) return false;
  for (size_t i = 0; i < n; i++)
    if (!inside(core, source[i], 1)) return false;
  APPEND(core, e->moves, e->n_moves);
  slw_move *m = &e->moves[e->n_moves - 1];
  m->first = first, m->n = (uint32_t)n, m->source = copied(source, n * sizeof *source);
  if (scale) m->scale = copied(scale, n * sizeof *scale), m->offset = copied(offset, n * sizeof *offset);
  return (m->source && (!scale || (m->scale && m->offset))) || refuse(core, "no memory", 0);
}

bool slw_core_table(slw_core *core, uint32_t block, uint32_t source, uint32_t target, size_t n,
                    const int64_t *from, const int64_t *to, bool strict) {
  slw_exchange *e = exchange_of(core, block);
  if (!e || !inside(core, source, 1) || !inside(core, target, 1)) return false;
  APPEND(core, e->tables, e->n_tables);
  e->tables[e->n_tables - 1] = (slw_table){
      source, target, n, copied(from, n * sizeof *from), copied(to, n * sizeof *to), strict};
  return (e->tables[e->n_tables - 1].from && e->tables[e->n_tables - 1].to) || refuse(core, "no memory", 0);
}

bool slw_core_copy(slw_core *core, uint32_t block, uint32_t source, uint32_t target) {
  slw_exchange *e = exchange_of(core, block);
  if (!e || !inside(core, source, 1) || !inside(core, target, 1)) return false;
  APPEND(core, e->copies, e->n_copies);
  e->copies[e->n_copies - 1] = (slw_copy){source, target};
  return true;
}

bool slw_core_fault(slw_core *core, uint32_t block, uint32_t cell, slw_fault_kind kind, int64_t from, int64_t to,
                    double a, double b, uint64_t seed) {
  slw_exchange *e = exchange_of(core, block);
  if (!e || !inside(core, cell, 1)) return false;
  if ((unsigned)kind >= SLW_N_FAULTS) return refuse(core, "no such kind of fault", (uint32_t)kind);
  APPEND(core, e->injections, e->n_injections);
  slw_injection *i = &e->injections[e->n_injections - 1];
  i->cell = cell, i->tick = -1;
  i->fault = slw_fault_new(kind, from, to, a, b, seed, core->step_s);
  return i->fault || refuse(core, "no memory for a fault", cell);
}

bool slw_core_fail(slw_core *core, uint32_t block, int64_t tick) {
  if (!known(core, block)) return false;
  core->blocks[block].fails_at = tick;
  return true;
}

static bool add_change(slw_core *core, slw_change change) {
  if (core->initialised) return refuse(core, "changes are given before the run", change.block);
  change.number = (uint32_t)core->n_changes;
  APPEND(core, core->changes, core->n_changes);
  core->changes[core->n_changes - 1] = change;
  return true;
}

bool slw_core_stimulus(slw_core *core, int64_t tick, uint32_t cell, int64_t bits) {
  return inside(core, cell, 1) &&
         add_change(core, (slw_change){tick, SLW_SINK, cell, SLW_FLOAT64, {.integer = bits}, 0});
}

bool slw_core_parameter(slw_core *core, int64_t tick, uint32_t block, slw_type type, uint32_t vr, int64_t bits) {
  if (!known(core, block)) return false;
  if ((unsigned)type > SLW_BOOLEAN) return refuse(core, "only numbers change during a run", vr);
  return add_change(core, (slw_change){tick, block, vr, type, {.integer = bits}, 0});
}

bool slw_core_clock(slw_core *core, uint32_t block, uint32_t vr, int64_t shift, int64_t interval) {
  if (!known(core, block)) return false;
  if (shift < 0 || interval < 1) return refuse(core, "a clock needs an interval of at least one tick", vr);
  slw_block *b = &core->blocks[block];
  APPEND(core, b->clocks, b->n_clocks);
  b->clocks[b->n_clocks - 1] = (slw_own_clock){.kind = SLW_GRID, .vr = vr, .shift = shift, .interval = interval};
  return true;
}

bool slw_core_timed_clock(slw_core *core, uint32_t block, uint32_t vr, slw_clock_kind kind, bool fraction,
                          double shift_s, double interval_s) {
  if (!known(core, block)) return false;
  if (kind <= SLW_GRID || kind > SLW_COUNTDOWN) return refuse(core, "no such kind of clock", (uint32_t)kind);
  if (kind == SLW_PERIODIC && !(shift_s >= 0.0 && interval_s > 0.0))
    return refuse(core, "a clock needs a positive interval", vr);
  slw_block *b = &core->blocks[block];
  APPEND(core, b->clocks, b->n_clocks);
  b->clocks[b->n_clocks - 1] = (slw_own_clock){
      .kind = kind, .vr = vr, .fraction = fraction, .shift_s = shift_s, .next = {0.0, interval_s, 0, false}};
  b->timed = true;
  return true;
}

bool slw_core_clock_told(const slw_core *core, uint32_t block, uint32_t vr) {
  const slw_block *b = block < core->n_blocks ? &core->blocks[block] : NULL;
  for (uint32_t i = 0; b && i < b->n_clocks; i++)
    if (b->clocks[i].vr == vr) return b->clocks[i].ever || b->clocks[i].next.known;
  return false;
}

bool slw_core_parts(slw_core *core, uint32_t block, double part_s) {
  if (!known(core, block)) return false;
  core->blocks[block].part_s = part_s;
  return true;
}

bool slw_core_algorithm(slw_core *core, slw_algorithm algorithm, double tolerance, uint32_t max_iterations,
                        uint32_t max_halvings) {
  if ((unsigned)algorithm > SLW_ADAPTIVE) return refuse(core, "no such algorithm", (uint32_t)algorithm);
  if (!(tolerance > 0.0) || max_iterations == 0 || max_halvings > MAX_HALVINGS)
    return refuse(core, "tolerance, iterations or halvings out of range", max_halvings);
  core->algorithm = algorithm, core->tolerance = tolerance;
  core->max_iterations = max_iterations, core->max_halvings = max_halvings;
  return true;
}

bool slw_core_nominal(slw_core *core, uint32_t cell, double nominal) {
  if (!inside(core, cell, 1)) return false;
  if (!(nominal > 0.0)) return refuse(core, "a nominal value is positive", cell);
  core->nominal[cell] = nominal;
  return true;
}

bool slw_core_order(slw_core *core, const uint32_t *order, const uint32_t *loop) {
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (!known(core, order[i])) return false;
  free(core->order);
  free(core->loop);
  core->order = copied(order, core->n_blocks * sizeof *order);
  core->loop = copied(loop, core->n_blocks * sizeof *loop);
  return (core->order && core->loop) || refuse(core, "no memory", 0);
}

bool slw_core_log(slw_core *core, size_t n, const uint32_t *cells, size_t rows) {
  for (size_t i = 0; i < n; i++)
    if (!inside(core, cells[i], 1)) return false;
  if (core->logs) return refuse(core, "there is one log", 0);
  core->log_cells = copied(cells, n * sizeof *cells);
  core->n_log = n;
  core->log_run = n ? core->cells + cells[0] : NULL;
  for (size_t i = 0; i < n; i++)
    if (cells[i] != cells[0] + i) core->log_run = NULL;
  core->logs = core->log_cells && slw_ring_open(&core->ring, n + 1, rows);
  return core->logs || refuse(core, "no memory", 0);
}

bool slw_core_pace(slw_core *core, double factor) {
  free(core->pace);
  core->pace = NULL;
  if (factor == 0.0) return true;
  if (!(factor > 0.0)) return refuse(core, "a pace is not negative", 0);
  core->pace = calloc(1, sizeof *core->pace);
  if (!core->pace) return refuse(core, "no memory", 0);
  core->pace->factor = factor;
  return true;
}

bool slw_core_timing(slw_core *core, bool on) {
  core->timing = on;
  return true;
}

/* ---- finishing ---- */

static int by_tick(const void *left, const void *right) {
  const slw_change *a = left, *b = right;
  if (a->tick != b->tick) return a->tick < b->tick ? -1 : 1;
  return a->number < b->number ? -1 : a->number > b->number;
}

static slw_path path_of(const slw_core *core, const slw_block *b) {
  const slw_fmu *f = b->fmu;
  if (b->event_mode || b->early_return || b->n_clocks || core->timing || b->fails_at != SLW_NEVER ||
      core->algorithm >= SLW_ITERATE || b->multiple != 1)
    return SLW_GENERAL;
  if (!f->local) return SLW_APART;
  if (b->n_sets > 1 || b->n_gets > 1 || (b->n_sets && b->sets[0].type != SLW_FLOAT64) ||
      (b->n_gets && b->gets[0].type != SLW_FLOAT64))
    return SLW_GENERAL;
  if (f->fmi_version == 2) return f->fast.fmi2.do_step ? SLW_FAST2 : SLW_GENERAL;
  return f->fast.fmi3.do_step ? SLW_FAST3 : SLW_GENERAL;
}

static void fill_fast(slw_fast *f, slw_block *b) {
  f->block = b, f->path = b->path, f->instance = b->fmu->instance;
  if (b->path == SLW_FAST2) {
    f->fmi2.set_real = b->fmu->fast.fmi2.set_real, f->fmi2.get_real = b->fmu->fast.fmi2.get_real;
    f->fmi2.do_step = b->fmu->fast.fmi2.do_step;
  } else if (b->path == SLW_FAST3) {
    f->fmi3.set = b->fmu->fast.fmi3.set, f->fmi3.get = b->fmu->fast.fmi3.get;
    f->fmi3.do_step = b->fmu->fast.fmi3.do_step;
  }
  if (b->n_sets) {
    const slw_group *g = b->sets;
    f->set_vr = g->vr, f->n_set_vr = g->n_vr, f->n_set = g->n, f->set_cells = g->cells;
  }
  if (b->n_gets) {
    const slw_group *g = b->gets;
    f->get_vr = g->vr, f->n_get_vr = g->n_vr, f->n_get = g->n, f->get_cells = g->cells;
  }
}

static bool only_moves(const slw_exchange *e) { return !e->n_tables && !e->n_copies && !e->n_injections; }

/* Whether all blocks are plain: then their exchanges are done at once, and their moves point into one list. */
static bool is_plain(const slw_core *core) {
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (core->blocks[i].path == SLW_GENERAL || core->blocks[i].path == SLW_APART || !only_moves(&core->blocks[i].in)) return false;
  return core->algorithm == SLW_JACOBI;
}

/* Joins the moves of all blocks; adjacent ones of the same kind become one. */
static bool join(slw_core *core) {
  size_t n = 0;
  for (uint32_t i = 0; i < core->n_blocks; i++) n += core->blocks[i].in.n_moves;
  core->whole.moves = calloc(n + 1, sizeof *core->whole.moves);
  if (!core->whole.moves) return false;
  for (uint32_t i = 0; i < core->n_blocks; i++)
    for (uint32_t k = 0; k < core->blocks[i].in.n_moves; k++) {
      const slw_move *m = &core->blocks[i].in.moves[k];
      slw_move *last = core->whole.n_moves ? &core->whole.moves[core->whole.n_moves - 1] : NULL;
      const bool joins = last && !last->scale && !m->scale && last->first + last->n == m->first;
      if (!joins) last = &core->whole.moves[core->whole.n_moves++], last->first = m->first;
      const size_t total = last->n + m->n;
      uint32_t *source = realloc(last->source, total * sizeof *source + 1);
      if (!source) return false;
      memcpy(source + last->n, m->source, m->n * sizeof *source);
      last->source = source;
      if (m->scale) {
        last->scale = copied(m->scale, m->n * sizeof(double));
        last->offset = copied(m->offset, m->n * sizeof(double));
        if (!last->scale || !last->offset) return false;
      }
      last->n = (uint32_t)total;
    }
  return true;
}

/* Of the joined moves those without conversion, as single copies. */
static bool part_copies(slw_core *core) {
  slw_exchange *whole = &core->whole;
  uint32_t kept = 0;
  core->copies = calloc(core->n_cells + 1u, sizeof *core->copies);
  if (!core->copies) return false;
  for (uint32_t i = 0; i < whole->n_moves; i++) {
    slw_move *m = &whole->moves[i];
    if (m->scale) {
      whole->moves[kept++] = *m;
      continue;
    }
    for (uint32_t k = 0; k < m->n; k++) core->copies[core->n_copies++] = (slw_copy){m->source[k], m->first + k};
    free(m->source);
  }
  whole->n_moves = kept;
  return true;
}

/* Whether the outputs of all blocks stand side by side: then they are looked at all at once. */
static bool join_outputs(slw_core *core) {
  size_t n = 0;
  for (const slw_fast *f = core->fast; f < core->fast + core->n_blocks; f++) {
    if (!f->n_get) continue;
    if (!n) core->outputs = f->get_cells;
    if (f->get_cells != core->outputs + n) return false;
    n += f->n_get;
  }
  core->n_outputs = n;
  return true;
}

/* The FMI version of all blocks, or 0. */
static int common_version(const slw_core *core) {
  const int version = core->n_blocks ? core->blocks[0].fmu->fmi_version : 0;
  for (uint32_t i = 0; i < core->n_blocks; i++)
    if (core->blocks[i].fmu->fmi_version != version) return 0;
  return version;
}

void slw_finish_plan(slw_core *core) {
  if (core->initialised) return;
  core->initialised = true;
  if (core->n_changes) {
    qsort(core->changes, core->n_changes, sizeof *core->changes, by_tick);
    core->next_change_tick = core->changes[0].tick;
  }
  core->fast = calloc(core->n_blocks + 1u, sizeof *core->fast);
  for (uint32_t i = 0; i < core->n_blocks; i++) {
    slw_block *b = &core->blocks[i];
    for (int slot = 0; slot < 2 && b->timed; slot++) b->kept[slot] = calloc(b->n_clocks, sizeof *b->kept[slot]);
    core->timed_instants = core->timed_instants || (b->timed && b->connected);
    b->path = core->fast ? path_of(core, b) : SLW_GENERAL;
    if (core->fast) fill_fast(&core->fast[i], b);
  }
  core->plain = is_plain(core) && join(core) && join_outputs(core) && part_copies(core);
  core->fmi_version = common_version(core);
  core->sink_works = core->sink.n_moves || !only_moves(&core->sink);
  core->size = (uint64_t)2 << core->max_halvings;
  switch (core->algorithm) {
    case SLW_GAUSS_SEIDEL: core->advance = slw_gauss_seidel; break;
    case SLW_ITERATE: core->advance = slw_iterate; break;
    case SLW_ADAPTIVE: core->advance = slw_adaptive; break;
    default: core->advance = slw_jacobi;
  }
}
