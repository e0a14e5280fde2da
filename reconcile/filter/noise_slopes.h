/* Part of filter.c: slopes of innovations and their variances by parameters of the noise, all of them in one run.
 *
 * Slopes of the motion and of the outputs are those at the filter's own states: how the noise moves these slopes is left
 * out, which is nothing for a linear model.  A V holds four parameters; every array has one more index, over LANES of them.
 * Of dP, the slopes of the covariance, only entries [i][j] with j <= i are kept.
 */
#define LANES ((3 * NW + NY + 3) / 4) /* sizes, time constants and white rates of disturbances, noise of outputs */
#define MOST_LANES ((3 * MOST_NW + MOST_NY + 3) / 4)
#define DP(i, j) (dP + ((i) * wide + (j)) * LANES)

static V dx[MOST_N * MOST_LANES], dP[MOST_N * MOST_N * MOST_LANES], dg[MOST_N * MOST_LANES], dmoved[MOST_N * MOST_LANES];
static V dsize[MOST_LANES], derror[MOST_LANES], dside[MOST_NY * MOST_LANES], doften[MOST_NY * MOST_LANES];
static V by_sigma[(MOST_NW + 1) * MOST_LANES], by_keep[(MOST_NW + 1) * MOST_LANES], by_white[(MOST_NW + 1) * MOST_LANES];
static V by_r[MOST_NY * MOST_LANES];

static void add(V *to, double a, const V *v) {
  for (int t = 0; t < LANES; t++) to[t] += a * v[t];
}

static void noise_begin(const Run *run, int n) {
  const int wide = n + NW;
  CLEAR(dx, N * LANES);
  CLEAR(dP, wide * wide * LANES);
  CLEAR(dmoved, N * LANES);
  CLEAR(dside, NY * LANES);
  CLEAR(doften, NY * LANES);
  COPY((double *)by_sigma, run->by_sigma, 4 * NW * LANES);
  COPY((double *)by_keep, run->by_keep, 4 * NW * LANES);
  COPY((double *)by_white, run->by_white, 4 * NW * LANES);
  COPY((double *)by_r, run->by_r, 4 * NY * LANES);
  for (int i = 0; i < NW; i++) add(DP(n + i, n + i), 2.0 * run->sigma[i], by_sigma + i * LANES);
}

/* Over a step: dP of the states = phi dP phi', of disturbances by states dP phi'; dx = phi dx. */
static void noise_move(const double *phi, int n) {
  if (n > NX) return;
  static V t[MOST_NX * MOST_N * MOST_LANES], moved[MOST_N * MOST_LANES];
  const int wide = n + NW;
  CLEAR(t, n * wide * LANES);
  CLEAR(moved, n * LANES);
  for (int i = 0; i < wide; i++) {
    for (int j = i + 1; j < wide; j++) COPY(DP(i, j), DP(j, i), LANES);
  }
  for (int i = 0; i < n; i++) {
    for (int l = 0; l < wide; l++) {
      const double a = phi[i * wide + l];
      if (a == 0.0) continue;
      for (int j = 0; j < wide * LANES; j++) t[i * wide * LANES + j] += a * dP[l * wide * LANES + j];
      add(moved + i * LANES, a, dx + l * LANES);
    }
  }
  COPY(dx, moved, n * LANES);
  for (int i = 0; i < n; i++) {
    CLEAR(DP(i, 0), (i + 1) * LANES);
    for (int j = 0; j <= i; j++) {
      for (int l = 0; l < wide; l++) {
        if (phi[j * wide + l] != 0.0) add(DP(i, j), phi[j * wide + l], t + (i * wide + l) * LANES);
      }
    }
    for (int j = n; j < wide; j++) COPY(DP(j, i), t + (i * wide + j) * LANES, LANES);
  }
}

/* What `shake` adds, for P and w before it. */
static void noise_shake(const Run *run, const double *b, double dt, const double *w, const double *P) {
  const int n = run->active, wide = n + NW, *at = run->state;
  for (int q = 0; q < NW; q++) {
    const double size = 2.0 * run->white[q] * (DISCRETE ? 1.0 / dt : dt);
    if (size == 0.0) continue;
    for (int i = 0; i < n; i++) {
      for (int j = 0; j <= i; j++) {
        const double a = size * b[q * NX + at[i]] * b[q * NX + at[j]];
        if (a != 0.0) add(DP(i, j), a, by_white + q * LANES);
      }
    }
  }
  double keep[MOST_NW + 1];
  for (int i = 0; i < NW; i++) {
    const double sigma = run->sigma[i];
    const V *by = by_keep + i * LANES;
    keep[i] = exp(-dt * run->keep[i]);
    for (int t = 0; t < LANES; t++) dx[(n + i) * LANES + t] = keep[i] * (dx[(n + i) * LANES + t] - dt * w[i] * by[t]);
    for (int j = 0; j <= n + i; j++) {
      const double share = keep[i] * (j < n ? 1.0 : keep[j - n]), p = -dt * P[(n + i) * wide + j];
      V *d = DP(n + i, j);
      add(d, p, by);
      if (j >= n) add(d, p, by_keep + (j - n) * LANES);
      for (int t = 0; t < LANES; t++) d[t] *= share;
    }
    add(DP(n + i, n + i), 2.0 * sigma * (1.0 - keep[i] * keep[i]), by_sigma + i * LANES);
    add(DP(n + i, n + i), 2.0 * dt * sigma * sigma * keep[i] * keep[i], by);
  }
}

/* What counts of an innovation: all up to `most`, of what is `beyond` all but the share `lost`.  That share falls by `side`
 * and `often` times what the samples before were out by. */
typedef struct {
  double kept, share, most, beyond, lost, side, often;
} Counted;

/* An output seen, before it changes P; de, ds: slopes of its innovation and of the logarithm of its variance. */
static void noise_see(int o, int wide, const double *row, const double *gain, double size, Counted c, double *de, double *ds) {
  CLEAR(dg, wide * LANES);
  CLEAR(derror, LANES);
  COPY(dsize, by_r + o * LANES, LANES);
  for (int j = 0; j < wide; j++) {
    if (row[j] == 0.0) continue;
    for (int i = 0; i < wide; i++) add(dg + i * LANES, row[j], i < j ? DP(j, i) : DP(i, j));
    add(derror, -row[j], dx + j * LANES);
    add(derror, -row[j], dmoved + j * LANES);
  }
  for (int i = 0; i < wide; i++) add(dsize, row[i], dg + i * LANES);
  for (int t = 0; t < LANES; t++) dsize[t] /= size;
  COPY(de, (double *)derror, 4 * LANES);
  COPY(ds, (double *)dsize, 4 * LANES);
  for (int t = 0; t < LANES; t++) { /* of what counts of the error from here on */
    const double inside = fabs(c.share) < 1.0 ? 1.0 : 0.0, out = c.share > 0.0 ? inside : -inside;
    V *side = dside + o * LANES + t, *often = doften + o * LANES + t;
    const V share = inside * (derror[t] / c.most - 0.5 * c.share * dsize[t]);
    derror[t] = (1.0 - c.lost) * derror[t] + 0.5 * c.lost * c.share * c.most * dsize[t];
    derror[t] += c.beyond * (c.side * *side + c.often * *often);
    *side = share;
    *often += OFTEN * (out * share - *often);
  }
  for (int i = 0; i < wide; i++) {
    V *g = dg + i * LANES;
    for (int t = 0; t < LANES; t++) {
      dmoved[i * LANES + t] += c.kept / size * g[t] + gain[i] / size * (derror[t] - c.kept * dsize[t]);
      g[t] = (g[t] - 0.5 * gain[i] * dsize[t]) / size;
    }
    for (int j = 0; j <= i; j++) {
      V *d = DP(i, j);
      for (int t = 0; t < LANES; t++) d[t] -= gain[j] * g[t] + gain[i] * dg[j * LANES + t];
    }
  }
}

/* After all outputs of a sample. */
static void noise_correct(int wide) {
  for (int i = 0; i < wide * LANES; i++) dx[i] += dmoved[i];
  CLEAR(dmoved, wide * LANES);
}
