r"""What of a sample's signals a filter may believe: `SignalGate`.

    readings, what was expected, variances --> SignalGate.passes --> which may be believed

Three questions are put to the signals that are there.

* Does it move?  A reading that stays the same to the last bit, while what it should show moves by
  five standard deviations, is not believed; after five such updates it is stuck until it changes.
* Does it agree with its own rate?  Heave with heave rate, haul with motor speed, and the payload's
  displacement, velocity and acceleration with each other.
* Is it near what was expected?  Asked of the payload's signals and the load cell.  A payload's
  signal is turned away that is far off and disagrees with its rate as well: where they agree, it is
  the prediction that is wrong, and then the load cell is believed too.  Where the hook should be is
  never asked: another sea is no fault.

Far is six times the standard deviation that is claimed, or that there has been of late where the
world is not as told: a gate is there for numbers that lie, not for a plant that is a little
different.  What was turned away has to come near again; unit and encoder, which alone tell where
hook and drum are, may also begin anew when they have agreed with themselves for a second or two.
"""

import math

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray
from models.plant import MEASUREMENTS
from models.sensing import MEASURED

from .prediction import PredictionModel

_Mask = npt.NDArray[np.bool_]

_LIMIT = 6.0  # standard deviations
_MEMORY = 30.0  # in which it is learnt how large they are [s]
# The least of them over what is claimed: a filter made robust trusts its sensors too little.
_LEAST = np.array([1.0] * 4 + [0.1] * 4)
_LEARNING = 20.0  # before which nothing is turned away but what does not move [s]
_ROW, _LONGEST = 20, 2.0  # samples in a row, or [s], after which unit and encoder begin anew
_UPDATES, _MOVED = 5, 5.0  # updates without change, while so many standard deviations are expected
_ROUGH = 0.02  # of the hook's way in a sample, by which haul and speed may disagree
_GROWS = np.array([3.0, 2.0, 2.0, 3.0])  # powers of the time between, by which that grows
_APART = 1.0  # beyond which two readings are not compared [s]

_PAYLOAD = [MEASURED.index(name) for name in MEASUREMENTS]
_ACCELERATION, _VELOCITY, _DISPLACEMENT = _PAYLOAD
_HEAVE, _RATE = MEASURED.index("mru.heave"), MEASURED.index("mru.heave_rate")
_HAUL, _TURNING = MEASURED.index("drum.haul"), MEASURED.index("motor.speed")
_CELL = MEASURED.index("rope.tension")
_DEVICES = [0, _HEAVE, _HAUL, _CELL]  # the first signal of each: payload, unit, encoder, load cell
_DEVICE = np.searchsorted(_DEVICES, np.arange(len(MEASURED)), side="right") - 1
# What is compared with what was expected, and signals with their own rates.
_EXPECTED = np.array([*_PAYLOAD, _CELL])
_VALUES = np.array([_HEAVE, _HAUL, _VELOCITY, _DISPLACEMENT])
_RATES = np.array([_RATE, _TURNING, _ACCELERATION, _VELOCITY])
_OWN = 2  # pairs of which there is no prediction: unit and encoder


class SignalGate:
    """What is remembered of the signals of one filter, and which of the next to believe."""

    def __init__(self, model: PredictionModel) -> None:
        winch, T = model.winch, model.winch.sample_time
        self._T = T
        shift = winch.plant.C @ winch.moved[: len(winch.plant.A)]
        turning = np.array([shift[_HAUL, 0], shift[_TURNING, 1]])
        self._per_drum = 1.0 / turning  # the payload's on a rigid rope, per haul and motor speed
        self._per_rate = np.array([1.0, turning[0] / turning[1], 1.0, 1.0])  # value per rate and s
        # Two values, the trapezoid of two rates, and how far off that is: in the waves by their
        # third derivative, at the drum, whose torque has steps, and on an elastic rope by a share
        # of the hook's way.
        _, way, acceleration = model.waves
        self._values = 2.0 * model.R[_VALUES]
        self._rates = 0.5 * self._per_rate**2 * model.R[_RATES]
        jerk = acceleration**2 / way
        third = jerk * T**3 / 12.0
        self._bent = np.array([third, _ROUGH * way * T, _ROUGH * acceleration * T, third])
        # A reading that is taken now and then is shown again until the next.
        self._held = np.ceil(np.array(winch.plant.holds) / T - 1e-6).clip(1.0) - 1.0
        self._row = min(_ROW, math.ceil(_LONGEST / T))
        self.reset()

    def reset(self) -> None:
        """Forget every reading."""
        signals, pairs = len(MEASURED), len(_VALUES)
        self._samples = 0
        self._size = np.ones(len(_EXPECTED) + pairs)  # mean square over the variance
        self._away = np.zeros(signals, dtype=np.bool_)  # turned away at the last sample
        self._pair = np.zeros((2, pairs))  # values and rates that were believed last
        self._when = np.full(pairs, -math.inf)  # and when [s]
        self._shown = np.zeros((2, _OWN))  # what unit and encoder showed at the last sample
        self._agreed = np.zeros(_OWN, dtype=np.int64)  # samples since they disagreed with that
        self._last = np.full(signals, math.nan)
        self._same = np.zeros(signals, dtype=np.int64)  # updates without change
        self._before = np.zeros((2, signals))  # what was shown and expected at the last sample
        self._edges = np.zeros((2, 2, signals))  # of what was expected since the last update
        self._stuck = np.zeros(signals, dtype=np.bool_)

    def passes(
        self,
        reading: FloatArray,
        expected: FloatArray,
        innovation: FloatArray,
        variance: FloatArray,
        there: _Mask,
        age: float = 0.0,
    ) -> _Mask:
        """Return which signals may be believed, (ny,).

        Readings as they are shown, what was expected, how far the filter holds them to be from it,
        and the variance of that, (ny,); `there` is which have come at all, `age` that of the
        payload's [s].
        """
        self._samples += 1
        now = self._samples * self._T
        good = there & ~self._standing(reading, expected, variance, there)
        when = np.array([now, now, now - age, now - age])
        since = np.abs(when - self._when)
        old = since > _APART
        since[old] = _APART
        value, rate = reading[_VALUES], reading[_RATES]
        apart = value - self._pair[0] - 0.5 * since * self._per_rate * (rate + self._pair[1])
        apart[old] = 0.0
        bent = self._bent * (since / self._T) ** _GROWS
        spread = self._values + self._rates * since**2 + bent**2
        square = np.concatenate([innovation[_EXPECTED] ** 2, apart**2])
        square /= np.concatenate([variance[_EXPECTED], spread])
        both = good[_VALUES] & good[_RATES]
        asked = np.concatenate([good[_EXPECTED], both])
        far = asked & (square > _LIMIT**2 * self._size)
        # What was turned away does not agree by having been away for long.
        far[len(_EXPECTED) :] |= both & old & self._away[_VALUES]
        if now < _LEARNING:
            far[:] = False
        shown = np.array((value[:_OWN], rate[:_OWN]))
        if far.any() or self._away.any():
            self._away = there & self._turned_away(far, shown)
            good &= ~self._away
        self._shown = shown
        believed = both & good[_VALUES] & good[_RATES]
        share = max(self._T / _MEMORY, 1.0 / self._samples)
        learnt = self._size + share * (np.minimum(square, _LIMIT**2 * self._size) - self._size)
        known = np.concatenate([good[_EXPECTED], believed])
        self._size = np.where(known, np.maximum(learnt, _LEAST), self._size)
        self._pair = np.where(believed, (value, rate), self._pair)
        self._when = np.where(believed, when, self._when)
        return good

    def _turned_away(self, far: _Mask, shown: FloatArray) -> _Mask:
        """Return which signals are turned away, (ny,).

        What is far from what was expected or from its rate, and what unit and encoder show, (2, 2).
        """
        acceleration, velocity, displacement, cell = far[: len(_EXPECTED)]
        unit, drum, first, second = far[len(_EXPECTED) :]
        still, away = self._away, np.zeros(len(MEASURED), dtype=np.bool_)
        away[_ACCELERATION] = acceleration and (first or still[_ACCELERATION])
        away[_VELOCITY] = velocity and (first or second or still[_VELOCITY])
        away[_DISPLACEMENT] = displacement and (second or still[_DISPLACEMENT])
        wrong = far[: len(_PAYLOAD)] & ~away[_PAYLOAD]
        away[_CELL] = cell and not wrong.any()
        (value, rate), (value_before, rate_before) = shown, self._shown
        apart = value - value_before - 0.5 * self._T * self._per_rate[:_OWN] * (rate + rate_before)
        spread = self._values + self._rates * self._T**2 + self._bent**2
        agrees = apart**2 <= _LIMIT**2 * (self._size[len(_EXPECTED) :] * spread)[:_OWN]
        self._agreed = np.where(agrees & still[_VALUES[:_OWN]], self._agreed + 1, 0)
        unit, drum = np.array((unit, drum)) & (self._agreed < self._row)
        away[[_HEAVE, _RATE]], away[[_HAUL, _TURNING]] = unit, drum
        return away

    def _standing(
        self, reading: FloatArray, expected: FloatArray, variance: FloatArray, there: _Mask
    ) -> _Mask:
        """Return which signals do not move though they should, (ny,)."""
        again: _Mask = there & (reading == self._last)
        if not again.any() and not self._same.any():
            self._last = np.where(there, reading, self._last)
            self._before = np.array((reading, expected))
            return again
        # What was expected since the reading began to stay the same.
        should, begin = self._should(reading, expected), self._should(*self._before)
        self._before = np.array((reading, expected))
        low, high = np.where(self._same > 0, self._edges, begin)
        self._edges = np.array((np.fmin(low, should), np.fmax(high, should)))
        moved = there & ~again
        self._last = np.where(moved, reading, self._last)
        self._same += again
        self._same[moved] = 0
        travel = (self._edges[1] - self._edges[0]).max(axis=0)
        still = self._same > self._held
        standing = still & (self._stuck | (travel > _MOVED * np.sqrt(variance)))
        # What shows it of one signal shows it of all that come from the same device.
        standing = still & np.logical_or.reduceat(standing, _DEVICES)[_DEVICE]
        self._stuck = standing & (self._same >= _UPDATES * (self._held + 1))
        return standing

    def _should(self, reading: FloatArray, expected: FloatArray) -> FloatArray:
        """Return what signals should show, by the filter and as if the rope were rigid, (2, ny).

        What does not move draws the filter along.
        """
        should = np.array((expected, expected))
        rigid = reading[[_HEAVE, _RATE]] + self._per_drum * reading[[_HAUL, _TURNING]]
        should[1, [_DISPLACEMENT, _VELOCITY]] = rigid
        return should
