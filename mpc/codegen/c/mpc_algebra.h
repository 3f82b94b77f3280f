/* Small dense algebra: matrices row by row, comparisons as Python and NumPy make them. */
#ifndef MPC_ALGEBRA_H
#define MPC_ALGEBRA_H

#include <math.h>
#include <string.h>

/* Python's max and min of two: what comes first stays where a comparison with NaN is false. */
static inline double mpc_max(double a, double b) { return b > a ? b : a; }
static inline double mpc_min(double a, double b) { return b < a ? b : a; }

/* NumPy's maximum and minimum: of a NaN and a number, the NaN. */
static inline double mpc_maximum(double a, double b) { return a >= b || isnan(a) ? a : b; }
static inline double mpc_minimum(double a, double b) { return a <= b || isnan(a) ? a : b; }

/* a'b of n numbers, in four sums that do not wait for each other. */
static inline double mpc_dot(const double *a, const double *b, int n) {
  double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
  int i = 0;
  for (; i + 3 < n; i += 4) {
    s0 += a[i] * b[i];
    s1 += a[i + 1] * b[i + 1];
    s2 += a[i + 2] * b[i + 2];
    s3 += a[i + 3] * b[i + 3];
  }
  for (; i < n; i++) s0 += a[i] * b[i];
  return (s0 + s1) + (s2 + s3);
}

/* y = A x, of A (rows, columns). */
static inline void mpc_times(const double *A, const double *x, int rows, int columns, double *y) {
  int i;
  for (i = 0; i < rows; i++) y[i] = mpc_dot(A + (size_t)i * (size_t)columns, x, columns);
}

/* y += a x, of n numbers. */
static inline void mpc_add(double *y, double a, const double *x, int n) {
  int i;
  for (i = 0; i < n; i++) y[i] += a * x[i];
}

/* C = A B, of A (n, k) and B (k, m); most of A may be zero. */
static inline void mpc_product(const double *A, const double *B, int n, int k, int m, double *C) {
  int i, j;
  for (i = 0; i < n; i++) {
    double *row = C + (size_t)i * (size_t)m;
    memset(row, 0, (size_t)m * sizeof *row);
    for (j = 0; j < k; j++) {
      double a = A[i * k + j];
      if (a != 0.0) mpc_add(row, a, B + (size_t)j * (size_t)m, m);
    }
  }
}

/* B = A' of a square A (n, n). */
static inline void mpc_turned(const double *A, int n, double *B) {
  int i, j;
  for (i = 0; i < n; i++)
    for (j = 0; j < n; j++) B[j * n + i] = A[i * n + j];
}

/* The root L of A = L L' in the lower half of A (n, n), `stride` apart; 0 if there is none. */
static inline int mpc_root(double *A, int n, int stride) {
  int i, j;
  for (j = 0; j < n; j++) {
    double *row = A + j * stride, left = row[j] - mpc_dot(row, row, j);
    if (!(left > 0.0)) return 0;
    row[j] = sqrt(left);
    for (i = j + 1; i < n; i++) {
      double *other = A + i * stride;
      other[j] = (other[j] - mpc_dot(other, row, j)) / row[j];
    }
  }
  return 1;
}

#endif
