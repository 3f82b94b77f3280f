/* What the parts of the controller have for each other.  Each repeats a class of the Python. */
#ifndef MPC_PARTS_H
#define MPC_PARTS_H

#include "mpc.h"
#include "mpc_data.h"

#ifndef INFINITY
#define INFINITY HUGE_VAL
#endif

/* Kalman filter: mpc/programme/kalman.py. */
void mpc_filter_reset(mpc_filter *filter);
void mpc_filter_innovations(mpc_filter *filter);
void mpc_filter_correct(mpc_filter *filter, const double *ahead, const double *error,
                        const int *there, const double *rows);

/* Which signals to believe: mpc/winch/gate.py. */
void mpc_gate_reset(mpc_gate *gate);
void mpc_gate_passes(mpc_gate *gate, const double *reading, const double *expected,
                     const double *innovation, const double *variance, const int *there,
                     double age, int *good);

/* Estimate of winch, sea and errors: mpc/winch/estimator.py. */
void mpc_estimator_reset(mpc_estimator *estimator);
void mpc_estimator_update(mpc_estimator *estimator, const double *shown, double applied);
int mpc_estimator_blind(const mpc_estimator *estimator);

/* Inertia at the motor: mpc/winch/inertia.py. */
void mpc_inertia_reset(mpc_inertia *inertia);
void mpc_inertia_update(mpc_inertia *inertia, const double *shown, int cut);
double mpc_inertia_ratio(const mpc_inertia *inertia);

/* Limits of the drive: DriveWindow and TorqueBudget of mpc/linear/winch_mpc.py. */
void mpc_window_reset(mpc_window *window);
int mpc_window_derated(const mpc_window *window);
int mpc_window_follow(mpc_window *window, double torque, double left_out, double speed);
void mpc_window_bounds(const mpc_window *window, double speed, const double *speeds, double cap,
                       const double *changes, double *low, double *high);
double mpc_window_asked(const mpc_window *window, double move, double low, double high,
                        double change, double *held);
double mpc_window_cap(double *rise, double torque);

/* The quadratic programme: mpc/programme/qp.py.  Returns whether there is an answer. */
void mpc_solver_reset(mpc_solver *solver);
int mpc_solver_solve(mpc_solver *solver, const double *gradient, const double *lower,
                     const double *upper, double *moves, double *multipliers);

#if MPC_BANK
/* Forecasts of the hook: mpc/forecast/bank.py, mpc/forecast/autoregressive.py. */
void mpc_bank_reset(mpc_bank *bank);
void mpc_bank_update(mpc_bank *bank, double heave, double rate, int valid);
void mpc_bank_forecast(const mpc_bank *bank, double *at_knots);
void mpc_learnt_reset(mpc_learnt *learnt);
void mpc_learnt_update(mpc_learnt *learnt, double heave, double rate, int valid);
void mpc_learnt_forecast(const mpc_learnt *learnt, const double *by_model, const double *by_fading,
                         int count, double *found);
#endif

#endif
