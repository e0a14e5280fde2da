/* Dry friction of one axis: v' = a - level tanh(v / creep), in closed form between two speeds.
 *
 * What sticks creeps: at a drive a below the level its speed is creep atanh(a / level).  A small creep is friction that
 * stops; a larger one is how simulations round it, or a bearing that gives way.  y is a speed in creeps. */

#define FAR 20.0  /* beyond it tanh y is 1 */
#define NEAR 0.1  /* of the speed of rest: within it the way there is an exponential */
#define PIECES 4
#define NEWTON 40 /* steps at most, each at least as good as halving where Newton's leaves the bracket */

typedef struct {
  double v, went;  /* speed at the end, and the way there */
  double kept;     /* its slope by the speed at the start */
  double followed; /* the same by the drive, as a share of without friction */
} Slid;

/* Time in creeps by unit of drive up to y >= 0, up to a constant; a is not the level. */
static double spent(double y, double a, double level) {
  const double less = a - level, more = a + level;
  return y / less + level / (less * more) * log(fabs(less + more * exp(-2.0 * y)));
}

/* Where y is after a time that ends within [low, high]. */
static double reached(double y, double a, double level, double time, double low, double high) {
  const double end = spent(y, a, level) + time;
  const int falls = high == y;
  double at = fmin(fmax(y + (a - level * tanh(y)) * time, low), high);
  for (int k = 0; k < NEWTON; k++) {
    const double late = spent(at, a, level) - end, rate = a - level * tanh(at);
    if ((late > 0.0) == falls) low = at;
    else high = at;
    double next = at - late * rate;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (fabs(next - at) <= 1e-10 * (1.0 + fabs(at))) return next;
    at = next;
  }
  return at;
}

/* Way from one speed to another in a time: in pieces whose times are known, each at its mean speed. */
static double way(double from, double to, double time, double a, double level) {
  double went = 0.0, at = from, left = time;
  for (int k = 1; k < PIECES; k++) {
    const double next = from + (to - from) * k / PIECES, piece = fmin(fmax(spent(next, a, level) - spent(at, a, level), 0.0), left);
    went += 0.5 * piece * (at + next);
    left -= piece;
    at = next;
  }
  return went + 0.5 * left * (at + to);
}

/* From y >= 0 on; `time` is what is left when it comes to 0, else 0; `went`: the way, in creeps. */
static double slid_forwards(double y, double a, double level, double *time, double *went) {
  double begun = y, t = *time, end;
  *time = 0.0;
  if (y > FAR && y + (a - level) * t > FAR) {
    end = y + (a - level) * t;
    *went += 0.5 * t * (y + end);
    return end;
  } else if (a < 0.0) {
    const double zero = spent(0.0, a, level) - spent(y, a, level);
    *time = fmax(t - zero, 0.0);
    end = *time > 0.0 ? 0.0 : reached(y, a, level, t, 0.0, y);
    t -= *time;
  } else if (a > level) {
    end = reached(y, a, level, t, y, y + a * t);
  } else {
    const double rest = atanh(a / level), share = a / level, edge = rest + (y > rest ? NEAR : -NEAR);
    if (fabs(y - rest) > NEAR) {
      const double there = spent(edge, a, level) - spent(y, a, level);
      if (there >= t) {
        end = reached(y, a, level, t, fmin(edge, y), fmax(edge, y));
        *went += way(begun, end, t, a, level);
        return end;
      }
      *went += way(begun, edge, there, a, level);
      t -= there;
      begun = edge;
    }
    const double rate = level * (1.0 - share * share), less = (begun - rest) * exp(-rate * t);
    *went += rest * t + (rate > 0.0 ? (begun - rest - less) / rate : 0.0);
    return rest + less;
  }
  *went += way(begun, end, t, a, level);
  return end;
}

/* Levels against motion forwards and backwards, speed by which they give way. */
typedef struct {
  double forwards, backwards, creep;
} Dry;

/* Speed v after h under a drive; `went`: the way there. */
static double slid_to(double v, double drive, Dry dry, double h, double *went) {
  double y = v / dry.creep, time = h / dry.creep;
  int side = y > 0.0 || (y == 0.0 && drive >= 0.0) ? 1 : -1;
  *went = 0.0;
  for (int part = 0; part < 2 && time > 0.0; part++, side = -side) {
    const double level = fmax(side > 0 ? dry.forwards : dry.backwards, 1e-12 * (dry.forwards + dry.backwards));
    double a = side * drive, gone = 0.0;
    if (fabs(fabs(a) - level) < 1e-9 * level) a *= 1.0 + 1e-8; /* there the closed form has a limit */
    y = side * slid_forwards(side * y, a, level, &time, &gone);
    *went += side * gone * dry.creep * dry.creep;
  }
  return y * dry.creep;
}

/* What dry friction of these levels takes off a drive at a speed. */
static double held(double v, Dry dry) { return (v > 0.0 ? dry.forwards : dry.backwards) * tanh(v / dry.creep); }

static Slid slid(double v, double drive, Dry dry, double h) {
  Slid end = {0.0, 0.0, 1.0, 1.0};
  end.v = slid_to(v, drive, dry, h, &end.went);
  const double slow = FAR * dry.creep, level = drive > 0.0 ? dry.forwards : dry.backwards;
  if ((v > slow && end.v > slow) || (v < -slow && end.v < -slow)) return end;
  const double first = drive - held(v, dry), more = 0.01 * (dry.forwards + dry.backwards), share = level > 0.0 ? drive / level : 2.0;
  if (fabs(first) > 1e-9 * level) end.kept = fmin(fabs((drive - held(end.v, dry)) / first), 1.0);
  else if (fabs(share) < 1.0) end.kept = exp(-level * (1.0 - share * share) * h / dry.creep);
  double ignored;
  end.followed = fmin(fmax((slid_to(v, drive + more, dry, h, &ignored) - end.v) / (more * h), 0.0), 1.0);
  return end;
}
