/* What the controller remembers from one step to the next, part by part.

   No pointers, so that all of it may be copied byte by byte.  Sizes are those of mpc_sizes.h. */
#ifndef MPC_MEMORY_H
#define MPC_MEMORY_H

#include "mpc_sizes.h"

/* The Kalman filter: its estimate, and the covariance while gains are not steady. */
typedef struct {
  double state[MPC_N]; /* the estimate */
  int unheard[MPC_NY]; /* for how many samples each signal was not believed */
  int heard;           /* samples with gains made beforehand */
  int there;           /* set of the last sample, a bit for each signal; -1 for none of them */
  int samples;         /* with that set */
  int holds;           /* whether the gain is steady, in `held` */
  int has_seen, has_spread, is_off, has_onward;
  double held[MPC_N * MPC_NY];
  double P[MPC_N * MPC_N];    /* covariance of the prediction, by which gains are made */
  double off[MPC_N * MPC_N];  /* what the prediction is off by, where P is not that */
  double seen[MPC_NY * MPC_N]; /* C P */
  double spread[MPC_NY];       /* variances of the innovations */
  double onward[MPC_N * (MPC_N + MPC_NY)]; /* A (I - K C) and A K of a gain that is held */
  double work[3][MPC_N * MPC_N];           /* of one step */
} mpc_filter;

/* Which signals were believed, and how large their errors have been. */
typedef struct {
  int samples;
  double size[8];
  int away[MPC_NY];
  double value[4], rate[4], when[4];
  double shown_value[2], shown_rate[2];
  int agreed[2];
  double last[MPC_NY];
  int same[MPC_NY];
  double reading[MPC_NY], expected[MPC_NY]; /* of the last sample */
  double low[2][MPC_NY], high[2][MPC_NY];
  int stuck[MPC_NY];
} mpc_gate;

/* The estimator: filter, gate, and what the linear model lacks. */
typedef struct {
  mpc_filter filter;
  mpc_gate gate;
  double ahead[MPC_N]; /* A chi */
  double speed;        /* the reckoned one [rad/s] */
  double given;        /* last command of late ones, NaN else */
  double drag;         /* at the sample before [N] */
  int begun, gated;
} mpc_estimator;

/* Inertia at the motor over that of the case. */
typedef struct {
  double ratio, pull, speed, torque, once[2], twice[2], sums[5];
} mpc_inertia;

/* What the drive can give, as far as it has been learnt. */
typedef struct {
  double peak, power;
  int shorts;
  double short_torque[3], short_power[3];
} mpc_window;

/* The programme's active set and its factors, as DAQP keeps them. */
typedef struct {
  int sense[MPC_NM], active[MPC_NA], count;
  double lambda[MPC_NA], L[MPC_NA * (MPC_NA + 1) / 2], D[MPC_NA];
} mpc_solver;

#if MPC_BANK
/* The autoregression of the bank, and its next model as far as it is made. */
typedef struct {
  double record[MPC_LEARNT_SPAN][2];
  int row, age, missing, since_gap, ready, turn;
  double power[2], gram[MPC_LEARNT_ALL * MPC_LEARNT_ALL], one, two;
  double model[2 * MPC_LEARNT_KNOTS * MPC_LEARNT_SEEN];
  double made[MPC_LEARNT_DEPTH][MPC_LEARNT_KNOTS][2];
  double errors[MPC_LEARNT_WHOLE][2], error_weights[MPC_LEARNT_WHOLE];
  /* Of the model in the making. */
  int working, stage, order, used, at[MPC_LEARNT_SEEN];
  double worth, most[2], noise[2];
  double R[MPC_LEARNT_SEEN * MPC_LEARNT_SEEN], S[MPC_LEARNT_SEEN * 6], T[36];
  double direct[6][MPC_LEARNT_SEEN], A[2][MPC_LEARNT_SEEN], about[4], first[4], later[4];
  double next[2 * MPC_LEARNT_KNOTS * MPC_LEARNT_SEEN], variance[MPC_LEARNT_KNOTS][2];
  double rows[(2 * MPC_LEARNT_STEPS + MPC_LEARNT_SEEN) * MPC_LEARNT_SEEN];
  double psi[(2 * MPC_LEARNT_STEPS + MPC_LEARNT_SEEN) * 2];
} mpc_learnt;

/* The bank of seas. */
typedef struct {
  mpc_learnt learnt;
  double heave[MPC_BANK_SPAN], rate[MPC_BANK_SPAN];
  int row, age, length, good, misfit;
  double made[MPC_BANK_DEPTH][MPC_BANK_MEMBERS][3];
  double errors[MPC_BANK_MEMBERS][3], judged[MPC_BANK_MEMBERS], since[MPC_BANK_MEMBERS][3];
  double shares[MPC_BANK_MEMBERS], blended[MPC_BANK_MEMBERS];
  double mixed[2 * MPC_BANK_KNOTS * MPC_BANK_SEEN];
} mpc_bank;
#endif

typedef struct {
  mpc_estimator estimator;
  mpc_window window;
  mpc_inertia inertia;
  mpc_solver solver;
#if MPC_BANK
  mpc_bank bank;
#endif
  double rise;             /* of the motor's temperature, over the rated one */
  double plan[MPC_NB];     /* the last good moves if limited */
  int has_plan, age;       /* and how old they are */
  double speeds[MPC_NB];   /* at the start of each move, by the last plan [rad/s] */
  double changes[MPC_NB];  /* over the first sample of each */
  double asked, sent;      /* torque asked of the drive [N m]; the command that went to it */
  double place, moving;    /* set point [m], [m/s] */
  double kept[MPC_WAITING + 1], told[MPC_WAITING + 1]; /* of commands on their way, newest first */
  double before;           /* the motor's speed at the last sample [rad/s] */
  int answered;
} mpc_memory;

#endif
