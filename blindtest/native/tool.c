/* The free-swinging tool, two axes on a moved suspension, at 0.02 s.
 *
 *   wy += dt ((r'' cos ty - g sin ty - W^2 (r - ly sin ty) + pitch effects) / ly - by wy)
 *   wx += dt ((-(W r)' cos tx - (g cos ty + wy^2 ly) sin tx + roll effects) / lx - bx wx)
 *   t  += dt w
 *
 * and, what the plain model leaves out, each with a factor:
 *   Coriolis     pitch: -2 W lx wx cos tx            roll: -W r' + 2 W ly wy cos ty
 *   centrifugal  roll: W^2 lx sin tx
 *   Euler        pitch: -W' lx sin tx                roll: W' ly sin ty
 *   wind (world)  pitch: radial part inwards         roll: tangential part
 *   lengths that change by l' m a second: -2 l'/l w of either axis
 */
#include <math.h>
#include <string.h>

#include "discrete.h"

#define EXPORT __attribute__((visibility("default")))

typedef struct {
  double length_x, length_y, damping_x, damping_y, gravity;
} Base;

typedef struct {
  double coriolis, centrifugal, euler, wind_x, wind_y, misalignment, lag, delay, offset, hoist;
} Coupling;

/* What the suspension does at a sample: slew angle and rate, radius and its rate. */
typedef struct {
  double angle, rate, radius, radius_rate;
} Suspension;

/* The suspension as it truly moves: the recorded one is early by `delay` and sharper by `lag`. */
static void suspension(const double *u, int k, double dt, const Coupling *c, Suspension *s) {
  static const int column[4] = {0, 1, 2, 3};
  double *value[4] = {&s->angle, &s->rate, &s->radius, &s->radius_rate};
  const double steps = c->delay / dt, whole = floor(steps + 1e-9), part = fmax(steps - whole, 0.0);
  for (int i = 0; i < 4; i++) {
    const int near = k - (int)whole < 0 ? 0 : k - (int)whole, far = near > 0 ? near - 1 : 0;
    const double a = u[5 * near + column[i]], b = u[5 * far + column[i]];
    const double now = a + part * (b - a) + (i == 1 ? c->offset : 0.0);
    *value[i] = k == 0 || c->lag <= 0.0 ? now : *value[i] + (1.0 - exp(-dt / c->lag)) * (now - *value[i]);
  }
}

/* n samples; u [n][5]: slew angle, slew rate, radius, radius rate, height; effects: Axis of roll, then pitch;
 * disturbance [n][2]: angular acceleration of each; noise, y [n][4]: roll, pitch, rates; start [4] likewise. */
EXPORT int bt_tool(const double *base, const double *coupling, const double *effects, int n, double dt,
                   const double *u, const double *disturbance, const double *noise, const double *start,
                   double *y) {
  Base b;
  Coupling c;
  Axis axis[2];
  AxisMemory memory[2];
  memcpy(&b, base, sizeof b);
  memcpy(&c, coupling, sizeof c);
  memcpy(axis, effects, sizeof axis);
  memset(memory, 0, sizeof memory);
  Suspension now = {0}, next; /* as of the last step, and of this one */
  const double length_x = b.length_x, length_y = b.length_y;
  double tx = start[0], ty = start[1], wx = start[2], wy = start[3];
  for (int k = 0; k < n; k++) {
    double *row = y + 4 * k;
    bt_sensors(&axis[0], &memory[0], k, tx, wx, dt, row, row + 2);
    bt_sensors(&axis[1], &memory[1], k, ty, wy, dt, row + 1, row + 3);
    for (int i = 0; i < 4; i += 2) { /* the sensor is turned about the vertical */
      const double x = row[i], p = row[i + 1], e = c.misalignment;
      row[i] = cos(e) * x - sin(e) * p;
      row[i + 1] = sin(e) * x + cos(e) * p;
    }
    for (int i = 0; i < 4; i++) row[i] += noise[4 * k + i];
    /* As the plain model on a recording: the step from k on takes the suspension of k and its change. */
    next = now;
    suspension(u, k, dt, &c, &next);
    if (k == 0) now = next;
    b.length_x = fmax(length_x + c.hoist * k * dt, 0.2);
    b.length_y = fmax(length_y + c.hoist * k * dt, 0.2);
    const double W = next.rate, W_rate = (next.rate - now.rate) / dt;
    const double along = (next.radius_rate - now.radius_rate) / dt;
    const double across = (next.rate * next.radius - now.rate * now.radius) / dt;
    const double r_y = next.radius - b.length_y * sin(ty);
    const double radial = c.wind_x * cos(next.angle) + c.wind_y * sin(next.angle);
    const double tangential = -c.wind_x * sin(next.angle) + c.wind_y * cos(next.angle);
    double pitch = along * cos(ty) - b.gravity * sin(ty) - W * W * r_y - radial;
    pitch -= c.coriolis * 2.0 * W * b.length_x * wx * cos(tx) + c.euler * W_rate * b.length_x * sin(tx);
    double roll = -across * cos(tx) - (b.gravity * cos(ty) + wy * wy * b.length_y) * sin(tx) + tangential;
    roll += c.coriolis * (-W * next.radius_rate + 2.0 * W * b.length_y * wy * cos(ty));
    roll += c.centrifugal * W * W * b.length_x * sin(tx) + c.euler * W_rate * b.length_y * sin(ty);
    const double push_x = bt_forces(&axis[0], tx, wx, memory[0].dahl) + disturbance[2 * k];
    const double push_y = bt_forces(&axis[1], ty, wy, memory[1].dahl) + disturbance[2 * k + 1];
    const double free_x = wx + dt * ((roll - 2.0 * c.hoist * wx) / b.length_x - b.damping_x * wx + push_x);
    const double free_y = wy + dt * ((pitch - 2.0 * c.hoist * wy) / b.length_y - b.damping_y * wy + push_y);
    const double new_x = bt_moreau(&axis[0], free_x, tx, wx, dt, 0.0);
    wy = bt_moreau(&axis[1], free_y, ty, wy, dt, 0.0);
    wx = new_x;
    bt_bristle(&axis[0], &memory[0], wx, dt);
    bt_bristle(&axis[1], &memory[1], wy, dt);
    tx += dt * wx;
    ty += dt * wy;
    now = next;
  }
  return 0;
}
