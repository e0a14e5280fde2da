/* z += x y (tr: x' y), dense, column-major; what CasADi's own routine of this name computes, to the last bit.
 *
 * Every z[j] gains its terms in the same order, one at a time; but the columns of x are walked along memory,
 * eight at a time, in loops over j that compilers turn into vector instructions without reordering a sum.
 */
static void casadi_mtimes_dense(const casadi_real *x, casadi_int nrow_x, casadi_int ncol_x, const casadi_real *y,
                                casadi_int ncol_y, casadi_real *z, casadi_int tr) {
  const casadi_int whole = ncol_x - ncol_x % 8;
  for (casadi_int i = 0; i < ncol_y; ++i) {
    if (tr) {
      for (casadi_int j = 0; j < ncol_x; ++j)
        for (casadi_int k = 0; k < nrow_x; ++k) z[j + i * ncol_x] += x[k + j * nrow_x] * y[k + i * nrow_x];
      continue;
    }
    const casadi_real *const b = y + i * ncol_x;
    casadi_real *restrict const c = z + i * nrow_x;
    for (casadi_int k = 0; k < whole; k += 8) {
      const casadi_real *const a = x + k * nrow_x;
      const casadi_real b0 = b[k], b1 = b[k + 1], b2 = b[k + 2], b3 = b[k + 3];
      const casadi_real b4 = b[k + 4], b5 = b[k + 5], b6 = b[k + 6], b7 = b[k + 7];
      const casadi_real *const a1 = a + nrow_x, *const a2 = a1 + nrow_x, *const a3 = a2 + nrow_x;
      const casadi_real *const a4 = a3 + nrow_x, *const a5 = a4 + nrow_x, *const a6 = a5 + nrow_x;
      const casadi_real *const a7 = a6 + nrow_x;
      for (casadi_int j = 0; j < nrow_x; ++j) {
        casadi_real sum = c[j];
        sum += a[j] * b0;
        sum += a1[j] * b1;
        sum += a2[j] * b2;
        sum += a3[j] * b3;
        sum += a4[j] * b4;
        sum += a5[j] * b5;
        sum += a6[j] * b6;
        sum += a7[j] * b7;
        c[j] = sum;
      }
    }
    for (casadi_int k = whole; k < ncol_x; ++k)
      for (casadi_int j = 0; j < nrow_x; ++j) c[j] += x[j + k * nrow_x] * b[k];
  }
}
