/* Extended Kalman filter of a model with ports over one recording.
 *
 * Compiled together with generated equations, dense and column-major, each of (x, u, m, p):
 *   kf_f    -> dx/dt (a model in steps: its next state)
 *   kf_fj   -> the same, d/dx, d/dw (w: the disturbances, part of u)
 *   kf_dry  -> speeds per second that dry friction takes off each axis, forwards then backwards
 *   kf_post -> states after a step (memories of sensors move here), d/dx
 *   kf_h    -> outputs; kf_hj -> outputs, d/dx, d/dw
 *   kf_in   (memory, u, m, p) -> u as the model feels it, memory after the step
 *   kf_first (memory, x, u, m, p) -> where the memory and the NH states of effects begin
 *
 * The state is (x, w).  A step is ROS2 (Verwer and others 1999: linearly implicit, order 2, L-stable), then the
 * dry friction as a step of its own: it takes off the speed until that is zero, and what stands goes on only where it is
 * driven by more.  Each w is an
 * Ornstein-Uhlenbeck process.  Outputs come one at a time; a missing one (NaN) is passed over.
 */
#include <math.h>
#include <string.h>

#include "filter.h" /* generated: NX, NU, NM, NW, NY, NI, AXES, axis_v, axis_q, DT, W0, DISCRETE, SZ_W, SZ_IW */

typedef int Function(const double **arg, double **res, long long *iw, double *w, int mem);
Function kf_f, kf_fj, kf_dry, kf_post, kf_h, kf_hj, kf_in, kf_first;

#define N (NX + NW)
#define GAMMA 0.29289321881345254
#define LEAK 0.1 /* slope of a stuck speed by the one before: a filter that sees none never comes loose */
#define CLIP 4.0 /* deviations beyond which an innovation counts no more */
#define OFTEN 0.3 /* share of a sample in how often innovations lately reached that */

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct {
  int steps, substeps, active;
  const int *state;               /* [active] */
  const double *u;                /* NU a step */
  const double *m;                /* NM a step */
  const double *y;                /* NY a step, NaN: missing */
  const double *p;
  const double *sigma, *keep, *white; /* NW: size of a disturbance, its share kept over 1 s as a rate 1/tau, white rate */
  const double *r;                /* NY: variances of the outputs */
  const double *x0, *p0;          /* NX: start and its variances (< 0: as kf starts it) */
  double *e, *s;                  /* NY a step: innovations and their variances */
  double *z, *v;                  /* N a step, or NULL: filtered states and their variances */
  const int *window;              /* a step, or NULL: number of the window in which the model also runs by itself */
  double *free, *zfree;           /* NY and NX a step, or NULL: what it does there */
  double *phi, *before, *after;   /* W * W a step (W: active + NW), or NULL: transition, variances before and after */
  double *ahead;                  /* W a step, or NULL: what was expected of the step */
} Run;

static double scratch[SZ_W + 1];
static long long iscratch[SZ_IW + 1];

static int call(Function f, const double *x, const double *u, const double *m, const double *p, double *a, double *b,
                double *c) {
  const double *arg[4] = {x, u, m, p};
  double *res[3] = {a, b, c};
  return f(arg, res, iscratch, scratch, 0);
}

/* LU with partial pivoting of a [n x n] row-major; 0 if singular. */
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
    for (int i = k + 1; i < n; i++) {
      double g = a[i * n + k] /= a[k * n + k];
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
    for (int j = 0; j < columns; j++) b[k * columns + j] /= a[k * n + k];
    for (int i = 0; i < k; i++) {
      double g = a[i * n + k];
      if (g != 0.0) {
        for (int j = 0; j < columns; j++) b[i * columns + j] -= g * b[k * columns + j];
      }
    }
  }
}

/* One substep of the active states with its slopes phi [n x (n + NW)] row-major; 0 if it runs away. */
static int substep(const Run *run, double *x, const double *u, const double *m, double h, double *phi, int slopes) {
  static double f[NX], g[NX], a[NX * NX], b[NX * NW + 1], lu[NX * NX], k1[NX * (N + 1)], k2[NX * (N + 1)], ab[NX * N];
  static int pivot[NX];
  const int n = run->active, wide = n + NW, all = slopes ? wide + 1 : 1;
  const int *at = run->state;
  call(kf_fj, x, u, m, run->p, f, a, b);
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < n; j++) ab[i * wide + j] = a[at[j] * NX + at[i]];
    for (int j = 0; j < NW; j++) ab[i * wide + n + j] = b[j * NX + at[i]];
  }
  if (DISCRETE) {
    memcpy(x, f, sizeof f); /* states that follow inputs alone are known: they are not active, but move */
    memcpy(phi, ab, sizeof(double) * (size_t)(n * wide));
  } else {
    static double moved[NX];
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < n; j++) lu[i * n + j] = (i == j) - GAMMA * h * ab[i * wide + j];
    }
    if (!factor(lu, pivot, n)) return 0;
    for (int i = 0; i < n; i++) {
      k1[i * all] = f[at[i]];
      for (int j = 1; j < all; j++) k1[i * all + j] = ab[i * wide + j - 1];
    }
    solve(lu, pivot, n, k1, all);
    memcpy(moved, x, sizeof moved);
    for (int i = 0; i < n; i++) moved[at[i]] += h * k1[i * all];
    call(kf_f, moved, u, m, run->p, g, 0, 0);
    for (int i = 0; i < n; i++) {
      k2[i * all] = g[at[i]] - 2.0 * k1[i * all];
      for (int j = 1; j < all; j++) {
        double t = ab[i * wide + j - 1] - 2.0 * k1[i * all + j];
        for (int l = 0; l < n; l++) t += h * ab[i * wide + l] * k1[l * all + j];
        k2[i * all + j] = t;
      }
    }
    solve(lu, pivot, n, k2, all);
    static double started[NX];
    memcpy(started, x, sizeof started);
    for (int i = 0; i < n; i++) {
      x[at[i]] += h * (1.5 * k1[i * all] + 0.5 * k2[i * all]);
      for (int j = 1; j < all; j++) {
        phi[i * wide + j - 1] = (i == j - 1) + h * (1.5 * k1[i * all + j] + 0.5 * k2[i * all + j]);
      }
    }
#if AXES
    static double dry[2 * AXES];
    call(kf_dry, x, u, m, run->p, dry, 0, 0);
    for (int k = 0; k < AXES; k++) {
      const double forwards = dry[k] * h, backwards = dry[AXES + k] * h;
      if (forwards == 0.0 && backwards == 0.0) continue;
      /* it slows down to where it stops within the step, if it does; from there it goes on or sticks */
      const double v = x[axis_v[k]], old = started[axis_v[k]], driven = v - old;
      double after = v - (old > 0.0 ? forwards : -backwards), slides = 1.0;
      if (old == 0.0 || after * old <= 0.0) {
        const double rest = old == 0.0 ? 1.0 : 1.0 - old / (old - after);
        after = driven > forwards ? rest * (driven - forwards) : driven < -backwards ? rest * (driven + backwards) : 0.0;
        slides = 1.0 - rest;
      }
      const double slope = after == 0.0 ? LEAK : 1.0;
      const double moved = slides == 1.0 ? old + after : slides * old + (1.0 - slides) * after;
      const double back = 0.5 * h * (old + v - moved);
      x[axis_v[k]] = after;
      int row = -1, place = -1;
      for (int i = 0; i < n; i++) {
        if (at[i] == axis_v[k]) row = i;
        if (at[i] == axis_q[k]) place = i;
      }
      if (place >= 0) x[axis_q[k]] -= back;
      for (int j = 0; slopes && j < wide; j++) {
        if (place >= 0) phi[place * wide + j] -= 0.5 * h * (1.0 - slope) * phi[row * wide + j];
        phi[row * wide + j] *= slope;
      }
    }
#endif
  }
  for (int i = 0; i < n; i++) {
    if (!isfinite(x[at[i]]) || fabs(x[at[i]]) > 1e12) return 0;
  }
  return 1;
}

/* Covariance over a substep: P = phi P phi' of the states, the disturbances kept. */
static void spread(double *P, const double *phi, int n) {
  if (n > NX) return;
  static double t[N * N];
  const int wide = n + NW;
  for (int i = 0; i < n; i++) {
    double *row = t + i * wide;
    memset(row, 0, sizeof(double) * (size_t)wide);
    for (int l = 0; l < wide; l++) {
      const double a = phi[i * wide + l];
      if (a == 0.0) continue;
      for (int j = 0; j < wide; j++) row[j] += a * P[l * wide + j];
    }
  }
  for (int i = 0; i < n; i++) {
    double *row = P + i * wide;
    memset(row, 0, sizeof(double) * (size_t)n);
    for (int l = 0; l < wide; l++) {
      const double a = phi[i * wide + l];
      if (a == 0.0) continue;
      for (int j = 0; j < n; j++) row[j] += a * t[j * wide + l];
    }
    for (int j = n; j < wide; j++) row[j] = t[i * wide + j];
  }
  for (int i = 0; i < n; i++) {
    for (int j = n; j < wide; j++) P[j * wide + i] = P[i * wide + j];
    for (int j = 0; j < i; j++) P[i * wide + j] = P[j * wide + i] = 0.5 * (P[i * wide + j] + P[j * wide + i]);
  }
}

/* total = phi total: the transition over all of a step */
static void follow(double *total, const double *phi, int n) {
  static double t[NX * N];
  const int wide = n + NW;
  memset(t, 0, sizeof t);
  for (int i = 0; i < n; i++) {
    for (int l = 0; l < wide; l++) {
      const double a = phi[i * wide + l];
      for (int j = 0; a != 0.0 && j < wide; j++) t[i * wide + j] += a * total[l * wide + j];
    }
  }
  memcpy(total, t, sizeof(double) * (size_t)(n * wide));
}

static int advance(const Run *run, double *x, const double *u, const double *m, double dt, double *P, double *phi,
                   double *total) {
  static double posted[NX], px[NX * NX], full[NX * N];
  const int n = run->active, wide = n + NW, *at = run->state;
  for (int q = 0; q < run->substeps; q++) {
    if (!substep(run, x, u, m, dt / run->substeps, phi, P != 0)) return 0;
    if (P) spread(P, phi, n);
    if (total) follow(total, phi, n);
  }
  if (!POSTS) return 1;
  call(kf_post, x, u, m, run->p, posted, px, 0);
  if (P) {
    memset(full, 0, sizeof full);
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < n; j++) full[i * wide + j] = px[at[j] * NX + at[i]];
    }
    spread(P, full, n);
    if (total) follow(total, full, n);
  }
  for (int i = 0; i < n; i++) x[at[i]] = posted[at[i]];
  return 1;
}

/* What random rates and the disturbances' own motion add over dt. */
static void shake(const Run *run, const double *x, const double *u, const double *m, double dt, double *w, double *P) {
  static double fx[NX], fa[NX * NX], fb[NX * NW + 1];
  const int n = run->active, wide = n + NW, *at = run->state;
  int rough = 0;
  for (int i = 0; i < NW; i++) rough |= run->white[i] > 0.0;
  if (rough) call(kf_fj, x, u, m, run->p, fx, fa, fb);
  for (int q = 0; q < NW && rough; q++) {
    /* a model in steps moves by B w in one of them, else at the rate B w */
    const double size = run->white[q] * run->white[q] * (DISCRETE ? 1.0 / dt : dt);
    for (int i = 0; i < n; i++) {
      for (int j = 0; j < n; j++) P[i * wide + j] += size * fb[q * NX + at[i]] * fb[q * NX + at[j]];
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

/* An innovation without what lies beyond `most`, unless the one before was out on the same side or many lately were:
 * then the filter is lost, not the sensor.  Continuous in all of them, or the likelihood would have steps. */
static double trusted(double error, double most, double *side, double *often) {
  const double share = error > most ? 1.0 : error < -most ? -1.0 : error / most, again = error > 0.0 ? *side : -*side;
  const double by_side = fmin(fmax(2.0 * again - 1.0, 0.0), 1.0), by_many = fmin(fmax(5.0 * *often - 4.0, 0.0), 1.0);
  *side = share;
  *often += OFTEN * (fabs(share) - *often);
  return share * most + fmax(by_side, by_many) * (error - share * most);
}

/* Steps done: fewer than run->steps where the states run away. */
EXPORT int run_filter(const Run *run) {
  const int n = run->active, wide = n + NW, *at = run->state;
  static double x[NX], alone[NX], P[N * N], phi[NX * N], u[NU], memory[NI + 1], next[NI + 1];
  static double y[NY], hx[NY * NX], hw[NY * NW + 1], gain[N], row[N], moved[N];
  double w[NW + 1] = {0}, side[NY], often[NY]; /* where the innovation before was, and how far they were lately, in CLIP */
  memset(side, 0, sizeof side);
  memset(often, 0, sizeof often);
  memset(P, 0, sizeof P);
  memcpy(x, run->x0, sizeof x);
  memset(memory, 0, sizeof memory);
  for (int pass = 0; pass < 2 && NI + NH; pass++) { /* the memory of one may begin where another one's is */
    const double *arg[5] = {memory, x, run->u, run->m, run->p};
    double *res[2] = {next, x + NX - NH};
    kf_first(arg, res, iscratch, scratch, 0);
    memcpy(memory, next, sizeof memory);
  }
  for (int i = 0; i < n; i++) P[i * wide + i] = run->p0[at[i]];
  for (int i = 0; i < NW; i++) P[(n + i) * wide + n + i] = run->sigma[i] * run->sigma[i];
  for (int k = 0; k < run->steps; k++) {
    const int window = run->window ? run->window[k] : 0;
    if (k > 0) {
      const double *before = run->u + (size_t)(k - 1) * NU, *m = run->m + (size_t)(k - 1) * NM, dt = before[DT];
      const double *arg[4] = {memory, before, m, run->p};
      double *res[2] = {u, next};
      kf_in(arg, res, iscratch, scratch, 0);
      if (NI) memcpy(memory, next, sizeof(double) * NI);
      if (window) {
        if (window != run->window[k - 1]) memcpy(alone, x, sizeof x);
        if (!advance(run, alone, u, m, dt, 0, phi, 0)) return k;
      }
      for (int i = 0; i < NW; i++) u[W0 + i] += w[i];
      double *total = run->phi ? run->phi + (size_t)k * (size_t)(wide * wide) : 0;
      for (int i = 0; total && i < wide * wide; i++) total[i] = i % (wide + 1) == 0;
      if (!advance(run, x, u, m, dt, P, phi, total)) return k;
      shake(run, x, u, m, dt, w, P);
      for (int i = 0; total && i < NW; i++) total[(n + i) * (wide + 1)] = exp(-dt * run->keep[i]);
    }
    if (run->before) memcpy(run->before + (size_t)k * (size_t)(wide * wide), P, sizeof(double) * (size_t)(wide * wide));
    for (int i = 0; run->ahead && i < wide; i++) run->ahead[(size_t)k * (size_t)wide + (size_t)i] = i < n ? x[at[i]] : w[i - n];
    const double *now = run->u + (size_t)k * NU, *m = run->m + (size_t)k * NM;
    const double *arg[4] = {memory, now, m, run->p};
    double *res[2] = {u, next};
    kf_in(arg, res, iscratch, scratch, 0);
    if (window && run->free) call(kf_h, alone, u, m, run->p, run->free + (size_t)k * NY, 0, 0);
    if (window && run->zfree) memcpy(run->zfree + (size_t)k * NX, alone, sizeof alone);
    for (int i = 0; i < NW; i++) u[W0 + i] = now[W0 + i] + w[i];
    call(kf_hj, x, u, m, run->p, y, hx, hw);
    memset(moved, 0, sizeof moved);
    for (int o = 0; o < NY; o++) {
      const double seen = run->y[(size_t)k * NY + (size_t)o];
      double *e = run->e + (size_t)k * NY + o, *s = run->s + (size_t)k * NY + o;
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
      error = k > 3 ? trusted(error, CLIP * sqrt(size), side + o, often + o) : error;
      for (int i = 0; i < wide; i++) moved[i] += gain[i] / size * error;
      for (int i = 0; i < wide; i++) {
        for (int j = 0; j < wide; j++) P[i * wide + j] -= gain[i] * gain[j] / size;
      }
    }
    for (int i = 0; i < n; i++) x[at[i]] += moved[i];
    for (int i = 0; i < NW; i++) w[i] += moved[n + i];
    if (run->after) memcpy(run->after + (size_t)k * (size_t)(wide * wide), P, sizeof(double) * (size_t)(wide * wide));
    if (run->z) {
      memcpy(run->z + (size_t)k * N, x, sizeof x);
      memcpy(run->z + (size_t)k * N + NX, w, sizeof(double) * NW);
    }
    if (run->v) {
      double *v = run->v + (size_t)k * N;
      memset(v, 0, sizeof(double) * N);
      for (int i = 0; i < n; i++) v[at[i]] = P[i * wide + i];
      for (int i = 0; i < NW; i++) v[NX + i] = P[(n + i) * wide + n + i];
    }
  }
  return run->steps;
}
