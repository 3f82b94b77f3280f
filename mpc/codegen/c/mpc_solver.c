/* The quadratic programme of a sample, by the dual active-set method of DAQP (D. Arnstrom,
   A. Bemporad and D. Axehill, IEEE TAC 67, 2022):

     min 1/2 v'H v + f'v + sum of w s + W s^2 / 2
     subject to l <= (v, S v, R v) <= u, rows of R but for their slacks s >= 0

   With H^-1 = U U', u = U^-1 v + U'f, it is the least distance of u from the origin within half
   spaces, whose multipliers are looked for one active set after another.  The factors of a set are
   the library's.  What it has not, in the form in which it comes, is a price for each row, and so
   the search is here:

   A soft row is hard as long as its multiplier is at most w.  There its slack gets free: the row
   then acts as one whose bound lies w / W inside, and gives way by its multiplier over W.  The
   answer is that of the whole programme, without a variable for each slack. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

#include "daqp/auxiliary.h"
#include "daqp/daqp.h"

#define NB MPC_NB
#define NM MPC_NM
#define FIRST_ROW (NB + MPC_NL) /* of the soft ones */

static const double primal_tol = 1e-9, dual_tol = 1e-12;
static const double zero_tol = 1e-11, pivot_tol = 1e-6, progress_tol = 1e-14;
static const double infinite = 1e30, rounding = 1e-14;
static const double refined = 1e-12; /* of a move */
static const int iterations = 1500, stalled = 10, passes = 3;

void mpc_solver_reset(mpc_solver *s) { memset(s, 0, sizeof *s); }

/* y = U x, of the root U of H^-1: an upper triangle, whose rows are stored over their norms. */
static void by_root(const double *x, double *y) {
  const double *row = mpc_qp_root;
  int i;
  for (i = 0; i < NB; row += NB - i, i++) y[i] = mpc_dot(row, x + i, NB - i) / mpc_qp_scaling[i];
}

/* y = U' x. */
static void by_root_turned(const double *x, double *y) {
  const double *row = mpc_qp_root;
  int i;
  memset(y, 0, NB * sizeof *y);
  for (i = 0; i < NB; row += NB - i, i++) mpc_add(y + i, x[i] / mpc_qp_scaling[i], row, NB - i);
}

/* The row of a constraint, of norm one, times x; x plus a share of it. */
static double row_times(int id, const double *x) {
  if (id >= NB) return mpc_dot(mpc_qp_rows + (id - NB) * NB, x, NB);
  return mpc_dot(mpc_qp_root + id * NB - id * (id - 1) / 2, x + id, NB - id);
}

static void add_row(int id, double share, double *x) {
  if (id >= NB)
    mpc_add(x, share, mpc_qp_rows + (id - NB) * NB, NB);
  else
    mpc_add(x + id, share, mpc_qp_root + id * NB - id * (id - 1) / 2, NB - id);
}

/* The multiplier at which the slack of a constraint gets free; none does of a hard one. */
static double cap_of(const DAQPWorkspace *work, int id) {
  return id < FIRST_ROW ? infinite : MPC_PRICE / work->scaling[id];
}

/* Let the slack of a soft row that is not in the active set be free, or not. */
static void free_slack(DAQPWorkspace *work, int id, int is_free) {
  double moved = MPC_PRICE / MPC_CURVATURE * work->scaling[id];
  if (is_free == (IS_SOFT(id) != 0)) return;
  if (is_free)
    SET_SOFT(id);
  else
    SET_HARD(id);
  if (!is_free) moved = -moved;
  if (IS_LOWER(id))
    work->dlower[id] += moved;
  else
    work->dupper[id] -= moved;
}

/* Fix the slacks of rows that the library has taken out of a set that got singular. */
static void fix_slacks(DAQPWorkspace *work) {
  int i;
  for (i = FIRST_ROW; i < NM; i++)
    if (!IS_ACTIVE(i)) free_slack(work, i, 0);
}

/* Go from the multipliers towards those that the active set asks for (or, of a singular one, on
   along them), up to the first that would leave its range.  It leaves the active set, or its slack
   changes sides.  Returns whether there was one: 2 where there was no way to go. */
static int stop_at_range(DAQPWorkspace *work, double next_to) {
  const int singular = work->sing_ind != EMPTY_IND;
  double alpha = infinite, end = 0.0;
  int i, id, found = EMPTY_IND;
  for (i = 0; i < work->n_active; i++) {
    double side, at, step, cap, low, high, reach;
    id = work->WS[i];
    side = IS_LOWER(id) ? -1.0 : 1.0;
    at = side * work->lam[i];
    step = side * (singular ? work->lam_star[i] : work->lam_star[i] - work->lam[i]);
    cap = cap_of(work, id);
    low = IS_SOFT(id) ? cap : 0.0;
    high = IS_SOFT(id) ? infinite : cap;
    /* A slack that is next to nothing may be either, or it would change sides without end. */
    if (singular ? step < -dual_tol : at + step < low * (1.0 - next_to) - dual_tol)
      reach = low;
    else if (high < infinite &&
             (singular ? step > dual_tol : at + step > high * (1.0 + next_to) + dual_tol))
      reach = high;
    else
      continue;
    if ((reach - at) / step < alpha) {
      alpha = (reach - at) / step;
      end = reach;
      found = i;
    }
  }
  if (found == EMPTY_IND) return 0;
  for (i = 0; i < work->n_active; i++)
    work->lam[i] += alpha * (singular ? work->lam_star[i] : work->lam_star[i] - work->lam[i]);
  work->sing_ind = EMPTY_IND;
  id = work->WS[found];
  remove_constraint(work, found);
  if (end > 0.0 && work->sing_ind == EMPTY_IND) {
    free_slack(work, id, !IS_SOFT(id));
    add_constraint(work, id, IS_LOWER(id) ? -end : end);
  }
  return alpha > 0.0 ? 1 : 2;
}

/* The direction in which the multipliers of a singular set cost nothing but what the bounds give,
   and so go on for ever: a row that comes in takes more, one whose slack is fixed again less. */
static void find_direction(DAQPWorkspace *work) {
  double gives = 0.0;
  int i;
  compute_singular_direction(work);
  for (i = 0; i <= work->sing_ind; i++) {
    const int id = work->WS[i];
    gives += work->lam_star[i] * (IS_LOWER(id) ? work->dlower[id] : work->dupper[id]);
  }
  if (gives > 0.0)
    for (i = 0; i <= work->sing_ind; i++) work->lam_star[i] = -work->lam_star[i];
}

/* Add the constraint that is violated most; return whether one is. */
static int add_violated(DAQPWorkspace *work) {
  /* Of what is far beyond all limits, as a set point of kilometres, rounding alone is more. */
  const double tol = fmax(primal_tol, rounding * sqrt(mpc_dot(work->u, work->u, NB)));
  double worst = -tol, *swapped = work->lam;
  int i, found = EMPTY_IND, is_lower = 0;
  for (i = 0; i < NM; i++) {
    const double least = -tol * work->scaling[i];
    double value, above, below;
    if (IS_ACTIVE(i)) continue;
    value = row_times(i, work->u);
    above = work->dupper[i] - value;
    below = value - work->dlower[i];
    if (above < worst && above < least) {
      worst = above;
      found = i;
      is_lower = 0;
    } else if (below < worst && below < least) {
      worst = below;
      found = i;
      is_lower = 1;
    }
  }
  if (found == EMPTY_IND) return 0;
  if (is_lower)
    SET_LOWER(found);
  else
    SET_UPPER(found);
  work->lam = work->lam_star;
  work->lam_star = swapped;
  /* From zero, so that the way to the next multipliers is straight: only there does the cost rise
     all along it. */
  add_constraint(work, found, 0.0);
  return 1;
}

/* Factors of the active set anew, as what each change of it has rounded adds up.  The order is that
   in which constraints came in, or the other way round. */
static void factorise(DAQPWorkspace *work, int turned) {
  double multipliers[MPC_NA];
  int i, ids[MPC_NA];
  const int count = work->n_active;
  memcpy(multipliers, work->lam, (size_t)count * sizeof *multipliers);
  memcpy(ids, work->WS, (size_t)count * sizeof *ids);
  work->n_active = work->reuse_ind = 0;
  work->sing_ind = EMPTY_IND;
  for (i = 0; i < count; i++) {
    const int k = turned ? count - 1 - i : i;
    if (work->sing_ind != EMPTY_IND)
      SET_INACTIVE(ids[k]);
    else
      add_constraint(work, ids[k], multipliers[k]);
  }
}

/* What the answer of the active set costs, which rises from one set to the next.  A free slack s
   costs w s + W s^2 / 2; the library has counted (w + W s)^2 / 2 W instead. */
static double cost_of(const DAQPWorkspace *work) {
  int i, is_free = 0;
  for (i = 0; i < work->n_active; i++) is_free += IS_SOFT(work->WS[i]) != 0;
  return work->fval - is_free * MPC_PRICE * MPC_PRICE / MPC_CURVATURE;
}

/* Whether the search has come to its end; lam_star and u are then those of the answer. */
static int search(DAQPWorkspace *work) {
  double cost, best = -1.0, next_to = 1e-8; /* of a price */
  int i, stop, same = 0, tried = 0, stays = 0;
  for (i = 1; i < iterations; i++) {
    if (stays > stalled) {
      next_to *= 10.0;
      stays = 0;
    }
    if (work->sing_ind != EMPTY_IND) {
      fix_slacks(work);
      find_direction(work);
      stop = stop_at_range(work, next_to);
      if (!stop) return 0; /* hard rows exclude each other */
      stays = stop == 2 ? stays + 1 : 0;
      continue;
    }
    compute_CSP(work);
    stop = stop_at_range(work, next_to);
    stays = stop == 2 ? stays + 1 : 0;
    if (stop) continue;
    compute_primal_and_fval(work);
    cost = cost_of(work);
    if (!(cost <= infinite)) return 0;
    if (!add_violated(work)) return 1;
    if (cost - best >= progress_tol) {
      best = cost;
      same = 0;
    } else if (same++ > stalled) {
      if (tried) return 0;
      tried = 1;
      factorise(work, 1);
      best = -1.0;
      same = 0;
    }
  }
  return 0;
}

/* Put moves right once more by what is left of their optimality conditions, as the Python's solver
   does where constraints are active: many of them leave little for the others to be found by.
   Returns the largest change. */
static double refine(const DAQPWorkspace *work, const double *gradient, const double *lower,
                     const double *upper, double *moves) {
  double left[NB], step[NB], off[MPC_NA], largest = 0.0;
  int i, j;
  mpc_times(mpc_qp_H, moves, NB, NB, left);
  mpc_add(left, 1.0, gradient, NB);
  for (i = 0; i < work->n_active; i++) {
    const int id = work->WS[i];
    const double multiplier = work->lam_star[i], price = IS_LOWER(id) ? -MPC_PRICE : MPC_PRICE;
    double bound = IS_LOWER(id) ? lower[id] : upper[id], value;
    if (IS_SOFT(id)) bound += (multiplier - price) / MPC_CURVATURE;
    if (id < NB) {
      value = moves[id];
      left[id] += multiplier;
    } else {
      value = mpc_dot(mpc_qp_given + (id - NB) * NB, moves, NB);
      mpc_add(left, multiplier, mpc_qp_given + (id - NB) * NB, NB);
    }
    off[i] = (value - bound) * work->scaling[id];
  }
  by_root_turned(left, step);
  for (i = 0; i < work->n_active; i++) off[i] -= row_times(work->WS[i], step);
  for (i = 1; i < work->n_active; i++) off[i] -= mpc_dot(work->L + ARSUM(i), off, i);
  for (i = 0; i < work->n_active; i++) off[i] /= work->D[i];
  for (i = work->n_active - 1; i >= 0; i--)
    for (j = 0; j < i; j++) off[j] -= work->L[ARSUM(i) + j] * off[i];
  for (i = 0; i < work->n_active; i++) {
    work->lam_star[i] += off[i] * work->scaling[work->WS[i]];
    add_row(work->WS[i], off[i], step);
  }
  by_root(step, left);
  for (i = 0; i < NB; i++) {
    moves[i] -= left[i];
    largest = fmax(largest, fabs(left[i]));
  }
  return largest;
}

int mpc_solver_solve(mpc_solver *s, const double *gradient, const double *lower,
                     const double *upper, double *moves, double *multipliers) {
  DAQPWorkspace work;
  DAQPSettings settings;
  double above[NM], below[NM], other[MPC_NA], x[MPC_NA], z[MPC_NA], u[NB], v[NB];
  int i, found;
  memset(&work, 0, sizeof work);
  memset(&settings, 0, sizeof settings);
  settings.primal_tol = primal_tol;
  settings.dual_tol = dual_tol;
  settings.zero_tol = zero_tol;
  settings.pivot_tol = pivot_tol;
  settings.progress_tol = progress_tol;
  settings.rho_soft = 1.0 / MPC_CURVATURE;
  work.settings = &settings;
  work.n = work.ms = NB;
  work.m = NM;
  /* The library only reads these. */
  work.M = (double *)mpc_qp_rows;
  work.Rinv = (double *)mpc_qp_root;
  work.scaling = (double *)mpc_qp_scaling;
  work.dupper = above;
  work.dlower = below;
  work.v = v;
  work.u = u;
  work.x = moves;
  work.sense = s->sense;
  work.lam = s->lambda;
  work.lam_star = other;
  work.L = s->L;
  work.D = s->D;
  work.xldl = x;
  work.zldl = z;
  work.WS = s->active;
  work.n_active = s->count;
  by_root_turned(gradient, v);
  for (i = 0; i < NM; i++) {
    const double price = MPC_PRICE / MPC_CURVATURE * mpc_qp_scaling[i], moved = row_times(i, v);
    above[i] = upper[i] * mpc_qp_scaling[i] + moved;
    below[i] = lower[i] * mpc_qp_scaling[i] + moved;
    if (s->sense[i] & SOFT) { /* whose slack is free */
      if (s->sense[i] & LOWER)
        below[i] += price;
      else
        above[i] -= price;
    }
  }
  factorise(&work, 0);
  found = search(&work);
  if (found) {
    memmove(s->lambda, work.lam_star, (size_t)work.n_active * sizeof(double));
    s->count = work.n_active;
    ldp2qp_solution(&work);
    for (i = 0; i < passes && work.n_active > 0; i++)
      if (refine(&work, gradient, lower, upper, moves) < refined) break;
    memset(multipliers, 0, NM * sizeof *multipliers);
    for (i = 0; i < work.n_active; i++) multipliers[work.WS[i]] = work.lam_star[i];
    for (i = 0; i < NB; i++) found = found && isfinite(moves[i]);
  }
  if (!found) mpc_solver_reset(s);
  return found;
}
