r"""Kalman filter of winch, sea and sensors' errors, for any set of signals: `WinchEstimator`.

    m[k], u applied over the last sample --> WinchEstimator.update --> chi[k]

Steady-state gain of the prediction model's Riccati equation (Anderson and Moore, *Optimal
Filtering*, 1979, sec. 4.4); before it, for some seconds, the gains of a filter that does not yet
know the load's weight.  Where signals are missing, the gain is that of the others alone, with the
covariance that they lead to (`mpc.programme.kalman.ChangingGains`): made for all signals together
it would let the estimate run away.  What comes late is compared with what was on its way at that
age.

A number that is not finite never gets in: a signal that shows one counts as missing.
"""

import math
from contextlib import suppress
from itertools import product

import numpy as np

from models.basics import FloatArray, SolverError, read_only
from models.plant import MEASUREMENTS
from models.sensing import HEARD, MEASURED, Measurement

from ..programme import ChangingGains, corrected, kalman_gain, prediction_covariance
from .gate import SignalGate
from .prediction import PredictionModel, ages, constant_scales

_AT = np.array([HEARD.index(name) for name in MEASURED])
_AGE, _FRESH = HEARD.index("payload.age"), HEARD.index("payload.valid")
_UNIT = HEARD.index("mru.valid")
_TELEMETRY, _REFERENCE = slice(0, 3), slice(3, 5)  # among the measurements
_GROUPS = _TELEMETRY, _REFERENCE, slice(5, 7), slice(7, 8)  # telegram, unit, encoder, load cell
_FORGOTTEN = 3600.0  # in which the gains let constants be forgotten of which nothing tells [s]
_APPLIED = HEARD.index("drive.applied")
_STARTING = 10.0  # in which the gain comes to its steady value [s]
# What is not known of the constants at first, over `constant_scales`.
_AT_FIRST = (0.3, 0.1, 0.01, 0.3)
_LOWER = 1.0  # by which the load may hang lower or higher at first [m]
_HUGE = 1e12
_BLIND = 1.0  # without the payload's signals [s]
_LATER = 1e-3  # of a sample: an age that is no other than usual


class WinchEstimator:
    """The filter's state, and what moves it.

    Raises SolverError if the Riccati equation has no solution.
    """

    def __init__(self, model: PredictionModel) -> None:
        self.model = model
        self.covariance = kalman_covariance(model)
        self.gain = kalman_gain(model.C, model.R, self.covariance)
        self._gains = changing_gains(model, self.covariance)
        self._first = _first_gains(model, self.covariance)
        self._C = np.ascontiguousarray(model.C)
        self._A = np.ascontiguousarray(model.A)
        self._B = np.ascontiguousarray(model.B[:, 0])
        # Telemetry that is later or earlier than usual is compared with what was on its way then.
        delays = ages(model.winch)
        self._usual = model.winch.data.delay
        self._own = {name: delays[name] - self._usual for name in MEASUREMENTS}
        # What is older than what is remembered has nothing to be compared with.
        self._oldest = _LATER * model.winch.sample_time + min(
            model.depth[name] * model.winch.sample_time - self._own[name] for name in MEASUREMENTS
        )
        self._slack = _LATER * model.winch.sample_time
        # All is counted from rest, where the rope already carries the load.
        self._rest = np.zeros(len(MEASURED))
        self._rest[MEASURED.index("rope.tension")] = model.winch.rest_tension
        self._force, self._velocity = np.zeros(model.size), np.zeros(model.size)
        self._force[: model.winch.size] = model.winch.from_constants[:, 0]
        self._velocity[: model.winch.size] = model.winch.velocity
        # The accelerometer feels a force at once, so that it is in what telemetry takes in at this
        # sample (`_sent`, still on its way) and, with a delay below a sample, in a part of what
        # arrives now (`_felt`).
        self._sent, self._felt = np.zeros(model.size), np.zeros(len(MEASURED))
        for k, name in enumerate(MEASUREMENTS):
            now = model.winch.force_felt[k]
            if model.depth[name]:
                self._sent[model.first[name]] = now
            self._felt[k] = now * max(0.0, 1.0 - delays[name] / model.winch.sample_time)
        self._speed = np.zeros(model.size)
        self._speed[: model.winch.size] = model.winch.reckoned
        self.gate = SignalGate(model)
        self._cut = np.zeros(model.size)  # of what the drive cuts from a command that has arrived
        self._cut[: model.winch.size] = model.winch.from_constants[:, 1] * model.winch.gain
        self.reset()

    def reset(self) -> None:
        """Forget everything: the load hangs at rest in still water."""
        self.state = np.zeros(self.model.size)
        self._ahead = np.zeros(self.model.size)
        self.speed = 0.0  # the reckoned one
        self.given = math.nan  # the last command, of a controller whose commands are late
        self._drag = 0.0  # force of quadratic drag at the sample before [N]
        self._begun = False
        self._samples = 0
        self.gate.reset()
        self.gated = False  #: Whether the last sample had a number that was not believed.
        self._unheard = 0  # samples since the payload was last heard of
        self._gains.begin(self.covariance)

    @property
    def blind(self) -> bool:
        """Whether nothing has been heard of the payload's motion for a second."""
        return self._unheard * self.model.winch.sample_time > _BLIND

    @property
    def sea_covariance(self) -> FloatArray:
        """Covariance of the sea's state once the sample is known, (nh, nh)."""
        at = self.model.sea_at
        kept = self.covariance - self.gain @ self.model.C @ self.covariance
        return np.array(0.5 * (kept + kept.T)[at, at])

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
            ahead = ahead + self._force * (0.5 * (before + after)) + self._sent * before
        self._begun = True
        # Age and validity of the telemetry come with it: old values are used as such, and a flag
        # that says "not valid" takes a signal out before its number is looked at.
        age, reading = float(shown[_AGE]), shown[_AT]
        age = age if math.isfinite(age) else self._usual
        rows = self._late(age)
        expected = rows @ ahead + self._rest
        error = reading - expected
        error -= self._felt * winch.extra_drag(float(self._velocity @ ahead))
        there = np.abs(error) < _HUGE
        if not shown[_FRESH] > 0.5 or age > self._oldest:
            there[_TELEMETRY] = False
        if shown[_UNIT] <= 0.5:
            there[_REFERENCE] = False
        reading = np.where(there, reading, math.nan)
        error = np.where(there, error, 0.0)
        variance = self._gains.innovations
        believed = self.gate.passes(reading, expected, error, variance, there, age)
        self.gated = bool((there > believed).any())
        there = believed
        self._unheard = 0 if there[_TELEMETRY].any() else self._unheard + 1
        if there.all() and self._samples < len(self._first):
            gain = self._first[self._samples]
            self._samples += 1
        else:
            gain = self._gains.at(there, None if rows is self._C else rows)
            error = np.where(there, error, 0.0)
        self.state = ahead + gain @ error
        if not float(np.abs(self.state).max()) < _HUGE:  # no number, or no longer of this world
            self.reset()
        self.speed = float(self._speed @ self.state)
        self._drag = winch.extra_drag(float(self._velocity @ self.state))
        return self.state

    def advance(self, ahead: FloatArray) -> None:
        """Take A chi, which the caller has computed among other products, as next prediction."""
        self._ahead = ahead

    def _late(self, age: float) -> FloatArray:
        """Return C for telemetry of an age [s]."""
        if abs(age - self._usual) <= self._slack:
            return self._C
        rows = self._C.copy()
        for name in MEASUREMENTS:
            rows[MEASURED.index(name)] = self.model.late_row(name, age + self._own[name])
        return rows


def kalman_covariance(model: PredictionModel) -> FloatArray:
    """Return the covariance of the steady one-step prediction, (n, n).

    Raises SolverError if there is none.
    """
    P = prediction_covariance(model.A, model.C, model.G, model.R, model.scale)
    # Some states are known to a fiftieth of their size and less: in units of what they are known
    # to, the equation is solved an order of magnitude closer.
    known = np.sqrt(np.diag(P))
    return read_only(prediction_covariance(model.A, model.C, model.G, model.R, known))


def changing_gains(model: PredictionModel, covariance: FloatArray) -> ChangingGains:
    """Return the gains for any set of signals; states are scaled by a covariance (n, n).

    Of a telegram, of the reference unit, the encoder and the load cell each is there as a whole or
    not; a set that tells neither of the drum nor of the payload has no steady gain.  For the gains
    the constants are forgotten in an hour: one of which nothing tells would else drift for ever.
    Noise on load and rope buys robustness where the load is heard of; where neither telegram nor
    load cell tells of it, it would let the drum's speed tell of a load that swings, and is left
    out.
    """
    A, kept = model.A.copy(), np.sqrt(np.diag(covariance))
    at = np.arange(model.constants_at.start, model.constants_at.stop)
    A[at, at] = math.exp(-model.winch.sample_time / _FORGOTTEN)
    scale = np.where(kept > 0.0, kept, model.scale)
    steady: dict[bytes, tuple[FloatArray, FloatArray | None]] = {}
    unshaken = model.G.copy()
    unshaken[:, model.load_noise] = 0.0
    for aboard in product((True, False), repeat=4):
        there = np.zeros(len(MEASURED), dtype=np.bool_)
        for part, own in zip(_GROUPS, aboard, strict=True):
            there[part] = own
        if not (aboard[0] or aboard[2]):
            continue
        G = model.G if aboard[0] or aboard[3] else unshaken
        P = None
        with suppress(SolverError):
            P = prediction_covariance(A, model.C[there], G, model.R[there], scale)
        steady[there.tobytes()] = G @ G.T, P
    return ChangingGains(A, model.C, model.G @ model.G.T, model.R, steady, scale)


def _first_gains(model: PredictionModel, P: FloatArray) -> list[FloatArray]:
    """Return the gains after a start at which the constants are not known, (k, n, ny)."""
    winch = model.winch
    at = np.arange(model.constants_at.start, model.constants_at.stop)
    P = np.array(P)
    # The steady covariance holds that the constants are known but for their slow drift: a load of
    # another weight would be learnt as slowly.
    P[at, at] += (np.array(_AT_FIRST) * constant_scales(model)) ** 2
    # A load of another weight hangs lower: the winch's state is not known any better at first.
    moved = winch.moved[:, 0]
    P[: winch.size, : winch.size] += (_LOWER**2) * np.outer(moved, moved)
    added, gains = model.G @ model.G.T, []
    for _ in range(round(_STARTING / winch.sample_time)):
        gain = kalman_gain(model.C, model.R, P)
        gains.append(gain)
        P = model.A @ corrected(P, model.C, model.R, gain) @ model.A.T + added
    return gains
