/* Gain and covariance of the Kalman filter, whose signals come and go: SampledFilter of
   mpc/programme/kalman.py.

   States are in units of what they are known to, outputs in units of their own errors. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

#define N MPC_N
#define NY MPC_NY

static const double settled = 1e-5; /* of a variance, that the steady gain may add */
static const double lost = 1e12;    /* times the variance at the start */
static const int looked = 16;       /* samples from one look at that to the next */

static void begin(mpc_filter *f) {
  memcpy(f->P, mpc_P0, sizeof f->P);
  f->there = -1;
  f->samples = f->holds = f->has_seen = f->has_spread = f->is_off = f->has_onward = 0;
}

void mpc_filter_reset(mpc_filter *f) {
  memset(f, 0, sizeof *f);
  begin(f);
}

/* Make sure of `spread`, the variances of the innovations of the next sample. */
void mpc_filter_innovations(mpc_filter *f) {
  const double *P = f->is_off ? f->off : f->P;
  double *seen = f->is_off ? f->work[0] : f->seen;
  int i;
  if (f->has_spread) return;
  mpc_product(mpc_unit_C, P, NY, N, N, seen);
  f->has_seen = !f->is_off;
  for (i = 0; i < NY; i++)
    f->spread[i] = mpc_R[i] * (1.0 + mpc_dot(seen + i * N, mpc_unit_C + i * N, N));
  f->has_spread = 1;
}

/* next = 0.5 A X A' + its transpose, of a symmetric X in work[1]; work[2] is overwritten. */
static void carried(mpc_filter *f, const double *A, double *next) {
  double *X = f->work[1], *Y = f->work[2];
  int i, j;
  mpc_product(A, X, N, N, N, Y);
  mpc_turned(Y, N, X);
  mpc_product(A, X, N, N, N, Y);
  for (i = 0; i < N; i++)
    for (j = 0; j < N; j++) next[i * N + j] = 0.5 * Y[i * N + j] + 0.5 * Y[j * N + i];
}

/* Carry what the estimate is off by over a sample, with a gain (N, NY) that is not made for it. */
static void carry(mpc_filter *f, const double *gain) {
  double *across = f->onward + N * N;
  int i, j;
  if (!f->has_onward || !f->holds) {
    mpc_product(mpc_unit_A, gain, N, N, NY, across);
    mpc_product(across, mpc_unit_C, N, NY, N, f->onward);
    for (i = 0; i < N * N; i++) f->onward[i] = mpc_unit_A[i] - f->onward[i];
    f->has_onward = 1;
  }
  memcpy(f->work[1], f->off, sizeof f->off);
  carried(f, f->onward, f->off);
  for (i = 0; i < N; i++)
    for (j = 0; j < N; j++)
      f->off[i * N + j] += mpc_dot(across + i * NY, across + j * NY, NY) + mpc_Q[i * N + j];
  f->has_spread = 0;
}

/* Whether the steady gain of a set does as well as the right one. */
static int is_settled(const mpc_filter *f, const double *gain, const double *rows, int set) {
  double across[N];
  const double *steady = mpc_steady_gain + (size_t)set * N * NY;
  int i, j, k;
  for (i = 0; i < N; i++) {
    double off[NY], added = 0.0;
    for (j = 0; j < NY; j++) off[j] = gain[i * NY + j] - steady[i * NY + j];
    memset(across, 0, sizeof across);
    for (j = 0; j < NY; j++) mpc_add(across, off[j], rows + j * N, N);
    for (k = 0; k < N; k++) added += across[k] * mpc_dot(across, f->P + k * N, N);
    added += mpc_dot(off, off, NY);
    if (!(added <= settled * f->P[i * N + i])) return 0;
  }
  return 1;
}

/* The gain of a sample (N, NY), and the covariance of the next.  Where signals tell of something
   else than usual, `rows` (NY, N) says of what; NULL else. */
static void gain_at(mpc_filter *f, const int *there, const double *own_rows, double *gain) {
  double rows[NY * N], seen[NY * N], told[NY * N], root[NY * NY], inverse[NY * NY];
  double made[N * NY];
  int i, j, k, key = 0, set, steady;
  for (i = 0; i < NY; i++) key |= there[i] << i;
  if (own_rows != NULL) key = -1;
  set = key < 0 ? -1 : mpc_set_of[key];
  steady = set < 0 ? -1 : mpc_steady_of[set];
  if (key != f->there) {
    f->there = key;
    f->holds = f->has_onward = f->samples = 0;
    if (set >= 0 && mpc_noise_of[set] > 0) { /* gains reckon with less noise than there is */
      if (!f->is_off) memcpy(f->off, f->P, sizeof f->off);
      f->is_off = 1;
    } else if (f->is_off) {
      memcpy(f->P, f->off, sizeof f->P);
      f->is_off = f->has_seen = 0;
    }
  }
  if (f->holds) {
    if (f->is_off) {
      for (i = 0; i < N * NY; i++) made[i] = f->held[i] / mpc_back[i];
      carry(f, made);
    }
    memcpy(gain, f->held, sizeof f->held);
    return;
  }
  if (own_rows != NULL)
    for (i = 0; i < NY * N; i++) rows[i] = own_rows[i] * mpc_unit[i];
  else
    memcpy(rows, mpc_unit_C, sizeof rows);
  if (f->has_seen && own_rows == NULL)
    memcpy(seen, f->seen, sizeof seen);
  else
    mpc_product(rows, f->P, NY, N, N, seen);
  /* What is not there tells nothing: a row of zeros, and so a column of the gain. */
  for (i = 0; i < NY; i++)
    if (!there[i]) memset(seen + i * N, 0, N * sizeof *seen);
  for (i = 0; i < NY; i++)
    for (j = 0; j < NY; j++)
      root[i * NY + j] =
          (there[j] ? mpc_dot(seen + i * N, rows + j * N, N) : 0.0) + (i == j ? 1.0 : 0.0);
  mpc_root(root, NY, NY);
  memset(inverse, 0, sizeof inverse);
  for (j = 0; j < NY; j++) {
    inverse[j * NY + j] = 1.0 / root[j * NY + j];
    for (i = j + 1; i < NY; i++) {
      double sum = 0.0;
      for (k = j; k < i; k++) sum += root[i * NY + k] * inverse[k * NY + j];
      inverse[i * NY + j] = -sum / root[i * NY + i];
    }
  }
  mpc_product(inverse, seen, NY, NY, N, told);
  for (i = 0; i < N; i++)
    for (j = 0; j < NY; j++) {
      double sum = 0.0;
      for (k = 0; k < NY; k++) sum += told[k * N + i] * inverse[k * NY + j];
      made[i * NY + j] = sum;
    }
  if (f->is_off) carry(f, made);
  f->has_seen = f->has_spread = 0;
  f->samples++;
  if (f->samples % looked == 0 && steady >= 0 && is_settled(f, made, rows, steady)) {
    memcpy(f->P, mpc_steady_P + (size_t)steady * N * N, sizeof f->P);
    for (i = 0; i < N * NY; i++)
      f->held[i] = mpc_steady_gain[(size_t)steady * N * NY + (size_t)i] * mpc_back[i];
    f->holds = 1;
    f->has_onward = 0;
    memcpy(gain, f->held, sizeof f->held);
    return;
  }
  memcpy(f->work[1], f->P, sizeof f->P);
  for (k = 0; k < NY; k++)
    for (i = 0; i < N; i++)
      if (told[k * N + i] != 0.0)
        mpc_add(f->work[1] + i * N, -told[k * N + i], told + k * N, N);
  carried(f, mpc_unit_A, f->P);
  mpc_add(f->P, 1.0, mpc_noise + (size_t)(set < 0 ? 0 : mpc_noise_of[set]) * N * N, N * N);
  for (i = 0; i < N * NY; i++) gain[i] = made[i] * mpc_back[i];
  /* What has not been heard of for so long that nothing is known of it is begun anew. */
  for (i = 0; i < N; i++)
    if (!(f->P[i * N + i] <= lost)) {
      begin(f);
      break;
    }
}

/* Estimate of a sample from its prediction, what is shown less what was expected, and which
   signals are to be believed. */
void mpc_filter_correct(mpc_filter *f, const double *ahead, const double *error, const int *there,
                        const double *rows) {
  double gain[N * NY], believed[NY];
  const double *K = gain;
  int i, all = 1, finite = 1;
  for (i = 0; i < NY; i++) {
    f->unheard[i] = there[i] ? 0 : f->unheard[i] + 1;
    believed[i] = there[i] ? error[i] : 0.0;
    all = all && there[i];
  }
  if (f->heard < MPC_FIRST && !all) {
    /* What they hold of the constants would be lost on a steady gain: the covariance of now, which
       has not been kept for each of them. */
    int everything[NY];
    for (i = 0; i < NY; i++) everything[i] = 1;
    begin(f);
    memcpy(f->P, mpc_start, sizeof f->P);
    for (i = 0; i < f->heard; i++) gain_at(f, everything, NULL, gain);
    f->heard = MPC_FIRST;
  }
  if (f->heard < MPC_FIRST)
    K = mpc_first_gains + (size_t)f->heard++ * N * NY;
  else
    gain_at(f, there, rows, gain);
  for (i = 0; i < N; i++) {
    f->state[i] = ahead[i] + mpc_dot(K + i * NY, believed, NY);
    finite = finite && isfinite(f->state[i]);
  }
  if (!finite) mpc_filter_reset(f);
}
