/* Autoregression fitted on line to the record alone: AdaptiveAR and KnotRegression of
   mpc/forecast/autoregressive.py, for means alone. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

#if MPC_BANK

#define SPAN MPC_LEARNT_SPAN
#define SEEN MPC_LEARNT_SEEN   /* numbers that a regression sees */
#define ALL MPC_LEARNT_ALL     /* these and what they are regressed on */
#define KNOTS MPC_LEARNT_KNOTS
#define STEPS MPC_LEARNT_STEPS /* spacings ahead */
#define ORDER MPC_LEARNT_ORDER /* coarse lags */
#define WHOLE MPC_LEARNT_WHOLE /* knots a whole number of spacings ahead */
#define DEPTH MPC_LEARNT_DEPTH
#define Q MPC_LEARNT_SPACING
#define HALF MPC_LEARNT_HALF
#define DIRECT 6
#define STRETCH (Q + 2 * HALF + 1)

static const double largest = 1e3; /* [m], [m/s]: what is larger is no measurement */
static const double bridged = 0.5; /* [s]: longer gaps are not learnt from */
static const double fading = 1.0;  /* [s] in which a forecast fades before there is a model */
static const double ridge = 1e-7;  /* of the mean diagonal */
static const double least_samples = 24.0, samples_per_lag = 5.0;
static const double belief = 20.0; /* errors of real forecasts that the model's own count as */

void mpc_learnt_reset(mpc_learnt *a) {
  int i, k;
  memset(a, 0, sizeof *a);
  a->row = SPAN - 1;
  a->since_gap = SPAN;
  for (i = 0; i < DEPTH; i++)
    for (k = 0; k < KNOTS; k++) a->made[i][k][0] = a->made[i][k][1] = NAN;
}

/* A row of the record, so many before the newest. */
static const double *ago(const mpc_learnt *a, int rows) {
  return a->record[(a->row - rows + SPAN) % SPAN];
}

/* What a regression sees, whose newest row is so many ago. */
static void regressors(const mpc_learnt *a, int rows, double *seen) {
  int i;
  for (i = 0; i < SEEN / 2; i++)
    memcpy(seen + 2 * i, ago(a, rows + mpc_learnt_lags[i]), 2 * sizeof *seen);
}

/* Rows of the record from the oldest on, the last of which is so many ago. */
static void stretch(const mpc_learnt *a, int rows, int count, double *found) {
  int i;
  for (i = 0; i < count; i++)
    memcpy(found + 2 * i, ago(a, rows + count - 1 - i), 2 * sizeof *found);
}

static void knots_of(const mpc_learnt *a, double *knots) {
  double seen[SEEN];
  regressors(a, 0, seen);
  mpc_times(a->model, seen, 2 * KNOTS, SEEN, knots);
}

static void append(mpc_learnt *a, double heave, double rate, int gap) {
  a->row = (a->row + 1) % SPAN;
  a->record[a->row][0] = heave;
  a->record[a->row][1] = rate;
  a->since_gap = gap ? 0 : a->since_gap < SPAN ? a->since_gap + 1 : SPAN;
}

/* Write what stands for a missing sample. */
static void bridge(mpc_learnt *a, int gap) {
  double knots[2 * KNOTS], next[2];
  int i;
  if (a->ready) {
    knots_of(a, knots);
    mpc_times(mpc_learnt_next_sample, knots, 2, 2 * KNOTS, next);
  } else {
    for (i = 0; i < 2; i++) next[i] = ago(a, 0)[i] * exp(-MPC_LEARNT_TIME / fading);
  }
  append(a, next[0], next[1], gap);
}

/* Add the newest regression whose targets are known. */
static void learn(mpc_learnt *a) {
  double both[ALL], record[2 * STRETCH];
  int i;
  regressors(a, Q + HALF, both);
  stretch(a, 0, STRETCH, record);
  mpc_times(mpc_learnt_smooth, record, DIRECT, 2 * STRETCH, both + SEEN);
  for (i = 0; i < ALL * ALL; i++) a->gram[i] *= MPC_LEARNT_FORGET;
  for (i = 0; i < ALL; i++) mpc_add(a->gram + i * ALL, both[i], both, ALL);
  a->one = MPC_LEARNT_FORGET * a->one + 1.0;
  a->two = MPC_LEARNT_FORGET * MPC_LEARNT_FORGET * a->two + 1.0;
}

/* Compare what was forecast with what has come, once a spacing. */
static void judge(mpc_learnt *a, int clean) {
  double record[2 * (2 * HALF + 1)], come[2];
  int i, k;
  a->turn = (a->turn + 1) % DEPTH;
  if (!a->ready || !clean) {
    for (k = 0; k < KNOTS; k++) a->made[a->turn][k][0] = a->made[a->turn][k][1] = NAN;
    return;
  }
  knots_of(a, &a->made[a->turn][0][0]);
  stretch(a, MPC_LEARNT_WAIT * Q - HALF, 2 * HALF + 1, record);
  for (k = 0; k < 2; k++) /* the first knot's rows of the smoother, on their own stretch */
    come[k] = mpc_dot(mpc_learnt_smooth + k * 2 * STRETCH, record, 2 * (2 * HALF + 1));
  for (i = 0; i < WHOLE; i++) {
    const double *made =
        a->made[(a->turn - mpc_learnt_ago[i] + DEPTH) % DEPTH][mpc_learnt_whole[i]];
    double weight = MPC_LEARNT_FORGET_ERROR * a->error_weights[i] + 1.0;
    double first = (come[0] - made[0]) * (come[0] - made[0]);
    double second = (come[1] - made[1]) * (come[1] - made[1]);
    if (!isfinite(first)) continue;
    a->errors[i][0] += (first - a->errors[i][0]) / weight;
    a->errors[i][1] += (second - a->errors[i][1]) / weight;
    a->error_weights[i] = weight;
  }
}

/* First part of a fit: the normal equations.  Returns whether there is data enough. */
static int begin_fit(mpc_learnt *a) {
  double worth = a->one * a->one / mpc_max(a->two, 1e-9) * MPC_LEARNT_PER_SPACING, trace = 0.0;
  int i, j, n = 0;
  if (worth < least_samples) return 0;
  a->worth = worth;
  a->order = (int)(worth / samples_per_lag);
  if (a->order > ORDER) a->order = ORDER;
  for (i = 0; i < SEEN; i++)
    if (i < 2 * a->order || i >= 2 * ORDER) a->at[n++] = i;
  a->used = n;
  for (i = 0; i < n; i++) {
    const double *row = a->gram + a->at[i] * ALL;
    for (j = 0; j < n; j++) a->R[i * SEEN + j] = row[a->at[j]] / a->one;
    for (j = 0; j < DIRECT; j++) a->S[i * DIRECT + j] = row[SEEN + j] / a->one;
    trace += a->R[i * SEEN + i];
  }
  for (i = 0; i < n; i++) a->R[i * SEEN + i] += ridge * trace / n;
  for (i = 0; i < DIRECT; i++)
    for (j = 0; j < DIRECT; j++)
      a->T[i * DIRECT + j] = a->gram[(SEEN + i) * ALL + SEEN + j] / a->one;
  for (i = 0; i < 2; i++) {
    double known = a->gram[i * ALL + i] / a->one, both = a->gram[i * ALL + SEEN + i] / a->one;
    a->noise[i] = mpc_maximum(known - 2.0 * both + a->T[i * DIRECT + i], 0.0);
    a->most[i] = mpc_maximum(a->most[i] - a->noise[i], 0.0);
  }
  return 1;
}

/* x of L L'x = S's column, with the first n rows of both. */
static void solved(const mpc_learnt *a, int column, int n, double *x) {
  int i, j;
  for (i = 0; i < n; i++)
    x[i] = (a->S[i * DIRECT + column] - mpc_dot(a->R + i * SEEN, x, i)) / a->R[i * SEEN + i];
  for (i = n - 1; i >= 0; i--) {
    double sum = x[i];
    for (j = i + 1; j < n; j++) sum -= a->R[j * SEEN + i] * x[j];
    x[i] = sum / a->R[i * SEEN + i];
  }
}

/* Second part: its solutions, for the direct knots and for the iteration.  Coarse lags come first,
   so that the root of their equations is the first part of the root of all. */
static int solve_fit(mpc_learnt *a) {
  int k;
  if (!mpc_root(a->R, a->used, SEEN)) return 0;
  for (k = 0; k < DIRECT; k++) solved(a, k, a->used, a->direct[k]);
  for (k = 0; k < 2; k++) solved(a, DIRECT - 2 + k, 2 * a->order, a->A[k]);
  return 1;
}

static double product(const mpc_learnt *a, const double *x, int n, int column) {
  double sum = 0.0;
  int i;
  for (i = 0; i < n; i++) sum += x[i] * a->S[i * DIRECT + column];
  return sum;
}

/* Third part: the model of the direct knots, and the covariances of what is left. */
static void direct_fit(mpc_learnt *a) {
  double lost = mpc_min(a->used / a->worth, 0.8), wider = (1.0 + lost) / (1.0 - lost);
  const int base = 2 * STEPS, reach = 2 * a->order;
  int i, j, k;
  memset(a->next, 0, sizeof a->next);
  memset(a->rows, 0, sizeof a->rows);
  memset(a->psi, 0, sizeof a->psi);
  memset(a->later, 0, sizeof a->later);
  for (k = 0; k < DIRECT; k++) {
    for (i = 0; i < a->used; i++) a->next[k * SEEN + a->at[i]] = a->direct[k][i];
    a->variance[k / 2][k % 2] =
        wider * (a->T[k * DIRECT + k] - product(a, a->direct[k], a->used, k));
  }
  for (i = 0; i < 2; i++)
    for (j = 0; j < 2; j++) {
      const int r = DIRECT - 2 + i, c = DIRECT - 2 + j;
      double noise = i == j ? a->noise[i] : 0.0;
      a->first[2 * i + j] =
          wider * (a->T[r * DIRECT + c] - product(a, a->direct[r], a->used, c)) + noise;
      a->about[2 * i + j] =
          wider * (a->T[r * DIRECT + c] - product(a, a->A[i], reach, c)) + noise;
    }
  /* Newest first, so that a step reads one stretch: steps .. 1, then the record. */
  for (i = 0; i < reach; i++) a->rows[(base + i) * SEEN + i] = 1.0;
  memcpy(a->rows + (base - 2) * SEEN, a->next + (DIRECT - 2) * SEEN, 2 * SEEN * sizeof(double));
  a->psi[(base - 2) * 2] = a->psi[(base - 1) * 2 + 1] = 1.0;
}

/* P X P', of (2, 2). */
static void turned(const double *P, const double *X, double *found) {
  int i, j;
  for (i = 0; i < 2; i++)
    for (j = 0; j < 2; j++)
      found[2 * i + j] = (P[2 * i] * X[0] + P[2 * i + 1] * X[2]) * P[2 * j] +
                         (P[2 * i] * X[1] + P[2 * i + 1] * X[3]) * P[2 * j + 1];
}

/* A further part: the knot j spacings ahead. */
static void iterate_fit(mpc_learnt *a, int j) {
  const int at = 2 * (STEPS - j), reach = 2 * a->order;
  double added[4], own[4];
  int i, k;
  for (k = 0; k < 2; k++) {
    double *row = a->rows + (at + k) * SEEN, *psi = a->psi + (at + k) * 2;
    memset(row, 0, SEEN * sizeof *row);
    psi[0] = psi[1] = 0.0;
    for (i = 0; i < reach; i++) {
      mpc_add(row, a->A[k][i], a->rows + (at + 2 + i) * SEEN, SEEN);
      mpc_add(psi, a->A[k][i], a->psi + (at + 2 + i) * 2, 2);
    }
    memcpy(a->next + (2 * (j + 1) + k) * SEEN, row, SEEN * sizeof *row);
  }
  turned(a->psi + (at + 2) * 2, a->about, added);
  for (i = 0; i < 4; i++) a->later[i] += added[i];
  turned(a->psi + at * 2, a->first, own);
  for (k = 0; k < 2; k++) a->variance[j + 1][k] = own[3 * k] + a->later[3 * k] - a->noise[k];
}

/* Last part: variances weighed with the errors made, and the model taken. */
static void finish_fit(mpc_learnt *a) {
  int i, k, m, finite = 1;
  for (k = 0; k < 2; k++) {
    double widened = 1.0;
    for (i = 0; i < WHOLE; i++) {
      double *own = &a->variance[mpc_learnt_whole[i]][k], weight = a->error_weights[i];
      double blend = (belief * *own + weight * a->errors[i][k]) / (belief + weight);
      if (i == 1) widened = blend / mpc_maximum(*own, 1e-300);
      *own = blend;
    }
    a->variance[1][k] *= widened;
  }
  /* What is worse than saying nothing is drawn towards nothing. */
  for (i = 0; i < KNOTS; i++)
    for (k = 0; k < 2; k++) {
      double *row = a->next + (2 * i + k) * SEEN;
      double share = mpc_minimum(1.0, a->most[k] / mpc_maximum(a->variance[i][k], 1e-300));
      for (m = 0; m < SEEN; m++) {
        row[m] *= share;
        finite = finite && isfinite(row[m]);
      }
    }
  a->ready = finite;
  if (finite) memcpy(a->model, a->next, sizeof a->model);
}

/* One part of the work for a new model, one a sample; returns whether more is left. */
static int work(mpc_learnt *a) {
  const int stage = a->stage++;
  if (stage == 0) return begin_fit(a);
  if (stage == 1) {
    if (solve_fit(a)) return 1;
    a->ready = 0;
    return 0;
  }
  if (stage == 2) {
    direct_fit(a);
    return 1;
  }
  if (stage < STEPS + 2) {
    iterate_fit(a, stage - 1);
    return 1;
  }
  finish_fit(a);
  return 0;
}

/* Take the hook's displacement [m] and velocity [m/s]. */
void mpc_learnt_update(mpc_learnt *a, double heave, double rate, int valid) {
  int i, clean;
  if (valid && fabs(heave) <= largest && fabs(rate) <= largest) {
    double share = mpc_max(1.0 / (a->age + 1), MPC_LEARNT_SHARE);
    append(a, heave, rate * MPC_LEARNT_WIDTH, 0);
    a->missing = 0;
    for (i = 0; i < 2; i++) {
      double newest = ago(a, 0)[i];
      a->power[i] += share * (newest * newest - a->power[i]);
    }
  } else {
    a->missing++;
    bridge(a, a->missing * MPC_LEARNT_TIME > bridged);
  }
  a->age++;
  if (a->age < SPAN) return;
  clean = a->since_gap >= SPAN - 1;
  if (clean && a->age % MPC_LEARNT_EVERY == 0) learn(a);
  if (a->working) a->working = work(a);
  if (a->age % Q == 0) {
    judge(a, clean);
    if (!a->working) {
      a->working = 1;
      a->stage = 0;
      memcpy(a->most, a->power, sizeof a->most);
    }
  }
}

/* What is foretold, by rows of the knots, or of a fading sample before there is a model. */
void mpc_learnt_forecast(const mpc_learnt *a, const double *by_model, const double *by_fading,
                         int count, double *found) {
  double knots[2 * KNOTS], fades[2];
  if (a->ready) {
    knots_of(a, knots);
    mpc_times(by_model, knots, count, 2 * KNOTS, found);
  } else {
    fades[0] = ago(a, 0)[0];
    fades[1] = ago(a, 0)[1] / MPC_LEARNT_WIDTH;
    mpc_times(by_fading, fades, count, 2, found);
  }
}

#else
typedef int mpc_no_autoregression; /* a source must not be empty */
#endif
