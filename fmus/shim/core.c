/* See core.h. */
#include "core.h"

#include <stdio.h>

#include "slw_math.h"

static int64_t to_count(double duration, double step) {
  return duration > 0.0 ? (int64_t)(duration / step + 0.5) : 0;
}

static double parameter_or_zero(const SlwState *s, int index) { return index < 0 ? 0.0 : s->p[index]; }

/* ---- the equations ---- */

#if SLW_CONTINUOUS
void slw_prepare(SlwCore *c) {
  const double *arg[8] = {c->s.p};
  double *res[8] = {c->q};
  slw_constants(arg, res, c->iw, c->w, 0);
}

int slw_rates(SlwCore *c, const double *x, double *result) {
  const double *arg[8] = {x, c->ud, c->s.m, c->q};
  double *res[8] = {result};
  return slw_f(arg, res, c->iw, c->w, 0);
}
#else
void slw_prepare(SlwCore *c) { (void)c; }
int slw_rates(SlwCore *c, const double *x, double *result) { return slw_evaluate(c, slw_f, x, result); }
#endif

/* ---- delay lines of the inputs: position tick % SLW_LINE holds the input during that tick ---- */

static void fill_lines(SlwCore *c) {
  for (int d = 0; d < SLW_NDELAYS; d++)
    for (int i = 0; i < SLW_LINE; i++) c->s.line[d][i] = c->s.u[slw_delay_input[d]];
}

static void read_lines(SlwCore *c) {
  memcpy(c->ud, c->s.u, sizeof c->ud);
  for (int d = 0; d < SLW_NDELAYS; d++) {
    int64_t ticks = to_count(c->s.p[slw_delay_parameter[d]], SLW_STEP);
    if (ticks == 0) continue; /* the present input, whether or not it is in the line yet */
    if (ticks > SLW_LINE - 1) ticks = SLW_LINE - 1;
    c->ud[slw_delay_input[d]] = c->s.line[d][(c->s.tick + SLW_LINE - ticks) % SLW_LINE];
  }
}

static void write_lines(SlwCore *c) {
  for (int d = 0; d < SLW_NDELAYS; d++) c->s.line[d][c->s.tick % SLW_LINE] = c->s.u[slw_delay_input[d]];
}

/* ---- modes: a guard must hold without a break for its delay ---- */

static void switch_modes(SlwCore *c) {
#if SLW_NM > 0
  double on[SLW_NM], off[SLW_NM];
  const double *arg[8] = {c->s.x, c->ud, c->s.m, c->s.p};
  double *res[8] = {on, off};
  slw_guards(arg, res, c->iw, c->w, 0);
  for (int i = 0; i < SLW_NM; i++) {
    const int is_on = c->s.m[i] > 0.5;
    const double guard = is_on ? off[i] : on[i];
    const int parameter = is_on ? slw_modes[i].off_delay : slw_modes[i].on_delay;
    c->s.held[i] = guard > 0.0 ? c->s.held[i] + 1 : 0;
    if (c->s.held[i] > to_count(parameter_or_zero(&c->s, parameter), SLW_STEP)) {
      c->s.m[i] = is_on ? 0.0 : 1.0;
      c->s.held[i] = 0;
    }
  }
#else
  (void)c;
#endif
}

/* ---- sensors ---- */

/* Uniform 64 bits from (seed, channel, sample): a counter-based generator keeps no state (SplitMix64). */
static uint64_t random_bits(int64_t seed, int channel, int64_t sample, int word) {
  uint64_t z = (uint64_t)seed * 0x9e3779b97f4a7c15ULL + (uint64_t)sample;
  z = z * 64 + (uint64_t)word;
  z ^= ((uint64_t)(unsigned)channel + 1u) * 0xd1342543de82ef95ULL;
  for (int round = 0; round < 2; round++) {
    z += 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    z ^= z >> 31;
  }
  return z;
}

/* Sum of twelve 16-bit uniforms: mean 0, variance 1, bounded by 6, and no transcendental function. */
static double normal(int64_t seed, int channel, int64_t sample) {
  uint64_t sum = 0;
  for (int word = 0; word < 3; word++) {
    const uint64_t bits = random_bits(seed, channel, sample, word);
    for (int part = 0; part < 4; part++) sum += (bits >> (16 * part)) & 0xffff;
  }
  return ((double)sum - 6.0 * 65535.0) / 65536.0;
}

static void sample_sensors(SlwCore *c) {
  SlwState *s = &c->s;
  for (int i = 0; i < SLW_NSENSORS; i++) {
    const SlwSensor *sensor = &slw_sensors[i];
    int64_t back = to_count(parameter_or_zero(s, sensor->delay), SLW_SAMPLE_TIME);
    const double noise = parameter_or_zero(s, sensor->noise), quantum = parameter_or_zero(s, sensor->quantum);
    double value;
    if (back > SLW_ECHO - 1) back = SLW_ECHO - 1;
    s->echo[i][s->sample % SLW_ECHO] = c->h[sensor->output];
    value = s->echo[i][(s->sample + SLW_ECHO - back) % SLW_ECHO] + parameter_or_zero(s, sensor->bias);
    if (s->seed != 0 && noise > 0.0) value += noise * normal(s->seed, sensor->output, s->sample);
    if (quantum > 0.0) value = quantum * slw_floor(value / quantum + 0.5);
    s->y[sensor->output] = value;
  }
  s->sample += 1;
}

static int is_sensor(int output) {
  for (int i = 0; i < SLW_NSENSORS; i++)
    if (slw_sensors[i].output == output) return 1;
  return 0;
}

static void evaluate_outputs(SlwCore *c) {
  read_lines(c);
  slw_evaluate(c, slw_h, c->s.x, c->h);
}

static void publish_outputs(SlwCore *c) {
  for (int i = 0; i < SLW_NY; i++)
    if (!is_sensor(i)) c->s.y[i] = c->h[i];
}

/* ---- the interface ---- */

void slw_reset(SlwCore *c) {
  memset(c, 0, sizeof *c);
  memcpy(c->s.u, slw_start_u, sizeof c->s.u);
  memcpy(c->s.p, slw_start_p, sizeof c->s.p);
  c->s.seed = SLW_SEED_START;
  c->phase = SLW_INSTANTIATED;
  c->stale = 1;
}

void slw_initialise(SlwCore *c) {
  const double *arg[8] = {c->s.p};
  double *res[8] = {c->s.x};
  c->s.tick = 0;
  c->s.sample = 0;
  c->s.serves = 0;
  slw_x0(arg, res, c->iw, c->w, 0);
  for (int i = 0; i < SLW_NM; i++) {
    c->s.m[i] = slw_modes[i].start;
    c->s.held[i] = 0;
  }
  fill_lines(c);
  evaluate_outputs(c);
  for (int i = 0; i < SLW_NSENSORS; i++)
    for (int k = 0; k < SLW_ECHO; k++) c->s.echo[i][k] = c->h[slw_sensors[i].output];
  sample_sensors(c);
  publish_outputs(c);
  c->stale = 0;
}

static int check_finite(SlwCore *c) {
  for (int i = 0; i < SLW_NX; i++)
    if (!slw_is_finite(c->s.x[i])) {
      snprintf(c->message, sizeof c->message, "state %s is not a finite number at t = %.6f s", slw_state_names[i],
               c->s.start_time + (double)c->s.tick * SLW_STEP);
      return -1;
    }
  return 0;
}

int slw_step(SlwCore *c, double h) {
  const int64_t steps = to_count(h, SLW_STEP);
  if (steps < 1 || slw_fabs(h - (double)steps * SLW_STEP) > 1e-6 * SLW_STEP * (double)steps) {
    snprintf(c->message, sizeof c->message, "step size %.9g s is not a multiple of the internal step %.9g s", h,
             SLW_STEP);
    return -1;
  }
  slw_prepare(c);
  for (int64_t i = 0; i < steps; i++) {
    write_lines(c);
    read_lines(c);
    switch_modes(c);
    if (slw_advance(c)) {
      snprintf(c->message, sizeof c->message, "the equations could not be solved at t = %.6f s",
               c->s.start_time + (double)c->s.tick * SLW_STEP);
      return -1;
    }
    c->s.tick += 1;
    if (SLW_NSENSORS > 0 && c->s.tick % SLW_TICKS_PER_SAMPLE == 0) {
      slw_evaluate(c, slw_h, c->s.x, c->h);
      sample_sensors(c);
    }
  }
  if (SLW_NSENSORS == 0 || c->s.tick % SLW_TICKS_PER_SAMPLE != 0) slw_evaluate(c, slw_h, c->s.x, c->h);
  publish_outputs(c);
  return check_finite(c);
}

static const SlwVariable *find(SlwCore *c, uint32_t vr) {
  int low = 0, high = SLW_NV - 1;
  while (low <= high) {
    const int middle = (low + high) / 2;
    if (slw_variables[middle].vr == vr) return &slw_variables[middle];
    if (slw_variables[middle].vr < vr) low = middle + 1;
    else high = middle - 1;
  }
  snprintf(c->message, sizeof c->message, "unknown value reference %lu", (unsigned long)vr);
  return NULL;
}

int slw_get(SlwCore *c, uint32_t vr, double *value) {
  const SlwVariable *v = find(c, vr);
  if (!v) return -1;
  if (c->stale && c->phase < SLW_STEPPING) slw_initialise(c);
  switch (v->group) {
  case SLW_STATE: *value = c->s.x[v->index]; return 0;
  case SLW_INPUT: *value = c->s.u[v->index]; return 0;
  case SLW_OUTPUT: *value = c->s.y[v->index]; return 0;
  case SLW_PARAMETER: *value = c->s.p[v->index]; return 0;
  case SLW_TIME: *value = c->s.start_time + (double)c->s.tick * SLW_STEP; return 0;
  case SLW_DERIVATIVE:
    read_lines(c);
    slw_prepare(c);
    slw_rates(c, c->s.x, c->f);
    *value = c->f[v->index];
    return 0;
  case SLW_SEED: break;
  }
  snprintf(c->message, sizeof c->message, "value reference %lu is not a Float64 variable", (unsigned long)vr);
  return -1;
}

int slw_set(SlwCore *c, uint32_t vr, double value) {
  const SlwVariable *v = find(c, vr);
  if (!v) return -1;
  if (v->group == SLW_INPUT) {
    c->s.u[v->index] = value;
  } else if (v->group == SLW_PARAMETER) {
    if (!(value >= v->min && value <= v->max)) {
      snprintf(c->message, sizeof c->message, "value reference %lu: %.9g is outside %.9g ... %.9g", (unsigned long)vr,
               value, v->min, v->max);
      return -1;
    }
    if (c->s.p[v->index] != value) c->s.serves = 0;
    c->s.p[v->index] = value;
  } else {
    snprintf(c->message, sizeof c->message, "value reference %lu cannot be set", (unsigned long)vr);
    return -1;
  }
  c->stale = 1;
  return 0;
}

int slw_get_seed(SlwCore *c, uint32_t vr, int64_t *value) {
  const SlwVariable *v = find(c, vr);
  if (!v || v->group != SLW_SEED) return -1;
  *value = c->s.seed;
  return 0;
}

int slw_set_seed(SlwCore *c, uint32_t vr, int64_t value) {
  const SlwVariable *v = find(c, vr);
  if (!v || v->group != SLW_SEED) return -1;
  c->s.seed = value;
  c->stale = 1;
  return 0;
}

static int is_delayed(int input) {
  for (int d = 0; d < SLW_NDELAYS; d++)
    if (slw_delay_input[d] == input) return 1;
  return 0;
}

/* A delayed input has no effect at this instant, nor has anything on a held output. */
static int seed_known(SlwCore *c, uint32_t vr, double seed) {
  const SlwVariable *v = find(c, vr);
  if (!v) return -1;
  if (v->group == SLW_INPUT) {
    if (!is_delayed(v->index)) c->du[v->index] += seed;
  } else if (v->group == SLW_STATE) {
    c->dx[v->index] += seed;
  } else if (v->group == SLW_PARAMETER) {
    c->dp[v->index] += seed;
  } else {
    snprintf(c->message, sizeof c->message, "value reference %lu is no known of a derivative", (unsigned long)vr);
    return -1;
  }
  return 0;
}

int slw_directional(SlwCore *c, const uint32_t *unknown, size_t n_unknown, const uint32_t *known, size_t n_known,
                    const double *seed, double *sensitivity) {
  const double *arg[8] = {c->s.x, c->ud, c->s.m, c->s.p, c->dx, c->du, c->dp};
  double *res[8] = {c->df, c->dh};
  memset(c->dx, 0, sizeof c->dx);
  memset(c->du, 0, sizeof c->du);
  memset(c->dp, 0, sizeof c->dp);
  if (c->stale && c->phase < SLW_STEPPING) slw_initialise(c);
  for (size_t i = 0; i < n_known; i++)
    if (seed_known(c, known[i], seed[i])) return -1;
  read_lines(c);
  if (slw_dir(arg, res, c->iw, c->w, 0)) return -1;
  for (size_t i = 0; i < n_unknown; i++) {
    const SlwVariable *v = find(c, unknown[i]);
    if (!v) return -1;
    if (v->group == SLW_DERIVATIVE) {
      sensitivity[i] = c->df[v->index];
    } else if (v->group == SLW_OUTPUT) {
      sensitivity[i] = is_sensor(v->index) ? 0.0 : c->dh[v->index];
    } else {
      snprintf(c->message, sizeof c->message, "value reference %lu is no unknown", (unsigned long)unknown[i]);
      return -1;
    }
  }
  return 0;
}

static const unsigned char MAGIC[8] = {'S', 'L', 'W', 'S', 'T', 'A', 'T', '1'};
#define HEADER_SIZE (sizeof MAGIC + sizeof(SLW_TOKEN) - 1)

size_t slw_serialised_size(void) { return HEADER_SIZE + sizeof(SlwState); }

void slw_serialise(const SlwState *s, unsigned char *bytes) {
  memcpy(bytes, MAGIC, sizeof MAGIC);
  memcpy(bytes + sizeof MAGIC, SLW_TOKEN, sizeof(SLW_TOKEN) - 1);
  memcpy(bytes + HEADER_SIZE, s, sizeof *s);
}

int slw_deserialise(const unsigned char *bytes, size_t size, SlwState *s) {
  if (size != slw_serialised_size() || memcmp(bytes, MAGIC, sizeof MAGIC) != 0 ||
      memcmp(bytes + sizeof MAGIC, SLW_TOKEN, sizeof(SLW_TOKEN) - 1) != 0)
    return -1;
  memcpy(s, bytes + HEADER_SIZE, sizeof *s);
  return 0;
}
