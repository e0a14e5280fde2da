/* Boom and stick as their velocity controller shows them: first order with delay, at 0.02 s.
 *
 *   v[k+1] = v[k] + (P (clip(r) - v[k]) + dt (tau / J + a/2 sin q v[k]^2)) / (1 + a cos q)   (Lagrange)
 *   then dry friction (Moreau)
 *   q[k+1] = q[k] + dt v[k+1]
 *
 * `parts` [2]: response, delay, inertia of each joint; forces, friction and chains of axis.h on both.
 */
#include <math.h>
#include <string.h>

#include "discrete.h"

#define EXPORT __attribute__((visibility("default")))

typedef struct {
  double response, delay, inertia;
} Joint;

/* n samples; u [n][2] references, overwritten where `gains` (kp, limit of each joint) and ref [n][2] are given;
 * torque [n] acts on joint `active`; noise and y [n][4]: q boom, q stick, v boom, v stick; start [4]. */
EXPORT int bt_arm(const double *parts, const double *effects, double limit, int n, double dt, double *u,
                  const double *ref, const double *gains, const double *torque, int active,
                  const double *noise, const double *start, double *y) {
  Joint joint[2];
  Axis axis[2];
  AxisMemory memory[2];
  memcpy(joint, parts, sizeof joint);
  memcpy(axis, effects, sizeof axis);
  memset(memory, 0, sizeof memory);
  double q[2] = {start[0], start[1]}, v[2] = {start[2], start[3]}, line[2][BT_LINE];
  for (int k = 0; k < n; k++) {
    for (int j = 0; j < 2; j++) {
      double *row = y + 4 * k;
      bt_sensors(&axis[j], &memory[j], k, q[j], v[j], dt, row + j, row + 2 + j);
      row[j] += noise[4 * k + j];
      row[2 + j] += noise[4 * k + 2 + j];
      if (gains) u[2 * k + j] = fmin(fmax(gains[0] * (ref[2 * k + j] - row[j]), -gains[1]), gains[1]);
    }
    for (int j = 0; j < 2; j++) line[j][k % BT_LINE] = u[2 * k + j];
    const double level[2] = {q[0], q[0] + q[1]}; /* above the horizontal: for gravity */
    for (int j = 0; j < 2; j++) {
      const Axis *a = &axis[j];
      Axis turned = *a; /* gravity acts by the link's elevation, all else by the joint's angle */
      turned.slope_cos = turned.slope_sin = 0.0;
      const double other = bt_back(line[1 - j], k, joint[1 - j].delay, dt, 0.0);
      const double wanted = bt_command(a, &memory[j], k, u[2 * k + j], other, joint[j].delay, dt);
      const double gain = dt / joint[j].inertia;
      const double drift = 1.0 + a->x_gain_drift * (1.0 - exp(-k * dt / 10.0));
      const double pull = joint[j].response * (drift * fmin(fmax(wanted, -limit), limit) - v[j]);
      const double weight = a->slope_sin * sin(level[j]) + a->slope_cos * cos(level[j]);
      const double force = bt_forces(&turned, q[j], v[j], memory[j].dahl) + weight +
                           (j == active ? torque[k] : 0.0) +
                           0.5 * joint[j].inertia * a->pose_inertia * sin(q[j]) * v[j] * v[j];
      const double mass = 1.0 + a->pose_inertia * cos(q[j]);
      const double free_speed = v[j] + (pull + gain * force) / mass;
      v[j] = bt_moreau(a, free_speed, q[j], v[j], gain / mass, pull / gain);
      bt_bristle(a, &memory[j], v[j], dt);
    }
    for (int j = 0; j < 2; j++) q[j] += dt * v[j];
  }
  return 0;
}
