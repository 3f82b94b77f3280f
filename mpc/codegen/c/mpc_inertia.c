/* The inertia at the motor as drive, encoder and load cell show it: MotorInertia of
   mpc/winch/inertia.py. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

static const double lowest = 0.6, highest = 1.6; /* over that of the case, never beyond */
static const double same = 0.02;                 /* what is less is no difference */

void mpc_inertia_reset(mpc_inertia *m) {
  memset(m, 0, sizeof *m);
  m->ratio = 1.0;
  m->speed = m->torque = NAN;
}

/* Inertia over that of the case, as the plan reckons with it. */
double mpc_inertia_ratio(const mpc_inertia *m) {
  return fabs(m->ratio - 1.0) > same ? m->ratio : 1.0;
}

/* Hear a sample, and whether the drive cut its torque at the end of it. */
void mpc_inertia_update(mpc_inertia *m, const double *shown, int cut) {
  double speed = shown[MPC_MOTOR_SPEED], before = m->speed, first = m->torque;
  double pull = (shown[MPC_ROPE_TENSION] / MPC_REST_TENSION - 1.0) * MPC_REST_TORQUE;
  double torque = shown[MPC_MOTOR_TORQUE] - MPC_REST_TORQUE, change = speed - before, turns;
  double x, y, ratio, *s = m->sums;
  m->speed = speed;
  m->torque = torque;
  if (!cut) /* what counts is the mean over the sample */
    torque += MPC_BY_CHANGE * change + MPC_BY_RISE * (torque - first);
  turns = torque - pull;
  if (!isfinite(turns + change)) return;
  m->pull = pull;
  m->once[0] += MPC_SMOOTH * (change / MPC_SAMPLE_TIME - m->once[0]);
  m->once[1] += MPC_SMOOTH * (turns / MPC_INERTIA - m->once[1]);
  m->twice[0] += MPC_SMOOTH * (m->once[0] - m->twice[0]);
  m->twice[1] += MPC_SMOOTH * (m->once[1] - m->twice[1]);
  x = m->twice[0];
  y = m->twice[1];
  s[0] = MPC_KEPT * s[0] + 1.0;
  s[1] = MPC_KEPT * s[1] + x;
  s[2] = MPC_KEPT * s[2] + y;
  s[3] = MPC_KEPT * s[3] + x * x;
  s[4] = MPC_KEPT * s[4] + x * y;
  ratio = (s[4] - s[1] * s[2] / s[0] + MPC_PRIOR) / (s[3] - s[1] * s[1] / s[0] + MPC_PRIOR);
  m->ratio = mpc_min(mpc_max(ratio, lowest), highest);
}
