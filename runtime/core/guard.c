/* See guard.h. */
#include "guard.h"

#include <string.h>

#include "image_layout.h"
#include "slw_math.h"

static const double TURN = 6.283185307179586;
static const double ARC = 0.5707963267948966; /* asin x <= x + (pi/2 - 1) x^3 */
static const double ALONE = 1e3;        /* m, room where nothing is near */
static const double EQUAL = 0.005;      /* m, within which two ways to rest come equally near */

static double lesser(double a, double b) { return a < b ? a : b; }
static double greater(double a, double b) { return a > b ? a : b; }
static double length(double a, double b) { return slw_sqrt(a * a + b * b); }

/* ---- how far the machine goes ---- */

/* The largest command in a direction (1 or -1) that still acts or is about to. */
static double acting(const SlrGuardPast *past, int axis, double command, double way) {
  double most = greater(way * command, 0.0);
  for (int i = 0; i < SLR_GUARD_SENT; i++) most = greater(most, way * past->sent[axis][i]);
  return most;
}

/* Largest steady speed that a command gives. */
static double steady(const SlrGuardLimits *l, int axis, double command) {
  return lesser(l->speed[axis] * greater(command - l->dead_band, 0.0), l->top[axis]);
}

/* Measured speed of an arm joint: the change of its angle over the ticks that are remembered. */
static double arm_rate(const SlrGuardView *v, const SlrGuardPast *past, int axis) {
  return (v->angle[axis] - past->angle[axis - SLR_BOOM][SLR_GUARD_BACK - 1]) / ((double)SLR_GUARD_BACK * SLR_TICK_S);
}

/* Largest speed on the way to rest, of slew or arm. */
static double slew_peak(const SlrGuardLimits *l, const SlrGuardPose *pose, double rate, double command) {
  const double driven = rate + l->push / pose->least * l->push_time;
  return greater(greater(rate, lesser(driven, steady(l, SLR_SLEW, command))), 0.0);
}

static double arm_peak(const SlrGuardLimits *l, const SlrGuardPast *past, int axis, double rate, double command) {
  const double now = past->known < SLR_GUARD_BACK ? l->top[axis] : greater(rate, 0.0);
  return greater(now, steady(l, axis, command));
}

/* Largest speeds on the way to rest, backwards and forwards. */
typedef struct {
  double peak[SLR_AXES][2];
} Speeds;

static double largest(const Speeds *speeds, int axis) { return greater(speeds->peak[axis][0], speeds->peak[axis][1]); }

static void foresee_speeds(const SlrGuardLimits *l, const SlrGuardPose *pose, const SlrGuardView *v,
                           const SlrGuardPast *past, const double commands[SLR_AXES], Speeds *speeds) {
  for (int axis = 0; axis < SLR_AXES; axis++) {
    const double measured = axis == SLR_SLEW ? v->slew_rate : arm_rate(v, past, axis);
    for (int side = 0; side < 2; side++) {
      const double way = side ? 1.0 : -1.0, rate = way * measured + l->rate_error[axis];
      const double command = acting(past, axis, commands[axis], way);
      speeds->peak[axis][side] =
          axis == SLR_SLEW ? slew_peak(l, pose, rate, command) : arm_peak(l, past, axis, rate, command);
    }
  }
}

static double way_to_rest(const SlrGuardLimits *l, const SlrGuardPose *pose, const Speeds *speeds, int axis, int side) {
  const double peak = speeds->peak[axis][side], way = peak * l->dead_time[axis];
  if (axis == SLR_SLEW) return way + peak * peak * pose->most / (2.0 * l->brake);
  return way + l->kick[axis] * largest(speeds, axis == SLR_BOOM ? SLR_STICK : SLR_BOOM);
}

static double measured_swing(const SlrGuardLimits *l, const SlrGuardView *v) {
  const double rate = l->swing_time * length(v->swing_rate[0], v->swing_rate[1]);
  return length(length(v->swing[0], v->swing[1]), rate) + l->swing_error;
}

/* What stopping adds to it. */
static double added_swing(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrGuardPose *pose,
                          const Speeds *speeds) {
  const double reach = length(pose->tip[0] - body->foot[0], pose->tip[1] - body->foot[1]);
  const double arm = reach * largest(speeds, SLR_BOOM) + body->stick * largest(speeds, SLR_STICK);
  return l->swing_slew * pose->tip[0] * largest(speeds, SLR_SLEW) + l->swing_arm * arm;
}

void slr_guard_foresee(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrGuardView *v,
                       const SlrGuardPast *past, const double commands[SLR_AXES], SlrSweep *sweep) {
  SlrGuardPose pose;
  Speeds speeds;
  slr_guard_pose(v->angle[SLR_BOOM], v->angle[SLR_STICK], &pose);
  foresee_speeds(l, &pose, v, past, commands, &speeds);
  sweep->swing = lesser(measured_swing(l, v) + added_swing(l, body, &pose, &speeds), l->swing_most);
  for (int axis = 0; axis < SLR_AXES; axis++) {
    const double more = l->angle_error + l->settle[axis] + l->give[axis] * sweep->swing;
    sweep->lo[axis] = v->angle[axis] - way_to_rest(l, &pose, &speeds, axis, 0) - more;
    sweep->hi[axis] = v->angle[axis] + way_to_rest(l, &pose, &speeds, axis, 1) + more;
  }
}

/* ---- how near that comes ---- */

/* A ball at the middle of the sweep: where, how far it may move from there, and the azimuth that it takes. */
typedef struct {
  double r, z, radius, moves, swings, rises, azimuth;
  int32_t part;
} Placed;

static void place_ball(const SlrGuardBody *body, const SlrGuardPose *pose, const SlrSweep *sweep, const SlrBall *ball,
                       Placed *p) {
  const double boom = 0.5 * (sweep->hi[SLR_BOOM] - sweep->lo[SLR_BOOM]);
  const double stick = 0.5 * (sweep->hi[SLR_STICK] - sweep->lo[SLR_STICK]) * body->stick;
  const double *from = ball->part == SLR_PART_BOOM ? body->foot : pose->knee;
  const double *to = ball->part == SLR_PART_BOOM ? pose->knee : pose->tip;
  const int hangs = ball->part == SLR_PART_LINES || ball->part == SLR_PART_GRAB;
  const double at = hangs ? 1.0 : ball->at, below = hangs ? ball->at : 0.0;
  const double r = from[0] + at * (to[0] - from[0]), z = from[1] + at * (to[1] - from[1]);
  p->part = ball->part;
  p->r = r;
  p->z = z - below;
  p->radius = ball->radius;
  p->moves = boom * length(r - body->foot[0], z - body->foot[1]) + (from == pose->knee ? at * stick : 0.0);
  p->swings = below * lesser(sweep->swing, 1.0);
  p->rises = below * lesser(0.5 * sweep->swing * sweep->swing, 1.0);
}

/* The azimuth within which something may be nearer to the ball than its margins. */
static double azimuth(const SlrGuardLimits *l, const Placed *p) {
  const double near = p->radius + l->clearance + p->moves + p->swings;
  if (!(near < p->r)) return 0.5 * TURN;
  const double sine = near / p->r;
  return sine * (1.0 + ARC * sine * sine); /* no less than its arc */
}

/* Distance of two intervals, negative where they overlap. */
static double apart(double low, double high, const double other[2]) { return greater(other[0] - high, low - other[1]); }

static double ball_room(const SlrGuardLimits *l, const Placed *p, const SlrRect *rect) {
  const double aside = p->moves + p->swings;
  const double r = apart(p->r - aside, p->r + aside, rect->r);
  const double z = apart(p->z - p->moves, p->z + p->moves + p->rises, rect->z);
  const double between = r > 0.0 && z > 0.0 ? length(r, z) : greater(r, z);
  return between - p->radius - l->clearance;
}

static void keep_least(double *least, int *part, double found, int32_t of) {
  if (!(found < *least)) return;
  *least = found;
  *part = of;
}

/* The machine at the middle of the sweep: its balls, and what they may come near to. */
typedef struct {
  Placed ball[SLR_GUARD_BALLS];
  int32_t balls;
  double widest; /* azimuth */
  double r[2], z[2];
} Body;

static void widen(double range[2], double low, double high) {
  range[0] = lesser(range[0], low);
  range[1] = greater(range[1], high);
}

static void place_body(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrSweep *sweep, Body *placed) {
  SlrGuardPose pose;
  const double boom = 0.5 * (sweep->lo[SLR_BOOM] + sweep->hi[SLR_BOOM]);
  slr_guard_pose(boom, 0.5 * (sweep->lo[SLR_STICK] + sweep->hi[SLR_STICK]), &pose);
  *placed = (Body){.balls = body->balls, .r = {ALONE, -ALONE}, .z = {ALONE, -ALONE}};
  for (int32_t b = 0; b < body->balls; b++) {
    Placed *p = &placed->ball[b];
    place_ball(body, &pose, sweep, &body->ball[b], p);
    p->azimuth = azimuth(l, p);
    placed->widest = greater(placed->widest, p->azimuth);
    const double near = p->radius + l->clearance + p->moves;
    widen(placed->r, p->r - near - p->swings, p->r + near + p->swings);
    widen(placed->z, p->z - near, p->z + near + p->rises);
  }
}

static void look_at(const SlrGuardLimits *l, const SlrRect *rect, double gap, const Body *body, double *least,
                    int *part) {
  if (apart(body->r[0], body->r[1], rect->r) > 0.0 || apart(body->z[0], body->z[1], rect->z) > 0.0) return;
  for (int32_t b = 0; b < body->balls; b++) {
    const Placed *p = &body->ball[b];
    const int tool = p->part == SLR_PART_LINES || p->part == SLR_PART_GRAB;
    if (gap <= p->azimuth && (tool || !rect->tool_only)) keep_least(least, part, ball_room(l, p, rect), p->part);
  }
}

static int sector_of(int64_t number) {
  return (int)((number % SLR_GUARD_SECTORS + SLR_GUARD_SECTORS) % SLR_GUARD_SECTORS);
}

double slr_guard_room(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrZones *zones, const SlrSweep *sweep,
                      double enough, int *part) {
  const double width = TURN / (double)SLR_GUARD_SECTORS, low = sweep->lo[SLR_SLEW];
  const double high = lesser(sweep->hi[SLR_SLEW], low + TURN);
  Body placed;
  double least = ALONE;
  *part = SLR_PART_NONE;
  place_body(l, body, sweep, &placed);
  const int64_t first = (int64_t)slw_floor((low - placed.widest) / width);
  const int64_t last = (int64_t)slw_floor((high + placed.widest) / width);
  for (int64_t n = first; n <= last && n < first + SLR_GUARD_SECTORS && least >= enough; n++) {
    const int sector = sector_of(n);
    const double from = (double)n * width;
    const double gap = greater(greater(low - (from + width), from - high), 0.0);
    if (gap <= 0.0) keep_least(&least, part, zones->carriage[sector] - l->clearance, SLR_PART_CARRIAGE);
    for (int32_t k = 0; k < zones->count[sector] && least >= enough; k++)
      look_at(l, &zones->rect[sector][k], gap, &placed, &least, part);
  }
  return least;
}

/* ---- what passes ---- */

typedef struct {
  const SlrGuardLimits *l;
  const SlrGuardBody *body;
  const SlrZones *zones;
  const SlrGuardView *v;
  const SlrGuardPast *past;
} Case;

/* Room on the way to rest after `commands`; with the swing as it is where `as_it_is`. */
static double room_after(const Case *c, const double commands[SLR_AXES], int as_it_is, double enough, int *part) {
  SlrSweep sweep;
  slr_guard_foresee(c->l, c->body, c->v, c->past, commands, &sweep);
  if (as_it_is) sweep.swing = measured_swing(c->l, c->v);
  return slr_guard_room(c->l, c->body, c->zones, &sweep, enough, part);
}

enum { SLR_GUARD_TRIES = 9 };
/* Shares of the wanted commands that are tried, of the slew and of the arm: what is kept most comes first. */
static const double tries[SLR_GUARD_TRIES][2] = {
    {1.0, 0.5}, {1.0, 0.25}, {0.5, 0.5}, {0.5, 0.25}, {1.0, 0.0}, {0.25, 0.25}, {0.5, 0.0}, {0.0, 0.5}, {0.0, 0.25}};

static void share(const double wanted[SLR_AXES], const double of[2], double most, double commands[SLR_AXES]) {
  for (int axis = 0; axis < SLR_AXES; axis++) {
    const double part = of[axis != SLR_SLEW] * wanted[axis];
    commands[axis] = lesser(greater(part, -most), most);
  }
}

/* A lesser command whose own way to rest is clear. */
static int lesser_command(const Case *c, double wanted[SLR_AXES]) {
  double commands[SLR_AXES];
  int part;
  for (int i = 0; i < SLR_GUARD_TRIES; i++) {
    share(wanted, tries[i], 1.0, commands);
    if (room_after(c, commands, 0, 0.0, &part) < 0.0) continue;
    memcpy(wanted, commands, sizeof commands);
    return 1;
  }
  return 0;
}

/* Room of standing still here: nothing is sent, nothing moves but the tool. */
static double room_here(const Case *c) {
  const double neutral[SLR_AXES] = {0.0, 0.0, 0.0};
  SlrGuardView still = *c->v;
  SlrGuardPast past;
  int part;
  memset(&past, 0, sizeof past);
  past.known = SLR_GUARD_BACK;
  still.slew_rate = 0.0;
  for (int joint = 0; joint < 2; joint++)
    past.angle[joint][SLR_GUARD_BACK - 1] = still.angle[SLR_BOOM + joint];
  const Case here = {c->l, c->body, c->zones, &still, &past};
  return room_after(&here, neutral, 1, -ALONE, &part);
}

/* A slow command that brings nothing nearer than standing here would; each axis by itself. */
static void leave(const Case *c, double wanted[SLR_AXES]) {
  double allowed[SLR_AXES] = {0.0, 0.0, 0.0};
  const double here = room_here(c);
  int part;
  for (int axis = 0; axis < SLR_AXES; axis++) {
    allowed[axis] = lesser(greater(wanted[axis], -c->l->creep), c->l->creep);
    if (room_after(c, allowed, 1, here - EQUAL, &part) < here - EQUAL) allowed[axis] = 0.0;
  }
  memcpy(wanted, allowed, sizeof allowed);
}

int slr_guard(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrZones *zones, const SlrGuardView *v,
              const SlrGuardPast *past, double wanted[SLR_AXES]) {
  const Case c = {l, body, zones, v, past};
  int part = SLR_PART_NONE;
  if (room_after(&c, wanted, 0, 0.0, &part) >= 0.0) return SLR_PART_NONE;
  if (!lesser_command(&c, wanted)) leave(&c, wanted);
  return part;
}

void slr_guard_remember(SlrGuardPast *past, const SlrGuardView *v, int usable, const double sent[SLR_AXES]) {
  for (int axis = 0; axis < SLR_AXES; axis++) {
    memmove(&past->sent[axis][1], &past->sent[axis][0], sizeof past->sent[axis] - sizeof past->sent[axis][0]);
    past->sent[axis][0] = sent[axis];
  }
  for (int joint = 0; joint < 2; joint++) {
    memmove(&past->angle[joint][1], &past->angle[joint][0], sizeof past->angle[joint] - sizeof past->angle[joint][0]);
    past->angle[joint][0] = v->angle[SLR_BOOM + joint];
  }
  past->known = !usable ? 0 : past->known < SLR_GUARD_BACK ? past->known + 1 : SLR_GUARD_BACK;
}
