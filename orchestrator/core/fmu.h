/* One instance of an FMU, of FMI 2.0 or 3.0, in this process or in one of its own; it steps itself
 * (co-simulation), is integrated by me.c (model exchange), or computes where its clocks tick (scheduled.c).
 *
 * Values travel as cells of 8 bytes: a double for the real types, an int64_t for integers, enumerations,
 * Booleans (0 or 1) and clocks (1: active), the same bits for UInt64, and the number of a blob for strings
 * and binaries. A group moves all variables of one type at once. A clock that is set has a second cell with the
 * time of the instant, which scheduled execution needs.
 *
 * Life: load -> [enter_configuration, set, exit_configuration] -> set start values -> enter_initialisation
 * -> set, get -> exit_initialisation -> { set, step, get } -> terminate -> free.
 * Nothing here reads a clock or keeps global state; each call returns the worst status it met. */
#ifndef SLW_FMU_H
#define SLW_FMU_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* FMI's statuses, and what only a process of its own can come to. */
typedef enum {
  SLW_OK, SLW_WARNING, SLW_DISCARD, SLW_ERROR, SLW_FATAL, SLW_PENDING,
  SLW_CRASHED, /* its process ended; `slw_fmu_message` says by which signal */
  SLW_HUNG,    /* no answer within the time limit; its process was killed */
} slw_status;

/* FMI 3's types; FMI 2's Real, Integer and Enumeration, Boolean, String are 0, 6, 10, 11. */
typedef enum {
  SLW_FLOAT64, SLW_FLOAT32, SLW_INT8, SLW_UINT8, SLW_INT16, SLW_UINT16, SLW_INT32, SLW_UINT32,
  SLW_INT64, SLW_UINT64, SLW_BOOLEAN, SLW_STRING, SLW_BINARY, SLW_CLOCK,
  SLW_N_TYPES
} slw_type;

typedef union {
  double real;
  int64_t integer;
} slw_cell;

/* The content of a string (without its final 0) or binary variable; grows, never shrinks. */
typedef struct {
  char *data;
  size_t size, capacity;
} slw_blob;

/* Variables of one type, moved by one call.  `cells` points into the caller's arena. */
typedef struct {
  slw_type type;
  size_t n_vr;        /* value references */
  size_t n;           /* values: more than n_vr where variables are arrays */
  const uint32_t *vr; /* [n_vr] */
  slw_cell *cells;    /* [n] */
  void *native;       /* [n] in the FMU's own form of the type; NULL where the cells are that form */
  slw_blob *blobs;    /* strings and binaries: the table that cells[i].integer points into; else NULL */
  int64_t *told;      /* set in event mode only: [3][n] what was set last, and at the states kept; else NULL */
} slw_group;

/* How to load an FMU; strings are copied. */
typedef struct {
  int fmi_version;         /* 2 or 3 */
  const char *library;     /* path of the shared library */
  const char *name;        /* of the instance */
  const char *token;       /* GUID or instantiation token */
  const char *resources;   /* FMI 2: URI; FMI 3: path with a final separator; NULL: none */
  bool event_mode;         /* FMI 3: event mode used */
  bool early_return;       /* FMI 3: early return allowed */
  const char *exchange;    /* model exchange: what me.c reads; NULL: co-simulation */
  const char *scheduled;   /* scheduled execution: what scheduled.c reads; NULL: another kind */
  const char *log;         /* log categories to be told, one a line; "": all of them; NULL: none are told */
} slw_fmu_options;

/* What a step came to, beside its status. */
typedef struct {
  double reached;          /* s: last successful time, as the FMU tells it: judged by block.c */
  bool event;              /* FMI 3: event handling needed */
  bool terminate;          /* the FMU asks to end the simulation */
  bool early;              /* it returned early */
} slw_step_result;

/* The parts of a step: a status is that of one of them, and Discard means something of SLW_AT_STEP only. */
typedef enum { SLW_AT_SET, SLW_AT_STEP, SLW_AT_GET } slw_phase;

/* What updating discrete states came to (FMI 3). */
typedef struct {
  bool more;               /* call again */
  bool terminate;
  bool next_event_defined;
  double next_event;       /* s */
} slw_event_result;

/* When a clock ticks next, as the FMU tells it (FMI 3). */
typedef enum { SLW_NOT_YET_KNOWN, SLW_UNCHANGED, SLW_CHANGED } slw_qualifier;
typedef struct {
  int qualifier;           /* slw_qualifier, or what else the FMU gave */
  double seconds;
} slw_interval;

/* FMUs need not write the last successful time: it holds bits before the call that no computation gives. */
#define SLW_UNTOLD 0x7ff8e55ed15ca4edULL
static inline void slw_untold(double *reached) {
  const uint64_t bits = SLW_UNTOLD;
  memcpy(reached, &bits, sizeof bits);
}
/* The time as told; untold it is the end of a step that was done, else its begin. */
static inline double slw_told(double reached, bool done, double time, double h) {
  uint64_t bits;
  memcpy(&bits, &reached, sizeof bits);
  if (bits != SLW_UNTOLD) return reached;
  return done ? time + h : time;
}

typedef struct slw_fmu slw_fmu;

/* An FMU's functions, one table for each kind of instance. */
typedef struct {
  slw_status (*enter_configuration)(slw_fmu *);
  slw_status (*exit_configuration)(slw_fmu *);
  /* tolerance 0: none is told */
  slw_status (*enter_initialisation)(slw_fmu *, double start, bool stop_defined, double stop,
                                     double tolerance);
  slw_status (*exit_initialisation)(slw_fmu *);
  slw_status (*set)(slw_fmu *, const slw_group *);
  slw_status (*get)(slw_fmu *, const slw_group *);
  slw_status (*step)(slw_fmu *, double time, double h, slw_step_result *);
  slw_status (*after_discard)(slw_fmu *, slw_step_result *); /* FMI 2: how far a discarded step got */
  slw_status (*enter_event)(slw_fmu *);
  slw_status (*update_discrete)(slw_fmu *, slw_event_result *);
  slw_status (*enter_step)(slw_fmu *);
  /* Of an input clock; `fraction`: asked for as one. */
  slw_status (*interval)(slw_fmu *, uint32_t vr, bool fraction, slw_interval *result);
  slw_status (*shift)(slw_fmu *, uint32_t vr, bool fraction, double *seconds);
  slw_status (*get_state)(slw_fmu *, void **state);      /* *state NULL: a new one, else it is overwritten */
  slw_status (*set_state)(slw_fmu *, void *state);
  slw_status (*free_state)(slw_fmu *, void **state);
  slw_status (*serialized_size)(slw_fmu *, void *state, size_t *size);
  slw_status (*serialize)(slw_fmu *, void *state, char *bytes, size_t size);
  slw_status (*deserialize)(slw_fmu *, const char *bytes, size_t size, void **state);
  /* d unknowns / d knowns times seed at the present point */
  slw_status (*directional)(slw_fmu *, const uint32_t *unknowns, size_t n_unknowns, const uint32_t *knowns,
                            size_t n_knowns, const double *seed, size_t n_seed, double *result,
                            size_t n_result);
  slw_status (*terminate)(slw_fmu *);
  slw_status (*reset)(slw_fmu *);
  void (*free)(slw_fmu *);                               /* frees instance and library, and the slw_fmu */
} slw_fmu_functions;

/* FMI functions that a step calls, for the fast path of plan.c; NULL in an FMU that is not here. */
typedef int (*slw_fmi2_get_real)(void *, const unsigned *, size_t, double *);
typedef int (*slw_fmi2_set_real)(void *, const unsigned *, size_t, const double *);
typedef int (*slw_fmi2_do_step)(void *, double, double, int);
typedef int (*slw_fmi3_get_float64)(void *, const uint32_t *, size_t, double *, size_t);
typedef int (*slw_fmi3_set_float64)(void *, const uint32_t *, size_t, const double *, size_t);
typedef int (*slw_fmi3_do_step)(void *, double, double, bool, bool *, bool *, bool *, double *);

#define SLW_MESSAGES 20
#define SLW_MESSAGE_SIZE 512

struct slw_fmu {
  const slw_fmu_functions *call;
  int fmi_version;
  bool local;                           /* in this process */
  bool scheduled;                       /* scheduled execution: an active clock is a computation, one at a time */
  bool fatal;                           /* nothing of it may be called any more; it is left as it is */
  void *instance;                       /* the FMU's own */
  union {
    struct { slw_fmi2_get_real get_real; slw_fmi2_set_real set_real; slw_fmi2_do_step do_step; } fmi2;
    struct { slw_fmi3_get_float64 get; slw_fmi3_set_float64 set; slw_fmi3_do_step do_step; } fmi3;
  } fast;
  uint64_t n_messages;                  /* ever logged */
  char messages[SLW_MESSAGES][SLW_MESSAGE_SIZE]; /* the last ones: message k at k % SLW_MESSAGES */
  struct slw_me *me;                    /* of model exchange, else NULL */
  struct slw_scheduled *partitions;     /* of scheduled execution, else NULL */
};

/* Load and instantiate in this process.  NULL and a sentence in `error` when that fails. */
slw_fmu *slw_fmu_load(const slw_fmu_options *options, char *error, size_t error_size);

/* The same in a process of its own, which ends with it (or with us).  `host`: path of the host program;
 * `limit_s`: how long one call may take before the process is killed and SLW_HUNG returned. */
slw_fmu *slw_fmu_spawn(const slw_fmu_options *options, const char *host, double limit_s, char *error,
                       size_t error_size);

/* The k-th last message (0: the last), "" if there is none. */
const char *slw_fmu_message(const slw_fmu *fmu, unsigned k);

/* How many messages there ever were. */
uint64_t slw_fmu_messages(const slw_fmu *fmu);

/* From now on a call of an FMU in a process of its own may take at most `limit_s`. */
void slw_fmu_hurry(slw_fmu *fmu, double limit_s);

/* Append a message (cut to SLW_MESSAGE_SIZE). */
void slw_fmu_log(slw_fmu *fmu, const char *message);

/* Give back what a blob of the caller's own holds. */
void slw_blob_release(slw_blob *blob);

/* Space for `native` of a group of that type and FMI version; 0 where the cells are the native form. */
size_t slw_native_size(int fmi_version, slw_type type);

#endif
