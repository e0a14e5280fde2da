/* What is known of each input: its status, whether it may still be bridged, and the value to use. */
#include "core_config.h"
#include "slr.h"

typedef struct {
  int32_t vr;
  SlrGroup group;
  double min, max;
  int32_t timeout; /* ticks */
  double start;
} Signal;

#define ENTRY(name, vr, group, min, max, timeout, start) {vr, group, min, max, timeout, start},
static const Signal signals[SLR_IN_COUNT] = {SLR_INPUT_SIGNALS(ENTRY)};

/* Sensors whose noise never lets them repeat their value for long. */
static const int restless[] = {SLR_IN_qd_slew,        SLR_IN_qd_boom,         SLR_IN_qd_stick,
                               SLR_IN_imu_cabin_rate_z, SLR_IN_imu_tool_rate_x, SLR_IN_imu_tool_rate_y,
                               SLR_IN_imu_tool_roll,  SLR_IN_imu_tool_pitch};

/* Angles that may stand still, but not while something else says that they move. */
static const int angles[][2] = {{SLR_IN_q_slew, SLR_IN_imu_cabin_rate_z},
                                {SLR_IN_q_boom, SLR_IN_qd_boom},
                                {SLR_IN_q_stick, SLR_IN_qd_stick}};

static const int heartbeats[] = {SLR_IN_planner_heartbeat, SLR_IN_operator_heartbeat, SLR_IN_machine_heartbeat,
                                 SLR_IN_policy_heartbeat};

#define LENGTH(array) ((int)(sizeof(array) / sizeof(array)[0]))

static double size_of(double x) { return x < 0.0 ? -x : x; }

int slr_is_forceable(int i) {
  return signals[i].group == SLR_GROUP_SENSOR || signals[i].group == SLR_GROUP_INFORMATION;
}

/* A service engineer's value in the place of a sensor's, in STANDBY only.  Anywhere else it is as good as none. */
static int may_be_forced(const SlrState *s, int i) { return s->mode == SLR_MODE_STANDBY && slr_is_forceable(i); }

static uint8_t judged(const SlrInput *in, const SlrState *s, int i) {
  const Signal *signal = &signals[i];
  const int forced = in->status[i] == SLR_STATUS_FORCED && may_be_forced(s, i);
  if (in->status[i] != SLR_STATUS_OK && !forced) return in->status[i];
  if (in->age[i] < 0) return SLR_STATUS_NEVER;
  if (in->age[i] >= signal->timeout) return SLR_STATUS_TIMEOUT;
  if (!(in->value[i] >= signal->min && in->value[i] <= signal->max)) return SLR_STATUS_RANGE;
  return SLR_STATUS_OK;
}

static void count_repeats(const SlrInput *in, SlrState *s) {
  for (int i = 0; i < SLR_IN_COUNT; i++) {
    s->same[i] = in->value[i] == s->raw[i] ? s->same[i] + 1 : 0;
    s->raw[i] = in->value[i];
  }
  for (int k = 0; k < LENGTH(angles); k++)
    if (!(size_of(in->value[angles[k][1]]) > SLR_MOVING)) s->same[angles[k][0]] = 0;
}

static void mark(SlrView *view, const SlrState *s, int i, int32_t after, uint8_t status) {
  if (after > 0 && s->same[i] >= after && view->status[i] == SLR_STATUS_OK) view->status[i] = status;
}

static void find_stuck(const SlrState *s, SlrView *view) {
  for (int k = 0; k < LENGTH(restless); k++) mark(view, s, restless[k], SLR_STUCK, SLR_STATUS_STUCK);
  for (int k = 0; k < LENGTH(angles); k++) mark(view, s, angles[k][0], SLR_STUCK, SLR_STATUS_STUCK);
  for (int k = 0; k < LENGTH(heartbeats); k++)
    mark(view, s, heartbeats[k], signals[heartbeats[k]].timeout, SLR_STATUS_TIMEOUT);
}

static int at_once(uint8_t status) {
  return status == SLR_STATUS_NEVER || status == SLR_STATUS_TIMEOUT || status == SLR_STATUS_STUCK;
}

/* A forced value is used as long as it is there; nothing is bridged with it afterwards. */
static int use_forced(const SlrInput *in, SlrState *s, SlrView *view, int i) {
  if (in->status[i] != SLR_STATUS_FORCED || view->status[i] != SLR_STATUS_OK) return 0;
  view->board[i] = in->value[i];
  view->lost[i] = 0;
  s->bad[i] = SLR_DEBOUNCE;
  return 1;
}

static void use(const SlrInput *in, SlrState *s, SlrView *view, int i) {
  if (use_forced(in, s, view, i)) return;
  if (view->status[i] == SLR_STATUS_OK) {
    s->last[i] = in->value[i] - slr_zero[i];
    s->bad[i] = 0;
  } else {
    s->bad[i] += s->bad[i] < INT32_MAX;
  }
  view->board[i] = s->last[i];
  view->lost[i] = s->bad[i] > 0 && (at_once(view->status[i]) || s->bad[i] > SLR_DEBOUNCE);
}

void slr_check(const SlrInput *in, SlrState *s, SlrView *view) {
  for (int i = 0; i < SLR_IN_COUNT; i++) view->status[i] = judged(in, s, i);
  count_repeats(in, s);
  find_stuck(s, view);
  for (int i = 0; i < SLR_IN_COUNT; i++) use(in, s, view, i);
  for (int i = 0; i < SLR_OUT_COUNT; i++) view->board[SLR_OWN(i)] = s->own[i];
  view->deflected = 0;
  for (int i = SLR_IN_joystick_slew; i <= SLR_IN_joystick_stick; i++)
    view->deflected |= size_of(view->board[i]) > SLR_DEFLECTED;
}

/* Sensors, and a policy outside, are there for some bundles and not for others. */
static int by_bundle(SlrGroup group) { return group == SLR_GROUP_SENSOR || group == SLR_GROUP_POLICY; }

int slr_first_lost(const SlrView *view, SlrGroup group) {
  for (int i = 0; i < SLR_IN_COUNT; i++)
    if (signals[i].group == group && view->lost[i] && (!by_bundle(group) || slr_needed[i])) return i;
  return -1;
}

int slr_first_doubled(const SlrView *view) {
  for (int i = 0; i < SLR_IN_COUNT; i++)
    if (view->status[i] == SLR_STATUS_TWO_SENDERS && signals[i].group != SLR_GROUP_INFORMATION &&
        (signals[i].group != SLR_GROUP_POLICY || slr_needed[i]))
      return i;
  return -1;
}

int32_t slr_value_reference(int input) { return input < 0 ? 0 : signals[input].vr; }

void slr_start_values(SlrState *s) {
  for (int i = 0; i < SLR_IN_COUNT; i++) s->last[i] = s->raw[i] = signals[i].start;
}
