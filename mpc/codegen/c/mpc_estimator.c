/* Kalman filter of winch, sea and sensors' errors: WinchEstimator of mpc/winch/estimator.py.

   A number that is not finite never gets in: a signal that shows one counts as missing. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

#define N MPC_N
#define NY MPC_NY
#define TELEMETRY 3 /* the first signals */
#define VELOCITY 1  /* among them */

static const double huge = 1e12;
static const double blind_after = 1.0; /* without the payload's signals [s] */
static const int heard_at[NY] = {
    MPC_PAYLOAD_ACCELERATION, MPC_PAYLOAD_VELOCITY, MPC_PAYLOAD_DISPLACEMENT, MPC_MRU_HEAVE,
    MPC_MRU_HEAVE_RATE,       MPC_DRUM_HAUL,        MPC_MOTOR_SPEED,          MPC_ROPE_TENSION};

void mpc_estimator_reset(mpc_estimator *e) {
  mpc_filter_reset(&e->filter);
  mpc_gate_reset(&e->gate);
  memset(e->ahead, 0, sizeof e->ahead);
  e->speed = e->drag = 0.0;
  e->given = NAN;
  e->begun = e->gated = 0;
}

/* Whether nothing has been heard of the payload's motion for a second. */
int mpc_estimator_blind(const mpc_estimator *e) {
  int i, least = e->filter.unheard[0];
  for (i = 1; i < TELEMETRY; i++)
    if (e->filter.unheard[i] < least) least = e->filter.unheard[i];
  return least * MPC_SAMPLE_TIME > blind_after;
}

/* The force of quadratic drag at a payload velocity that the linear model has not [N]. */
static double extra_drag(double velocity) {
  velocity = mpc_min(mpc_max(velocity, -MPC_HIGHEST_VELOCITY), MPC_HIGHEST_VELOCITY);
  return (MPC_LINEAR_DRAG - MPC_QUADRATIC_DRAG * fabs(velocity)) * velocity;
}

static double torque_of(double command, double speed) {
  return (command - MPC_REST_COMMAND - MPC_BACK * speed) * MPC_GAIN;
}

/* Add a share of a signal so many samples ago to its row, if it is one. */
static void share_of_row(double *row, int k, int back, double weight) {
  if (!(weight > 1e-9)) return;
  if (back == 0)
    mpc_add(row, weight, mpc_now + k * N, N);
  else
    row[mpc_register_at[k] + back - 1] += weight;
}

/* Rows for telemetry of an age [s], and how much its signals tell of now; 0 if it is as usual. */
static int late_rows(double age, double *rows, double *of_now) {
  int k;
  if (fabs(age - MPC_USUAL_AGE) <= MPC_AGE_SLACK) return 0;
  memcpy(rows, mpc_rows, NY * N * sizeof *rows);
  for (k = 0; k < TELEMETRY; k++) {
    double samples = (age - MPC_USUAL_AGE + mpc_delays[k]) / MPC_SAMPLE_TIME, whole, share;
    of_now[k] = mpc_minimum(mpc_maximum(1.0 - samples, 0.0), 1.0);
    samples = mpc_min(mpc_max(samples, 0.0), (double)mpc_register_depth[k]);
    whole = floor(samples + 1e-6);
    share = mpc_max(samples - whole, 0.0);
    memset(rows + k * N, 0, N * sizeof *rows);
    share_of_row(rows + k * N, k, (int)whole, 1.0 - share);
    share_of_row(rows + k * N, k, (int)whole + 1, share);
  }
  return 1;
}

/* The estimate of a sample.  `applied` is the command that does as much as a drive which cut its
   torque for a part of the sample before; NaN for the one that the drive says it has followed. */
void mpc_estimator_update(mpc_estimator *e, const double *shown, double applied) {
  double ahead[N], reading[NY], expected[NY], error[NY], of_now[NY], own_rows[NY * N];
  double age, now, drag, late;
  const double *rows = mpc_rows;
  int i, told, there[NY], believed[NY];
  memcpy(ahead, e->ahead, sizeof ahead);
  if (e->begun) {
    double given, before, after;
    if (!isfinite(applied)) applied = shown[MPC_DRIVE_APPLIED];
    given = isnan(e->given) ? applied : e->given;
    if (isfinite(given)) /* what is not known is taken as having held the load */
      mpc_add(ahead, torque_of(given, e->speed), mpc_B, N);
    if (given != applied && isfinite(applied)) mpc_add(ahead, applied - given, mpc_cut, N);
    before = e->drag;
    after = extra_drag(mpc_dot(mpc_velocity, ahead, N));
    mpc_add(ahead, 0.5 * (before + after), mpc_force, N);
  }
  e->begun = 1;
  age = isfinite(shown[MPC_PAYLOAD_AGE]) ? shown[MPC_PAYLOAD_AGE] : MPC_USUAL_AGE;
  told = shown[MPC_PAYLOAD_VALID] > 0.5 && age <= MPC_OLDEST;
  memcpy(of_now, mpc_usual_share, sizeof of_now);
  if (told && late_rows(age, own_rows, of_now)) rows = own_rows;
  mpc_times(rows, ahead, NY, N, expected);
  now = mpc_dot(mpc_velocity, ahead, N);
  /* Drag of then is that of the velocity in the same telegram. */
  drag = extra_drag(now);
  late = shown[MPC_PAYLOAD_VELOCITY];
  late = extra_drag(isfinite(late) ? late : now);
  for (i = 0; i < NY; i++) {
    reading[i] = shown[heard_at[i]];
    expected[i] += mpc_rest[i];
    error[i] = reading[i] - expected[i] -
               mpc_felt[i] * (of_now[i] * drag + (1.0 - of_now[i]) * late);
    there[i] = fabs(error[i]) < huge;
    if (i < TELEMETRY && !told) there[i] = 0;
    if ((i == 3 || i == 4) && shown[MPC_MRU_VALID] <= 0.5) there[i] = 0;
    if (!there[i]) {
      reading[i] = NAN;
      error[i] = 0.0;
    }
  }
  mpc_filter_innovations(&e->filter);
  mpc_gate_passes(&e->gate, reading, expected, error, e->filter.spread, there, age, believed);
  e->gated = 0;
  for (i = 0; i < NY; i++) e->gated = e->gated || (there[i] && !believed[i]);
  mpc_filter_correct(&e->filter, ahead, error, believed, rows == mpc_rows ? NULL : rows);
  e->speed = mpc_dot(mpc_reckoned, e->filter.state, N);
  e->drag = extra_drag(mpc_dot(mpc_velocity, e->filter.state, N));
}
