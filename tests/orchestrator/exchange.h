/* The equations of the FMUs exchange2.c and exchange3.c: two states, and what `kind` says of them.
 *
 * 0 oscillator  x' = v, v' = mu (1 - x^2) v - x      (Van der Pol)
 * 1 ball        h' = v, v' = -9.81; bounces at h = 0 with 0.7 of its speed, rests below 0.1 m/s
 * 2 endless     the same, but never rests (Zeno)
 * 3 broken      v' is not a number from 0.5 s on
 * 4 stair       counts seconds by time events; x' = count
 * 5 lag         x' = u - x, v' = 0
 * 6 chatter     an event that always wants another iteration, at 0.5 s
 * 7 watched     as 5; counts the steps of the integrator that it is told of */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { OSCILLATOR, BALL, ENDLESS, BROKEN, STAIR, LAG, CHATTER, WATCHED, PAST };
/* Value references: 0 time, 1 x, 2 x', 3 v, 4 v', 5 u, 6 mu, 7 y = x + u; 8 kind, 9 count. */
typedef struct {
  double time, x[2], u, mu, last;
  int kind, count;
  bool rests, continuous, bad; /* bad: called in a mode that does not allow it, or back in time */
} model;

static void start(model *m) {
  m->mu = 1.0, m->x[0] = 2.0, m->x[1] = 0.0;
}

static double *settable(model *m, unsigned vr) {
  return vr == 1 ? &m->x[0] : vr == 3 ? &m->x[1] : vr == 5 ? &m->u : &m->mu;
}

static void initialise(model *m) {
  if (m->kind == BALL || m->kind == ENDLESS) m->x[0] = 1.0, m->x[1] = 0.0;
  if (m->kind > ENDLESS) m->x[0] = m->x[1] = 0.0;
  m->last = m->time;
}

static void rates(const model *m, double *dx) {
  dx[0] = m->x[1], dx[1] = 0.0;
  if (m->kind == OSCILLATOR) dx[1] = m->mu * (1.0 - m->x[0] * m->x[0]) * m->x[1] - m->x[0];
  if (m->kind == BALL || m->kind == ENDLESS) dx[1] = m->rests ? 0.0 : -9.81;
  if (m->kind == BROKEN) dx[1] = m->time < 0.5 ? 1.0 : NAN;
  if (m->kind == STAIR) dx[0] = m->count;
  if (m->kind == LAG || m->kind == WATCHED) dx[0] = m->u - m->x[0];
}

static double indicator(const model *m) {
  if (m->kind != BALL && m->kind != ENDLESS) return 1.0;
  return m->x[0] == 0.0 && m->x[1] == 0.0 ? 1.0 : m->x[0];
}

/* What an event comes to; the time of the next one, or less than now. */
static double event(model *m, bool *more, bool *changed) {
  *more = *changed = false;
  if ((m->kind == BALL || m->kind == ENDLESS) && m->x[0] <= 0.0 && m->x[1] < 0.0) {
    m->x[0] = 0.0, m->x[1] *= -0.7, m->count++, *changed = true;
    if (m->kind == BALL && m->x[1] < 0.1) m->x[1] = 0.0, m->rests = true;
  }
  if (m->kind == STAIR && m->time >= m->count + 1 - 1e-9) m->count++;
  if (m->kind == STAIR) return m->count + 1;
  if (m->kind == CHATTER) {
    *more = m->time >= 0.5;
    return m->time < 0.5 ? 0.5 : 1e9;
  }
  if (m->kind == PAST && m->time >= 0.5) return 0.25;
  return m->kind == PAST ? 0.5 : m->time - 1.0;
}

/* The master may not go back behind a step that it said was done. */
static void set_time(model *m, double t) {
  m->bad = m->bad || t < m->last - 1e-12 || !m->continuous;
  m->time = t;
}

static void completed(model *m) {
  m->last = m->time;
  if (m->kind == WATCHED) m->count++;
}

static double value(const model *m, unsigned vr) {
  double dx[2];
  rates(m, dx);
  const double values[] = {m->time, m->x[0], dx[0], m->x[1], dx[1], m->u, m->mu, m->x[0] + m->u};
  return vr < 8 ? values[vr] : 0.0;
}
