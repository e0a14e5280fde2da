/* Dry friction of one axis: v' = drive - level tanh(v / creep), in closed form between two speeds.
 *
 * What sticks creeps: at a drive a below the level its speed is creep atanh(a / level).  A small creep is friction that
 * stops; a larger one is how simulations round it, or a bearing that gives way.  Speeds y are in creeps, times in creeps
 * by unit of drive. */

#define FAR 20.0  /* beyond it tanh y is 1 */
#define NEAR 0.1  /* of the speed of rest: within it the way there is an exponential */
#define PIECES 4  /* of a way between two speeds */
#define STANDS 3.0 /* creeps: what is slower may have stood */
#define NEWTON 40 /* steps at most, each at least as good as halving where Newton's leaves the bracket */

/* Where it is, the time left, the way so far, and the slopes of y by the speed at the start and by the drive. */
typedef struct {
  double y, time, went, kept, followed;
} Sliding;

/* Levels against motion forwards and backwards, speed by which they give way. */
typedef struct {
  double forwards, backwards, creep;
} Dry;

static double rate_at(double y, double a, double level) { return a - level * tanh(y); }

/* Time up to y >= 0, up to a constant; a is not the level. */
static double spent(double y, double a, double level) {
  const double less = a - level, more = a + level;
  return y / less + level / (less * more) * log(fabs(less + more * exp(-2.0 * y)));
}

/* Where y is after a time that ends within [low, high]. */
static double reached(double y, double a, double level, double time, double low, double high) {
  const double end = spent(y, a, level) + time;
  const int falls = high == y;
  double at = fmin(fmax(y + rate_at(y, a, level) * time, low), high);
  for (int k = 0; k < NEWTON; k++) {
    const double late = spent(at, a, level) - end;
    if ((late > 0.0) == falls) low = at;
    else high = at;
    double next = at - late * rate_at(at, a, level);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (fabs(next - at) <= 1e-10 * (1.0 + fabs(at))) return next;
    at = next;
  }
  return at;
}

/* On to another speed in a time: in pieces whose times are known. */
static void pass(Sliding *s, double to, double time, double a, double level) {
  const double from = s->y, first = rate_at(from, a, level), last = rate_at(to, a, level);
  double at = from, before = spent(from, a, level), rate = first, left = time, slow = 0.0;
  for (int k = 1; k <= PIECES; k++) {
    const double next = k < PIECES ? from + (to - from) * k / PIECES : to, then = k < PIECES ? spent(next, a, level) : 0.0;
    const double piece = k < PIECES ? fmin(fmax(then - before, 0.0), left) : left, now = rate_at(next, a, level);
    s->went += 0.5 * piece * (at + next);
    slow += 0.5 * piece * (1.0 / rate + 1.0 / now);
    left -= piece;
    at = next;
    before = then;
    rate = now;
  }
  const double kept = last / first;
  s->kept *= kept;
  s->followed = s->followed * kept + last * slow;
  s->y = to;
  s->time -= time;
}

/* The rest of the time with a speed of rest, from near it. */
static void settle(Sliding *s, double rest, double share, double level) {
  const double rate = level * (1.0 - share * share), kept = exp(-rate * s->time), begun = s->y - rest;
  const double lasted = rate > 0.0 ? (1.0 - kept) / rate : s->time;
  s->went += rest * s->time + begun * lasted;
  s->kept *= kept;
  s->followed = s->followed * kept + lasted;
  s->y = rest + begun * kept;
  s->time = 0.0;
}

/* From y >= 0 on, to the end or to 0. */
static void slide(Sliding *s, double a, double level) {
  const double y = s->y, t = s->time, free = y + (a - level) * t;
  if (y > FAR && free > FAR) {
    s->went += 0.5 * t * (y + free);
    s->followed += t;
    s->y = free;
    s->time = 0.0;
  } else if (a < 0.0) {
    const double zero = spent(0.0, a, level) - spent(y, a, level);
    if (zero < t) pass(s, 0.0, zero, a, level);
    else pass(s, reached(y, a, level, t, 0.0, y), t, a, level);
  } else if (a > level) {
    pass(s, reached(y, a, level, t, y, y + a * t), t, a, level);
  } else {
    const double share = a / level, rest = atanh(share), edge = rest + (y > rest ? NEAR : -NEAR);
    if (fabs(y - rest) > NEAR) {
      const double there = spent(edge, a, level) - spent(y, a, level);
      if (there >= t) pass(s, reached(y, a, level, t, fmin(edge, y), fmax(edge, y)), t, a, level);
      else pass(s, edge, there, a, level);
    }
    if (s->time > 0.0) settle(s, rest, share, level);
  }
}

/* From speed v on for h under a drive; speed, way and slopes in the units of v and h, the one by the drive in h. */
static Sliding slid(double v, double drive, Dry dry, double h) {
  Sliding s = {v / dry.creep, h / dry.creep, 0.0, 1.0, 0.0};
  int side = s.y > 0.0 || (s.y == 0.0 && drive >= 0.0) ? 1 : -1;
  for (int part = 0; part < 2 && s.time > 0.0; part++, side = -side) {
    const double level = fmax(side > 0 ? dry.forwards : dry.backwards, 1e-12 * (dry.forwards + dry.backwards));
    double a = side * drive;
    if (fabs(fabs(a) - level) < 1e-9 * level) a *= 1.0 + 1e-8; /* there the closed form has a limit */
    Sliding own = s;
    own.y *= side;
    own.went = 0.0;
    slide(&own, a, level);
    own.y *= side;
    own.went = s.went + side * own.went;
    s = own;
  }
  s.y *= dry.creep;
  s.went *= dry.creep * dry.creep;
  s.followed *= dry.creep / h;
  return s;
}

/* A speed v a little later, or with h < 0 a little earlier, as its rate there says; what stood by then may have moved. */
static Sliding beside(double v, double drive, Dry dry, double h) {
  if (h > 0.0 && (dry.forwards > 0.0 || dry.backwards > 0.0)) return slid(v, drive, dry, h);
  Sliding s = {v, 0.0, h * v, 1.0, 0.0};
  if (dry.forwards + dry.backwards > 0.0 && fabs(v) < STANDS * dry.creep) return s;
  s.y += h * (drive - (v > 0.0 ? dry.forwards : -dry.backwards));
  if (s.y * v < 0.0 && dry.forwards + dry.backwards > 0.0) s.y = 0.0;
  s.went = 0.5 * h * (v + s.y);
  s.followed = 1.0;
  return s;
}
