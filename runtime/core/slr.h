/* The control core: one tick of the machine controller, from the input image to the output image.
 *
 * No clock, no input or output, no allocation: what a tick does follows from the input image, the tick's number
 * and the state alone.  The state is a caller's memory of slr_state_size() bytes: SlrState, then the states of
 * the blocks; values only, without gaps, so that a copy of it is a snapshot and equal states are equal bytes.
 */
#ifndef SLR_H
#define SLR_H

#include <stddef.h>
#include <stdint.h>

#include "block.h"
#include "gate.h"
#include "guard.h"

#if defined(_WIN32)
#define SLR_EXPORT __declspec(dllexport)
#else
#define SLR_EXPORT __attribute__((visibility("default")))
#endif

/* Limited authority: the largest command of each axis, then the shares of the gate's speed limits and of its rise
 * that are left. */
enum { SLR_AUTHORITY_SPEED = SLR_AXES, SLR_AUTHORITY_RISE, SLR_AUTHORITY };

typedef struct {
  int64_t tick;         /* of the last step */
  int32_t mode;         /* SlrMode */
  int32_t fault;        /* SlrFault: latched, or why there is a hold */
  int32_t fault_signal; /* value reference */
  int32_t running;      /* ticks since the controllers were started; -1: they do not run */
  int32_t enable;       /* operator's switches at the last step, for their edges */
  int32_t request;
  int32_t overruns;     /* as told at the last step */
  int32_t late;         /* cycles in a row that ended too late */
  int32_t in_reach;
  int32_t limited;      /* the gate changed the last command */
  int32_t estimating;   /* the estimator has been started */
  int32_t guarding;     /* part of the machine for which the guard changed the last command; 0: none */
  double last[SLR_IN_COUNT];  /* last valid value of each input */
  double raw[SLR_IN_COUNT];   /* value of each input at the last step, valid or not */
  int32_t bad[SLR_IN_COUNT];  /* steps in a row without a valid value */
  int32_t same[SLR_IN_COUNT]; /* steps in a row with the same value */
  double own[SLR_OUT_COUNT];  /* the core's half of the board */
  double held[SLR_AXES];      /* commands as the gate let them through */
  double load;                /* kg, kept from the last run until the estimator knows its own; negative: none */
  double authority[SLR_AUTHORITY]; /* see slr_limit */
  SlrGuardPast past;
} SlrState;

/* Everything a step finds out before it decides. */
typedef struct {
  double board[SLR_BOARD];
  uint8_t status[SLR_IN_COUNT]; /* as found, not as told */
  uint8_t lost[SLR_IN_COUNT];   /* not usable, and not to be bridged any longer */
  SlrWall walls[SLR_WALLS];
  double distance; /* m, hanging grab point to target */
  double reach;    /* m or rad: by how much the target is within reach; negative: it is not */
  int deflected;   /* the joystick is out of its rest */
} SlrView;

/* ---- the bundle's own part, generated: core_config.c ---- */
extern const SlrBlock *const slr_controller;
extern const SlrBlock *const slr_arm;
extern const SlrBlock *const slr_estimator; /* of the load; negative: nothing known yet */
extern const uint8_t slr_needed[SLR_IN_COUNT]; /* inputs that automatic operation depends on */
extern const double slr_zero[SLR_IN_COUNT];    /* what each input shows at its zero: taken off when it is used */
extern const SlrGateLimits slr_limits;
extern const SlrGuardLimits slr_guard_limits;
extern const SlrGuardBody slr_guard_body;
extern const SlrZones *const slr_zones; /* NULL: there is no guard */
extern const char slr_identity_text[];
/* Walls (distance, rate, gradient by boom, gradient by stick, each), distance to the target, reach. */
void slr_geometry(const double *joints, const double *target, double *walls, double *distance, double *reach);

/* ---- parts ---- */

/* Values that may be used, by the images alone: check.c. */
void slr_check(const SlrInput *in, SlrState *s, SlrView *view);
/* First lost input of a group (of sensors and the policy outside: one that is needed); -1: all are well. */
int slr_first_lost(const SlrView *view, SlrGroup group);
/* Whether an input may be forced: not what decides who may move (switches, readiness, targets). */
int slr_is_forceable(int i);
/* First input that is not only information and whose message two nodes send; -1: none. */
int slr_first_doubled(const SlrView *view);
/* The next mode, with fault and fault_signal; `view` and the switches of the last step decide: mode.c. */
void slr_next_mode(const SlrInput *in, SlrState *s, const SlrView *view);
void slr_fail(SlrState *s, SlrFault fault, int32_t signal);
/* Value reference of an input, 0 for -1; every input at its start value. */
int32_t slr_value_reference(int input);
void slr_start_values(SlrState *s);

/* Walls, distance and reach of a view whose board is there: step.c. */
void slr_look_around(SlrView *view);
/* Takes back what would lead into a zone, in automatic operation; the part of the machine: step.c. */
int slr_guarded(const SlrState *s, const SlrView *view, double wanted[SLR_AXES]);
SlrGuardView slr_guard_sees(const SlrView *view);
/* What the gate is shown, and its limits with the commands as far as the authority goes (slr_limit): step.c. */
SlrGateView slr_gate_sees(const SlrState *s, const SlrView *view);
SlrGateLimits slr_within_authority(const double authority[SLR_AUTHORITY], double allowed[SLR_AXES]);

/* Where a block's state lies. */
unsigned char *slr_state_of(SlrState *s, const SlrBlock *block);

/* ---- what the runtime calls ---- */

SLR_EXPORT const char *slr_layout(void);   /* the images that this core was compiled for */
SLR_EXPORT const char *slr_identity(void); /* of the bundle: a hash of its sources */
SLR_EXPORT const char *slr_parameters(void); /* SHA-256 of the parameters.json with which it was compiled */
SLR_EXPORT size_t slr_input_size(void);
SLR_EXPORT size_t slr_output_size(void);
SLR_EXPORT size_t slr_state_size(void);
SLR_EXPORT void slr_reset(SlrState *state);
/* The first state with what was kept of the last run: a latched fault, the load (negative: none). */
SLR_EXPORT void slr_restart(SlrState *state, int32_t fault, int32_t fault_signal, double load);
/* Takes over SLR_AUTHORITY values, each 0 to 1; after slr_reset all are 1.  They are part of the state, so that a
 * snapshot has them.  Ways to neutral are never limited. */
SLR_EXPORT void slr_limit(SlrState *state, const double *authority);
/* Whether the controller would run at the tick of this image, and the board that it would see: for a policy that
 * is evaluated outside.  The state stays as it is. */
enum { SLR_NOT_DUE, SLR_DUE, SLR_STARTS };
SLR_EXPORT int slr_observe(const SlrInput *in, const SlrState *state, double *board);
/* Its answer, before slr_step (external.c). */
SLR_EXPORT void slr_offer(SlrState *state, const double *action);
SLR_EXPORT void slr_step(const SlrInput *in, SlrState *state, int64_t tick, SlrOutput *out);

/* For people: which of the state machine's conditions hold after a step.  SLR_LADDER numbers: known (1), what stops
 * the machine and about which signal, what bars automatic operation and about which, enabling switch, automatic
 * switch, automatic allowed, joystick deflected, a target in reach, commands neutral (mode.c). */
enum { SLR_LADDER = 11 };
SLR_EXPORT void slr_ladder(const SlrInput *in, const SlrState *now, int64_t *told);

/* For reports and tests, not in the cycle: where the machine may come until it rests when `commands` are sent in the
 * next step and neutral ones after it (guard.c), as lo and hi of each joint and the swing, and the room that is left. */
enum { SLR_FORESEEN = 2 * SLR_AXES + 2 };
SLR_EXPORT void slr_foresee(const SlrInput *in, const SlrState *before, const double *commands, double *foreseen);

/* For reports, not in the cycle: what the controller wanted in a step that has been taken, and, bit by bit, which
 * of the gate's reasons, or the guard, changed that (explain.c). */
enum {
  SLR_WHY_RANGE, SLR_WHY_RATE, SLR_WHY_SPEED, SLR_WHY_KEEP_OUT, SLR_WHY_JOINT_LIMIT, SLR_WHY_SENSOR,
  SLR_WHY_AUTHORITY, SLR_WHY_GUARD, SLR_REASONS
};
SLR_EXPORT void slr_explain(const SlrInput *in, const SlrState *before, const SlrState *after, double *wanted,
                            int32_t *why);

#endif
