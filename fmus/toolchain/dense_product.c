/* z += x y (tr: x' y), dense, column-major: CasADi's routine of this name, made faster.
 *
 * Every z[j] gains its terms in the same order, one at a time, so the sums are the same to the last bit.  But the
 * columns of x are walked along memory, eight at a time, in loops over j that compilers turn into vector
 * instructions without reordering a sum; and columns that y multiplies by zero (half of them behind a ReLU)
 * are left out.  x must be finite, as weights are.
 */
static void add_columns(const casadi_real *const *a, const casadi_real *b, casadi_real *restrict z, casadi_int n) {
  const casadi_real *const a0 = a[0], *const a1 = a[1], *const a2 = a[2], *const a3 = a[3];
  const casadi_real *const a4 = a[4], *const a5 = a[5], *const a6 = a[6], *const a7 = a[7];
  const casadi_real b0 = b[0], b1 = b[1], b2 = b[2], b3 = b[3], b4 = b[4], b5 = b[5], b6 = b[6], b7 = b[7];
  for (casadi_int j = 0; j < n; ++j) {
    casadi_real sum = z[j];
    sum += a0[j] * b0;
    sum += a1[j] * b1;
    sum += a2[j] * b2;
    sum += a3[j] * b3;
    sum += a4[j] * b4;
    sum += a5[j] * b5;
    sum += a6[j] * b6;
    sum += a7[j] * b7;
    z[j] = sum;
  }
}

static void casadi_mtimes_dense(const casadi_real *x, casadi_int nrow_x, casadi_int ncol_x, const casadi_real *y,
                                casadi_int ncol_y, casadi_real *z, casadi_int tr) {
  for (casadi_int i = 0; i < ncol_y; ++i) {
    const casadi_real *columns[8];
    casadi_real factors[8];
    int waiting = 0;
    for (casadi_int k = 0; k < ncol_x; ++k) {
      if (tr) {
        for (casadi_int j = 0; j < nrow_x; ++j) z[k + i * ncol_x] += x[j + k * nrow_x] * y[j + i * nrow_x];
      } else if (y[k + i * ncol_x] != 0.0) {
        columns[waiting] = x + k * nrow_x;
        factors[waiting] = y[k + i * ncol_x];
        if (++waiting < 8) continue;
        add_columns(columns, factors, z + i * nrow_x, nrow_x);
        waiting = 0;
      }
    }
    for (int k = 0; k < waiting; ++k)
      for (casadi_int j = 0; j < nrow_x; ++j) z[j + i * nrow_x] += columns[k][j] * factors[k];
  }
}
