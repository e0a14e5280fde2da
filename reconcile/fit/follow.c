/* Simulates a window of an extended model and carries the sensitivities of its states and outputs along.
 *
 * Compiled together with generated equations, dense and column-major unless said otherwise:
 *   rx_f  (x, u, m, p) -> f
 *   rx_fj (x, u, m, p) -> f, df/dx
 *   rx_d  (x, u, m, p) -> f, df/dx, df/du, df/dp (its nonzeros, pattern in follow.h)
 *   rx_h  (x, u, m, p) -> y
 *   rx_hd (x, u, m, p) -> y, dy/dx, dy/dp (its nonzeros)
 *
 * A step is SDIRK2 (Alexander 1977: two stages, L-stable, gamma = 1 - 1/sqrt 2) solved by Newton's method with the
 * exact Jacobian, so that the sensitivities are those of the very numbers computed; while the Jacobian of where the
 * step before ended serves (simplified Newton), it is not computed again.  A step in which f bends by more than the tolerance
 * is halved, at most DEPTH times.  A discrete model takes f as its next state.
 * States that are not active stay as they are and cost nothing.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "follow.h" /* generated: NX, NU, NM, NP, NY, patterns, DISCRETE, work sizes */

typedef int Function(const double **arg, double **res, long long *iw, double *w, int mem);
Function rx_f, rx_fj, rx_d, rx_h, rx_hd;

#define GAMMA 0.29289321881345254
#define DEPTH 6
#define ITERATIONS 12
#define QUICK 10   /* iterations with the Jacobian of near the step's start */
#define LANES 4    /* columns that a processor works on at once */
#define SOLVED 1e-14 /* squared residual, in sizes of the states, below which an iteration is the last */
#define AT_REST 1e-22 /* below which there is none: a slow state moves by less than SOLVED in a step */
#define SHRINKS 0.1 /* of the squared residual: slower than that, and the Jacobian is computed again */

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef double Lanes __attribute__((vector_size(LANES * sizeof(double))));

typedef struct {
  int steps;           /* of the window */
  double h;            /* s, one step */
  int active;          /* how many states are active */
  const int *state;    /* which they are */
  int columns;         /* sensitivities by parameters; those by the active states' starts come first */
  const int *parameter; /* of each column, -1: none */
  const int *input;     /* of each column: the input that its delay shifts, -1: none */
  const int *first, *last; /* of each column: the steps in which it acts */
  const double *u;      /* NU a step */
  const double *shift;  /* NU a step: d u / d delay */
  const double *m;      /* NM a step */
  const double *p;
  const double *scale;  /* NX: sizes of the states */
  const double *tolerance; /* NX: error of a state above which a step is halved */
  int cut_input;           /* the input that changes within steps, -1: none */
  int cut_moves;           /* whether columns that shift it move the change */
  const double *cut_share, *cut_after; /* by step: the share before the change (0: none), the input after it */
  long long *calls; /* of rx_f, rx_fj, rx_d, rx_h, rx_hd, counted up */
} Window;

/* The equations linearised at a point, and the factors of I - c J there. */
typedef struct {
  double fu[NX * NU], fp[NNZ_FP + 1], lu[NX * NX];
  int pivot[NX];
  int below[NX], above[NX], row_below[NX * NX], row_above[NX * NX]; /* by column: what is not zero, and where */
} Tangent;

typedef struct {
  const Window *r;
  const double *u, *shift, *m;
  int n, ns, step;
  int stride;      /* of a row of sensitivities: ns, and some that stay zero */
  double *w;       /* work */
  double *s, *next, *rows; /* sensitivities: a row of columns for each state; room for as many */
  long long *iw;
  Tangent *at, stages[2]; /* `at` is the one in use */
  int near;        /* whether j is the Jacobian of a point near x: where the step before ended */
  double factored; /* c of the factors in stages[1], which are of j */
  double x[NX], f[NX], j[NX * NX];
  int place[NX]; /* of a state among the active ones, -1: not active */
} Run;

static void evaluate(Run *k, Function *function, const double *x, double *second, double *third, double *fourth) {
  const double *arg[8] = {x, k->u, k->m, k->r->p};
  double *res[8] = {k->f, second, third, fourth};
  k->r->calls[function == rx_f ? 0 : function == rx_fj ? 1 : 2]++;
  function(arg, res, k->iw, k->w, 0);
}

/* Lists what is not zero of the factors: with many effects at once most of them is. */
static void list(Tangent *t, int n) {
  for (int i = 0; i < n; i++) {
    t->below[i] = t->above[i] = 0;
    for (int row = 0; row < i; row++)
      if (t->lu[i * NX + row] != 0.0) t->row_above[i * NX + t->above[i]++] = row;
    for (int row = i + 1; row < n; row++)
      if (t->lu[i * NX + row] != 0.0) t->row_below[i * NX + t->below[i]++] = row;
  }
}

/* LU of I - c J over the active states; 0 if singular. */
static int factorise(Run *k, double c) {
  const int n = k->n;
  const int *a = k->r->state;
  double *lu = k->at->lu;
  int *pivot = k->at->pivot;
  for (int col = 0; col < n; col++)
    for (int row = 0; row < n; row++)
      lu[col * NX + row] = (row == col ? 1.0 : 0.0) - c * k->j[a[col] * NX + a[row]];
  for (int i = 0; i < n; i++) {
    int best = i;
    for (int row = i + 1; row < n; row++)
      if (fabs(lu[i * NX + row]) > fabs(lu[i * NX + best])) best = row;
    pivot[i] = best;
    if (!(fabs(lu[i * NX + best]) > 0.0)) return 0;
    if (best != i)
      for (int col = 0; col < n; col++) {
        const double t = lu[col * NX + i];
        lu[col * NX + i] = lu[col * NX + best];
        lu[col * NX + best] = t;
      }
    int right[NX], many = 0;
    for (int col = i + 1; col < n; col++)
      if (lu[col * NX + i] != 0.0) right[many++] = col;
    for (int row = i + 1; row < n; row++) {
      if (lu[i * NX + row] == 0.0) continue;
      const double factor = lu[i * NX + row] /= lu[i * NX + i];
      for (int c = 0; c < many; c++) lu[right[c] * NX + row] -= factor * lu[right[c] * NX + i];
    }
  }
  list(k->at, n);
  return 1;
}

/* b (active entries in order) becomes the solution. */
static void solve(const Run *k, double *b) {
  const Tangent *at = k->at;
  const int n = k->n, *pivot = at->pivot;
  const double *lu = at->lu;
  for (int i = 0; i < n; i++) {
    const double t = b[pivot[i]];
    b[pivot[i]] = b[i];
    b[i] = t;
  }
  for (int i = 0; i < n; i++) { /* most columns are mostly zero */
    if (b[i] == 0.0) continue;
    for (int e = 0; e < at->below[i]; e++) {
      const int row = at->row_below[i * NX + e];
      b[row] -= lu[i * NX + row] * b[i];
    }
  }
  for (int i = n - 1; i >= 0; i--) {
    if (b[i] == 0.0) continue;
    b[i] /= lu[i * NX + i];
    for (int e = 0; e < at->above[i]; e++) {
      const int row = at->row_above[i * NX + e];
      b[row] -= lu[i * NX + row] * b[i];
    }
  }
}

static void exchange(double *a, double *b, int stride) {
  for (int c = 0; c < stride; c++) {
    const double t = a[c];
    a[c] = b[c];
    b[c] = t;
  }
}

/* b -= factor x, rows of sensitivities. */
static void subtract(double *b, const double *x, double factor, int stride) {
  for (int c = 0; c < stride; c += LANES) {
    Lanes to, from;
    memcpy(&to, b + c, sizeof to);
    memcpy(&from, x + c, sizeof from);
    to -= factor * from;
    memcpy(b + c, &to, sizeof to);
  }
}

/* As solve, for all columns at once: b has n rows of them, `stride` apart. */
static void solve_rows(const Run *k, double *b) {
  const Tangent *at = k->at;
  const int n = k->n, stride = k->stride;
  const double *lu = at->lu;
  double *row[NX];
  for (int i = 0; i < n; i++) row[i] = b + (size_t)i * (size_t)stride;
  for (int i = 0; i < n; i++)
    if (at->pivot[i] != i) exchange(row[i], row[at->pivot[i]], stride);
  for (int i = 0; i < n; i++)
    for (int e = 0; e < at->below[i]; e++) {
      const int below = at->row_below[i * NX + e];
      subtract(row[below], row[i], lu[i * NX + below], stride);
    }
  for (int i = n - 1; i >= 0; i--) {
    for (int c = 0; c < stride; c++) row[i][c] /= lu[i * NX + i];
    for (int e = 0; e < at->above[i]; e++) {
      const int above = at->row_above[i * NX + e];
      subtract(row[above], row[i], lu[i * NX + above], stride);
    }
  }
}

/* What a stage at x leaves with f as it is there, in r; squared, in sizes of the states. */
static double left(const Run *k, const double *base, const double *x, double c, double *r) {
  double size = 0.0;
  for (int i = 0; i < k->n; i++) {
    const int a = k->r->state[i];
    r[i] = base[a] + c * k->f[a] - x[a];
    const double e = r[i] / k->r->scale[a];
    size += e * e;
  }
  return size;
}

/* As left, with f computed, and the Jacobian where `j` has room for it. */
static double residual(Run *k, const double *base, const double *x, double c, double *r, double *j) {
  evaluate(k, j ? rx_fj : rx_f, x, j, NULL, NULL);
  return left(k, base, x, c, r);
}

/* Solves x = base + c f(x) from `x` on with the factors that are there; f is left at the solution.  0 if the
 * residual does not shrink quickly; x is then as it was.  `known`: f is that of x. */
static int quick(Run *k, const double *base, double *x, double c, int known) {
  double r[NX], trial[NX];
  memcpy(trial, x, sizeof trial);
  double size = known ? left(k, base, trial, c, r) : residual(k, base, trial, c, r, NULL);
  for (int iteration = 0; isfinite(size) && iteration < QUICK; iteration++) {
    if (size < AT_REST) {
      memcpy(x, trial, sizeof trial);
      return 1;
    }
    solve(k, r);
    for (int i = 0; i < k->n; i++) trial[k->r->state[i]] += r[i];
    const double found = residual(k, base, trial, c, r, NULL);
    if (!(found < SHRINKS * size) && !(found < SOLVED)) return 0;
    size = found < SOLVED ? 0.0 : found;
  }
  return 0;
}

/* As quick, by Newton's method with the Jacobian of every iteration. */
static int stage(Run *k, const double *base, double *x, double c, int known) {
  double r[NX], trial[NX];
  if (quick(k, base, x, c, known)) return 1;
  double size = residual(k, base, x, c, r, k->j);
  for (int iteration = 0; iteration < ITERATIONS; iteration++) {
    if (!isfinite(size) || !factorise(k, c)) return 0;
    if (size < AT_REST) return 1;
    solve(k, r);
    double share = 1.0, found = size;
    for (int halving = 0; halving < 6; halving++) {
      memcpy(trial, x, sizeof trial);
      for (int i = 0; i < k->n; i++) trial[k->r->state[i]] += share * r[i];
      double fresh[NX];
      found = residual(k, base, trial, c, fresh, k->j);
      if (found < size || halving == 5) {
        memcpy(r, fresh, sizeof fresh);
        break;
      }
      share *= 0.5;
    }
    memcpy(x, trial, sizeof trial);
    if (found < SOLVED) break;
    size = found;
  }
  return factorise(k, c);
}

/* Adds c times the derivatives of f by a column's parameter or shifted input to its place in b, rows of columns of
 * the active states. */
static void force(const Run *k, int column, double c, double *b) {
  if (k->step < k->r->first[column] || k->step >= k->r->last[column]) return;
  const int parameter = k->r->parameter[column], input = k->r->input[column];
  b += k->n + column;
  if (parameter >= 0)
    for (int e = FP_COLUMN[parameter]; e < FP_COLUMN[parameter + 1]; e++)
      if (k->place[FP_ROW[e]] >= 0) b[k->place[FP_ROW[e]] * k->stride] += c * k->at->fp[e];
  if (input >= 0)
    for (int i = 0; i < k->n; i++)
      b[i * k->stride] += c * k->at->fu[input * NX + k->r->state[i]] * k->shift[input];
}

/* The row of sensitivities of the i-th active state. */
static double *row_of(const Run *k, double *s, int i) { return s + (size_t)k->r->state[i] * (size_t)k->stride; }

/* Sensitivities after a stage: solves M s = given + c * forcing. */
static void carry(Run *k, double *given, double *into, double c) {
  const size_t size = (size_t)k->stride * sizeof(double);
  for (int i = 0; i < k->n; i++) memcpy(k->rows + i * k->stride, row_of(k, given, i), size);
  for (int column = 0; column < k->ns - k->n; column++) force(k, column, c, k->rows);
  solve_rows(k, k->rows);
  for (int i = 0; i < k->n; i++) memcpy(row_of(k, into, i), k->rows + i * k->stride, size);
}

static int bends(Run *k, const double *f0, const double *f1, const double *f2, double h) {
  double e[NX];
  for (int i = 0; i < k->n; i++) {
    const int a = k->r->state[i];
    e[i] = 0.1 * h * ((f2[a] - f1[a]) / (1.0 - GAMMA) - (f1[a] - f0[a]) / GAMMA);
  }
  solve(k, e);
  for (int i = 0; i < k->n; i++)
    if (!(fabs(e[i]) < k->r->tolerance[k->r->state[i]])) return 1;
  return 0;
}

/* f at x, and factors of I - c J of near there. */
static int begin(Run *k, double c) {
  evaluate(k, k->near ? rx_f : rx_fj, k->x, k->near ? NULL : k->j, NULL, NULL);
  k->at = &k->stages[1];
  const int known = k->near && k->factored == c;
  k->factored = c;
  return known || factorise(k, c);
}

static int advance(Run *k, double h, int depth) {
  double f0[NX], f1[NX], x1[NX], x2[NX], base[NX];
  const int sens = k->ns > 0;
  int fine = begin(k, GAMMA * h);
  memcpy(f0, k->f, sizeof f0);
  memcpy(x1, k->x, sizeof x1);
  fine = fine && stage(k, k->x, x1, GAMMA * h, 1);
  memcpy(f1, k->f, sizeof f1);
  memcpy(base, k->x, sizeof base);
  for (int i = 0; i < k->n; i++) base[k->r->state[i]] += (1.0 - GAMMA) * h * f1[k->r->state[i]];
  memcpy(x2, x1, sizeof x2);
  for (int i = 0; i < k->n; i++) x2[k->r->state[i]] += (1.0 - GAMMA) * h * f1[k->r->state[i]];
  fine = fine && stage(k, base, x2, GAMMA * h, 0);
  k->near = fine; /* where that failed the last Jacobian may be of anywhere */
  if (depth < DEPTH && (!fine || bends(k, f0, f1, k->f, h)))
    return advance(k, 0.5 * h, depth + 1) && advance(k, 0.5 * h, depth + 1);
  if (!fine) return 0;
  if (sens) {
    for (int i = 0; i < 2; i++) {
      k->at = &k->stages[i];
      if (k->ns > k->n)
        evaluate(k, rx_d, i ? x2 : x1, k->j, k->at->fu, k->at->fp);
      else /* by initial states alone */
        evaluate(k, rx_fj, i ? x2 : x1, k->j, NULL, NULL);
      if (!factorise(k, GAMMA * h)) return 0;
    }
    k->at = &k->stages[0];
    carry(k, k->s, k->next, GAMMA * h); /* dX1 */
    for (int i = 0; i < k->n; i++) { /* S + h (1 - g) dF1, dF1 = (dX1 - S) / (h g) */
      const double *s = row_of(k, k->s, i);
      double *next = row_of(k, k->next, i);
      for (int c = 0; c < k->ns; c++) next[c] = s[c] + (1.0 - GAMMA) / GAMMA * (next[c] - s[c]);
    }
    k->at = &k->stages[1];
    carry(k, k->next, k->s, GAMMA * h);
  }
  memcpy(k->x, x2, sizeof x2);
  return 1;
}

/* A step of h in which an input changes: up to there with the one value, from there on with the other.  Where a
 * column moves the change by a time, the state moves by as much of the difference of f. */
static int change(Run *k, double h) {
  const double share = k->r->cut_share[k->step];
  const int input = k->r->cut_input;
  double u[NU], before[NX];
  if (!advance(k, share * h, 0)) return 0;
  evaluate(k, rx_f, k->x, NULL, NULL, NULL);
  memcpy(before, k->f, sizeof before);
  memcpy(u, k->u, sizeof u);
  u[input] = k->r->cut_after[k->step];
  k->u = u;
  evaluate(k, rx_f, k->x, NULL, NULL, NULL);
  for (int c = k->n; k->r->cut_moves && c < k->ns; c++)
    for (int i = 0; k->r->input[c - k->n] == input && i < k->n; i++)
      row_of(k, k->s, i)[c] += before[k->r->state[i]] - k->f[k->r->state[i]];
  return advance(k, (1.0 - share) * h, 0);
}

static int jump(Run *k) {
  const int *a = k->r->state;
  const size_t size = (size_t)k->stride * sizeof(double);
  k->at = &k->stages[0];
  if (k->ns)
    evaluate(k, rx_d, k->x, k->j, k->at->fu, k->at->fp);
  else
    evaluate(k, rx_f, k->x, NULL, NULL, NULL);
  memset(k->rows, 0, (size_t)k->n * size);
  for (int column = 0; column < k->ns - k->n; column++) force(k, column, 1.0, k->rows);
  for (int i = 0; k->ns && i < k->n; i++)
    for (int c = 0; c < k->n; c++) {
      const double factor = k->j[a[c] * NX + a[i]];
      if (factor != 0.0) subtract(k->rows + i * k->stride, row_of(k, k->s, c), -factor, k->stride);
    }
  for (int i = 0; i < k->n; i++) memcpy(row_of(k, k->s, i), k->rows + i * k->stride, size);
  for (int i = 0; i < k->n; i++) k->x[a[i]] = k->f[a[i]];
  return 1;
}

/* Whether all of them are numbers that a fit can use. */
static int usable(const double *values, size_t count, double most) {
  for (size_t i = 0; i < count; i++)
    if (!(fabs(values[i]) < most)) return 0;
  return 1;
}

static int show(Run *k, double *y, double *ys) {
  double hx[NY * NX], hp[NNZ_HP + 1];
  const double *arg[8] = {k->x, k->u, k->m, k->r->p};
  double *res[8] = {y, hx, hp};
  k->r->calls[ys ? 4 : 3]++;
  if (!ys) {
    rx_h(arg, res, k->iw, k->w, 0);
    return usable(y, NY, INFINITY);
  }
  rx_hd(arg, res, k->iw, k->w, 0);
  memset(ys, 0, (size_t)k->ns * NY * sizeof *ys);
  for (int c = k->n; c < k->ns; c++) {
    const int parameter = k->r->parameter[c - k->n];
    if (parameter >= 0)
      for (int e = HP_COLUMN[parameter]; e < HP_COLUMN[parameter + 1]; e++) ys[c * NY + HP_ROW[e]] = hp[e];
  }
  for (int i = 0; i < k->n; i++) {
    const double *s = row_of(k, k->s, i), *slope = hx + k->r->state[i] * NY;
    for (int o = 0; o < NY; o++)
      for (int c = 0; slope[o] != 0.0 && c < k->ns; c++) ys[c * NY + o] += slope[o] * s[c];
  }
  return usable(y, NY, INFINITY) && usable(ys, (size_t)k->ns * NY, 1e100);
}

/* States x (NX) and outputs y (NY) at steps + 1 times, and unless null d outputs, (active + columns) x NY a
 * time.  Returns the number of rows written: fewer than steps + 1 if they are no longer finite; -1: no room. */
EXPORT int follow(const Window *r, const double *x0, double *x, double *y, double *ys) {
  Run *k = calloc(1, sizeof *k);
  const int ns = ys ? r->active + r->columns : 0, stride = (ns + LANES - 1) / LANES * LANES;
  const size_t rows = (size_t)stride * NX;
  double *room = calloc((size_t)SZ_W + 3 * rows, sizeof *room);
  long long *iw = calloc(SZ_IW, sizeof *iw);
  int done = -1;
  if (k && room && iw) {
    k->r = r, k->n = r->active, k->ns = ns, k->stride = stride;
    k->w = room, k->s = room + SZ_W, k->next = k->s + rows, k->rows = k->next + rows, k->iw = iw;
    memcpy(k->x, x0, sizeof k->x);
    for (int i = 0; i < NX; i++) k->place[i] = -1;
    for (int i = 0; i < k->n; i++) k->place[r->state[i]] = i;
    for (int i = 0; ns && i < k->n; i++) row_of(k, k->s, i)[i] = 1.0;
    for (done = 0;;) {
      const int row = done < r->steps ? done : r->steps - 1;
      k->step = row;
      k->u = r->u + (size_t)row * NU, k->m = r->m + (size_t)row * NM;
      k->shift = r->shift + (size_t)row * NU;
      memcpy(x + (size_t)done * NX, k->x, sizeof k->x);
      if (!show(k, y + (size_t)done * NY, ys ? ys + (size_t)done * NY * (size_t)ns : NULL)) break;
      if (done++ == r->steps) break;
      const int cut = r->cut_input >= 0 && r->cut_share[row] > 0.0;
      if (DISCRETE ? !jump(k) : cut ? !change(k, r->h) : !advance(k, r->h, 0)) break;
      int finite = 1;
      for (int i = 0; i < k->n; i++) finite = finite && fabs(k->x[r->state[i]]) < 1e12;
      if (!finite) break;
    }
  }
  free(k);
  free(room);
  free(iw);
  return done;
}

/* Outputs and their slopes between rows: of each of n samples its `output`, and `near` rows with what they weigh
 * for its value and for its slope by the row.  Into `at` [n], `moved` [n] and `slopes` [n, ns]. */
EXPORT void sample(int n, int near, const int *output, const int *row, const double *value, const double *rate,
                   int ns, const double *y, const double *ys, double *at, double *moved, double *slopes) {
  for (int i = 0; i < n; i++) {
    at[i] = moved[i] = 0.0;
    double *to = slopes + (size_t)i * (size_t)ns;
    for (int c = 0; c < ns; c++) to[c] = 0.0;
    for (int j = i * near; j < (i + 1) * near; j++) {
      const double y_there = y[(size_t)row[j] * NY + (size_t)output[i]];
      at[i] += value[j] * y_there;
      moved[i] += rate[j] * y_there;
      const double *from = ys + (size_t)row[j] * (size_t)ns * NY + output[i];
      for (int c = 0; c < ns; c++) to[c] += value[j] * from[c * NY];
    }
  }
}
