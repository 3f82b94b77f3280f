/* One step of the predictive controller: LinearMPC of mpc/linear/linear.py. */
#include "mpc.h"

#include "mpc_algebra.h"
#include "mpc_parts.h"

#define N MPC_N
#define NB MPC_NB
#define NM MPC_NM
#define NEWEST 0
#define OLDEST MPC_WAITING

/* As in STATUSES of models/sensing/control.py. */
enum { ENGAGED, LIMITED, GATED, MISFIT, DERATED, BLIND, FALLBACK };

static const double edge = 1e-7; /* of a move that is at its bound */
static const double same = 1e-3; /* of the peak torque */

void mpc_reset(mpc_memory *m) {
  int i;
  memset(m, 0, sizeof *m);
  mpc_estimator_reset(&m->estimator);
  mpc_window_reset(&m->window);
  mpc_inertia_reset(&m->inertia);
  mpc_solver_reset(&m->solver);
#if MPC_BANK
  mpc_bank_reset(&m->bank);
#endif
  m->asked = MPC_REST_TORQUE;
  m->sent = NAN;
  for (i = 0; i <= MPC_WAITING; i++) m->kept[i] = NAN;
  m->answered = 1;
}

int mpc_status(const mpc_memory *m) {
  if (!m->answered) return FALLBACK;
  if (mpc_estimator_blind(&m->estimator)) return BLIND;
  if (m->estimator.gated) return GATED;
  if (mpc_window_derated(&m->window)) return DERATED;
#if MPC_BANK
  if (m->bank.misfit) return MISFIT;
#endif
  return fabs(m->asked) >= m->window.peak * (1.0 - edge) ? LIMITED : ENGAGED;
}

void mpc_commanded(mpc_memory *m, double command) {
  m->sent = command;
  if (MPC_WAITING > 0) m->estimator.given = command;
}

/* The command for a torque over the one at rest, at a reckoned speed. */
static double command_of(double torque, double speed) {
  return MPC_REST_COMMAND + MPC_BACK * speed + torque / MPC_GAIN;
}

/* The command that does as much as the torque held over the last sample, of a drive that was asked
   to hold its peak and shows that it still did at the end; NaN if it did not. */
static double held_command(const mpc_memory *m, double torque, double speed) {
  const int next = MPC_HOLD < 1.0 && OLDEST > 0 ? OLDEST - 1 : OLDEST;
  const double before = MPC_WAITING > 0 ? m->before : m->estimator.speed, kept = m->kept[OLDEST];
  double told, fall;
  if (kept != m->kept[next] || !(fabs(torque - MPC_REST_TORQUE - kept) < same * m->window.peak))
    return NAN;
  told = MPC_HOLD * m->told[OLDEST] + (1.0 - MPC_HOLD) * m->told[next];
  /* A torque that is held does as much as one that falls to as much below it. */
  fall = 0.5 * MPC_GAIN * MPC_BACK * (speed - before);
  return command_of(kept + fall, before) + (m->told[NEWEST] - told);
}

/* Solve for the moves; return whether there is an answer. */
static int solve(mpc_memory *m, const double *gradient, double *lower, const double *upper,
                 double *moves) {
  const double lowering = m->window.power / (MPC_BRAKES * fabs(MPC_REST_TORQUE));
  double multipliers[NM];
  int i, finite = 1, limited = 0;
  m->answered = 0;
  /* No plan lowers faster than the drive's power can brake. */
  if (!(lowering >= -MPC_LOWEST_SPEED))
    for (i = 0; i < MPC_NR; i++)
      lower[NM - MPC_NR + i] += (-lowering - MPC_LOWEST_SPEED) * mpc_speed_scale[i];
  for (i = 0; i < NB; i++) finite = finite && isfinite(gradient[i]);
  for (i = 0; i < NM; i++) finite = finite && isfinite(lower[i]) && isfinite(upper[i]);
  if (!finite) return 0;
  if (!mpc_solver_solve(&m->solver, gradient, lower, upper, moves, multipliers)) return 0;
  m->answered = 1;
  for (i = 0; i <= mpc_block_of[MPC_STALE - 1]; i++) limited = limited || multipliers[i] != 0.0;
  m->has_plan = limited;
  m->age = 0;
  memcpy(m->plan, moves, sizeof m->plan);
  return 1;
}

/* The move where the programme has no answer: that of the last plan for this moment, or of the law
   without limits. */
static double otherwise(mpc_memory *m, const double *chi) {
  double asked;
  m->age++;
  if (m->has_plan && m->age < MPC_STALE) return m->plan[mpc_block_of[m->age]];
  asked = mpc_unlimited_moved[0] * m->place + mpc_unlimited_moved[1] * m->moving;
  return (asked - mpc_dot(mpc_unlimited, chi, N)) / MPC_UNIT;
}

/* The set point, of which one that is not finite keeps its last place, at rest there. */
static void hear_set_point(mpc_memory *m, const double *shown) {
  double place = shown[MPC_REFERENCE_DISPLACEMENT], moving = shown[MPC_REFERENCE_VELOCITY];
  if (isfinite(place + moving)) {
    m->place = place;
    m->moving = moving;
  } else {
    m->moving = 0.0;
  }
}

double mpc_step(mpc_memory *m, const double *shown) {
  double product[N + NB + MPC_NR], *gradient = product + N, *rows = product + N + NB;
  double low[NB], high[NB], lower[NM], upper[NM], moves[NB], drift[NB];
  double applied, speed, cap, ratio, pull, move, torque, kept = NAN, command;
  const double *chi = m->estimator.filter.state, left_out = m->sent - shown[MPC_DRIVE_APPLIED];
  int i, k, cut, leaning, solved;
  /* What the sensors show becomes an estimate. */
  applied = held_command(m, shown[MPC_MOTOR_TORQUE], shown[MPC_MOTOR_SPEED]);
  cut = mpc_window_follow(&m->window, shown[MPC_MOTOR_TORQUE], left_out, shown[MPC_MOTOR_SPEED]);
  mpc_inertia_update(&m->inertia, shown, cut);
  mpc_estimator_update(&m->estimator, shown, applied);
  mpc_times(mpc_products, chi, N + NB + MPC_NR, N, product);
  memcpy(m->estimator.ahead, product, sizeof m->estimator.ahead);
  if (MPC_WAITING > 0) m->before = mpc_dot(mpc_motor_speed, chi, MPC_NX);
  hear_set_point(m, shown);
  if (m->place != 0.0 || m->moving != 0.0)
    for (i = 0; i < NB + MPC_NR; i++)
      gradient[i] -= mpc_shifted[2 * i] * m->place + mpc_shifted[2 * i + 1] * m->moving;
#if MPC_BANK
  {
    /* The forecast begins with the hook as the filter knows it, of which it loses sight. */
    double heave = mpc_dot(mpc_hook, chi + MPC_SEA, MPC_NS);
    double rate = mpc_dot(mpc_hook + MPC_NS, chi + MPC_SEA, MPC_NS);
    enum { PATH = 2 * MPC_BANK_KNOTS + 2 };
    double path[PATH];
    mpc_bank_update(&m->bank, heave, rate, !mpc_estimator_blind(&m->estimator));
    mpc_bank_forecast(&m->bank, path);
    path[PATH - 2] = heave - path[0];
    path[PATH - 1] = rate - path[1];
    for (i = 0; i < NB + MPC_NR; i++) gradient[i] += mpc_dot(mpc_along + i * PATH, path, PATH);
  }
#endif
  /* The window of the drive bounds the moves. */
  speed = m->estimator.speed;
  cap = INFINITY;
  if (MPC_THERMAL)
    cap = mpc_window_cap(&m->rise, mpc_max(fabs(shown[MPC_MOTOR_TORQUE]), fabs(m->asked)));
  /* Only its own limits does the drive keep by itself. */
  leaning = cap >= m->window.peak && MPC_NL == 0;
  mpc_window_bounds(&m->window, speed, m->speeds, cap, leaning ? m->changes : NULL, low, high);
  if (MPC_NL > 0) {
    double last = m->asked - MPC_REST_TORQUE;
    double least = (last - MPC_AT_MOST) / MPC_UNIT, most = (last + MPC_AT_MOST) / MPC_UNIT;
    low[0] = mpc_min(mpc_max(low[0], least), most);
    high[0] = mpc_min(mpc_max(high[0], least), most);
  }
  ratio = mpc_inertia_ratio(&m->inertia);
  pull = m->inertia.pull / MPC_UNIT;
  for (i = 0; i < NB; i++) {
    lower[i] = ratio == 1.0 ? low[i] : (low[i] + (ratio - 1.0) * pull) / ratio;
    upper[i] = ratio == 1.0 ? high[i] : (high[i] + (ratio - 1.0) * pull) / ratio;
  }
  for (i = 0; i < MPC_NL; i++) {
    lower[NB + i] = -mpc_rate_steps[i] / ratio;
    upper[NB + i] = mpc_rate_steps[i] / ratio;
  }
  for (i = 0, k = NB + MPC_NL; i < MPC_NR; i++, k++) {
    lower[k] = mpc_row_low[i] - rows[i];
    upper[k] = mpc_row_high[i] - rows[i];
  }
  solved = solve(m, gradient, lower, upper, moves);
  if (solved) {
    mpc_times(mpc_speed_known, chi, NB, N, m->speeds);
    mpc_times(mpc_speed_moves, moves, NB, NB, drift);
    for (i = 0; i < NB; i++) m->speeds[i] += drift[i];
    for (i = 0; i + 1 < NB; i++)
      m->changes[i] = (m->speeds[i + 1] - m->speeds[i]) / mpc_lengths[i];
  }
  /* The first move becomes a command. */
  move = solved ? moves[0] : otherwise(m, chi);
  if (ratio != 1.0) move = ratio * move - (ratio - 1.0) * pull;
  if (leaning)
    torque = mpc_window_asked(&m->window, move, low[0], high[0], m->changes[0], &kept);
  else
    torque = mpc_min(mpc_max(move, low[0]), high[0]) * MPC_UNIT;
  command = command_of(torque, speed);
  command = mpc_min(mpc_max(command, -MPC_VOLTAGE), MPC_VOLTAGE);
  mpc_commanded(m, command);
  for (i = OLDEST; i > NEWEST; i--) {
    m->kept[i] = m->kept[i - 1];
    m->told[i] = m->told[i - 1];
  }
  m->kept[NEWEST] = kept;
  m->told[NEWEST] = command;
  m->asked = mpc_min(mpc_max(torque + MPC_REST_TORQUE, -m->window.peak), m->window.peak);
  return command;
}
