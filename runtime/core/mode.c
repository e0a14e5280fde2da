/* The state machine.
 *
 *   OFF        nothing heard yet from operator or machine
 *   STANDBY    no commands; the enabling switch, pressed anew, arms a machine that is ready
 *   ARMED      enabled, commands neutral: the joystick starts manual, the automatic switch automatic operation
 *   MANUAL     the joystick's commands, through the gate
 *   AUTOMATIC  the controller's commands, through the gate
 *   HOLD       automatic without a target to go to: neutral
 *   STOPPING   on the way to neutral
 *   FAULT      neutral; left for STANDBY by the enabling switch, pressed anew when the cause has gone
 *
 * The joystick takes over from automatic operation at any time; only the switch, turned on anew with the
 * joystick at rest, gives it back.
 */
#include "core_config.h"
#include "slr.h"

static int on(const SlrView *view, int input) { return view->board[input] > 0.5; }

static int enabled(const SlrView *view) { return on(view, SLR_IN_operator_enable); }

static int enable_edge(const SlrState *s, const SlrView *view) { return enabled(view) && !s->enable; }

static int requested(const SlrView *view) {
  return on(view, SLR_IN_automatic_request) && on(view, SLR_IN_automatic_allowed);
}

static int request_edge(const SlrState *s, const SlrView *view) {
  return requested(view) && !s->request && !view->deflected;
}

static int target_there(const SlrView *view) { return on(view, SLR_IN_target_valid) && view->reach >= 0.0; }

static SlrMode automatic_or_hold(const SlrView *view) {
  return target_there(view) ? SLR_MODE_AUTOMATIC : SLR_MODE_HOLD;
}

static SlrFault of_status(uint8_t status) {
  switch (status) {
  case SLR_STATUS_NEVER:
  case SLR_STATUS_TIMEOUT: return SLR_FAULT_SENSOR_TIMEOUT;
  case SLR_STATUS_RANGE: return SLR_FAULT_SENSOR_RANGE;
  case SLR_STATUS_CHECKSUM: return SLR_FAULT_SENSOR_CHECKSUM;
  case SLR_STATUS_STUCK: return SLR_FAULT_SENSOR_STUCK;
  default: return SLR_FAULT_SENSOR_ERROR;
  }
}

typedef struct {
  SlrFault fault;
  int input; /* that it is about, or -1 */
} Cause;

static const Cause none = {SLR_FAULT_NONE, -1};

/* What stops the machine whoever drives it. */
static Cause general(const SlrInput *in, const SlrState *s, const SlrView *view) {
  int input;
  if (on(view, SLR_IN_emergency_stop)) return (Cause){SLR_FAULT_EMERGENCY_STOP, SLR_IN_emergency_stop};
  if (in->flags & SLR_FLAG_BUS_OFF) return (Cause){SLR_FAULT_BUS_OFF, -1};
  if (in->flags & SLR_FLAG_OTHER_CONTROLLER) return (Cause){SLR_FAULT_OTHER_CONTROLLER, -1};
  if ((input = slr_first_doubled(view)) >= 0) return (Cause){SLR_FAULT_TWO_SENDERS, input};
  if ((input = slr_first_lost(view, SLR_GROUP_OPERATOR)) >= 0) return (Cause){SLR_FAULT_OPERATOR_TIMEOUT, input};
  if ((input = slr_first_lost(view, SLR_GROUP_MACHINE)) >= 0) return (Cause){SLR_FAULT_MACHINE_TIMEOUT, input};
  if (view->board[SLR_IN_machine_fault] > 0.5) return (Cause){SLR_FAULT_MACHINE_FAULT, SLR_IN_machine_fault};
  if (!on(view, SLR_IN_machine_ready)) return (Cause){SLR_FAULT_MACHINE_NOT_READY, SLR_IN_machine_ready};
  if (s->late >= SLR_OVERRUNS) return (Cause){SLR_FAULT_TASK_OVERRUN, -1};
  return none;
}

/* What stops automatic operation beside that. */
static Cause automatic(const SlrView *view) {
  int input;
  if ((input = slr_first_lost(view, SLR_GROUP_SENSOR)) >= 0) return (Cause){of_status(view->status[input]), input};
  if ((input = slr_first_lost(view, SLR_GROUP_PLANNER)) >= 0) return (Cause){SLR_FAULT_TARGET_TIMEOUT, input};
  if ((input = slr_first_lost(view, SLR_GROUP_POLICY)) >= 0) return (Cause){SLR_FAULT_POLICY_TIMEOUT, input};
  return none;
}

static int is_automatic(int32_t mode) { return mode == SLR_MODE_AUTOMATIC || mode == SLR_MODE_HOLD; }

static int at_neutral(const SlrState *s) {
  return s->held[SLR_SLEW] == 0.0 && s->held[SLR_BOOM] == 0.0 && s->held[SLR_STICK] == 0.0;
}

static SlrMode from_standby(const SlrState *s, const SlrView *view, Cause stop) {
  return enable_edge(s, view) && stop.fault == SLR_FAULT_NONE ? SLR_MODE_ARMED : SLR_MODE_STANDBY;
}

static SlrMode from_armed(const SlrState *s, const SlrView *view) {
  if (!enabled(view)) return SLR_MODE_STANDBY;
  if (view->deflected) return SLR_MODE_MANUAL;
  return request_edge(s, view) && automatic(view).fault == SLR_FAULT_NONE ? automatic_or_hold(view) : SLR_MODE_ARMED;
}

static SlrMode from_manual(const SlrState *s, const SlrView *view) {
  if (!enabled(view)) return SLR_MODE_STOPPING;
  return request_edge(s, view) && automatic(view).fault == SLR_FAULT_NONE ? automatic_or_hold(view) : SLR_MODE_MANUAL;
}

static SlrMode from_automatic(const SlrView *view) {
  if (!enabled(view)) return SLR_MODE_STOPPING;
  if (view->deflected) return SLR_MODE_MANUAL;
  return requested(view) ? automatic_or_hold(view) : SLR_MODE_STOPPING;
}

static SlrMode from_stopping(const SlrState *s, const SlrView *view) {
  if (!at_neutral(s)) return SLR_MODE_STOPPING;
  return enabled(view) ? SLR_MODE_ARMED : SLR_MODE_STANDBY;
}

static SlrMode from_fault(const SlrState *s, const SlrView *view, Cause stop) {
  const int acknowledged = enable_edge(s, view) && !view->deflected && at_neutral(s);
  return acknowledged && stop.fault == SLR_FAULT_NONE ? SLR_MODE_STANDBY : SLR_MODE_FAULT;
}

static SlrMode next(const SlrState *s, const SlrView *view, Cause stop) {
  switch (s->mode) {
  case SLR_MODE_STANDBY: return from_standby(s, view, stop);
  case SLR_MODE_ARMED: return from_armed(s, view);
  case SLR_MODE_MANUAL: return from_manual(s, view);
  case SLR_MODE_AUTOMATIC:
  case SLR_MODE_HOLD: return from_automatic(view);
  case SLR_MODE_STOPPING: return from_stopping(s, view);
  case SLR_MODE_FAULT: return from_fault(s, view, stop);
  default: /* OFF */
    return slr_first_lost(view, SLR_GROUP_OPERATOR) < 0 && slr_first_lost(view, SLR_GROUP_MACHINE) < 0
               ? SLR_MODE_STANDBY
               : SLR_MODE_OFF;
  }
}

void slr_fail(SlrState *s, SlrFault fault, int32_t signal) {
  s->mode = SLR_MODE_FAULT;
  s->fault = (int32_t)fault;
  s->fault_signal = signal;
}

static int moves_or_may(int32_t mode) {
  return mode != SLR_MODE_OFF && mode != SLR_MODE_STANDBY && mode != SLR_MODE_FAULT;
}

static void count_late(const SlrInput *in, SlrState *s) {
  s->late = in->overruns != s->overruns ? s->late + 1 : 0;
  s->overruns = in->overruns;
}

/* Refused frames stop the machine before they are many enough to say why: then the fault gets its true name. */
static int by_refused_frames(int32_t fault) {
  switch (fault) {
  case SLR_FAULT_OPERATOR_TIMEOUT:
  case SLR_FAULT_MACHINE_TIMEOUT:
  case SLR_FAULT_TARGET_TIMEOUT:
  case SLR_FAULT_SENSOR_TIMEOUT:
  case SLR_FAULT_SENSOR_CHECKSUM: return 1;
  default: return 0;
  }
}

static void note_hold(SlrState *s, const SlrView *view) {
  const int far = s->mode == SLR_MODE_HOLD && on(view, SLR_IN_target_valid);
  if (s->mode == SLR_MODE_FAULT) return; /* latched */
  s->fault = far ? SLR_FAULT_TARGET_OUT_OF_REACH : SLR_FAULT_NONE;
  s->fault_signal = 0;
}

void slr_ladder(const SlrInput *in, const SlrState *now, int64_t *told) {
  SlrState s = *now;
  SlrView view;
  slr_check(in, &s, &view);
  slr_look_around(&view);
  const Cause stops = general(in, &s, &view), bars = automatic(&view);
  const int64_t found[SLR_LADDER] = {
      1, stops.fault, slr_value_reference(stops.input), bars.fault, slr_value_reference(bars.input),
      enabled(&view), on(&view, SLR_IN_automatic_request), on(&view, SLR_IN_automatic_allowed), view.deflected,
      target_there(&view), at_neutral(&s)};
  for (int i = 0; i < SLR_LADDER; i++) told[i] = found[i];
}

void slr_next_mode(const SlrInput *in, SlrState *s, const SlrView *view) {
  Cause stop;
  count_late(in, s);
  stop = general(in, s, view);
  if (is_automatic(s->mode) && stop.fault == SLR_FAULT_NONE) stop = automatic(view);
  const int renamed = s->mode == SLR_MODE_FAULT && stop.fault == SLR_FAULT_TWO_SENDERS && by_refused_frames(s->fault);
  if ((renamed || moves_or_may(s->mode)) && stop.fault != SLR_FAULT_NONE)
    slr_fail(s, stop.fault, slr_value_reference(stop.input));
  else
    s->mode = (int32_t)next(s, view, stop);
  note_hold(s, view);
  s->enable = enabled(view);
  s->request = requested(view);
}
