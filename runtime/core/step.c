/* One tick: read (check.c), update (mode.c, the blocks), write (guard.c, gate.c, the output image). */
#include <string.h>

#include "core_config.h"
#include "slr.h"

static const int commands[SLR_AXES] = {SLR_OUT_u_slew, SLR_OUT_u_boom, SLR_OUT_u_stick};
static const int joysticks[SLR_AXES] = {SLR_IN_joystick_slew, SLR_IN_joystick_boom, SLR_IN_joystick_stick};

unsigned char *slr_state_of(SlrState *s, const SlrBlock *block) {
  unsigned char *after = (unsigned char *)(s + 1);
  if (block == slr_arm) return after;
  after += slr_arm->size;
  return block == slr_estimator ? after : after + slr_estimator->size;
}

void slr_look_around(SlrView *view) {
  const double *b = view->board;
  const double joints[] = {b[SLR_IN_q_slew], b[SLR_IN_q_boom], b[SLR_IN_q_stick], b[SLR_IN_qd_boom],
                           b[SLR_IN_qd_stick]};
  const double target[] = {b[SLR_IN_target_x], b[SLR_IN_target_y], b[SLR_IN_target_z]};
  double walls[SLR_WALLS][4];
  slr_geometry(joints, target, walls[0], &view->distance, &view->reach);
  for (int i = 0; i < SLR_WALLS; i++)
    view->walls[i] = (SlrWall){walls[i][0], walls[i][1], {0.0, walls[i][2], walls[i][3]}};
}

/* ---- the controllers ---- */

static int finite(const SlrView *view) {
  double sum = 0.0;
  for (int i = 0; i < SLR_OUT_COUNT; i++) sum += view->board[SLR_OWN(i)] - view->board[SLR_OWN(i)];
  return sum == 0.0;
}

#define ENTRY(name, vr, group, min, max, timeout, start) {min, max},
static const double ranges[SLR_OUT_COUNT][2] = {SLR_OUTPUT_SIGNALS(ENTRY)};

static int is_command(int output) {
  return output == SLR_OUT_u_slew || output == SLR_OUT_u_boom || output == SLR_OUT_u_stick;
}

/* Whatever a controller says, no signal leaves its range; commands are the gate's. */
static void keep_ranges(SlrView *view) {
  for (int i = 0; i < SLR_OUT_COUNT; i++) {
    if (is_command(i)) continue;
    double *value = &view->board[SLR_OWN(i)];
    if (*value < ranges[i][0]) *value = ranges[i][0];
    if (*value > ranges[i][1]) *value = ranges[i][1];
  }
}

static void start_controllers(SlrState *s, SlrView *view) {
  for (int i = 0; i < SLR_OUT_COUNT; i++) view->board[SLR_OWN(i)] = 0.0;
  slr_controller->initialise(slr_state_of(s, slr_controller), view->board);
  slr_arm->initialise(slr_state_of(s, slr_arm), view->board);
  s->running = 0;
}

/* Each block acts on what the others gave in the last tick, as the components of a simulated system do. */
static int run_controllers(SlrState *s, SlrView *view) {
  int failed = 0;
  if (s->running < 0) start_controllers(s, view);
  if (s->running % slr_arm->period == 0) failed |= slr_arm->step(slr_state_of(s, slr_arm), view->board);
  if (s->running % slr_controller->period == 0)
    failed |= slr_controller->step(slr_state_of(s, slr_controller), view->board);
  s->running += 1;
  if (failed || !finite(view)) return -1;
  keep_ranges(view);
  return 0;
}

static void stop_controllers(SlrState *s, SlrView *view) {
  s->running = -1;
  for (int i = 0; i < SLR_OUT_COUNT; i++) view->board[SLR_OWN(i)] = 0.0;
}

/* What is wanted of the axes: by the controller, by hand, or nothing. */
static void find_wanted(SlrState *s, SlrView *view, double wanted[SLR_AXES]) {
  if (s->mode == SLR_MODE_AUTOMATIC && run_controllers(s, view)) slr_fail(s, SLR_FAULT_CONTROLLER_FAILED, 0);
  if (s->mode != SLR_MODE_AUTOMATIC) stop_controllers(s, view);
  for (int axis = 0; axis < SLR_AXES; axis++) {
    const double by_hand = s->mode == SLR_MODE_MANUAL ? view->board[joysticks[axis]] : 0.0;
    wanted[axis] = s->mode == SLR_MODE_AUTOMATIC ? view->board[SLR_OWN(commands[axis])] : by_hand;
  }
}

/* ---- the estimator: in every mode, while its sensors are there ---- */

static int sees(const SlrView *view, const SlrBlock *block) {
  for (int i = 0; i < block->n_inputs; i++)
    if (view->lost[block->inputs[i]]) return 0;
  return 1;
}

static void estimate(SlrState *s, SlrView *view) {
  void *state = slr_state_of(s, slr_estimator);
  if (!s->estimating) slr_estimator->initialise(state, view->board);
  s->estimating = sees(view, slr_estimator) && slr_estimator->step(state, view->board) == 0;
  double *load = &view->board[SLR_OWN(SLR_OUT_load_estimate)];
  if (!s->estimating) *load = -1.0;
  if (*load >= 0.0) s->load = -1.0; /* it knows its own */
  if (s->estimating && *load < 0.0) *load = s->load;
}

/* ---- the guard ---- */

SlrGuardView slr_guard_sees(const SlrView *view) {
  const double *b = view->board;
  return (SlrGuardView){.angle = {b[SLR_IN_q_slew], b[SLR_IN_q_boom], b[SLR_IN_q_stick]},
                        .slew_rate = b[SLR_IN_imu_cabin_rate_z],
                        .swing = {b[SLR_IN_imu_tool_pitch], b[SLR_IN_imu_tool_roll]},
                        .swing_rate = {b[SLR_IN_imu_tool_rate_y], b[SLR_IN_imu_tool_rate_x]}};
}

int slr_guarded(const SlrState *s, const SlrView *view, double wanted[SLR_AXES]) {
  if (!slr_zones || s->mode != SLR_MODE_AUTOMATIC) return SLR_PART_NONE;
  const SlrGuardView seen = slr_guard_sees(view);
  return slr_guard(&slr_guard_limits, &slr_guard_body, slr_zones, &seen, &s->past, wanted);
}

static void remember_sent(SlrState *s, const SlrView *view) {
  if (!slr_zones) return;
  const SlrGuardView seen = slr_guard_sees(view);
  const int usable = !(view->lost[SLR_IN_q_boom] || view->lost[SLR_IN_q_stick]);
  slr_guard_remember(&s->past, &seen, usable, s->held);
}

/* ---- the gate ---- */

/* The gate's limits, and commands, as far as the authority goes (slr_limit). */
SlrGateLimits slr_within_authority(const double authority[SLR_AUTHORITY], double allowed[SLR_AXES]) {
  SlrGateLimits limits = slr_limits;
  for (int axis = 0; axis < SLR_AXES; axis++) {
    const double most = authority[axis];
    allowed[axis] = allowed[axis] > most ? most : allowed[axis] < -most ? -most : allowed[axis];
    limits.speed[axis] *= authority[SLR_AUTHORITY_SPEED];
  }
  limits.rise *= authority[SLR_AUTHORITY_RISE];
  return limits;
}

SlrGateView slr_gate_sees(const SlrState *s, const SlrView *view) {
  SlrGateView seen = {.move = s->mode == SLR_MODE_AUTOMATIC || s->mode == SLR_MODE_MANUAL,
                      .by_hand = s->mode == SLR_MODE_MANUAL,
                      .speed = {view->board[SLR_IN_imu_cabin_rate_z], view->board[SLR_IN_qd_boom],
                                view->board[SLR_IN_qd_stick]}};
  const int arm = !(view->lost[SLR_IN_q_boom] || view->lost[SLR_IN_q_stick] || view->lost[SLR_IN_qd_boom] ||
                    view->lost[SLR_IN_qd_stick]);
  seen.known[SLR_SLEW] = !view->lost[SLR_IN_imu_cabin_rate_z];
  seen.known[SLR_BOOM] = seen.known[SLR_STICK] = arm;
  memcpy(seen.walls, view->walls, sizeof seen.walls);
  return seen;
}

static void pass_gate(SlrState *s, const SlrView *view, const double wanted[SLR_AXES]) {
  const SlrGateView seen = slr_gate_sees(s, view);
  double allowed[SLR_AXES] = {wanted[SLR_SLEW], wanted[SLR_BOOM], wanted[SLR_STICK]};
  const SlrGateLimits limits = slr_within_authority(s->authority, allowed);
  s->limited = slr_gate(&limits, &seen, allowed, s->held);
  for (int axis = 0; axis < SLR_AXES; axis++) s->limited |= !(allowed[axis] == wanted[axis]);
  if (s->fault == SLR_FAULT_EMERGENCY_STOP) memset(s->held, 0, sizeof s->held);
}

/* ---- the output image ---- */

static int enables(int32_t mode) {
  return mode != SLR_MODE_OFF && mode != SLR_MODE_STANDBY && mode != SLR_MODE_FAULT;
}

static void write_commands(SlrState *s, const SlrView *view, SlrOutput *out) {
  memcpy(s->own, view->board + SLR_IN_COUNT, sizeof s->own);
  memcpy(out->value, s->own, sizeof out->value);
  for (int axis = 0; axis < SLR_AXES; axis++) out->value[commands[axis]] = s->held[axis];
  out->value[SLR_OUT_control_enable] = enables(s->mode);
}

/* 0 to 250 and round, for negative numbers too. */
static double round_count(int64_t n) { return (double)((n % 251 + 251) % 251); }

static void write_status(const SlrInput *in, const SlrState *s, const SlrView *view, SlrOutput *out) {
  const uint32_t limited = s->limited && s->mode == SLR_MODE_AUTOMATIC ? SLR_FLAG_GATE_LIMITED : 0u;
  const uint32_t own = limited | (s->guarding ? SLR_FLAG_GUARDED : 0u);
  out->value[SLR_OUT_control_mode] = s->mode;
  out->value[SLR_OUT_fault_code] = s->fault;
  out->value[SLR_OUT_fault_signal] = s->fault_signal;
  out->value[SLR_OUT_target_in_reach] = view->reach >= 0.0;
  out->value[SLR_OUT_target_reached] = view->distance <= SLR_TARGET_TOLERANCE && s->mode == SLR_MODE_AUTOMATIC;
  out->value[SLR_OUT_cycle_overruns] = round_count(in->overruns);
  out->value[SLR_OUT_command_heartbeat] = round_count(s->tick);
  out->value[SLR_OUT_controller_heartbeat] = round_count(s->tick / SLR_STATUS_TICKS);
  out->value[SLR_OUT_guard_part] = s->guarding;
  out->value[SLR_OUT_runtime_flags] = (double)(in->flags | own);
  if (s->own[SLR_OUT_load_estimate] < 0.0) {
    out->value[SLR_OUT_load_estimate] = 0.0;
    out->status[SLR_OUT_load_estimate] = SLR_STATUS_NOT_AVAILABLE;
  }
  out->flags = in->flags | own;
}

/* ---- what the runtime calls ---- */

const char *slr_layout(void) { return SLR_LAYOUT; }
const char *slr_identity(void) { return slr_identity_text; }
size_t slr_input_size(void) { return sizeof(SlrInput); }
size_t slr_output_size(void) { return sizeof(SlrOutput); }
size_t slr_state_size(void) {
  return sizeof(SlrState) + slr_arm->size + slr_estimator->size + slr_controller->size;
}

void slr_reset(SlrState *s) {
  memset(s, 0, slr_state_size());
  slr_start_values(s);
  s->tick = -1;
  s->running = -1;
  s->load = -1.0;
  for (int i = 0; i < SLR_AUTHORITY; i++) s->authority[i] = 1.0;
}

void slr_limit(SlrState *s, const double *authority) { memcpy(s->authority, authority, sizeof s->authority); }

void slr_restart(SlrState *s, int32_t fault, int32_t fault_signal, double load) {
  slr_reset(s);
  s->load = load;
  if (fault == SLR_FAULT_NONE || fault == SLR_FAULT_TARGET_OUT_OF_REACH) return;
  slr_fail(s, (SlrFault)fault, fault_signal);
  s->enable = 1; /* a switch that is on already acknowledges nothing: it counts as pressed until it is heard of */
  s->last[SLR_IN_operator_enable] = 1.0;
}

int slr_observe(const SlrInput *in, const SlrState *state, double *board) {
  SlrState s = *state;
  SlrView view;
  slr_check(in, &s, &view);
  slr_look_around(&view);
  slr_next_mode(in, &s, &view);
  if (s.mode != SLR_MODE_AUTOMATIC || (s.running > 0 && s.running % slr_controller->period != 0)) return 0;
  memcpy(board, view.board, sizeof view.board);
  return s.running < 0 ? SLR_STARTS : SLR_DUE;
}

void slr_step(const SlrInput *in, SlrState *s, int64_t tick, SlrOutput *out) {
  SlrView view;
  double wanted[SLR_AXES];
  memset(out, 0, sizeof *out);
  s->tick = out->tick = tick;
  slr_check(in, s, &view);
  slr_look_around(&view);
  slr_next_mode(in, s, &view);
  find_wanted(s, &view, wanted);
  s->guarding = slr_guarded(s, &view, wanted);
  pass_gate(s, &view, wanted);
  remember_sent(s, &view);
  estimate(s, &view);
  write_commands(s, &view, out);
  write_status(in, s, &view, out);
}
