/* The hook foretold by whoever of a bank of seas has foretold it best: SeaBank of
   mpc/forecast/bank.py. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

#if MPC_BANK

#define MEMBERS MPC_BANK_MEMBERS /* seas, and the autoregression last */
#define SEAS (MEMBERS - 1)
#define LEADS 3                  /* that are judged */
#define KNOTS MPC_BANK_KNOTS
#define STEP MPC_BANK_STEP
#define SPAN MPC_BANK_SPAN
#define DEPTH MPC_BANK_DEPTH

static const double judged_at[LEADS] = {1.0, 2.0, 4.0}; /* [s] */
static const double every = 0.5, memory = 90.0, begins = 20.0, long_enough = 60.0; /* [s] */
static const double independent = 1.0; /* leads, after which an error is another */
static const double misfits = 1e-5, fits = 0.5; /* share below which the sea is not as told, .. */
static const double faint = 2e-3, moved = 0.02;
static const int rates = 20;                    /* velocities that are remembered, at the most */

void mpc_bank_reset(mpc_bank *b) {
  int i, k, m;
  memset(b, 0, sizeof *b);
  mpc_learnt_reset(&b->learnt);
  b->row = SPAN - 1;
  b->length = -1;
  for (i = 0; i < DEPTH; i++)
    for (m = 0; m < MEMBERS; m++)
      for (k = 0; k < LEADS; k++) b->made[i][m][k] = NAN;
  for (m = 0; m < MEMBERS; m++) b->shares[m] = exp(mpc_bank_prior[m]);
}

/* What is remembered, velocities first, the oldest of each first; returns how many there are. */
static int seen_by(const mpc_bank *b, double *seen) {
  int i, n = 0, count = mpc_bank_lengths[b->length], few = count < rates ? count : rates;
  for (i = few - 1; i >= 0; i--) seen[n++] = b->rate[(b->row - STEP * i + SPAN) % SPAN];
  for (i = count - 1; i >= 0; i--) seen[n++] = b->heave[(b->row - STEP * i + SPAN) % SPAN];
  return n;
}

static int taps(const mpc_bank *b) {
  int count = mpc_bank_lengths[b->length];
  return count + (count < rates ? count : rates);
}

/* Make one FIR of all that matter. */
static void blend(mpc_bank *b) {
  const int size = 2 * KNOTS * taps(b);
  double sum = 0.0;
  int m;
  for (m = 0; m < MEMBERS; m++) {
    b->blended[m] = b->shares[m] > faint ? b->shares[m] : 0.0;
    sum += b->blended[m];
  }
  memset(b->mixed, 0, sizeof b->mixed);
  for (m = 0; m < MEMBERS; m++) {
    b->blended[m] /= sum;
    if (m < SEAS && b->blended[m] != 0.0)
      mpc_add(b->mixed, b->blended[m], mpc_bank_rows[b->length] + (size_t)m * (size_t)size, size);
  }
}

static double likelihood(double error) { return -0.5 * log(mpc_maximum(error, 1e-300)); }

/* Logarithm of how likely errors of the leads are together, of so many seconds. */
static double together(const double *errors, double seconds) {
  double sum = 0.0;
  int k;
  for (k = 0; k < LEADS; k++) sum += likelihood(errors[k]) / (independent * judged_at[k]);
  return seconds * sum;
}

/* Shares of all, by the errors that they have made. */
static void weigh(mpc_bank *b) {
  double score[MEMBERS], top, sum = 0.0, fit = 0.0, apart = 0.0;
  int m, best = 0;
  for (m = 0; m < SEAS; m++) {
    score[m] = mpc_bank_prior[m] + together(b->errors[m], b->judged[0]);
    if (score[m] > score[best]) best = m;
  }
  /* The autoregression came later: by how much it is better than the best since then. */
  if (b->judged[SEAS] < long_enough)
    score[SEAS] = -INFINITY;
  else
    score[SEAS] = score[best] + (mpc_bank_prior[SEAS] - mpc_bank_prior[best]) +
                  together(b->since[SEAS], b->judged[SEAS]) -
                  together(b->since[best], b->judged[SEAS]);
  top = mpc_max(score[best], score[SEAS]);
  for (m = 0; m < MEMBERS; m++) {
    b->shares[m] = exp(score[m] - top);
    sum += b->shares[m];
  }
  for (m = 0; m < MEMBERS; m++) {
    b->shares[m] /= sum;
    apart += fabs(b->shares[m] - b->blended[m]);
    if (m < MPC_BANK_TOLD) fit += b->shares[m];
  }
  b->misfit = fit < (b->misfit ? fits : misfits);
  if (apart > moved) blend(b);
}

/* Weigh everybody by the errors that have come to light, and let everybody foretell anew. */
static void judge(mpc_bank *b, double heave) {
  const int turn = b->age / MPC_BANK_EVERY;
  double seen[MPC_BANK_SEEN], (*now)[LEADS] = b->made[turn % DEPTH];
  int m, k, n;
  if (b->good > MPC_BANK_FARTHEST) {
    const double *made[LEADS]; /* of the members, LEADS apart */
    for (k = 0; k < LEADS; k++) {
      int at = (turn - mpc_bank_ago[k]) % DEPTH;
      made[k] = &b->made[at < 0 ? at + DEPTH : at][0][k];
    }
    for (m = 0; m < MEMBERS; m++) {
      int last = isfinite(made[LEADS - 1][m * LEADS]);
      b->judged[m] = mpc_minimum(b->judged[m] + (last ? every : 0.0), memory);
    }
    for (m = 0; m < MEMBERS; m++)
      for (k = 0; k < LEADS; k++) {
        double own = made[k][m * LEADS], square = (own - heave) * (own - heave);
        double share = every / mpc_maximum(b->judged[m], every);
        double other = every / mpc_maximum(b->judged[SEAS], every);
        if (!isfinite(own)) continue;
        b->errors[m][k] += share * (square - b->errors[m][k]);
        if (isfinite(made[k][SEAS * LEADS])) b->since[m][k] += other * (square - b->since[m][k]);
      }
    if (isfinite(made[LEADS - 1][0])) weigh(b);
  }
  for (m = 0; m < MEMBERS; m++)
    for (k = 0; k < LEADS; k++) now[m][k] = NAN;
  if (!(b->age * MPC_SAMPLE_TIME > begins)) return;
  n = seen_by(b, seen);
  mpc_times(mpc_bank_judged[b->length], seen, SEAS * LEADS, n, &now[0][0]);
  if (b->learnt.ready)
    mpc_learnt_forecast(&b->learnt, mpc_bank_to_judged[(b->age - 1) % STEP], NULL, LEADS,
                        now[SEAS]);
}

/* Take the hook's displacement [m] and velocity [m/s]; a sample that is not valid judges nobody. */
void mpc_bank_update(mpc_bank *b, double heave, double rate, int valid) {
  if (b->age % STEP == 0) mpc_learnt_update(&b->learnt, heave, rate, valid);
  b->row = (b->row + 1) % SPAN;
  b->heave[b->row] = heave;
  b->rate[b->row] = rate;
  b->age++;
  b->good = valid ? b->good + 1 : 0;
  if (b->length + 1 < MPC_BANK_LENGTHS && b->age == mpc_bank_grows[b->length + 1]) {
    b->length++;
    blend(b);
  }
  if (b->age % MPC_BANK_EVERY == 0) judge(b, heave);
}

/* The hook's displacement and velocity at the knots ahead, in turn. */
void mpc_bank_forecast(const mpc_bank *b, double *at_knots) {
  double seen[MPC_BANK_SEEN], learnt[2 * KNOTS];
  const int n = seen_by(b, seen), k = (b->age - 1) % STEP;
  mpc_times(b->mixed, seen, 2 * KNOTS, n, at_knots);
  if (!(b->blended[SEAS] > 0.0)) return;
  mpc_learnt_forecast(&b->learnt, mpc_bank_moved[k], mpc_bank_faded[k], 2 * KNOTS, learnt);
  mpc_add(at_knots, b->blended[SEAS], learnt, 2 * KNOTS);
}

#else
typedef int mpc_no_bank; /* a source must not be empty */
#endif
