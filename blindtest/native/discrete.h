/* Effects of an axis whose plain model is a difference equation (arm, tool): the same chains at the samples,
 * dry friction by Moreau's step, which sticks exactly as its continuous form does. */
#ifndef BT_DISCRETE_H
#define BT_DISCRETE_H

#include "axis.h"

enum { BT_LINE = 256 }; /* samples of the longest delay */

typedef struct {
  Chain chain;
  double before; /* what comes of no command */
  double limited, lagged, dahl, play, lag_q, lag_v;
  double line[BT_LINE], seen_q[BT_LINE], seen_v[BT_LINE];
  int began;
} AxisMemory;

/* Value `delay` seconds back on a line of one value a sample, linear between samples; `now`: index. */
double bt_back(const double *line, int now, double delay, double dt, double before);

/* The command that acts at sample k, after delay (`base_delay` is the plain model's), chain, limit, lag;
 * `other`: the crosstalking command as it arrives, delayed by what the plain model has for it. */
double bt_command(const Axis *a, AxisMemory *m, int k, double command, double other, double base_delay,
                  double dt);

/* Speed after a step that would end at `free_speed` without dry friction; `gain` = dt / inertia. */
double bt_moreau(const Axis *a, double free_speed, double q, double v, double gain, double transmitted);

void bt_bristle(const Axis *a, AxisMemory *m, double v, double dt);

/* What the sensors of q and v show at sample k. */
void bt_sensors(const Axis *a, AxisMemory *m, int k, double q, double v, double dt, double *seen_q,
                double *seen_v);

#endif
