/* The safety gate: the last thing between whatever wants to move the machine and the machine.
 *
 * For every axis and every call, whatever is wanted (numbers of any size, infinities and NaN included):
 *
 *   range      |command| <= range
 *   rate       the command changes by at most `fall` a tick, and moves away from neutral by at most `rise`
 *   stop       without `move`, with a NaN, or (except by hand) without usable sensors, it only goes to neutral
 *   creep      by hand without usable sensors, it goes no further than `creep`
 *   speed      at or above the speed limit, it goes to neutral rather than further in the direction of motion
 *   room       towards a wall it is at most the share of `range` that is left of the wall's zone, when the motion
 *              goes on for `ahead`; at the wall and behind it, it goes to neutral
 *
 * A wall is a distance [m or rad] with its rate and its gradient by the arm joints: keep-out height and radius
 * of the grab point, and the joints' mechanical limits.  The keep-out is of automatic operation: by hand the
 * grab must reach the ground, and the operator sees where it is.
 */
#ifndef SLR_GATE_H
#define SLR_GATE_H

enum { SLR_SLEW, SLR_BOOM, SLR_STICK, SLR_AXES };
enum { SLR_KEEPOUT_HEIGHT, SLR_KEEPOUT_RADIUS, SLR_BOOM_LOW, SLR_BOOM_HIGH, SLR_STICK_LOW, SLR_STICK_HIGH, SLR_WALLS };
enum { SLR_FIRST_JOINT_WALL = SLR_BOOM_LOW }; /* walls before it are the keep-out */

typedef struct {
  double distance;           /* to the wall, negative behind it */
  double rate;               /* of the distance, per second */
  double gradient[SLR_AXES]; /* of the distance by the axes' angles; an axis' command moves it this way */
} SlrWall;

typedef struct {
  double range, creep;      /* largest command, and by hand without sensors */
  double rise, fall;        /* per tick, away from and towards neutral; fall is not below rise */
  double speed[SLR_AXES];   /* rad/s */
  double ahead;             /* s */
  double zone[SLR_WALLS];   /* in front of each wall, m or rad: where commands towards it are reduced */
} SlrGateLimits;

typedef struct {
  int move;                 /* 0: go to neutral */
  int by_hand;              /* the operator's joystick, not a controller, is what is wanted */
  int known[SLR_AXES];      /* the axis' sensors are usable: `speed` and `walls` hold for it */
  double speed[SLR_AXES];   /* rad/s, measured */
  SlrWall walls[SLR_WALLS];
} SlrGateView;

/* Moves the commands `held` of the last tick towards `wanted`, as far as is allowed; 1 if it was not let through
 * unchanged. */
int slr_gate(const SlrGateLimits *limits, const SlrGateView *view, const double wanted[SLR_AXES],
             double held[SLR_AXES]);

#endif
