#include "discrete.h"

#include <math.h>

double bt_back(const double *line, int now, double delay, double dt, double before) {
  const double steps = delay / dt, whole = floor(steps + 1e-9), part = fmax(steps - whole, 0.0);
  const int near = now - (int)whole, far = near - 1;
  const double a = near < 0 ? before : line[near % BT_LINE], b = far < 0 ? before : line[far % BT_LINE];
  return a + part * (b - a);
}

double bt_command(const Axis *a, AxisMemory *m, int k, double command, double other, double base_delay,
                  double dt) {
  if (k == 0) m->before = m->limited = m->lagged = bt_chain(a, &m->chain, 0.0, 0.0);
  m->line[k % BT_LINE] = command;
  double u = bt_chain(a, &m->chain, bt_back(m->line, k, base_delay + a->in_delay, dt, 0.0), other);
  const double most = a->in_rate * dt;
  m->limited += fmin(fmax(u - m->limited, -most), most);
  if (isfinite(a->in_rate)) u = m->limited;
  if (a->in_lag > 0.0) u = m->lagged += (1.0 - exp(-dt / a->in_lag)) * (u - m->lagged);
  return u;
}

double bt_moreau(const Axis *a, double free_speed, double q, double v, double gain, double transmitted) {
  if (!bt_has_dry(a)) return free_speed;
  const double sign = free_speed > 0.0 ? 1.0 : -1.0;
  const double speed = sign * v > 0.0 ? v : 0.0; /* the static level when it turns or starts */
  const double slid = free_speed - sign * gain * bt_dry(a, sign, q, speed, transmitted);
  return sign * slid > 0.0 ? slid : 0.0;
}

void bt_bristle(const Axis *a, AxisMemory *m, double v, double dt) {
  if (a->dahl_force <= 0.0) return;
  const double sign = v > 0.0 ? 1.0 : -1.0; /* exact for a constant v: z tends to sgn v */
  m->dahl = sign + (m->dahl - sign) * exp(-a->dahl_stiffness / a->dahl_force * fabs(v) * dt);
}

void bt_sensors(const Axis *a, AxisMemory *m, int k, double q, double v, double dt, double *seen_q,
                double *seen_v) {
  if (!m->began) m->play = m->lag_q = q, m->lag_v = v, m->seen_q[0] = q, m->seen_v[0] = v;
  m->began = 1;
  if (a->out_lag_q > 0.0) q = m->lag_q += (1.0 - exp(-dt / a->out_lag_q)) * (q - m->lag_q);
  if (a->out_lag_v > 0.0) v = m->lag_v += (1.0 - exp(-dt / a->out_lag_v)) * (v - m->lag_v);
  if (a->out_backlash > 0.0) q = bt_play(&m->play, q, a->out_backlash);
  m->seen_q[k % BT_LINE] = q;
  m->seen_v[k % BT_LINE] = v;
  const double behind = a->out_clock * k * dt;
  const double start_q = k < BT_LINE ? m->seen_q[0] : 0.0, start_v = k < BT_LINE ? m->seen_v[0] : 0.0;
  *seen_q = bt_back(m->seen_q, k, a->out_delay_q + behind, dt, start_q) * (1.0 + a->out_scale) + a->out_bias_q +
            a->out_drift * k * dt;
  *seen_v = bt_back(m->seen_v, k, a->out_delay_v + behind, dt, start_v) * (1.0 + a->out_scale_v) + a->out_bias_v;
}
