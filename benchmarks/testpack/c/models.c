/* The models: each is chosen by the macro KIT_<name>. All have answers in closed form.
 *
 * No model calls a function of libm, so that results are the same bits everywhere. */
#include <math.h>
#include <string.h>

#include "kit.h"

#define CLOSE 1e-9 /* s: a time that is reached up to this is reached */

/* What most models do: one step ends where it should, and outputs follow. */
static inline kit_status done(kit_instance *m, double t, double h, kit_result *result) {
  m->time = result->reached = t + h;
  kit_outputs(m);
  return KIT_OK;
}

#if defined(KIT_gain) /* y = k u + b, at once */
void kit_outputs(kit_instance *m) { R(y) = R(k) * R(u) + R(b); }
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) { return done(m, t, h, result); }
void kit_event(kit_instance *m) { (void)m; }

#elif defined(KIT_sum) /* y = u1 + u2, at once */
void kit_outputs(kit_instance *m) { R(y) = R(u1) + R(u2); }
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) { return done(m, t, h, result); }
void kit_event(kit_instance *m) { (void)m; }

#elif defined(KIT_integrator) /* x' = k u, y = x: exact for an input that is held */
void kit_outputs(kit_instance *m) {
  if (m->initialising) m->x = R(x0);
  R(y) = m->x;
}
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) {
  m->x += h * R(k) * R(u);
  return done(m, t, h, result);
}
void kit_event(kit_instance *m) { (void)m; }

#elif defined(KIT_exchange) /* model exchange: a lag y' = u - y; a ball; stairs; a rate that is no number */
#define FALLS 8.0  /* m/s^2: from 1 m it bounces after 0.5 s, each time with half of its speed, and never rests */
#define STAIR 0.25 /* s */
enum { LAG, BALL, STAIRS, BROKEN };

void kit_rates(const kit_instance *m, double dx[2]) {
  dx[0] = R(u) - m->x, dx[1] = 0.0;
  if (W(kind) == BALL) dx[0] = m->x2, dx[1] = -FALLS;
  if (W(kind) == STAIRS) dx[0] = (double)m->count;
  if (W(kind) == BROKEN) dx[0] = m->time < 0.35 ? 1.0 : (double)NAN;
}
double kit_indicator(const kit_instance *m) { return W(kind) == BALL ? m->x : 1.0; }
bool kit_happens(kit_instance *m, double *next) {
  const bool bounces = W(kind) == BALL && m->x <= 0.0 && m->x2 < 0.0;
  if (bounces) m->x = 0.0, m->x2 *= -0.5, m->count++;
  if (W(kind) == STAIRS && m->time > (double)(m->count + 1) * STAIR - CLOSE) m->count++;
  *next = W(kind) == STAIRS ? (double)(m->count + 1) * STAIR : m->time - 1.0;
  return bounces;
}
void kit_outputs(kit_instance *m) {
  double dx[2];
  if (m->initialising) m->x = W(kind) == BALL ? 1.0 : 0.0, m->x2 = 0.0;
  kit_rates(m, dx);
  R(y) = m->x, R(speed) = m->x2, R(der_y) = dx[0], R(der_speed) = dx[1], W(count) = m->count;
}
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) {
  (void)m, (void)t, (void)h, (void)result;
  return KIT_ERROR;
}
void kit_event(kit_instance *m) { (void)m; }

#elif defined(KIT_source) /* y = offset + slope t; what counts is t / period */
void kit_outputs(kit_instance *m) {
  R(y) = R(offset) + R(slope) * m->time;
  W(count) = (int64_t)(m->time / R(period) + CLOSE);
  W(on) = W(count) % 2;
  W(mode) = 1 + W(count) % 3;
}
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) { return done(m, t, h, result); }
void kit_event(kit_instance *m) { (void)m; }

#elif defined(KIT_echo) /* each output is its input: a number one more, a Boolean the other one */
void kit_outputs(kit_instance *m) {
  R(real_out) = R(real_in) + 1.0;
  W(integer_out) = W(integer_in) + 1;
  W(boolean_out) = !W(boolean_in);
  W(mode_out) = W(mode_in);
  m->text[string_out] = m->text[string_in];
  W(string_size) = (int64_t)m->text[string_in].size;
#if defined(KIT_FMI3)
  R(float32_out) = R(float32_in) + 1.0;
  W(int8_out) = W(int8_in) + 1;
  W(int16_out) = W(int16_in) + 1;
  W(int64_out) = W(int64_in) + 1;
  N(uint8_out) = N(uint8_in) + 1;
  N(uint16_out) = N(uint16_in) + 1;
  N(uint32_out) = N(uint32_in) + 1;
  N(uint64_out) = N(uint64_in) + 1;
  W(int64_rest) = W(int64_in) % 1000; /* which shows whether a double was on the way */
  W(uint64_rest) = (int64_t)(N(uint64_in) % 1000);
  m->text[binary_out] = m->text[binary_in];
  W(binary_sum) = 0;
  for (size_t i = 0; i < m->text[binary_in].size; i++)
    W(binary_sum) += (unsigned char)m->text[binary_in].data[i];
#endif
}
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) { return done(m, t, h, result); }
void kit_event(kit_instance *m) { (void)m; }

#elif defined(KIT_vector) /* y[i] = k u[i] + i, total = their sum */
void kit_outputs(kit_instance *m) {
  const size_t size = kit_size(m, &kit_variables[KIT_VECTOR]);
  R(total) = 0.0;
  for (size_t i = 0; i < size; i++) {
    m->v[(size_t)y + i].real = R(k) * m->v[(size_t)u + i].real + (double)i;
    R(total) += m->v[(size_t)y + i].real;
  }
}
kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) { return done(m, t, h, result); }
void kit_event(kit_instance *m) { (void)m; }

#elif defined(KIT_counter) /* an event at every whole multiple of `period`: counted, and when the last one was */
static double next(const kit_instance *m) { return (double)(m->count + 1) * R(period); }

void kit_outputs(kit_instance *m) { W(count) = m->count; }

void kit_event(kit_instance *m) {
  while (next(m) <= m->time + CLOSE) {
    m->count++;
    R(last) = m->time;
  }
  kit_outputs(m);
}

kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) {
  const double end = t + h;
  m->time = result->reached = end;
  if (next(m) > end + CLOSE) return KIT_OK;
  if (!m->events) {
    kit_event(m);
    return KIT_OK;
  }
  result->event = true;
  result->early = m->early && next(m) < end - CLOSE;
  if (result->early) m->time = result->reached = next(m);
  return KIT_OK;
}

#elif defined(KIT_sampler) /* at each tick of its clock: count, and keep u */
void kit_outputs(kit_instance *m) { W(count) = m->count; }

void kit_event(kit_instance *m) {
  if (!W(tick)) return;
  W(tick) = 0;
  m->count++;
  R(sampled) = R(u);
  kit_outputs(m);
}

kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) { return done(m, t, h, result); }

#elif defined(KIT_trouble) /* y counts the seconds; from `at` on it behaves as badly as `trick` says */
enum { GOOD, WARNS, DISCARDS, TERMINATES, FAILS, NO_NUMBER, CRASHES, HANGS, REFUSES };

void kit_outputs(kit_instance *m) { R(y) = m->x; }
void kit_event(kit_instance *m) { (void)m; }

static kit_status misbehave(kit_instance *m, double t, double h, kit_result *result) {
  volatile int *nowhere = NULL;
  switch (W(trick)) {
    case WARNS: return KIT_WARNING;
    case FAILS: return KIT_ERROR;
    case NO_NUMBER: R(y) = R(y) / 0.0 - R(y) / 0.0; return KIT_OK;
    case CRASHES: *nowhere = 1; return KIT_OK;
    case HANGS:
      for (volatile int i = 0; i >= 0; i = 1) continue;
      return KIT_OK;
    case TERMINATES:
      m->terminated = result->terminate = true;
      return KIT_OK;
    case DISCARDS: /* it only manages half of the step */
      if (h < R(largest) + CLOSE) return KIT_OK;
      m->x -= 0.5 * h;
      m->time = result->reached = t + 0.5 * h;
      kit_outputs(m);
      return KIT_DISCARD;
    case REFUSES: /* it does not even begin a step that is too long */
      if (h < R(largest) + CLOSE) return KIT_OK;
      m->x -= h;
      m->time = result->reached = t;
      kit_outputs(m);
      return KIT_DISCARD;
    default: return KIT_OK;
  }
}

kit_status kit_step(kit_instance *m, double t, double h, kit_result *result) {
  m->x += h;
  (void)done(m, t, h, result);
  return t > R(at) - CLOSE ? misbehave(m, t, h, result) : KIT_OK;
}
#endif
