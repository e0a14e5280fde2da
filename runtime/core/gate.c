/* See gate.h. */
#include "gate.h"

static double lesser(double a, double b) { return a < b ? a : b; }
static double greater(double a, double b) { return a > b ? a : b; }

/* Of a command that is no number nothing is left. */
static double number_or_neutral(double x) { return x - x == 0.0 ? x : 0.0; }

static double within(double x, double limit) { return lesser(greater(x, -limit), limit); }

/* How far an axis may be commanded at all. */
static double reach(const SlrGateLimits *l, const SlrGateView *v, int axis) {
  if (!v->move) return 0.0;
  if (v->known[axis]) return l->range;
  return v->by_hand ? l->creep : 0.0;
}

static int too_fast(const SlrGateLimits *l, const SlrGateView *v, int axis, double command) {
  if (command > 0.0) return v->speed[axis] >= l->speed[axis];
  return command < 0.0 && v->speed[axis] <= -l->speed[axis];
}

static int opposed(double a, double b) { return (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0); }

/* How far an axis may be commanded this way before the walls. */
static double room(const SlrGateLimits *l, const SlrGateView *v, int axis, double command) {
  double most = l->range;
  for (int i = v->by_hand ? SLR_FIRST_JOINT_WALL : 0; i < SLR_WALLS; i++) {
    const SlrWall *w = &v->walls[i];
    const double then = w->distance + l->ahead * lesser(w->rate, 0.0);
    if (opposed(w->gradient[axis], command)) most = lesser(most, l->range * greater(then, 0.0) / l->zone[i]);
  }
  return most;
}

static double allowed(const SlrGateLimits *l, const SlrGateView *v, int axis, double wanted) {
  const double command = within(number_or_neutral(wanted), reach(l, v, axis));
  if (!v->known[axis]) return command;
  return too_fast(l, v, axis, command) ? 0.0 : within(command, room(l, v, axis, command));
}

/* From `held` towards `aim` in one tick: neutral is passed only as far as it may be left. */
static double towards(const SlrGateLimits *l, double held, double aim) {
  const double low = held > 0.0 ? greater(held - l->fall, -l->rise) : held - l->rise;
  const double high = held < 0.0 ? lesser(held + l->fall, l->rise) : held + l->rise;
  return lesser(greater(aim, low), high);
}

int slr_gate(const SlrGateLimits *limits, const SlrGateView *view, const double wanted[SLR_AXES],
             double held[SLR_AXES]) {
  int changed = 0;
  for (int axis = 0; axis < SLR_AXES; axis++) {
    held[axis] = towards(limits, held[axis], allowed(limits, view, axis, wanted[axis]));
    changed |= !(held[axis] == wanted[axis]);
  }
  return changed;
}
