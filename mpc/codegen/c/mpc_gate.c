/* What of a sample's signals the filter may believe: SignalGate of mpc/winch/gate.py. */
#include "mpc_algebra.h"
#include "mpc_parts.h"

#define NY MPC_NY
#define COMPARED 4 /* signals that are compared with what was expected */
#define PAIRS 4    /* signals with their own rates */
#define OWN 2      /* pairs of which there is no prediction: unit and encoder */

enum { ACCELERATION, VELOCITY, DISPLACEMENT, HEAVE, RATE, HAUL, TURNING, CELL };

static const double limit = 6.0, memory = 30.0, learning = 20.0, moved_by = 5.0, apart_by = 1.0;
static const int updates = 5;
static const double least[COMPARED + PAIRS] = {1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.1};
static const int compared[COMPARED] = {ACCELERATION, VELOCITY, DISPLACEMENT, CELL};
static const int values_at[PAIRS] = {HEAVE, HAUL, VELOCITY, DISPLACEMENT};
static const int rates_at[PAIRS] = {RATE, TURNING, ACCELERATION, VELOCITY};
static const double grows[PAIRS] = {3.0, 2.0, 2.0, 3.0};
static const int device[NY] = {0, 0, 0, 1, 1, 2, 2, 3};

void mpc_gate_reset(mpc_gate *g) {
  int i;
  memset(g, 0, sizeof *g);
  for (i = 0; i < COMPARED + PAIRS; i++) g->size[i] = 1.0;
  for (i = 0; i < PAIRS; i++) g->when[i] = -INFINITY;
  for (i = 0; i < NY; i++) g->last[i] = NAN;
}

/* What signals should show, by the filter and as if the rope were rigid. */
static void should_show(const double *reading, const double *expected, double should[2][NY]) {
  memcpy(should[0], expected, NY * sizeof *expected);
  memcpy(should[1], expected, NY * sizeof *expected);
  should[1][DISPLACEMENT] = reading[HEAVE] + mpc_per_drum[0] * reading[HAUL];
  should[1][VELOCITY] = reading[RATE] + mpc_per_drum[1] * reading[TURNING];
}

/* Which signals do not move though they should. */
static void find_standing(mpc_gate *g, const double *reading, const double *expected,
                          const double *variance, const int *there, int *standing) {
  double should[2][NY], begin[2][NY];
  int i, k, again[NY], still[NY], whole[4] = {0, 0, 0, 0}, any = 0;
  for (i = 0; i < NY; i++) {
    again[i] = there[i] && reading[i] == g->last[i];
    any = any || again[i] || g->same[i] != 0;
  }
  if (any) {
    /* What was expected since the reading began to stay the same. */
    should_show(reading, expected, should);
    should_show(g->reading, g->expected, begin);
  }
  for (i = 0; i < NY; i++) {
    int moved = there[i] && !again[i];
    double travel = 0.0;
    standing[i] = still[i] = 0;
    g->reading[i] = reading[i];
    g->expected[i] = expected[i];
    if (any) {
      for (k = 0; k < 2; k++) {
        double low = g->same[i] > 0 ? g->low[k][i] : begin[k][i];
        double high = g->same[i] > 0 ? g->high[k][i] : begin[k][i];
        g->low[k][i] = fmin(low, should[k][i]);
        g->high[k][i] = fmax(high, should[k][i]);
      }
      travel = mpc_maximum(g->high[0][i] - g->low[0][i], g->high[1][i] - g->low[1][i]);
      g->same[i] = moved ? 0 : g->same[i] + again[i];
      still[i] = g->same[i] > mpc_held[i];
      standing[i] = still[i] && (g->stuck[i] || travel > moved_by * sqrt(variance[i]));
    }
    if (moved) g->last[i] = reading[i];
    if (standing[i]) whole[device[i]] = 1;
  }
  if (!any) return;
  for (i = 0; i < NY; i++) {
    /* What shows it of one signal shows it of all that come from the same device. */
    standing[i] = still[i] && whole[device[i]];
    g->stuck[i] = standing[i] && g->same[i] >= updates * (mpc_held[i] + 1.0);
  }
}

/* Which signals are turned away, of those far from what was expected or from their rates. */
static void turn_away(mpc_gate *g, const int *far, const double *value, const double *rate,
                      int *away) {
  const int *still = g->away, *expected = far, *pair = far + COMPARED;
  int i, wrong, own[OWN];
  memset(away, 0, NY * sizeof *away);
  away[ACCELERATION] = expected[0] && (pair[2] || still[ACCELERATION]);
  away[VELOCITY] = expected[1] && (pair[2] || pair[3] || still[VELOCITY]);
  away[DISPLACEMENT] = expected[2] && (pair[3] || still[DISPLACEMENT]);
  wrong = (expected[0] && !away[ACCELERATION]) || (expected[1] && !away[VELOCITY]) ||
          (expected[2] && !away[DISPLACEMENT]);
  away[CELL] = expected[3] && !wrong;
  for (i = 0; i < OWN; i++) {
    double apart = value[i] - g->shown_value[i] -
                   0.5 * MPC_SAMPLE_TIME * mpc_per_rate[i] * (rate[i] + g->shown_rate[i]);
    double spread = mpc_gate_values[i] + mpc_gate_rates[i] * MPC_SAMPLE_TIME * MPC_SAMPLE_TIME +
                    mpc_gate_bent[i] * mpc_gate_bent[i];
    int agrees = apart * apart <= limit * limit * (g->size[COMPARED + i] * spread);
    g->agreed[i] = agrees && still[values_at[i]] ? g->agreed[i] + 1 : 0;
    own[i] = pair[i] && g->agreed[i] < MPC_GATE_ROW;
  }
  away[HEAVE] = away[RATE] = own[0];
  away[HAUL] = away[TURNING] = own[1];
}

void mpc_gate_passes(mpc_gate *g, const double *reading, const double *expected,
                     const double *innovation, const double *variance, const int *there,
                     double age, int *good) {
  double now, share, value[PAIRS], rate[PAIRS], when[PAIRS], square[COMPARED + PAIRS];
  int i, both[PAIRS], old[PAIRS], far[COMPARED + PAIRS], any = 0;
  g->samples++;
  now = g->samples * MPC_SAMPLE_TIME;
  find_standing(g, reading, expected, variance, there, good);
  for (i = 0; i < NY; i++) good[i] = there[i] && !good[i];
  for (i = 0; i < COMPARED; i++) {
    int k = compared[i];
    square[i] = innovation[k] * innovation[k] / variance[k];
    far[i] = good[k] && square[i] > limit * limit * g->size[i];
  }
  for (i = 0; i < PAIRS; i++) {
    double since, apart, bent, spread;
    int k = COMPARED + i;
    when[i] = i < OWN ? now : now - age;
    value[i] = reading[values_at[i]];
    rate[i] = reading[rates_at[i]];
    since = fabs(when[i] - g->when[i]);
    old[i] = since > apart_by;
    if (old[i]) since = apart_by;
    apart = value[i] - g->value[i] - 0.5 * since * mpc_per_rate[i] * (rate[i] + g->rate[i]);
    if (old[i]) apart = 0.0;
    bent = mpc_gate_bent[i] * pow(since / MPC_SAMPLE_TIME, grows[i]);
    spread = mpc_gate_values[i] + mpc_gate_rates[i] * since * since + bent * bent;
    square[k] = apart * apart / spread;
    both[i] = good[values_at[i]] && good[rates_at[i]];
    /* What was turned away does not agree by having been away for long. */
    far[k] = (both[i] && square[k] > limit * limit * g->size[k]) ||
             (both[i] && old[i] && g->away[values_at[i]]);
  }
  if (now < learning) memset(far, 0, sizeof far);
  for (i = 0; i < COMPARED + PAIRS; i++) any = any || far[i];
  for (i = 0; i < NY; i++) any = any || g->away[i];
  if (any) {
    int away[NY];
    turn_away(g, far, value, rate, away);
    for (i = 0; i < NY; i++) {
      g->away[i] = there[i] && away[i];
      good[i] = good[i] && !g->away[i];
    }
  }
  for (i = 0; i < OWN; i++) {
    g->shown_value[i] = value[i];
    g->shown_rate[i] = rate[i];
  }
  share = mpc_max(MPC_SAMPLE_TIME / memory, 1.0 / g->samples);
  for (i = 0; i < COMPARED + PAIRS; i++) {
    int believed = i < COMPARED ? good[compared[i]]
                                : both[i - COMPARED] && good[values_at[i - COMPARED]] &&
                                      good[rates_at[i - COMPARED]];
    double most = mpc_minimum(square[i], limit * limit * g->size[i]);
    if (!believed) continue;
    g->size[i] = mpc_maximum(g->size[i] + share * (most - g->size[i]), least[i]);
    if (i >= COMPARED) {
      g->value[i - COMPARED] = value[i - COMPARED];
      g->rate[i - COMPARED] = rate[i - COMPARED];
      g->when[i - COMPARED] = when[i - COMPARED];
    }
  }
}
