/* Extended Kalman filter of a model with ports over one recording.
 *
 * Of equations that are dense and column-major, each of (x, u, m, p):
 *   kf_f    -> dx/dt (a model in steps: its next state)
 *   kf_fj   -> the same, d/dx, d/dw (w: the disturbances, part of u)
 *   kf_dry  -> speeds per second that dry friction takes off each axis, forwards then backwards
 *   kf_post -> states after a step (memories of sensors move here), d/dx
 *   kf_hj   -> outputs, d/dx, d/dw
 *   kf_in   (memory, u, m, p) -> u as the model feels it, memory after the step
 *   kf_first (memory, x, u, m, p) -> where the memory and the NH states of effects begin
 *
 * The state is (x, w).  A step is ROS2 (Verwer and others 1999: linearly implicit, order 2, L-stable) in substeps that
 * share the slopes at its start.  Dry friction is a step of its own after each: it takes off the speed until that is
 * zero, and what stands goes on only where it is driven by more.  Each w is an Ornstein-Uhlenbeck process.  Outputs come one at a time; a missing one (NaN) is passed over.
 *
 * Compiled once for all models, whose sizes and equations come with each run (ANY_MODEL: any_model.h), or for the sizes of
 * one, beside its compiled equations.  Both compute the same bits.
 */
#include <math.h>
#include <string.h>

/* NX, NU, NM, NW, NY, NI, NH, AXES, POSTS, axis_v, axis_q, DT, EARLY, STEP, W0, DISCRETE, SZ_W, SZ_IW; MOST_...: no smaller */
#ifdef ANY_MODEL
#include "any_model.h"
#else
#include "filter.h" /* generated */
#endif

typedef int Function(const double **arg, double **res, long long *iw, double *w, int mem);
Function kf_f, kf_fj, kf_dry, kf_post, kf_hj, kf_in, kf_first;

#define N (NX + NW)
#define MOST_N (MOST_NX + MOST_NW)
#define COPY(to, from, n) memcpy(to, from, sizeof(*(from)) * (size_t)(n))
#define AT(a, k, n) ((a) + (size_t)(k) * (size_t)(n)) /* where that of step k begins */
#define CLEAR(a, n) memset(a, 0, sizeof(*(a)) * (size_t)(n))
#define GAMMA 0.29289321881345254
#define LEAK 0.1 /* slope of a stuck speed by the one before: a filter that sees none never comes loose */
#define CLIP 4.0 /* deviations beyond which an innovation counts no more */
#define OFTEN 0.3 /* share of a sample in how often innovations lately reached that */
#define NEVER 1e300 /* more than any innovation: of the first samples all counts */

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct {
  int steps, substeps, active;
  double step;                    /* length of a step that has `substeps`; shorter ones have fewer */
  const int *state;               /* [active] */
  const double *u;                /* NU a step */
  const double *m;                /* NM a step */
  const double *y;                /* NY a step, NaN: missing */
  const double *p;
  const double *sigma, *keep, *white; /* NW: size of a disturbance, its share kept over 1 s as a rate 1/tau, white rate */
  const double *r;                /* NY: variances of the outputs */
  const double *creep;            /* AXES: speeds by which dry friction gives way at standstill */
  const double *x0, *p0;          /* NX: start and its variances (< 0: as kf starts it) */
  double *e, *s;                  /* NY a step: innovations and their variances */
  double *z, *v;                  /* N a step, or NULL: filtered states and their variances */
  const int *window;              /* a step, or NULL: number of the window in which the model also runs by itself */
  double *free, *zfree;           /* NY and NX a step, or NULL: what it does there */
  double *phi, *before, *after;   /* W * W a step (W: active + NW), or NULL: transition, variances before and after */
  double *ahead;                  /* W a step, or NULL: what was expected of the step */
  /* slopes of sigma, keep, white (NW) and r (NY) by parameters of the noise [4 LANES], or NULL */
  const double *by_sigma, *by_keep, *by_white, *by_r;
  double *de, *ds;                /* NY x 4 LANES a step: slopes of e and of log s by them */
} Run;

typedef double V __attribute__((vector_size(32)));
#define MOST_QUADS ((MOST_NX + 3) / 4)
#define QUADS ((NX + 3) / 4) /* Vs that hold the states: of a transition so many for each state and disturbance that it is from */
#define ROW (4 * QUADS) /* numbers in them */

#include "noise_slopes.h"

static double scratch[SZ_W + 1];
static long long iscratch[SZ_IW + 1];

static int call(Function f, const double *x, const double *u, const double *m, const double *p, double *a, double *b,
                double *c) {
  const double *arg[4] = {x, u, m, p};
  double *res[3] = {a, b, c};
  return f(arg, res, iscratch, scratch, 0);
}

/* The same of a function [rows] with its slopes by x and w.  One without end, as of a root at nothing, is left out. */
static void sloped(Function f, int rows, const double *x, const double *u, const double *m, const double *p, double *a,
                   double *b, double *c) {
  call(f, x, u, m, p, a, b, c);
  for (int i = 0; i < rows * NX; i++) b[i] = isfinite(b[i]) ? b[i] : 0.0;
  for (int i = 0; i < rows * NW; i++) c[i] = isfinite(c[i]) ? c[i] : 0.0;
}

/* LU with partial pivoting of a [n x n] row-major, the diagonal inverted; 0 if singular. */
static int factor(double *a, int *pivot, int n) {
  if (n > NX) return 0; /* never: it tells the compiler how large a is */
  for (int k = 0; k < n; k++) {
    int best = k;
    for (int i = k + 1; i < n; i++) {
      if (fabs(a[i * n + k]) > fabs(a[best * n + k])) best = i;
    }
    if (a[best * n + k] == 0.0 || !isfinite(a[best * n + k])) return 0;
    pivot[k] = best;
    if (best != k) {
      for (int j = 0; j < n; j++) {
        double t = a[k * n + j];
        a[k * n + j] = a[best * n + j];
        a[best * n + j] = t;
      }
    }
    a[k * n + k] = 1.0 / a[k * n + k];
    for (int i = k + 1; i < n; i++) {
      double g = a[i * n + k] *= a[k * n + k];
      if (g != 0.0) {
        for (int j = k + 1; j < n; j++) a[i * n + j] -= g * a[k * n + j];
      }
    }
  }
  return 1;
}

/* Solves for `columns` right-hand sides in b [n x columns], row-major. */
static void solve(const double *a, const int *pivot, int n, double *b, int columns) {
  if (n > NX) return;
  for (int k = 0; k < n; k++) {
    if (pivot[k] != k) {
      for (int j = 0; j < columns; j++) {
        double t = b[k * columns + j];
        b[k * columns + j] = b[pivot[k] * columns + j];
        b[pivot[k] * columns + j] = t;
      }
    }
  }
  for (int k = 0; k < n; k++) {
    for (int i = k + 1; i < n; i++) {
      double g = a[i * n + k];
      if (g != 0.0) {
        for (int j = 0; j < columns; j++) b[i * columns + j] -= g * b[k * columns + j];
      }
    }
  }
  for (int k = n - 1; k >= 0; k--) {
    for (int j = 0; j < columns; j++) b[k * columns + j] *= a[k * n + k];
    for (int i = 0; i < k; i++) {
      double g = a[i * n + k];
      if (g != 0.0) {
        for (int j = 0; j < columns; j++) b[i * columns + j] -= g * b[k * columns + j];
      }
    }
  }
}

/* What a step is made with: rates and their slopes where it begins, and the factors for substeps of h. */
typedef struct {
  double f[MOST_NX], b[MOST_NX * MOST_NW + 1], ab[MOST_NX * MOST_N], lu[MOST_NX * MOST_NX]; /* ab: [n x (n + NW)] row-major */
  V phi[MOST_N * MOST_QUADS]; /* what a substep makes of each state and disturbance */
  int pivot[MOST_NX];
} Slopes;

/* Slopes at the start of a step, for all of its substeps: ROS2 keeps its order with any of them; 0 if singular. */
static int linearise(const Run *run, const double *x, const double *u, const double *m, double h, Slopes *s, int slopes) {
  static double a[MOST_NX * MOST_NX], k1[MOST_NX * MOST_N], k2[MOST_NX * MOST_N];
  const int n = run->active, wide = n + NW;
  const int *at = run->state;
  sloped(kf_fj, NX, x, u, m, run->p, s->f, a, s->b);
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < n; j++) s->ab[i * wide + j] = a[at[j] * NX + at[i]];
    for (int j = 0; j < NW; j++) s->ab[i * wide + n + j] = s->b[j * NX + at[i]];
  }
  double *phi = (double *)s->phi;
  if (DISCRETE) {
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < wide; j++) phi[j * ROW + i] = s->ab[i * wide + j];
    }
    return 1;
  }
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < n; j++) s->lu[i * n + j] = (i == j) - GAMMA * h * s->ab[i * wide + j];
  }
  if (!factor(s->lu, s->pivot, n)) return 0;
  if (!slopes) return 1;
  COPY(k1, s->ab, n * wide);
  solve(s->lu, s->pivot, n, k1, wide);
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < wide; j++) k2[i * wide + j] = s->ab[i * wide + j] - 2.0 * k1[i * wide + j];
    for (int l = 0; l < n; l++) {
      const double g = h * s->ab[i * wide + l];
      if (g == 0.0) continue;
      for (int j = 0; j < wide; j++) k2[i * wide + j] += g * k1[l * wide + j];
    }
  }
  solve(s->lu, s->pivot, n, k2, wide);
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < wide; j++) phi[j * ROW + i] = (i == j) + h * (1.5 * k1[i * wide + j] + 0.5 * k2[i * wide + j]);
  }
  return 1;
}

#if MOST_AXES
#include "dry_friction.h"

/* Dry friction of a substep from the state `started`: at the speed where it begins, then between that and where it ends.
 * What it takes off is damped over the step as all else is, so that it lets go at its level whatever the step. */
static void rub(const Run *run, const double *started, double *x, const double *u, const double *m, double h,
                const Slopes *s, double *phi) {
  static double dry[2 * MOST_AXES], between[MOST_NX];
  const int n = run->active, wide = n + NW;
  call(kf_dry, started, u, m, run->p, dry, 0, 0);
  for (int k = 0; k < AXES; k++) {
    const int axis = axis_v[k];
    if (dry[k] == 0.0 && dry[AXES + k] == 0.0) continue;
    int row = -1, place = -1;
    for (int i = 0; i < n; i++) {
      if (run->state[i] == axis) row = i;
      if (run->state[i] == axis_q[k]) place = i;
    }
    const double v = x[axis], old = started[axis], z = h * s->ab[row * wide + row];
    /* what a step leaves of a force that acts all through it: ROS2 of v' = 1 + z v / h, in h */
    const double left = (1.0 + (0.5 - 2.0 * GAMMA) * z) / ((1.0 - GAMMA * z) * (1.0 - GAMMA * z));
    Dry levels = {left * dry[k], left * dry[AXES + k], run->creep[k]};
    Sliding end = slid(old, (v - old) / h, levels, h);
    COPY(between, started, NX);
    between[axis] = 0.5 * (old + end.y);
    call(kf_dry, between, u, m, run->p, dry, 0, 0);
    if (left * dry[k] != levels.forwards || left * dry[AXES + k] != levels.backwards) {
      levels.forwards = left * dry[k];
      levels.backwards = left * dry[AXES + k];
      end = slid(old, (v - old) / h, levels, h);
    }
    const double followed = fmax(end.followed, LEAK), kept = fmax(end.kept, followed); /* else what breaks loose seems known */
    x[axis] = end.y;
    if (place >= 0) x[axis_q[k]] -= 0.5 * h * (old + v) - end.went;
    for (int j = 0; phi && j < wide; j++) {
      const double before = phi[j * ROW + row], own = j == row;
      phi[j * ROW + row] = kept * own + followed * (before - own);
      if (place >= 0) phi[j * ROW + place] -= 0.5 * h * (before - phi[j * ROW + row]);
    }
  }
}
#endif

/* One substep of the active states from rates f; 0 if it runs away.  Dry friction changes the slopes phi, if any. */
static int substep(const Run *run, double *x, const double *f, const double *u, const double *m, double h, const Slopes *s,
                   double *phi) {
  static double g[MOST_NX], k1[MOST_NX], k2[MOST_NX], moved[MOST_NX], started[MOST_NX];
  const int n = run->active;
  const int *at = run->state;
  if (DISCRETE) {
    COPY(x, f, NX); /* states that follow inputs alone are known: they are not active, but move */
  } else {
    for (int i = 0; i < n; i++) k1[i] = f[at[i]];
    solve(s->lu, s->pivot, n, k1, 1);
    COPY(moved, x, NX);
    COPY(started, x, NX);
    for (int i = 0; i < n; i++) moved[at[i]] += h * k1[i];
    call(kf_f, moved, u, m, run->p, g, 0, 0);
    for (int i = 0; i < n; i++) k2[i] = g[at[i]] - 2.0 * k1[i];
    solve(s->lu, s->pivot, n, k2, 1);
    for (int i = 0; i < n; i++) x[at[i]] += h * (1.5 * k1[i] + 0.5 * k2[i]);
#if MOST_AXES
    if (AXES) rub(run, started, x, u, m, h, s, phi);
#else
    (void)phi;
#endif
  }
  for (int i = 0; i < n; i++) {
    if (!isfinite(x[at[i]]) || fabs(x[at[i]]) > 1e12) return 0;
  }
  return 1;
}

/* Sums of rows of Vs: row i of `out` is the sum over l < many of a[i, l] b[l]; a by rows that are `apart`. */
static void product(const double *a, int apart, int rows, int many, const V *b, V *out) {
  for (int i = 0; i < rows; i++) {
    V sum[MOST_QUADS];
    CLEAR(sum, QUADS);
    for (int l = 0; l < many; l++) {
      for (int v = 0; v < QUADS; v++) sum[v] += a[i * apart + l] * b[l * QUADS + v];
    }
    COPY(out + i * QUADS, sum, QUADS);
  }
}

/* Covariance over a step: P = phi P phi' of the states, the disturbances kept. */
static void spread(double *P, const V *phi, int n) {
  if (n > NX) return;
  static V moved[MOST_N * MOST_QUADS], after[MOST_NX * MOST_QUADS];
  static double rows[MOST_NX * MOST_N];
  const double *half = (const double *)moved, *whole = (const double *)after;
  const int wide = n + NW;
  product(P, wide, wide, wide, phi, moved);
  for (int i = 0; i < n; i++) {
    for (int l = 0; l < wide; l++) rows[i * wide + l] = ((const double *)phi)[l * ROW + i];
  }
  product(rows, wide, n, wide, moved, after);
  for (int i = 0; i < n; i++) {
    for (int j = n; j < wide; j++) P[i * wide + j] = P[j * wide + i] = half[j * ROW + i];
    for (int j = 0; j <= i; j++) P[i * wide + j] = P[j * wide + i] = 0.5 * (whole[i * ROW + j] + whole[j * ROW + i]);
  }
}

/* total = phi total: the transition over all of a step, of the disturbances themselves none. */
static void follow(V *total, const V *phi, int n) {
  if (n > NX) return;
  static V t[MOST_N * MOST_QUADS];
  const int wide = n + NW;
  product((const double *)total, ROW, wide, n, phi, t);
  COPY(total, t, n * QUADS);
  for (int i = n * QUADS; i < wide * QUADS; i++) total[i] = t[i] + phi[i];
}

/* All substeps of a step under the inputs `given`, with the disturbances w, if any; s: what they were made with; total:
 * the transition, if any.  The memories of inputs move too; u: what the model felt last. */
static int advance(const Run *run, double *x, const double *given, const double *w, double *memory, double *u,
                   const double *m, Slopes *s, V *total) {
  static V phi[MOST_N * MOST_QUADS], full[MOST_N * MOST_QUADS];
  static double posted[MOST_NX], px[MOST_NX * MOST_NX], f[MOST_NX], row[MOST_NU], next[MOST_NI + 1];
  const int n = run->active, *at = run->state;
  const double dt = given[DT];
  const int substeps = DISCRETE || dt >= run->step ? run->substeps : (int)ceil(run->substeps * dt / run->step - 1e-6);
  const double h = dt / substeps;
  COPY(row, given, NU);
  if (!DISCRETE) row[DT] = h;
  for (int q = 0; q < substeps; q++) {
    const int again = q == 0 || DISCRETE;
    if (q == 0 || (NI && !DISCRETE)) {
      const double *arg[4] = {memory, row, m, run->p};
      double *res[2] = {u, next};
      kf_in(arg, res, iscratch, scratch, 0);
      COPY(memory, next, NI);
      for (int i = 0; w && i < NW; i++) u[W0 + i] += w[i];
    }
    if (again && !linearise(run, x, u, m, h, s, total != 0)) return 0;
    if (!again) call(kf_f, x, u, m, run->p, f, 0, 0);
    if (total) COPY(phi, s->phi, N * QUADS);
    if (!substep(run, x, again ? s->f : f, u, m, h, s, total ? (double *)phi : 0)) return 0;
    if (total && q > 0) follow(total, phi, n);
    if (total && q == 0) COPY(total, phi, N * QUADS);
  }
  u[DT] = dt;
  if (!POSTS) return 1;
  call(kf_post, x, u, m, run->p, posted, px, 0);
  if (total) {
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < n; j++) ((double *)full)[j * ROW + i] = px[at[j] * NX + at[i]];
    }
    CLEAR(full + n * QUADS, NW * QUADS); /* disturbances move no memory here */
    follow(total, full, n);
  }
  for (int i = 0; i < n; i++) x[at[i]] = posted[at[i]];
  return 1;
}

/* What random rates, that push as b [NX x NW] says, and the disturbances' own motion add over dt. */
static void shake(const Run *run, const double *b, double dt, double *w, double *P) {
  const int n = run->active, wide = n + NW, *at = run->state;
  for (int q = 0; q < NW; q++) {
    /* a model in steps moves by B w in one of them, else at the rate B w */
    const double size = run->white[q] * run->white[q] * (DISCRETE ? 1.0 / dt : dt);
    if (size == 0.0) continue;
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < n; j++) P[i * wide + j] += size * b[q * NX + at[i]] * b[q * NX + at[j]];
    }
  }
  for (int i = 0; i < NW; i++) {
    const double keep = exp(-dt * run->keep[i]);
    w[i] *= keep;
    for (int j = 0; j < wide; j++) {
      P[(n + i) * wide + j] *= keep;
      P[j * wide + n + i] *= keep;
    }
    P[(n + i) * wide + n + i] += run->sigma[i] * run->sigma[i] * (1.0 - keep * keep);
  }
}

/* A row r times a [NX x columns], column-major. */
static void times(const double *r, const double *a, int columns, double *out) {
  for (int j = 0; j < columns; j++) {
    out[j] = 0.0;
    for (int i = 0; i < NX; i++) out[j] += r[i] * a[j * NX + i];
  }
}

/* What samples earlier than the step show, or with `side` 1 later ones: of the state then, by its rates under u to second
 * order and dry friction.  Between two states of a model in steps lies the straight line, beyond them a parabola. */
static void shifted(const Run *run, int side, const double *early, const double *x, const double *u, const double *m,
                    double *y, double *hx, double *hw) {
  static double f[MOST_NX], a[MOST_NX * MOST_NX], b[MOST_NX * MOST_NW + 1], second[MOST_NX], then[MOST_NX], kept[MOST_NX];
  static double a2[MOST_NX * MOST_NX], b2[MOST_NX * MOST_NW + 1], r[MOST_NX], ra[MOST_NX], raa[MOST_NX];
  static double y1[MOST_NY], hx1[MOST_NY * MOST_NX], hw1[MOST_NY * MOST_NW + 1], rb[MOST_NW + 1], rab[MOST_NW + 1];
  sloped(kf_fj, NX, x, u, m, run->p, f, a, b);
  if (DISCRETE) sloped(kf_fj, NX, f, u, m, run->p, second, a2, b2);
  for (int i = 0; !DISCRETE && i < NX; i++) {
    second[i] = 0.0;
    for (int j = 0; j < NX; j++) second[i] += a[j * NX + i] * f[j];
  }
#if MOST_AXES
  static double dry[2 * MOST_AXES];
  Sliding rubbed[MOST_AXES];
  if (AXES) call(kf_dry, x, u, m, run->p, dry, 0, 0);
#endif
  for (int o = 0; o < NY; o++) {
    const double e = early[o], half = 0.5 * e * e, parts = e / STEP;
    if (e == 0.0 || (e < 0.0) != side) continue;
    const int between = parts < 0.0 && parts >= -1.0 - 1e-6;
    /* by f and `second`: of a model in steps the next two states, of others x' and x'' */
    const double one = !DISCRETE ? -e : between ? -parts : -2.0 * parts - parts * parts;
    const double two = !DISCRETE ? half : between ? 0.0 : 0.5 * (parts + parts * parts);
    const double none = DISCRETE ? 1.0 - one - two : 1.0;
    for (int i = 0; i < NX; i++) then[i] = none * x[i] + one * f[i] + two * second[i];
#if MOST_AXES
    for (int k = 0; k < AXES; k++) {
      const double v = x[axis_v[k]], free = then[axis_v[k]];
      rubbed[k] = beside(v, (free - v) / one, (Dry){dry[k], dry[AXES + k], run->creep[k]}, one);
      then[axis_v[k]] = rubbed[k].y;
      if (axis_q[k] >= 0) then[axis_q[k]] += rubbed[k].went - 0.5 * one * (v + free);
    }
#endif
    sloped(kf_hj, NY, then, u, m, run->p, y1, hx1, hw1);
    y[o] = y1[o];
    for (int i = 0; i < NX; i++) r[i] = hx1[i * NY + o];
    COPY(kept, r, NX);
#if MOST_AXES
    for (int k = 0; k < AXES; k++) { /* the speed, and the place with it, keep and follow what friction lets them */
      const int v = axis_v[k], q = axis_q[k];
      const double by = r[v] + (q >= 0 ? 0.5 * one * r[q] : 0.0);
      kept[v] += by * (rubbed[k].kept - 1.0);
      r[v] += by * (rubbed[k].followed - 1.0);
    }
#endif
    times(r, a, NX, ra);
    times(r, b, NW, rb);
    if (DISCRETE) { /* of the step after the next: r a2 a, r (a2 b + b2) */
      static double through[MOST_NX];
      times(r, a2, NX, through);
      times(through, a, NX, raa);
      times(through, b, NW, rab);
      for (int i = 0; i < NW; i++) {
        for (int j = 0; j < NX; j++) rab[i] += r[j] * b2[i * NX + j];
      }
    } else {
      times(ra, a, NX, raa);
      times(ra, b, NW, rab);
    }
    for (int i = 0; i < NX; i++) hx[i * NY + o] = none * kept[i] + one * ra[i] + two * raa[i];
    for (int i = 0; i < NW; i++) hw[i * NY + o] = hw1[i * NY + o] + one * rb[i] + two * rab[i];
  }
}

/* Outputs with d/dx, d/dw under inputs u; those before, which an earlier sample saw, are `before`. */
static void shown(const Run *run, const double *x, const double *before, const double *u, const double *m, double *y,
                  double *hx, double *hw) {
  const double *early = u + EARLY;
  int earlier = 0, later = 0;
  for (int o = 0; o < NY; o++) {
    earlier |= early[o] > 0.0;
    later |= early[o] < 0.0;
  }
  sloped(kf_hj, NY, x, u, m, run->p, y, hx, hw);
  if (earlier) shifted(run, 0, early, x, before, m, y, hx, hw);
  if (later) shifted(run, 1, early, x, u, m, y, hx, hw);
}

/* An innovation without what lies beyond `most`, unless the one before was out on the same side or many lately were:
 * then the filter is lost, not the sensor.  Continuous in all of them, or the likelihood would have steps. */
static Counted trusted(double error, double most, double *side, double *often) {
  const double share = error > most ? 1.0 : error < -most ? -1.0 : error / most, sign = error > 0.0 ? 1.0 : -1.0;
  const double by_side = fmin(fmax(2.0 * sign * *side - 1.0, 0.0), 1.0), by_many = fmin(fmax(5.0 * *often - 4.0, 0.0), 1.0);
  const double counted = fmax(by_side, by_many), beyond = error - share * most;
  Counted found = {share * most + counted * beyond, share, most, beyond, fabs(share) < 1.0 ? 0.0 : 1.0 - counted, 0.0, 0.0};
  if (counted > 0.0 && counted < 1.0) {
    if (by_side > by_many) found.side = 2.0 * sign;
    else found.often = 5.0;
  }
  *side = share;
  *often += OFTEN * (fabs(share) - *often);
  return found;
}

/* Steps done: fewer than run->steps where the states run away. */
EXPORT int run_filter(const Run *run) {
  const int n = run->active, wide = n + NW, *at = run->state;
  static double x[MOST_NX], alone[MOST_NX], P[MOST_N * MOST_N], stepped[MOST_N * MOST_N];
  static double u[MOST_NU], last[MOST_NU], free[MOST_NU], memory[MOST_NI + 1], next[MOST_NI + 1];
  static double y[MOST_NY], hx[MOST_NY * MOST_NX], hw[MOST_NY * MOST_NW + 1], gain[MOST_N], row[MOST_N], moved[MOST_N];
  static V total[MOST_N * MOST_QUADS];
  static Slopes slopes;
  double w[MOST_NW + 1], side[MOST_NY], often[MOST_NY]; /* where the innovation before was, and how far they were lately, in CLIP */
  CLEAR(w, NW);
  CLEAR(side, NY);
  CLEAR(often, NY);
  CLEAR(P, N * N);
  COPY(x, run->x0, NX);
  CLEAR(memory, NI);
  for (int pass = 0; pass < 2 && NI + NH; pass++) { /* the memory of one may begin where another one's is */
    const double *arg[5] = {memory, x, run->u, run->m, run->p};
    double *res[2] = {next, x + NX - NH};
    kf_first(arg, res, iscratch, scratch, 0);
    COPY(memory, next, NI);
  }
  for (int i = 0; i < n; i++) P[i * wide + i] = run->p0[at[i]];
  for (int i = 0; i < NW; i++) P[(n + i) * wide + n + i] = run->sigma[i] * run->sigma[i];
  if (run->de) noise_begin(run, n);
  for (int k = 0; k < run->steps; k++) {
    const int window = run->window ? run->window[k] : 0;
    if (k > 0) {
      const double *before = AT(run->u, k - 1, NU), *m = AT(run->m, k - 1, NM), dt = before[DT];
      if (window) {
        if (window != run->window[k - 1]) COPY(alone, x, NX);
        COPY(next, memory, NI);
        if (!advance(run, alone, before, 0, next, u, m, &slopes, 0)) return k;
        COPY(free, u, NU); /* without disturbances, which `last` has */
      }
      double *transition = run->phi ? AT(run->phi, k, wide * wide) : stepped;
      if (!advance(run, x, before, w, memory, u, m, &slopes, total)) return k;
      spread(P, total, n);
      for (int i = 0; (run->phi || run->de) && i < wide * wide; i++) {
        transition[i] = i < n * wide ? ((double *)total)[i % wide * ROW + i / wide] : i % (wide + 1) == 0;
      }
      if (run->de) {
        noise_move(transition, n);
        noise_shake(run, slopes.b, dt, w, P);
      }
      shake(run, slopes.b, dt, w, P);
      COPY(last, u, NU);
      for (int i = 0; i < NW; i++) transition[(n + i) * (wide + 1)] = exp(-dt * run->keep[i]);
    }
    if (run->before) COPY(AT(run->before, k, wide * wide), P, wide * wide);
    for (int i = 0; run->ahead && i < wide; i++) AT(run->ahead, k, wide)[i] = i < n ? x[at[i]] : w[i - n];
    const double *now = AT(run->u, k, NU), *m = AT(run->m, k, NM);
    const double *arg[4] = {memory, now, m, run->p};
    double *res[2] = {u, next};
    kf_in(arg, res, iscratch, scratch, 0);
    if (window && run->free) shown(run, alone, k ? free : u, u, m, AT(run->free, k, NY), hx, hw);
    if (window && run->zfree) COPY(AT(run->zfree, k, NX), alone, NX);
    for (int i = 0; i < NW; i++) u[W0 + i] = now[W0 + i] + w[i];
    int seen_any = 0;
    for (int o = 0; o < NY; o++) seen_any |= !isnan(AT(run->y, k, NY)[o]);
    if (seen_any) shown(run, x, k ? last : u, u, m, y, hx, hw);
    CLEAR(moved, N);
    for (int o = 0; o < NY; o++) {
      const double seen = AT(run->y, k, NY)[o];
      double *e = AT(run->e, k, NY) + o, *s = AT(run->s, k, NY) + o;
      *e = *s = NAN;
      if (isnan(seen)) continue;
      double size = run->r[o];
      for (int i = 0; i < n; i++) row[i] = hx[at[i] * NY + o];
      for (int i = 0; i < NW; i++) row[n + i] = hw[i * NY + o];
      for (int i = 0; i < wide; i++) {
        double sum = 0.0;
        for (int j = 0; j < wide; j++) sum += P[i * wide + j] * row[j];
        gain[i] = sum;
      }
      for (int i = 0; i < wide; i++) size += row[i] * gain[i];
      double error = seen - y[o]; /* less what the outputs before it have moved, by the one linearisation */
      for (int i = 0; i < wide; i++) error -= row[i] * moved[i];
      if (!isfinite(error) || !(size > 0.0)) return k;
      *e = error;
      *s = size;
      const Counted counted = k > 3 ? trusted(error, CLIP * sqrt(size), side + o, often + o) : (Counted){error, 0.0, NEVER, 0.0, 0.0, 0.0, 0.0};
      const int slope = 4 * LANES * o;
      if (run->de) noise_see(o, wide, row, gain, size, counted, AT(run->de, k, 4 * NY * LANES) + slope, AT(run->ds, k, 4 * NY * LANES) + slope);
      error = counted.kept;
      for (int i = 0; i < wide; i++) moved[i] += gain[i] / size * error;
      for (int i = 0; i < wide; i++) {
        for (int j = 0; j < wide; j++) P[i * wide + j] -= gain[i] * gain[j] / size;
      }
    }
    if (run->de) noise_correct(wide);
    for (int i = 0; i < n; i++) x[at[i]] += moved[i];
    for (int i = 0; i < NW; i++) w[i] += moved[n + i];
    if (run->after) COPY(AT(run->after, k, wide * wide), P, wide * wide);
    if (run->z) {
      COPY(AT(run->z, k, N), x, NX);
      COPY(AT(run->z, k, N) + NX, w, NW);
    }
    if (run->v) {
      double *v = AT(run->v, k, N);
      CLEAR(v, N);
      for (int i = 0; i < n; i++) v[at[i]] = P[i * wide + i];
      for (int i = 0; i < NW; i++) v[NX + i] = P[(n + i) * wide + n + i];
    }
  }
  return run->steps;
}
