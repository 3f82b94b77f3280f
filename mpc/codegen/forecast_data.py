"""What the bank of seas knows, as tables for the C.

The C makes no forecast at every lead: what a path does to the programme is linear in the motion at
the knots of the forecast, and that product is made here.
"""

from __future__ import annotations

import numpy as np

from models.basics import FloatArray

from ..forecast import AdaptiveAR, SeaBank, bank, forecast
from ..linear import LinearMPC
from .tables import Tables


def add_forecast(tables: Tables, controller: LinearMPC) -> None:
    """Add the bank, if the controller has one."""
    b = controller.predictor
    tables.size("BANK", isinstance(b, SeaBank))
    if not isinstance(b, SeaBank):
        return
    knots, steps = len(b._knots), b._step
    seas = len(b._tables.rows[0])
    tables.size("BANK_MEMBERS", seas + 1)
    tables.size("BANK_TOLD", len(bank._DOUBTS))
    tables.size("BANK_KNOTS", knots)
    tables.size("BANK_STEP", steps)
    tables.size("BANK_EVERY", b._every)
    tables.size("BANK_FARTHEST", int(b._ahead.max()))
    tables.size("BANK_DEPTH", b._depth)
    tables.size("BANK_SPAN", b._span)
    tables.size("BANK_SEEN", bank._TAPS + bank._RATES)
    tables.size("BANK_LENGTHS", len(bank._LENGTHS))
    tables.whole("bank_lengths", bank._LENGTHS)
    tables.whole("bank_grows", sorted(b._grows))
    tables.whole("bank_ago", b._ahead // b._every)
    tables.array("bank_prior", b._prior)
    tables.large("bank_rows", b._tables.rows)
    tables.large("bank_judged", b._tables.judged)
    tables.array("along", _along(controller, b))
    _add_learnt(tables, b)


def _along(controller: LinearMPC, b: SeaBank) -> FloatArray:
    """Return what the knots of a forecast do to gradient and rows, (nb + nr, 2k + 2).

    The last two columns are those of a motion now that is another than the forecast's.
    """
    of = controller.products
    fading = forecast._fading(b.leads.size, b.sample_time)
    path = np.zeros((2 * b.leads.size, 2 * len(b._knots) + 2))
    path[0::2, :-2], path[1::2, :-2] = np.split(b._hermite, 2)
    path[0::2, -2], path[1::2, -1] = fading, fading
    return np.vstack([of.path_gradient, of.path_free]) @ path


def _add_learnt(tables: Tables, b: SeaBank) -> None:
    """Add the autoregression, and what its knots do to those of the bank and to what is judged."""
    learnt = b._learnt
    r = learnt._regression
    for name, value in {
        "SPAN": r.span,
        "SEEN": r._n,
        "ALL": len(r._gram),
        "KNOTS": len(r.knots),
        "STEPS": r._steps,
        "ORDER": r._p,
        "WHOLE": len(r._whole),
        "DEPTH": int(r._ago[-1]) + 1,
        "SPACING": r._q,
        "HALF": r._half,
        "WAIT": r._wait,
        "EVERY": learnt._every,
    }.items():
        tables.size(f"LEARNT_{name}", value)
    for name, number in {
        "TIME": learnt.sample_time,
        "WIDTH": learnt._D,
        "SHARE": learnt._share,
        "FORGET": r._forget,
        "FORGET_ERROR": r._forget_error,
        "PER_SPACING": r._per_spacing,
    }.items():
        tables.constant(f"LEARNT_{name}", number)
    tables.whole("learnt_lags", r.lags)
    tables.whole("learnt_ago", r._ago)
    tables.whole("learnt_whole", r._whole)
    tables.array("learnt_smooth", r._smooth)
    tables.array("learnt_next_sample", learnt._next_sample)
    by_model, by_fading = _paths(learnt)
    at_knots = [_in_turn(moved) for moved in b._moved]
    tables.array("bank_moved", np.array([m @ by_model for m in at_knots]), parts=True)
    tables.array("bank_faded", np.array([m @ by_fading for m in at_knots]), parts=True)
    tables.array("bank_to_judged", np.array([m @ by_model for m in b._to_judged]), parts=True)


def _paths(learnt: AdaptiveAR) -> tuple[FloatArray, FloatArray]:
    """Return the path of all leads, displacement and velocity in turn, as a linear function.

    Of the knots of a model, (2n, 2k), and of displacement and velocity now, while there is none.
    """
    n = learnt.leads.size
    by_model = np.empty((2 * n, learnt._weights.shape[1]))
    by_model[0::2], by_model[1::2] = learnt._weights[:n], learnt._weights[n:]
    by_fading = np.zeros((2 * n, 2))
    by_fading[0::2, 0] = by_fading[1::2, 1] = learnt._fade
    return by_model, by_fading


def _in_turn(rows: FloatArray) -> FloatArray:
    """Return rows of values and then of rates, (2k, .), as those of each knot in turn."""
    return np.asarray(rows.reshape(2, -1, rows.shape[1]).transpose(1, 0, 2).reshape(rows.shape))
