/* An integrator that stops at events: RK4 in equal steps, guards located by bisection, jumps of mode. */
#ifndef BT_INTEGRATOR_H
#define BT_INTEGRATOR_H

enum { BT_STATES = 24, BT_GUARDS = 16, BT_EVENTS_AT_ONCE = 64 };

typedef void BtRhs(void *who, double t, const double *x, double *rate);
typedef void BtGuard(void *who, double t, const double *x, double *g); /* an event when one is < 0 */
typedef void BtJump(void *who, double t, double *x, int which);        /* must make its guard >= 0 */
typedef void BtAfter(void *who, double t, const double *x);            /* after every step; may be null */

typedef struct {
  int states, guards;
  double step; /* s, the longest */
  BtRhs *rhs;
  BtGuard *guard;
  BtJump *jump;
  BtAfter *after;
  void *who;
} BtFlow;

/* From t0 to t1; returns the number of events, or -1 when events follow each other without end. */
int bt_advance(const BtFlow *flow, double t0, double t1, double *x);

#endif
