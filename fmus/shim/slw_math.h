/* Deterministic mathematics: the same bits on every platform with IEEE 754 doubles.
 *
 * libm differs between C libraries in the last place of sin, exp, tanh ...; generated code includes this
 * header instead of <math.h> and the compiler is told not to contract a*b+c (-ffp-contract=off).
 * Accuracy (tested against mpmath): at most 2 units in the last place for |x| < 1e5, tanh 3, atan2 2.
 *
 * Argument reductions and polynomials are those of FreeBSD msun / fdlibm 5.3:
 *   Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved. Developed at SunPro, a Sun
 *   Microsystems, Inc. business. Permission to use, copy, modify, and distribute this software is freely
 *   granted, provided that this notice is preserved.
 */
#ifndef SLW_MATH_H
#define SLW_MATH_H

#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
#define SLW_UNUSED __attribute__((unused))
#else
#define SLW_UNUSED
#endif
#define SLW_FN SLW_UNUSED static inline

SLW_FN uint64_t slw_bits(double x) {
  uint64_t b;
  memcpy(&b, &x, sizeof b);
  return b;
}

SLW_FN double slw_from_bits(uint64_t b) {
  double x;
  memcpy(&x, &b, sizeof x);
  return x;
}

SLW_FN double slw_fabs(double x) { return slw_from_bits(slw_bits(x) & 0x7fffffffffffffffULL); }
SLW_FN double slw_fmin(double x, double y) { return x < y ? x : y; }
SLW_FN double slw_fmax(double x, double y) { return x > y ? x : y; }
SLW_FN double slw_sqrt(double x) { return __builtin_sqrt(x); } /* one instruction, correctly rounded */
SLW_FN int slw_is_finite(double x) { return (slw_bits(x) & 0x7ff0000000000000ULL) != 0x7ff0000000000000ULL; }

/* Nearest integer, ties to even, for |x| < 2^51. */
SLW_FN double slw_round_even(double x) { return (x + 6755399441055744.0) - 6755399441055744.0; }

SLW_FN double slw_floor(double x) {
  double r;
  if (!(slw_fabs(x) < 2251799813685248.0)) return x; /* already an integer, infinite or NaN */
  r = slw_round_even(x);
  return r > x ? r - 1.0 : r;
}

SLW_FN double slw_ceil(double x) { return -slw_floor(-x); }

/* x * 2^k for results in the normal range. */
SLW_FN double slw_scale(double x, int k) { return x * slw_from_bits((uint64_t)(1023 + k) << 52); }

/* ---- sine and cosine: kernels on [-pi/4, pi/4] with a low part y1 of the argument ---- */

SLW_FN double slw_sin_kernel(double x, double y) {
  const double z = x * x, v = z * x;
  const double r = 8.33333333332248946124e-03 +
                   z * (-1.98412698298579493134e-04 +
                        z * (2.75573137070700676789e-06 +
                             z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
  return x - ((z * (0.5 * y - v * r) - y) - v * -1.66666666666666324348e-01);
}

SLW_FN double slw_cos_kernel(double x, double y) {
  const double z = x * x;
  const double r =
      z * (4.16666666666666019037e-02 +
           z * (-1.38888888888741095749e-03 +
                z * (2.48015872894767294178e-05 +
                     z * (-2.75573143513906633035e-07 +
                          z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
  const double hz = 0.5 * z, w = 1.0 - hz;
  return w + (((1.0 - w) - hz) + (z * r - x * y));
}

/* x = n*pi/2 + (y0 + y1), |y0| <= pi/4; pi/2 in four parts of 33 bits: exact for |n| < 2^20. */
SLW_FN int slw_reduce(double x, double *y0, double *y1) {
  const double n = slw_round_even(x * 6.36619772367581382433e-01);
  const double r1 = x - n * 1.57079632673412561417e+00;
  const double r2 = r1 - n * 6.07710050630396597660e-11;
  const double e2 = (r1 - r2) - n * 6.07710050630396597660e-11;
  const double t3 = n * 2.02226624871116645580e-21;
  const double r3 = r2 - t3;
  const double low = ((r2 - r3) - t3) + (e2 - n * 8.47842766036889956997e-32);
  *y0 = r3 + low;
  *y1 = (r3 - *y0) + low;
  return (int)((int64_t)n & 3);
}

SLW_FN double slw_sin(double x) {
  double y0, y1;
  if (slw_fabs(x) < 0.785) return slw_sin_kernel(x, 0.0); /* what the reduction would leave */
  if (!(slw_fabs(x) < 1.0e6)) return slw_is_finite(x) ? slw_sin_kernel(0.0, 0.0) : x - x;
  switch (slw_reduce(x, &y0, &y1)) {
  case 0: return slw_sin_kernel(y0, y1);
  case 1: return slw_cos_kernel(y0, y1);
  case 2: return -slw_sin_kernel(y0, y1);
  default: return -slw_cos_kernel(y0, y1);
  }
}

SLW_FN double slw_cos(double x) {
  double y0, y1;
  if (slw_fabs(x) < 0.785) return slw_cos_kernel(x, 0.0);
  if (!(slw_fabs(x) < 1.0e6)) return slw_is_finite(x) ? 1.0 : x - x;
  switch (slw_reduce(x, &y0, &y1)) {
  case 0: return slw_cos_kernel(y0, y1);
  case 1: return -slw_sin_kernel(y0, y1);
  case 2: return -slw_cos_kernel(y0, y1);
  default: return slw_sin_kernel(y0, y1);
  }
}

SLW_FN double slw_tan(double x) { return slw_sin(x) / slw_cos(x); }

/* ---- exponential, logarithm, hyperbolic tangent ---- */

SLW_FN double slw_exp(double x) {
  double hi, lo, r, t, c, y;
  int k;
  if (!(x < 709.0)) return x != x ? x : slw_from_bits(0x7ff0000000000000ULL);
  if (x < -708.0) return 0.0;
  k = (int)slw_round_even(x * 1.44269504088896338700e+00);
  hi = x - k * 6.93147180369123816490e-01;
  lo = k * 1.90821492927058770002e-10;
  r = hi - lo;
  t = r * r;
  c = r - t * (1.66666666666666019037e-01 +
               t * (-2.77777777770155933842e-03 +
                    t * (6.61375632143793436117e-05 +
                         t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08))));
  y = 1.0 - ((lo - (r * c) / (2.0 - c)) - hi);
  return slw_scale(y, k);
}

SLW_FN double slw_log(double x) {
  uint64_t b;
  double f, s, z, w, r, hfsq, dk;
  int k = 0;
  if (!(x > 0.0)) return x == 0.0 ? -slw_from_bits(0x7ff0000000000000ULL) : slw_from_bits(0x7ff8000000000000ULL);
  if (!slw_is_finite(x)) return x;
  if (x < 2.2250738585072014e-308) {
    x *= 18014398509481984.0; /* 2^54: out of the subnormal range */
    k = -54;
  }
  b = slw_bits(x);
  k += (int)(b >> 52) - 1023;
  x = slw_from_bits((b & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL);
  if (x > 1.41421356237309504880) {
    x *= 0.5;
    k += 1;
  }
  dk = (double)k;
  f = x - 1.0;
  s = f / (2.0 + f);
  z = s * s;
  w = z * z;
  r = z * (6.666666666666735130e-01 +
           w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01))) +
      w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
  hfsq = 0.5 * f * f;
  return dk * 6.93147180369123816490e-01 - ((hfsq - (s * (hfsq + r) + dk * 1.90821492927058770002e-10)) - f);
}

/* Cephes-style rational approximation below 0.625, exponential above. */
SLW_FN double slw_tanh(double x) {
  const double a = slw_fabs(x);
  double z, y;
  if (x != x) return x;
  if (a > 20.0) return x > 0.0 ? 1.0 : -1.0;
  if (a >= 0.625) {
    y = 1.0 - 2.0 / (slw_exp(2.0 * a) + 1.0);
    return x > 0.0 ? y : -y;
  }
  z = x * x;
  y = ((-9.64399179425052238628e-1 * z - 9.92877231001918586564e1) * z - 1.61468768441708447952e3) /
      (((z + 1.12811678491632931402e2) * z + 2.23548839060100448583e3) * z + 4.84406305325125486048e3);
  return x + x * (z * y);
}

/* ---- arc tangent ---- */

SLW_FN double slw_atan(double x) {
  static const double hi[4] = {4.63647609000806093515e-01, 7.85398163397448278999e-01,
                               9.82793723247329054082e-01, 1.57079632679489655800e+00};
  static const double lo[4] = {2.26987774529616870924e-17, 3.06161699786838301793e-17,
                               1.39033110312309984516e-17, 6.12323399573676603587e-17};
  const double a = slw_fabs(x);
  double t, z, w, s1, s2, r;
  int id = -1;
  if (x != x) return x;
  if (a >= 7.37869762948382e19) return x > 0.0 ? hi[3] : -hi[3]; /* 2^66 */
  t = a;
  if (a < 0.4375) {
    id = -1;
  } else if (a < 0.6875) {
    id = 0;
    t = (2.0 * a - 1.0) / (2.0 + a);
  } else if (a < 1.1875) {
    id = 1;
    t = (a - 1.0) / (a + 1.0);
  } else if (a < 2.4375) {
    id = 2;
    t = (a - 1.5) / (1.0 + 1.5 * a);
  } else {
    id = 3;
    t = -1.0 / a;
  }
  z = t * t;
  w = z * z;
  s1 = z * (3.33333333333329318027e-01 +
            w * (1.42857142725034663711e-01 +
                 w * (9.09088713343650656196e-02 +
                      w * (6.66107313738753120669e-02 +
                           w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))));
  s2 = w * (-1.99999999998764832476e-01 +
            w * (-1.11111104054623557880e-01 +
                 w * (-7.69187620504482999495e-02 +
                      w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
  r = id < 0 ? t - t * (s1 + s2) : hi[id] - ((t * (s1 + s2) - lo[id]) - t);
  return x < 0.0 ? -r : r;
}

SLW_FN double slw_atan2(double y, double x) {
  const double pi = 3.14159265358979311600e+00, pi_lo = 1.22464679914735317720e-16;
  const double half = 1.57079632679489655800e+00;
  double r;
  if (x != x || y != y) return x + y;
  if (y == 0.0) return (slw_bits(x) >> 63) ? ((slw_bits(y) >> 63) ? -pi : pi) : y;
  if (x == 0.0) return y > 0.0 ? half : -half;
  r = slw_atan(slw_fabs(y / x));
  if (x < 0.0) r = pi - (r - pi_lo);
  return y < 0.0 ? -r : r;
}

/* Generated code says sin, exp ...; these names mean ours. */
#ifndef SLW_MATH_KEEP_NAMES
#define fabs slw_fabs
#define fmin slw_fmin
#define fmax slw_fmax
#define sqrt slw_sqrt
#define floor slw_floor
#define ceil slw_ceil
#define sin slw_sin
#define cos slw_cos
#define tan slw_tan
#define exp slw_exp
#define log slw_log
#define tanh slw_tanh
#define atan slw_atan
#define atan2 slw_atan2
#endif

#endif
