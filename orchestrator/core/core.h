/* The orchestrator's core: a checked system lowered once into a flat plan, stepped in integer time.
 *
 * All values stand in one arena of cells (fmu.h): system inputs, outputs and inputs of every FMU, system
 * outputs. The plan is built by the functions below, in any order, before slw_core_initialise; each copies
 * what it is given and refuses (returns false, slw_core_error says why) what is out of range. A step of the
 * plan then allocates nothing, takes no lock, formats no string, and checks every status and every real
 * output. Time is an integer count of ticks; a tick is `step_s` long. */
#ifndef SLW_CORE_H
#define SLW_CORE_H

#include "fmu.h"

#define SLW_SINK UINT32_MAX /* as block: the system outputs, moved after every step */
#define SLW_TARGET 0x80000000U /* as block, plus its number: what a target clock clocks, moved when it ticks */

#define SLW_NO_CLOCK UINT32_MAX

typedef struct slw_core slw_core;

/* The first tick is at `start_s`. */
slw_core *slw_core_new(uint32_t n_cells, uint32_t n_blobs, double step_s, double start_s);
/* Frees the core, not its FMUs. */
void slw_core_free(slw_core *core);
slw_cell *slw_core_cells(slw_core *core);
slw_blob *slw_core_blobs(slw_core *core);
const char *slw_core_error(const slw_core *core);
/* The content of the string or binary in `cell`. */
bool slw_core_write_blob(slw_core *core, uint32_t cell, const char *data, size_t size);

/* ---- building the plan ---- */

/* An FMU that steps once in `multiple` ticks; returns its block number. Blocks step in the order they are added;
 * `event_mode`, `early_return`: it was loaded so. */
bool slw_core_block(slw_core *core, slw_fmu *fmu, uint32_t multiple, bool event_mode, bool early_return,
                    uint32_t *block);

typedef enum { SLW_SET, SLW_GET, SLW_SET_DISCRETE } slw_direction;
/* Variables of one type that a block sets before, or gets after, a step; their cells are consecutive.
 * SLW_SET_DISCRETE, of a block with event mode: a change of them is an event, and they are set in it only. */
bool slw_core_group(slw_core *core, uint32_t block, slw_direction direction, slw_type type, size_t n_vr,
                    const uint32_t *vr, size_t n, uint32_t first_cell);

/* cells[first + i] = scale[i] * cells[source[i]] + offset[i], real; scale and offset NULL: any cell unchanged. */
bool slw_core_move(slw_core *core, uint32_t block, size_t n, const uint32_t *source, uint32_t first,
                   const double *scale, const double *offset);
/* cells[target] = to[k] where from[k] == cells[source]; without a match unchanged, or an error if `strict`. */
bool slw_core_table(slw_core *core, uint32_t block, uint32_t source, uint32_t target, size_t n,
                    const int64_t *from, const int64_t *to, bool strict);
/* The content of a string or binary. */
bool slw_core_copy(slw_core *core, uint32_t block, uint32_t source, uint32_t target);

/* A fault on what arrives in a real cell of a block's inputs, from tick `from` on, before tick `to`. */
typedef enum {
  SLW_STUCK,     /* keeps the value it had at `from`, or a if b is 1 */
  SLW_BIAS,      /* + a */
  SLW_DRIFT,     /* + a per s since `from` */
  SLW_NOISE,     /* + a times a standard normal number */
  SLW_DELAY,     /* what it was a s (whole ticks) before */
  SLW_DROPOUT,   /* with probability a per tick the value of the last tick that was not lost; b: mean ticks lost */
  SLW_SPIKE,     /* with probability a per tick + b or - b */
  SLW_QUANTISE,  /* the nearest multiple of a */
  SLW_SCALE,     /* times a */
  SLW_SATURATE,  /* between a and b */
  SLW_N_FAULTS
} slw_fault_kind;
bool slw_core_fault(slw_core *core, uint32_t block, uint32_t cell, slw_fault_kind kind, int64_t from, int64_t to,
                    double a, double b, uint64_t seed);

/* From tick `tick` on this block's steps fail, as if its FMU had returned an error. */
bool slw_core_fail(slw_core *core, uint32_t block, int64_t tick);

/* From tick `tick` on: cells[cell] = the cell with these bits (a system input). */
bool slw_core_stimulus(slw_core *core, int64_t tick, uint32_t cell, int64_t bits);
/* At tick `tick`: set a tunable parameter of a block. */
bool slw_core_parameter(slw_core *core, int64_t tick, uint32_t block, slw_type type, uint32_t vr, int64_t bits);
/* A time-based input clock that ticks with the grid: active at ticks shift, shift + interval, ...  Of clocks that are
 * due at one instant those added first tick first. */
bool slw_core_clock(slw_core *core, uint32_t block, uint32_t vr, int64_t shift, int64_t interval);
/* One that ticks at times of its own (timed.c): every `interval_s` from the start + `shift_s` on, or as its FMU tells. */
typedef enum { SLW_GRID, SLW_PERIODIC, SLW_FIXED, SLW_TUNABLE, SLW_CHANGING, SLW_COUNTDOWN } slw_clock_kind;
bool slw_core_timed_clock(slw_core *core, uint32_t block, uint32_t vr, slw_clock_kind kind, bool fraction,
                          double shift_s, double interval_s);
/* Into what parts a step of the block may be divided, where a clock ticks inside it: multiples of `part_s`; 0: any;
 * negative (as it is without this call): none. */
bool slw_core_parts(slw_core *core, uint32_t block, double part_s);

/* Clocks connected to each other (clocks.c), of blocks with event mode that step every tick.  A source is an output
 * clock, or a time-based input clock that its block already has; a target is a triggered input clock, with the source
 * that ticks it. */
bool slw_core_source_clock(slw_core *core, uint32_t block, uint32_t vr);
bool slw_core_target_clock(slw_core *core, uint32_t block, uint32_t vr, uint32_t source_block, uint32_t source_vr,
                           uint32_t *number);
/* As slw_core_group, for variables that clock `clock_vr` clocks, which they move with: set before it ticks, got
 * after. */
bool slw_core_clocked(slw_core *core, uint32_t block, slw_direction direction, uint32_t clock_vr, slw_type type,
                      size_t n_vr, const uint32_t *vr, size_t n, uint32_t first_cell);

typedef enum { SLW_JACOBI, SLW_GAUSS_SEIDEL, SLW_ITERATE, SLW_ADAPTIVE } slw_algorithm;
bool slw_core_algorithm(slw_core *core, slw_algorithm algorithm, double tolerance, uint32_t max_iterations,
                        uint32_t max_halvings);
/* The magnitude that a real output's change is compared with, at least (default 1). */
bool slw_core_nominal(slw_core *core, uint32_t cell, double nominal);
/* Order in which initial outputs are propagated (all blocks once), and the groups of it that form a loop:
 * loop[i] is 0, or the number of the algebraic loop that block order[i] belongs to. */
bool slw_core_order(slw_core *core, const uint32_t *order, const uint32_t *loop);

/* The ring buffer of recorded rows: `n` cells a row, room for `rows` rows. Every row: 1 + n cells, the first
 * one the tick. */
bool slw_core_log(slw_core *core, size_t n, const uint32_t *cells, size_t rows);

/* Pace: `factor` simulated seconds per second of the monotonic clock; 0: as fast as it goes. */
bool slw_core_pace(slw_core *core, double factor);
/* Measure the time spent inside each block's FMU. */
bool slw_core_timing(slw_core *core, bool on);

/* ---- running ---- */

typedef enum { SLW_DONE, SLW_FAILED, SLW_ENDED /* an FMU asked to terminate */ } slw_outcome;

/* The FMUs, in initialisation mode, to tick 0: initial outputs propagated, loops solved, initialisation left. */
slw_outcome slw_core_initialise(slw_core *core);
/* Up to tick `until`; the row of every tick is logged when it begins. Waits while the ring is full. */
slw_outcome slw_core_run(slw_core *core, int64_t until);
int64_t slw_core_tick(const slw_core *core);
/* Applies the changes of the present tick and logs its row: the last one of a run. False: see the failure. */
bool slw_core_log_last(slw_core *core);
/* No row follows: a waiting slw_core_take returns. */
void slw_core_log_finish(slw_core *core);

/* What failed. */
typedef enum {
  SLW_DOING_SET, SLW_DOING_STEP, SLW_DOING_GET, SLW_DOING_EVENT, SLW_DOING_STATE, SLW_DOING_INITIALISE,
  SLW_NOT_FINITE,      /* output cell `cell` is no number */
  SLW_NOT_IN_TABLE,    /* cell `cell` holds a value that its mapping lacks */
  SLW_NO_CONVERGENCE,  /* the sweeps of a step, or of loop `loop` at the start */
  SLW_STEP_TOO_SMALL,  /* the smallest step still misses the tolerance */
  SLW_RETURNED_EARLY,  /* without being allowed to */
  SLW_NO_PROGRESS,     /* an FMU that returns early without advancing, or iterates events without end */
  SLW_INJECTED,        /* the failure that slw_core_fail asked for */
  SLW_BAD_TIME,        /* an FMU told a time that its step cannot have reached */
  SLW_BAD_INTERVAL,    /* an FMU told of clock `clock` what no clock ticks at */
  SLW_CLOCK_INSIDE,    /* clock `clock` ticks inside a step that cannot be divided there */
} slw_what;
typedef struct {
  slw_what what;
  slw_status status;
  uint32_t block, cell, loop;
  int64_t tick;        /* of the step's begin; -1: initialisation */
  double time;         /* s */
  double told, from, to; /* SLW_BAD_TIME: the time, and the ends of the step; of a clock: what was told, and when */
  uint32_t clock;        /* value reference; SLW_NO_CLOCK: another component's */
  int32_t qualifier;     /* SLW_BAD_INTERVAL: as told; -1: it is the shift */
} slw_failure;
/* After SLW_ENDED: `block` says whose FMU asked. */
const slw_failure *slw_core_failure(const slw_core *core);
/* Whether a clock of slw_core_timed_clock has ticked, or will at a time that is known. */
bool slw_core_clock_told(const slw_core *core, uint32_t block, uint32_t vr);

/* ---- beside a run, from another thread ---- */

/* Take at most `max` rows out of the ring, waiting up to `wait_ms` for `at_least`; returns how many. */
size_t slw_core_take(slw_core *core, slw_cell *rows, size_t at_least, size_t max, int wait_ms);

typedef struct {
  uint64_t steps, discards, events, early_returns, warnings, rollbacks;
  double seconds;          /* inside the FMU, 0 unless timed */
} slw_block_statistics;
typedef struct {
  uint64_t steps;          /* of the system, sub-steps included */
  uint64_t rejected;       /* sub-steps taken back */
  uint64_t sweeps;         /* of "iterate" */
  uint64_t late;           /* paced ticks that began more than 1 ms late */
  double late_max_s;
  double late_p50_s, late_p99_s, late_p999_s;
  uint64_t waits;          /* for room in the ring */
} slw_statistics;
void slw_core_statistics(const slw_core *core, slw_statistics *statistics);
void slw_core_block_statistics(const slw_core *core, uint32_t block, slw_block_statistics *statistics);

/* ---- the whole system's state ---- */

/* Bytes of a snapshot at the present tick; 0 when an FMU cannot serialise its state. */
size_t slw_core_snapshot_size(slw_core *core);
bool slw_core_snapshot(slw_core *core, char *bytes, size_t size);
/* Into a core of the same plan, initialised; false and slw_core_error if the bytes are not of such a one. */
bool slw_core_restore(slw_core *core, const char *bytes, size_t size);

#endif
