/* Why a command was changed: by the guard, whose answer is asked anew, then by the gate.
 *
 * Each of the gate's reasons is asked by itself, all others taken away. *
 * Those count that give by themselves what came out; if none does, all that would have changed the command.  It is
 * the gate of gate.c that answers, with other limits and another view; nothing of it is stated here again.
 */
#include <string.h>

#include "core_config.h"
#include "slr.h"

static const double FAR = 1e9; /* a limit that is none */
static const int commands[SLR_AXES] = {SLR_OUT_u_slew, SLR_OUT_u_boom, SLR_OUT_u_stick};

typedef struct {
  SlrGateLimits limits;
  SlrGateView view;
  double wanted[SLR_AXES];
} Question;

/* The question without any reason: everything passes. */
static Question open_question(const Question *asked) {
  Question q = *asked;
  q.limits.range = q.limits.rise = q.limits.fall = FAR;
  for (int axis = 0; axis < SLR_AXES; axis++) {
    q.limits.speed[axis] = FAR;
    q.view.known[axis] = 1;
  }
  for (int i = 0; i < SLR_WALLS; i++) {
    q.view.walls[i].distance = FAR;
    q.view.walls[i].rate = 0.0;
  }
  return q;
}

static void add_walls(Question *q, const Question *asked, int first, int end) {
  q->limits.range = asked->limits.range; /* what is left of it before a wall */
  for (int i = first; i < end; i++) q->view.walls[i] = asked->view.walls[i];
}

static void add_reason(Question *q, const Question *asked, int reason) {
  switch (reason) {
  case SLR_WHY_RANGE: q->limits.range = asked->limits.range; break;
  case SLR_WHY_RATE:
    q->limits.rise = asked->limits.rise;
    q->limits.fall = asked->limits.fall;
    break;
  case SLR_WHY_SPEED: memcpy(q->limits.speed, asked->limits.speed, sizeof q->limits.speed); break;
  case SLR_WHY_KEEP_OUT: add_walls(q, asked, 0, SLR_FIRST_JOINT_WALL); break;
  case SLR_WHY_JOINT_LIMIT: add_walls(q, asked, SLR_FIRST_JOINT_WALL, SLR_WALLS); break;
  default: memcpy(q->view.known, asked->view.known, sizeof q->view.known); break;
  }
}

static int in_range(double command, double range) { return command >= -range && command <= range; }

/* A wall is asked with the range; what is beyond the range alone is not the wall's doing. */
static int by_wall(int reason, double wanted, double range) {
  const int wall = reason == SLR_WHY_KEEP_OUT || reason == SLR_WHY_JOINT_LIMIT;
  return !wall || in_range(wanted, range);
}

/* `alone`: what would have come out of this reason alone, by axis. */
static void ask(const Question *asked, const double before[SLR_AXES], int reason, double alone[SLR_AXES]) {
  Question q = open_question(asked);
  memcpy(alone, before, sizeof q.wanted);
  add_reason(&q, asked, reason);
  (void)slr_gate(&q.limits, &q.view, q.wanted, alone);
  for (int axis = 0; axis < SLR_AXES; axis++)
    if (!by_wall(reason, q.wanted[axis], asked->limits.range)) alone[axis] = q.wanted[axis];
}

static int32_t reasons(double alone[SLR_WHY_GUARD][SLR_AXES], int axis, double wanted, double passed) {
  int32_t changed = 0, exact = 0;
  for (int reason = 0; reason < SLR_WHY_GUARD; reason++) {
    changed |= !(alone[reason][axis] == wanted) ? 1 << reason : 0;
    exact |= alone[reason][axis] == passed ? 1 << reason : 0;
  }
  return changed & exact ? changed & exact : changed;
}

void slr_foresee(const SlrInput *in, const SlrState *before, const double *commands, double *foreseen) {
  SlrState s = *before;
  SlrView view;
  SlrSweep sweep;
  int part;
  slr_check(in, &s, &view);
  const SlrGuardView seen = slr_guard_sees(&view);
  slr_guard_foresee(&slr_guard_limits, &slr_guard_body, &seen, &s.past, commands, &sweep);
  memcpy(foreseen, sweep.lo, sizeof sweep.lo);
  memcpy(foreseen + SLR_AXES, sweep.hi, sizeof sweep.hi);
  foreseen[2 * SLR_AXES] = sweep.swing;
  foreseen[2 * SLR_AXES + 1] =
      slr_zones ? slr_guard_room(&slr_guard_limits, &slr_guard_body, slr_zones, &sweep, -FAR, &part) : FAR;
}

void slr_explain(const SlrInput *in, const SlrState *before, const SlrState *after, double *wanted, int32_t *why) {
  double alone[SLR_WHY_GUARD][SLR_AXES];
  SlrState s = *before;
  SlrView view;
  slr_check(in, &s, &view);
  slr_look_around(&view);
  s.mode = after->mode;
  Question asked = {.view = slr_gate_sees(&s, &view)};
  for (int axis = 0; axis < SLR_AXES; axis++) {
    const double by_hand = s.mode == SLR_MODE_MANUAL ? view.board[SLR_IN_joystick_slew + axis] : 0.0;
    asked.wanted[axis] = s.mode == SLR_MODE_AUTOMATIC ? after->own[commands[axis]] : by_hand;
  }
  memcpy(wanted, asked.wanted, sizeof asked.wanted);
  (void)slr_guarded(&s, &view, asked.wanted);
  memset(why, 0, SLR_AXES * sizeof *why);
  if (!asked.view.move) return;
  memcpy(alone[SLR_WHY_AUTHORITY], asked.wanted, sizeof asked.wanted);
  asked.limits = slr_within_authority(s.authority, alone[SLR_WHY_AUTHORITY]);
  for (int reason = 0; reason < SLR_WHY_AUTHORITY; reason++) ask(&asked, before->held, reason, alone[reason]);
  for (int axis = 0; axis < SLR_AXES; axis++) {
    const double guarded = asked.wanted[axis];
    if (!(guarded == wanted[axis])) why[axis] = 1 << SLR_WHY_GUARD;
    if (!(after->held[axis] == guarded)) why[axis] |= reasons(alone, axis, guarded, after->held[axis]);
  }
}
