/* The lowered plan: what core.h builds and the algorithms walk through. Internal to the core. */
#ifndef SLW_PLAN_H
#define SLW_PLAN_H

#include <stdlib.h>
#include <string.h>

#include "core.h"
#include "fault.h"
#include "ring.h"

#define SLW_NEVER INT64_MAX
#define SLW_EXPONENT 0x7ff0000000000000ULL /* all ones in a double that is infinite or no number */
#define SLW_EXPONENT_ONE 0x0010000000000000ULL

/* cells[first + i] = scale[i] * cells[source[i]] + offset[i]; scale NULL: the cell unchanged. */
typedef struct {
  uint32_t first, n;
  uint32_t *source;
  double *scale, *offset;
} slw_move;

typedef struct {
  uint32_t source, target;
  size_t n;
  int64_t *from, *to;
  bool strict;
} slw_table;

typedef struct {
  uint32_t source, target;
} slw_copy;

typedef struct {
  uint32_t cell;
  int64_t tick; /* of the exchange that `raw` is from; one tick may take several */
  double raw;   /* what arrived first in that tick, before the fault */
  slw_fault *fault;
} slw_injection;

/* All that brings the inputs of one block up to date, in this order. */
typedef struct {
  slw_move *moves;
  slw_table *tables;
  slw_copy *copies;
  slw_injection *injections;
  uint32_t n_moves, n_tables, n_copies, n_injections;
} slw_exchange;

/* When a clock of its own times ticks next: at base + n * every, if that is known. */
typedef struct {
  double base, every;
  int64_t n, known;
} slw_schedule;

/* A time-based input clock. */
typedef struct {
  slw_clock_kind kind;
  uint32_t vr;
  bool fraction;
  int64_t shift, interval; /* SLW_GRID: ticks */
  double shift_s;          /* the others */
  slw_schedule next;
  bool due, ticked, active; /* within one instant: is to tick, has ticked, ticks in its present iteration */
  bool ever;               /* it ticked in this run */
  slw_group *sets, *gets;  /* what it clocks and is connected, or read */
  uint32_t n_sets, n_gets;
} slw_own_clock;

/* A clock that ticks clocks of other blocks. */
typedef struct {
  uint32_t vr;
  int32_t own;     /* number of the own clock that it is; -1: an output clock */
  slw_group *gets; /* what it clocks and somebody reads */
  uint32_t n_gets;
  bool active;
} slw_source_clock;

/* A triggered input clock that such a one ticks. */
typedef struct {
  uint32_t block, vr, source_block, source; /* number of the clock in its block */
  slw_group *sets; /* what it clocks and is connected */
  uint32_t n_sets;
  slw_exchange in;
} slw_target_clock;

typedef enum {
  SLW_GENERAL, /* through the FMU's function table */
  SLW_FAST2,   /* FMI 2, here, at most one group of reals each way, nothing special */
  SLW_FAST3,   /* the same of FMI 3 */
  SLW_APART,   /* in a process of its own: set, step and get in one round trip */
} slw_path;

typedef struct {
  slw_fmu *fmu;
  slw_path path;
  bool event_mode, early_return;
  uint32_t multiple;
  slw_group *sets, *gets;
  uint32_t n_sets, n_gets;
  slw_exchange in;
  slw_own_clock *clocks;
  uint32_t n_clocks;
  bool timed;      /* it has clocks that tick at times of their own */
  double part_s;   /* see slw_core_parts */
  slw_schedule *kept[2]; /* of a rollback: of each clock, as `state` */
  slw_source_clock *sources;
  uint32_t n_sources;
  bool connected;  /* its clocks tick others or are ticked by them: its events are those of clocks.c */
  bool event_due;  /* its step asked for event mode */
  bool in_event, takes_part; /* within one instant: in event mode, and in its present iteration */
  int64_t fails_at;
  void *state[2]; /* of a rollback: at the begin of the step, and of the better half */
  slw_block_statistics count;
} slw_block;

/* What the fast path needs of a block, side by side. */
typedef struct {
  union {
    struct { slw_fmi2_set_real set_real; slw_fmi2_do_step do_step; slw_fmi2_get_real get_real; } fmi2;
    struct { slw_fmi3_set_float64 set; slw_fmi3_do_step do_step; slw_fmi3_get_float64 get; } fmi3;
  };
  void *instance;
  const uint32_t *set_vr, *get_vr;
  slw_cell *set_cells, *get_cells;
  size_t n_set_vr, n_set, n_get_vr, n_get;
  slw_path path;
  slw_block *block;
} slw_fast;

/* Something that happens once, at the begin of a tick: a stimulus (block SLW_SINK) or a parameter set. */
typedef struct {
  int64_t tick;
  uint32_t block, target; /* cell, or value reference */
  slw_type type;
  slw_cell value;
  uint32_t number; /* in the order given: what comes later wins */
} slw_change;

#define SLW_BUCKETS 1024 /* of lateness: 32 per power of two, from 1 us */

typedef struct {
  double factor, start_s;
  int64_t start_tick;
  uint64_t histogram[SLW_BUCKETS], late;
  double max_s;
} slw_pacing;

struct slw_core {
  slw_cell *cells;
  slw_blob *blobs;
  double *nominal; /* of each cell */
  uint32_t n_cells, n_blobs;
  double step_s, start_s;
  int64_t tick;
  slw_block *blocks;
  slw_fast *fast; /* of each block; meaningful where its path says so */
  uint32_t n_blocks;
  slw_target_clock *targets;
  uint32_t n_targets;
  int fmi_version;         /* of all blocks; 0: both */
  slw_copy *copies;        /* plain systems: moves without conversion */
  size_t n_copies;
  const slw_cell *outputs; /* plain systems: of all blocks, side by side */
  size_t n_outputs;
  slw_exchange sink;
  bool sink_works; /* there is something to do for it */
  slw_exchange whole; /* plain systems: the moves of all blocks, joined */
  bool plain;         /* every block steps every tick, exchanges by moves alone */
  slw_change *changes;
  size_t n_changes, next_change;
  int64_t next_change_tick;
  uint32_t *order, *loop;
  slw_algorithm algorithm;
  double tolerance;
  uint32_t max_iterations, max_halvings;
  bool (*advance)(slw_core *);
  uint32_t *log_cells;
  const slw_cell *log_run; /* where these cells stand side by side: the first; else NULL */
  size_t n_log;
  slw_ring ring;
  bool logs;
  slw_pacing *pace;
  bool timing, ended, initialised;
  bool timed_instants; /* connected blocks have clocks that tick at times of their own */
  uint64_t size; /* of the adaptive step, in units of step_s / 2^(max_halvings + 1) */
  slw_cell *scratch; /* SCRATCH_ARENAS copies of all cells, for rollbacks and loops */
  slw_statistics count;
  slw_failure failure;
  char error[256];
};

/* plan.c */
void slw_finish_plan(slw_core *core);

/* run.c */
bool slw_run_sink(slw_core *core);
/* step.c: slw_core_run of plain systems. */
slw_outcome slw_run_plain(slw_core *core, int64_t until);
bool slw_apply_changes(slw_core *core, int64_t tick, bool parameters);

/* exchange.c: false: slw_core_failure says why. */
bool slw_exchange_run(slw_core *core, uint32_t block, slw_exchange *e);
/* For the faults, once a tick: the values that the first exchange of it brought. */
void slw_exchange_accept(slw_core *core, slw_exchange *e);
/* The exchanges so far were none of a tick: those of the initialisation, or of before a restored state. */
void slw_exchange_forget(slw_core *core);

static inline void slw_move_run(slw_cell *cells, const slw_move *m) {
  slw_cell *to = cells + m->first;
  if (!m->scale) {
    for (uint32_t i = 0; i < m->n; i++) to[i] = cells[m->source[i]];
    return;
  }
  for (uint32_t i = 0; i < m->n; i++) to[i].real = m->scale[i] * cells[m->source[i]].real + m->offset[i];
}

/* block.c: one block. */
bool slw_block_set(slw_core *core, slw_block *b);
bool slw_block_get(slw_core *core, slw_block *b);
bool slw_block_step(slw_core *core, slw_block *b, double t, double h);
/* After the one step of this tick, whose status is OK, Warning or Discard: the rest of it, if there is one. */
bool slw_block_finish_step(slw_core *core, slw_block *b, slw_status status, const slw_step_result *result);
bool slw_block_finish_discarded(slw_core *core, slw_block *b); /* FMI 2 */
/* Whether a step from t, the `whole` of it or a part, can have reached the time that its FMU told. */
bool slw_time_told(slw_core *core, const slw_block *b, bool whole, double t, double h, double told);
bool slw_block_initial_events(slw_core *core, slw_block *b);
/* Before a step from t: its inputs, and (`clocks`) the clocks that tick at its begin. */
bool slw_block_inputs(slw_core *core, slw_block *b, double t, bool clocks);
/* A tunable parameter, in event mode where there is one. */
bool slw_block_parameter(slw_core *core, slw_block *b, const slw_group *group);
bool slw_block_save(slw_core *core, slw_block *b, int slot);
bool slw_block_restore(slw_core *core, slw_block *b, int slot);
bool slw_check_finite(slw_core *core, const slw_block *b);
bool slw_groups_finite(slw_core *core, const slw_block *b, const slw_group *groups, uint32_t n);

/* timed.c: the time-based clocks of one block. */
#define SLW_INSIDE (-1) /* as tick: an instant inside a step, where no clock of the grid ticks */
bool slw_timed_start(slw_core *core, slw_block *b);             /* in initialisation mode: first times */
bool slw_timed_ask(slw_core *core, slw_block *b, double time);  /* after an event: times that have changed */
/* Notes who is to tick; whether anybody is. */
bool slw_own_due(slw_core *core, slw_block *b, int64_t tick, double time);
bool slw_activate(slw_core *core, slw_block *b, uint32_t vr, double time); /* a clock */
bool slw_own_tick(slw_core *core, slw_block *b, double time);   /* those who are; of scheduled execution the first one */
/* Where a step from t to `end` is divided: at the first tick inside it, or not at all. */
bool slw_timed_part(slw_core *core, slw_block *b, double t, double end, double *stop);
bool slw_may_part(slw_core *core, slw_block *b, double t, double stop);
bool slw_timed_near(const slw_core *core, double a, double b);  /* whether two times are one */
/* False: events without end, of a clock if one ticks at `time` or up to `within_s` later. */
bool slw_timed_endless(slw_core *core, slw_block *b, double time, double within_s);

/* clocks.c: an instant, after the step that led to it. */
bool slw_clocks_run(slw_core *core, int64_t tick, double time);
/* A tick of the connected blocks, divided where a clock ticks inside it; their inputs are in their cells. */
bool slw_clocks_advance(slw_core *core);

/* step.c, rollback.c: one tick. */
bool slw_jacobi(slw_core *core);
bool slw_gauss_seidel(slw_core *core);
bool slw_iterate(slw_core *core);
bool slw_adaptive(slw_core *core);
/* Steps of the blocks that step less often than every tick, around one tick of the others. */
bool slw_slow_begin(slw_core *core);
bool slw_slow_end(slw_core *core);
static inline bool slw_due(const slw_core *core, const slw_block *b) { return core->tick % b->multiple == 0; }
static inline bool slw_ready(const slw_core *core, const slw_block *b) {
  return (core->tick + 1) % b->multiple == 0;
}

static inline double slw_time_of(const slw_core *core, int64_t tick) {
  return core->start_s + (double)tick * core->step_s;
}
static inline double slw_time(const slw_core *core) { return slw_time_of(core, core->tick); }

static inline double slw_max(double a, double b) { return a > b ? a : b; }
static inline double slw_abs(double a) { return a < 0.0 ? -a : a; }

/* Change of a real cell against the tolerance: <= 1 is within it. */
static inline double slw_distance(const slw_core *core, uint32_t cell, double a, double b) {
  const double magnitude = slw_max(slw_max(slw_abs(a), slw_abs(b)), core->nominal[cell]);
  return slw_abs(a - b) / (core->tolerance * magnitude);
}

/* pace.c */
void slw_pace_wait(slw_core *core);
double slw_clock_s(void);

/* snapshot.c: FNV-1a, of more bytes after those of `hash`. */
uint64_t slw_hashed(uint64_t hash, const void *data, size_t size);

/* Its FMU asks to end the simulation. */
void slw_end(slw_core *core, const slw_block *b);
/* Sets slw_core_failure; returns false. */
bool slw_fail(slw_core *core, slw_what what, slw_status status, const slw_block *b, uint32_t cell);

/* Cells that stand side by side, four at a time: most rows are that short. */
static inline void slw_copy_cells(slw_cell *to, const slw_cell *from, size_t n) {
  size_t i = 0;
  for (; i + 4 <= n; i += 4)
    to[i] = from[i], to[i + 1] = from[i + 1], to[i + 2] = from[i + 2], to[i + 3] = from[i + 3];
  for (; i < n; i++) to[i] = from[i];
}

static inline void slw_write_row(const slw_core *core, slw_cell *row) {
  row[0].integer = core->tick;
  if (core->log_run) { /* often what is recorded stands side by side */
    slw_copy_cells(row + 1, core->log_run, core->n_log);
  } else {
    for (size_t i = 0; i < core->n_log; i++) row[1 + i] = core->cells[core->log_cells[i]];
  }
}

/* The begin of every tick: changes, pace, system outputs, and the logged row, which waits while the ring is full. */
static inline bool slw_begin_tick(slw_core *core) {
  core->failure.tick = core->tick;
  if (core->tick >= core->next_change_tick && !slw_apply_changes(core, core->tick, true)) return false;
  if (core->pace) slw_pace_wait(core);
  if (core->sink_works && !slw_run_sink(core)) return false;
  if (!core->logs) return true;
  slw_cell *row = slw_ring_row(&core->ring);
  if (!row) row = slw_ring_wait_row(&core->ring);
  slw_write_row(core, row);
  slw_ring_commit(&core->ring);
  return true;
}

#endif
