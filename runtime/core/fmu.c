/* The control core inside an FMU: in the place of the shim's integrator.c.
 *
 * The FMU's inputs are sensors and targets; operator, machine and planner around the core are the ones that
 * follow: ready, enabled, asking for automatic operation from the first tick on.  What the core keeps lies in
 * the FMU's state (`extra`), so that saving and restoring it works as with every FMU of the shim.
 */
#include "core.h"
#include "fmu_map.h"
#include "slr.h"
#include "slw_math.h"

enum { ARMING_TICKS = 4, STATUS_TICKS = 5, COUNTS = 251 };

typedef struct {
  int64_t started;
  double y[SLR_LEN_OUTPUTS];
} Kept; /* the core's state follows */

#define ENTRY(name, vr, group, min, max, timeout, start) {min, max, start},
static const double signals[SLR_IN_COUNT][3] = {SLR_INPUT_SIGNALS(ENTRY)};
static const int inputs[SLR_LEN_INPUTS] = SLR_FMU_INPUTS;
static const int outputs[SLR_LEN_OUTPUTS] = SLR_FMU_OUTPUTS;
static const int always_on[] = {SLR_IN_machine_ready, SLR_IN_pilot_enabled, SLR_IN_automatic_allowed,
                                SLR_IN_target_valid};

static Kept *kept(SlwCore *c) { return (Kept *)(void *)c->s.extra; }

static SlrState *core_state(SlwCore *c) { return (SlrState *)(void *)(kept(c) + 1); }

static double count(int64_t tick, int64_t every) {
  return (double)((tick + COUNTS * every) / every % COUNTS);
}

static void surround(SlrInput *in, int64_t tick) {
  for (int i = 0; i < (int)(sizeof always_on / sizeof always_on[0]); i++) in->value[always_on[i]] = 1.0;
  in->value[SLR_IN_operator_heartbeat] = count(tick, 1);
  in->value[SLR_IN_machine_heartbeat] = count(tick, STATUS_TICKS);
  in->value[SLR_IN_planner_heartbeat] = count(tick, STATUS_TICKS);
  in->value[SLR_IN_operator_enable] = tick > 1 - ARMING_TICKS;
  in->value[SLR_IN_automatic_request] = tick >= 0;
}

/* A sensor's field ends where its range does; what is no number stays so. */
static double within(double x, const double range[3]) {
  if (x < range[0]) return range[0];
  return x > range[1] ? range[1] : x;
}

static void run_core(SlwCore *c, int64_t tick) {
  SlrInput in;
  SlrOutput out;
  memset(&in, 0, sizeof in);
  in.tick = tick;
  for (int i = 0; i < SLR_IN_COUNT; i++) in.value[i] = signals[i][2];
  for (int i = 0; i < SLW_NU; i++) in.value[inputs[i]] = within(c->s.u[i], signals[inputs[i]]);
  surround(&in, tick);
  slr_step(&in, core_state(c), tick, &out);
  for (int i = 0; i < SLW_NY; i++) kept(c)->y[i] = out.value[outputs[i]];
}

int slw_advance(SlwCore *c) {
  if (!kept(c)->started) {
    slr_reset(core_state(c));
    for (int64_t tick = -ARMING_TICKS; tick < 0; tick++) run_core(c, tick);
    kept(c)->started = 1;
  }
  run_core(c, c->s.tick);
  return 0;
}

int slw_evaluate(SlwCore *c, SlwFunction *function, const double *x, double *result) {
  const double *arg[8] = {x, c->ud, c->s.m, c->s.p};
  double *res[8] = {result};
  if (function != slw_h) return function(arg, res, c->iw, c->w, 0);
  for (int i = 0; i < SLW_NY; i++) result[i] = kept(c)->y[i];
  return 0;
}
