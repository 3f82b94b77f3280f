r"""Kalman filter of winch, sea and sensors' errors, for any set of signals: `WinchEstimator`.

    m[k], u applied over the last sample --> WinchEstimator.update --> chi[k]

A recipe for `mpc.programme.SampledFilter`: steady-state gains of the prediction model's Riccati
equation (Anderson and Moore, *Optimal Filtering*, 1979, sec. 4.4), for all signals and for those
sets of them that may be left; before it, for some seconds, the gains of a filter that does not yet
know the load's weight.  What comes late is compared with what was on its way at that age.

A number that is not finite never gets in: a signal that shows one counts as missing.
"""

import math
from itertools import product

import numpy as np
from typing_extensions import override

from models.basics import FloatArray
from models.plant import MEASUREMENTS
from models.sensing import HEARD, MEASURED, Measurement

from ..programme import SampledFilter, ages, late_row
from .gate import SignalGate
from .prediction import PredictionModel, constant_scales

_AT = np.array([HEARD.index(name) for name in MEASURED])
_AGE, _FRESH = HEARD.index("payload.age"), HEARD.index("payload.valid")
_UNIT = HEARD.index("mru.valid")
_TELEMETRY, _REFERENCE = slice(0, 3), slice(3, 5)  # among the measurements
_VELOCITY = MEASURED.index("payload.velocity")
_GROUPS = 3, 2, 2, 1  # measurements of telegram, reference unit, encoder and load cell
_FORGOTTEN = 3600.0  # in which the gains let constants be forgotten of which nothing tells [s]
_APPLIED = HEARD.index("drive.applied")
_STARTING = 10.0  # in which the gain comes to its steady value [s]
# What is not known of the constants at first, over `constant_scales`.
_AT_FIRST = (0.3, 0.1, 0.01, 0.3)
_LOWER = 1.0  # by which the load may hang lower or higher at first [m]
_HUGE = 1e12
_BLIND = 1.0  # without the payload's signals [s]
_LATER = 1e-3  # of a sample: an age that is no other than usual


class WinchEstimator(SampledFilter):
    """The filter's state, and what moves it.

    Raises SolverError if the Riccati equation has no solution.
    """

    def __init__(self, model: PredictionModel) -> None:
        self.model, winch = model, model.winch
        # Telemetry that is later or earlier than usual is compared with what was on its way then.
        T = winch.sample_time
        self._delays = delays = T * ages(winch.plant, T)[_TELEMETRY]
        self._usual, self._slack = winch.data.delay, _LATER * T
        # What is older than what is remembered has nothing to be compared with.
        kept = T * np.array([model.depth[name] for name in MEASUREMENTS])
        self._oldest = self._usual + self._slack + float((kept - delays).min())
        # All is counted from rest, where the rope already carries the load.
        self._rest = np.zeros(len(MEASURED))
        self._rest[MEASURED.index("rope.tension")] = winch.rest_tension
        self._rows, self._B = np.ascontiguousarray(model.C), np.ascontiguousarray(model.B[:, 0])
        more = (0, model.size - winch.size)
        self._force = np.pad(winch.from_constants[:, 0], more)
        # Of what the drive cuts from a command that has arrived.
        self._cut = np.pad(winch.from_constants[:, 1] * winch.gain, more)
        self._velocity, self._speed = np.pad(winch.velocity, more), np.pad(winch.reckoned, more)
        # The accelerometer feels a force at once: one of now in what telemetry tells of now, one of
        # then in what comes late.
        self._felt = np.zeros(len(MEASURED))
        self._felt[_TELEMETRY] = winch.force_felt
        self._usual_share = self._share_of_now(delays / T)
        self.gate = SignalGate(model)
        # For the gains the constants are forgotten in an hour: one of which nothing tells would
        # else drift for ever.
        A, at = model.A.copy(), np.arange(model.constants_at.start, model.constants_at.stop)
        A[at, at] = math.exp(-T / _FORGOTTEN)
        super().__init__(A, model.C, model.G, model.R, model.covariance, _sets(model))
        self.begin_with(_at_first(model), round(_STARTING / T))

    @override
    def reset(self) -> None:
        """Forget everything: the load hangs at rest in still water."""
        super().reset()
        self._ahead = np.zeros(self.model.size)
        self.speed = 0.0  # the reckoned one
        self.given = math.nan  # the last command, of a controller whose commands are late
        self._drag = 0.0  # force of quadratic drag at the sample before [N]
        self._begun = False
        self.gate.reset()
        self.gated = False  #: Whether the last sample had a number that was not believed.

    @property
    def blind(self) -> bool:
        """Whether nothing has been heard of the payload's motion for a second."""
        return bool(self.unheard[_TELEMETRY].min() * self.model.winch.sample_time > _BLIND)

    def update(self, measurement: Measurement, applied: float = math.nan) -> FloatArray:
        """Return chi at this sample, given what is shown now.

        The input over the sample before is that which the drive says it has followed, not the one
        that it was asked for.  `applied` is the command that does as much as a drive which cut its
        torque for a part of the sample; NaN for the one that the drive says it has followed.
        """
        shown = measurement.values
        winch = self.model.winch
        ahead = self._ahead
        # What A chi lacks: the input, which is known only now that the drive has told of it, and
        # the drag.  At the first sample there was no input, and the load is taken to be at rest.
        if self._begun:
            if not math.isfinite(applied):
                applied = float(shown[_APPLIED])
            given = applied if math.isnan(self.given) else self.given
            if math.isfinite(given):  # what is not known is taken as having held the load
                ahead = ahead + self._B * winch.torque(given, self.speed)
            if given != applied and math.isfinite(applied):
                ahead = ahead + self._cut * (applied - given)
            # Quadratic drag at the mean of the velocities before and after: no linear model has it.
            before, after = self._drag, winch.extra_drag(float(self._velocity @ ahead))
            ahead = ahead + self._force * (0.5 * (before + after))
        self._begun = True
        # Age and validity of the telemetry come with it: old values are used as such, and a flag
        # that says "not valid" takes a signal out before its number is looked at.
        age, reading = float(shown[_AGE]), shown[_AT]
        age = age if math.isfinite(age) else self._usual
        # What is not shown is not late: a row for an age that grows would have no steady gain.
        told = shown[_FRESH] > 0.5 and age <= self._oldest
        rows, of_now = self._late(age) if told else (self._rows, self._usual_share)
        expected = rows @ ahead + self._rest
        error = reading - expected
        # Drag of then is that of the velocity in the same telegram.  Of the velocity estimated then
        # it would shake the estimate itself: a filter that trusts its accelerometer, to which an
        # error of the velocity is one of the force, falls into an oscillation above half a metre
        # per second.
        now, then = float(self._velocity @ ahead), float(reading[_VELOCITY])
        drag, late = winch.extra_drag(now), winch.extra_drag(then if math.isfinite(then) else now)
        error -= self._felt * (of_now * drag + (1.0 - of_now) * late)
        there = np.abs(error) < _HUGE
        if not told:
            there[_TELEMETRY] = False
        if shown[_UNIT] <= 0.5:
            there[_REFERENCE] = False
        reading = np.where(there, reading, math.nan)
        error = np.where(there, error, 0.0)
        believed = self.gate.passes(reading, expected, error, self.innovations, there, age)
        self.gated = bool((there > believed).any())
        self.correct(ahead, error, believed, None if rows is self._rows else rows)
        self.speed = float(self._speed @ self.state)
        self._drag = winch.extra_drag(float(self._velocity @ self.state))
        return self.state

    def advance(self, ahead: FloatArray) -> None:
        """Take A chi, which the caller has computed among other products, as next prediction."""
        self._ahead = ahead

    def _late(self, age: float) -> tuple[FloatArray, FloatArray]:
        """Return C for telemetry of an age [s], and how much each signal tells of now (ny,).

        Its age changes by as much for all that it tells.
        """
        if abs(age - self._usual) <= self._slack:
            return self._rows, self._usual_share
        rows, model = self._rows.copy(), self.model
        samples = (age - self._usual + self._delays) / model.winch.sample_time
        for k, name in enumerate(MEASUREMENTS):
            rows[k] = late_row(model.now[k], model.first[name], model.depth[name], samples[k])
        return rows, self._share_of_now(samples)

    def _share_of_now(self, samples: FloatArray) -> FloatArray:
        """Return how much each signal tells of now, (ny,), of telemetry so late [samples]."""
        share = np.ones(len(MEASURED))
        share[_TELEMETRY] = np.clip(1.0 - samples, 0.0, 1.0)
        return share


def _sets(model: PredictionModel) -> dict[bytes, FloatArray]:
    """Return the sets of signals that have a steady gain, and the noise with each.

    Of a telegram, of the reference unit, the encoder and the load cell each is there as a whole or
    not; a set that tells neither of the drum nor of the payload has no steady gain.  Noise on load
    and rope buys robustness where the load is heard of; where neither telegram nor load cell tells
    of it, it would let the drum's speed tell of a load that swings, and is left out.
    """
    unshaken = model.G.copy()
    unshaken[:, model.load_noise] = 0.0
    found = {}
    for telegram, unit, encoder, cell in product((True, False), repeat=4):
        if telegram or encoder:
            there = np.repeat((telegram, unit, encoder, cell), _GROUPS)
            found[there.tobytes()] = model.G if telegram or cell else unshaken
    return found


def _at_first(model: PredictionModel) -> FloatArray:
    """Return the covariance at a start, where the constants are not known, (n, n)."""
    winch = model.winch
    at = np.arange(model.constants_at.start, model.constants_at.stop)
    P = np.array(model.covariance)
    # The steady covariance holds that the constants are known but for their slow drift: a load of
    # another weight would be learnt as slowly.
    P[at, at] += (np.array(_AT_FIRST) * constant_scales(model)) ** 2
    # A load of another weight hangs lower: the winch's state is not known any better at first.
    moved = winch.moved[:, 0]
    P[: winch.size, : winch.size] += (_LOWER**2) * np.outer(moved, moved)
    return P
