/* The guard: before the gate, it keeps the machine off what stands around it, whatever a controller says.
 *
 * Each tick it foresees how far slew, boom and stick go and how far the tool swings, if the wanted commands were sent
 * in this tick and neutral ones from the next tick on (SlrSweep: bounds, not an estimate).  Where the machine would be
 * clear of every zone all along, the commands pass bit for bit.  Else they are replaced by the first of a few lesser
 * ones whose own way to rest is clear, at worst by neutral.  So the way to rest that was last found clear is always
 * there, and neutral commands follow it.
 *
 * Whoever stands closer than the margins is let go by what brings nothing nearer, at a creep.
 *
 * Zones are held in polar form: for each sector of the slew angle a few rectangles of radius and height, which
 * contain all that stands there; the ground is the gate's.  The arm is balls in its vertical plane, carriage and cabin a distance for each sector.
 * Lengths in m, angles in rad, times in s.  Nothing is allocated; what a tick does follows from its arguments.
 */
#ifndef SLR_GUARD_H
#define SLR_GUARD_H

#include <stdint.h>

#include "gate.h"

enum { SLR_GUARD_SECTORS = 240, SLR_GUARD_RECTS = 8, SLR_GUARD_BALLS = 36 };
enum { SLR_GUARD_SENT = 20, SLR_GUARD_BACK = 5 }; /* ticks that commands and angles are remembered */
enum { SLR_PART_NONE, SLR_PART_BOOM, SLR_PART_STICK, SLR_PART_LINES, SLR_PART_GRAB, SLR_PART_CARRIAGE };

/* Something in a sector: from r[0] to r[1] from the slew axis, from z[0] to z[1] above the ground. */
typedef struct {
  double r[2], z[2];
  int32_t tool_only; /* a keep-out zone, which holds for lines and grab */
  int32_t unused;
} SlrRect;

typedef struct {
  int32_t count[SLR_GUARD_SECTORS];
  SlrRect rect[SLR_GUARD_SECTORS][SLR_GUARD_RECTS];
  double carriage[SLR_GUARD_SECTORS]; /* least distance of carriage and cabin to anything, at angles of the sector */
} SlrZones;

/* A ball that covers a piece of the machine: `at` is its place along boom or stick (0 to 1), or below the arm tip [m]. */
typedef struct {
  int32_t part;
  int32_t unused;
  double at, radius;
} SlrBall;

typedef struct {
  double foot[2]; /* radius and height of the boom's foot */
  double stick;   /* its length */
  int32_t balls;
  int32_t unused;
  SlrBall ball[SLR_GUARD_BALLS];
} SlrGuardBody;

/* Bounds on what the machine does and its sensors err (specs/parameters/guard.toml). */
typedef struct {
  double clearance;                /* m, kept beside all other margins */
  double angle_error;              /* rad, of each encoder */
  double rate_error[SLR_AXES];     /* rad/s, of what is taken as the joints' speeds */
  double dead_time[SLR_AXES];      /* s, way to rest over speed, of the slew beside what its inertia takes */
  double settle[SLR_AXES];         /* rad, by which a joint may go though nothing moves it */
  double give[SLR_AXES];           /* rad, by which a joint yields to the tool, over its swing */
  double kick[SLR_AXES];           /* s, way of an arm joint when the other one brakes, over that one's speed */
  double dead_band;                /* command below which nothing moves */
  double speed[SLR_AXES];          /* rad/s, steady speed over what a command is above the dead band */
  double top[SLR_AXES];            /* rad/s, largest speed by commands */
  double push, brake;              /* N.m, most and least torque that speeds the slew up and slows it down */
  double push_time;                /* s, for which it may be sped up after the last command */
  double creep;                    /* largest command within the margins */
  double swing_time;               /* s, largest of a swing's angle over its rate */
  double swing_error;              /* rad, of a measured swing */
  double swing_slew, swing_arm;    /* s/m, swing that stopping adds, over the speed of the arm tip by slew, by arm */
  double swing_most;               /* swing at the tool's stops */
} SlrGuardLimits;

typedef struct {
  double angle[SLR_AXES];
  double slew_rate;
  double swing[2], swing_rate[2];
} SlrGuardView;

/* What is remembered: commands sent, newest first, and the arm's angles. */
typedef struct {
  double sent[SLR_AXES][SLR_GUARD_SENT];
  double angle[2][SLR_GUARD_BACK];
  int64_t known; /* ticks in a row with usable angles, at most SLR_GUARD_BACK */
} SlrGuardPast;

/* Where the machine may come until it rests: joints from lo to hi; twice the sine of half the tool's swing. */
typedef struct {
  double lo[SLR_AXES], hi[SLR_AXES];
  double swing;
} SlrSweep;

/* Generated: (boom, stick) -> knee and tip (radius, height each), least and largest inertia about the slew axis. */
typedef struct {
  double knee[2], tip[2];
  double least, most;
} SlrGuardPose;
void slr_guard_pose(double boom, double stick, SlrGuardPose *pose);

/* The sweep of sending `commands` in this tick and neutral from then on. */
void slr_guard_foresee(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrGuardView *v,
                       const SlrGuardPast *past, const double commands[SLR_AXES], SlrSweep *sweep);

/* What is left of the least distance to anything near after all margins, or one below `enough`; `part` has it. */
double slr_guard_room(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrZones *zones, const SlrSweep *sweep,
                      double enough, int *part);

/* Reduces `wanted` (numbers within -1..1) to what may pass; the part for which it had to, or SLR_PART_NONE. */
int slr_guard(const SlrGuardLimits *l, const SlrGuardBody *body, const SlrZones *zones, const SlrGuardView *v,
              const SlrGuardPast *past, double wanted[SLR_AXES]);

/* At the end of each tick: what was sent; `usable`: the view's angles hold. */
void slr_guard_remember(SlrGuardPast *past, const SlrGuardView *v, int usable, const double sent[SLR_AXES]);

#endif
