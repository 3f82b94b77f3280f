/* What torque the drive can give, as bounds on the moves, and the motor's temperature:
   DriveWindow and TorqueBudget of mpc/linear/winch_mpc.py. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

#define SHORTS 3 /* samples in a row that a drive gives less than asked, until that is its limit */

static const double edge = 1e-7; /* of a move that is at its bound */
static const double most = 0.2;  /* of the peak: half of what the torque may fall by */
static const double more = 0.2;  /* of the fall, so that the drive stays at its peak */
static const double seen = 5e-3, lags = 0.03, probe = 0.01, engaged = 0.3;

/* Highest torque at a motor speed [rad/s]. */
static double top(double power, double speed, double peak) {
  double fast = mpc_maximum(fabs(speed), 1e-9);
  return mpc_minimum(peak, mpc_minimum(power / fast, MPC_TOLD_BREAKDOWN / (fast * fast)));
}

/* Take a torque as the drive's peak [N m], at most what was told, at least what holds the load. */
static void take(mpc_window *w, double peak) {
  w->peak = mpc_min(mpc_max(peak, fabs(MPC_REST_TORQUE)), MPC_TOLD_PEAK);
}

/* Take a power as the drive's limit [W], that told if it is no less. */
static void take_power(mpc_window *w, double power) {
  w->power = power < MPC_FULL_POWER ? power : MPC_TOLD_POWER;
}

void mpc_window_reset(mpc_window *w) {
  memset(w, 0, sizeof *w);
  w->power = MPC_TOLD_POWER;
  take(w, MPC_TOLD_PEAK);
}

int mpc_window_derated(const mpc_window *w) {
  return w->peak < MPC_TOLD_PEAK || w->power < MPC_TOLD_POWER;
}

/* Whether power rather than torque stayed the same while the drive gave less than asked. */
static int steadier_power(const mpc_window *w) {
  const double *t = w->short_torque, *p = w->short_power;
  double t_low = t[0], t_high = t[0], p_low = p[0], p_high = p[0];
  int i;
  for (i = 1; i < SHORTS; i++) {
    t_low = mpc_min(t_low, t[i]);
    t_high = mpc_max(t_high, t[i]);
    p_low = mpc_min(p_low, p[i]);
    p_high = mpc_max(p_high, p[i]);
  }
  return (p_high - p_low) * t_high < (t_high - t_low) * p_high;
}

/* Learn from a drive that gives less than asked what its peak is, or its power. */
static void learn(mpc_window *w, double given, double power, double speed) {
  double highest = top(MPC_TOLD_POWER, speed, MPC_TOLD_PEAK), known = w->power;
  int below, of_power, less;
  if (!(engaged * highest < given)) return;
  below = speed < (1.0 - MPC_CLEAR) * MPC_TOLD_SPEED && given < (1.0 - seen) * highest;
  of_power = power > (1.0 - lags) * known || steadier_power(w);
  if ((below && !of_power) || given > w->peak) take(w, given);
  less = below && power < (1.0 - lags) * MPC_TOLD_POWER;
  if ((less && of_power) || power > known) take_power(w, power);
}

/* Learn peak and power from what the drive follows; return whether it left some out. */
int mpc_window_follow(mpc_window *w, double torque, double left_out, double speed) {
  double given = fabs(torque), power = fabs(torque * speed), known = w->power;
  int i;
  if (copysign(MPC_GAIN, torque) * left_out > seen * MPC_TOLD_PEAK) {
    if (w->shorts == SHORTS) {
      for (i = 1; i < SHORTS; i++) {
        w->short_torque[i - 1] = w->short_torque[i];
        w->short_power[i - 1] = w->short_power[i];
      }
      w->shorts--;
    }
    w->short_torque[w->shorts] = given;
    w->short_power[w->shorts++] = power;
    if (w->shorts == SHORTS && isfinite(power)) learn(w, given, power, fabs(speed));
    return 1;
  }
  w->shorts = 0;
  if (w->peak < MPC_TOLD_PEAK && given > (1.0 - seen) * w->peak)
    take(w, (1.0 + probe) * mpc_max(given, w->peak));
  if (known < MPC_TOLD_POWER && power > (1.0 - seen) * known)
    take_power(w, (1.0 + probe) * mpc_max(power, known));
  return 0;
}

/* Lowest and highest value of each move; `changes` of speed may be NULL. */
void mpc_window_bounds(const mpc_window *w, double speed, const double *speeds, double cap,
                       const double *changes, double *low, double *high) {
  const double rest = MPC_REST_TORQUE, unit = MPC_UNIT;
  int i, narrows = mpc_min(w->power, MPC_TOLD_BREAKDOWN) < INFINITY;
  for (i = 0; i < MPC_NB; i++) {
    low[i] = (-w->peak - rest) / unit;
    high[i] = (w->peak - rest) / unit;
    if (cap < w->peak) {
      low[i] = mpc_maximum(low[i], (-cap - rest) / unit);
      high[i] = mpc_minimum(high[i], (cap - rest) / unit);
    }
    if (narrows) {
      double highest = top(w->power, i == 0 ? speed : speeds[i], w->peak);
      low[i] = mpc_maximum(low[i], (-highest - rest) / unit);
      high[i] = mpc_minimum(high[i], (highest - rest) / unit);
    }
    if (changes != NULL) {
      double largest = most * w->peak, fall = 0.5 * MPC_FALL * changes[i];
      fall = mpc_minimum(mpc_maximum(fall, -largest), largest) / unit;
      low[i] += fall;
      high[i] += fall;
    }
  }
  if (MPC_VOLTAGE < INFINITY) {
    double middle = MPC_REST_COMMAND + MPC_BACK * speed, gain = MPC_GAIN / unit;
    /* Where the two leave nothing, the speed is beyond what the voltage can brake: the torque's
       bound counts, and the drive cuts the rest. */
    low[0] = mpc_min(mpc_max(low[0], (-MPC_VOLTAGE - middle) * gain), high[0]);
    high[0] = mpc_max(mpc_min(high[0], (MPC_VOLTAGE - middle) * gain), low[0]);
  }
}

/* The input to ask of the drive, and the torque that it then holds over the sample, or NaN. */
double mpc_window_asked(const mpc_window *w, double move, double low, double high, double change,
                        double *held) {
  double torque = mpc_min(mpc_max(move, low), high) * MPC_UNIT;
  double fall = mpc_min(mpc_max(MPC_FALL * change, -2.0 * most * w->peak), 2.0 * most * w->peak);
  double side = fabs(move - high) < edge ? 1.0 : fabs(move - low) < edge ? -1.0 : 0.0;
  *held = NAN;
  if (side == 0.0) return torque;
  *held = side * w->peak - MPC_REST_TORQUE;
  return torque + side * (mpc_max(0.0, side * 0.5 * fall) + more * fabs(fall));
}

/* Highest torque that the windings' temperature allows after a sample with a torque [N m]. */
double mpc_window_cap(double *rise, double torque) {
  double left, over = torque / MPC_RATED;
  if (isfinite(torque)) *rise += MPC_THERMAL_SHARE * (over * over - *rise);
  left = (1.0 - *rise * (1.0 - MPC_THERMAL_AHEAD)) / MPC_THERMAL_AHEAD;
  return mpc_max(MPC_RATED * sqrt(mpc_max(left, 0.0)), MPC_THERMAL_LEAST);
}
