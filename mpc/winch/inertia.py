r"""The inertia at the motor as its drive, encoder and load cell show it: `MotorInertia`.

    torque, speed, tension --> low-pass --> regression --> I over that of the case

What the torque has over that which holds the rope's tension turns the motor, `I x = y`.  Both sides
go through the same low-pass, so that a speed that is rounded need not be differentiated, and their
covariance over the last minutes tells I.  Friction and the gear's losses go with the speed, a
quarter of a wave off, and constants have no covariance.
"""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from models.basics import FloatArray
from models.plant import zero_order_hold
from models.sensing import HEARD

from .sampled import SampledWinch

Of = TypeVar("Of", float, FloatArray)

_SMOOTH = 0.5  # [s]
_MEMORY = 120.0  # [s]
# What is told counts as much as so many seconds at an acceleration of this share of the peak's.
_BELIEVED, _SHARE = 10.0, 0.1
_AT_ONCE = 1e4  # [rad/s]
_LOW, _HIGH = 0.6, 1.6  # never beyond
_SAME = 0.02  # of the inertia: what is less is no difference
_TORQUE, _SPEED, _TENSION = (
    HEARD.index(name) for name in ("motor.torque", "motor.speed", "rope.tension")
)


class Turns(NamedTuple):
    """How a motor of another inertia turns: as that of the case would under another torque."""

    ratio: float  #: Inertia over that of the case.
    pull: float  #: Torque with which the rope pulls, over that at rest, in the unit of the moves.

    def planned(self, asked: Of) -> Of:
        """Return the move of the case's motor that turns as this one does if so asked."""
        if self.ratio == 1.0:
            return asked
        return (asked + (self.ratio - 1.0) * self.pull) / self.ratio

    def asked(self, planned: Of) -> Of:
        """Return what is to be asked of this motor, so that it turns as planned."""
        if self.ratio == 1.0:
            return planned
        return self.ratio * planned - (self.ratio - 1.0) * self.pull


class MotorInertia:
    """Inertia at the motor over that of the case, learnt from sample to sample."""

    def __init__(self, winch: SampledWinch) -> None:
        T, self._winch = winch.sample_time, winch
        self._kept, self._new = math.exp(-T / _MEMORY), -math.expm1(-T / _SMOOTH)
        peak = winch.case.winch.drive.torque_peak / winch.data.inertia
        self._by_change, self._by_rise = _mean_torque(winch)
        self._prior = _BELIEVED / T * (_SHARE * peak) ** 2
        self.reset()

    def reset(self) -> None:
        """Hold the inertia to be that of the case."""
        self.ratio = 1.0
        #: Torque with which the rope pulls, over that at rest [N m], in a motor's inertia.
        self.pull = 0.0
        self._speed = self._torque = math.nan
        self._once, self._twice = (0.0, 0.0), (0.0, 0.0)
        self._sums = 0.0, 0.0, 0.0, 0.0, 0.0

    def turns(self, unit: float) -> Turns:
        """Return how the motor turns, for moves in a unit [N m]."""
        ratio = self.ratio if abs(self.ratio - 1.0) > _SAME else 1.0
        return Turns(ratio, self.pull / unit)

    def update(self, shown: FloatArray, cut: bool, partly: bool = False) -> None:
        """Hear a sample, and whether the drive cut its torque at the end of it, or before."""
        winch = self._winch
        speed, before = float(shown[_SPEED]), self._speed
        pull = (float(shown[_TENSION]) / winch.rest_tension - 1.0) * winch.rest_torque
        torque, first = float(shown[_TORQUE]) - winch.rest_torque, self._torque
        self._speed, self._torque = speed, torque
        change = speed - before
        if not cut:  # what counts is the mean over the sample
            torque += self._by_change * change + self._by_rise * (torque - first)
        turns = torque - pull
        if not math.isfinite(turns + change):
            return
        self.pull = pull
        if partly and not cut:
            return
        kept, new, (x, y) = self._kept, self._new, self._once
        x += new * (change / winch.sample_time - x)
        y += new * (turns / winch.data.inertia - y)
        self._once = x, y
        x, y = (
            self._twice[0] + new * (x - self._twice[0]),
            self._twice[1] + new * (y - self._twice[1]),
        )
        self._twice = x, y
        n, sx, sy, xx, xy = self._sums
        n, sx, sy = kept * n + 1.0, kept * sx + x, kept * sy + y
        xx, xy = kept * xx + x * x, kept * xy + x * y
        self._sums = n, sx, sy, xx, xy
        ratio = (xy - sx * sy / n + self._prior) / (xx - sx * sx / n + self._prior)
        self.ratio = min(max(ratio, _LOW), _HIGH)


def _mean_torque(winch: SampledWinch) -> tuple[float, float]:
    """Return what a torque's mean over a sample has over its end, per change of speed and its own.

    Of a motor under a held command and a constant load: with the speed its torque falls, which
    comes with the bandwidth of the drive's torque loop.
    """
    data, T = winch.data, winch.sample_time
    lag = min(data.torque_bandwidth, _AT_ONCE)
    if data.inductance > 0.0:
        lag = data.resistance / data.inductance
    # Speed, torque and its integral, by the torque at first, command and load.
    A = np.zeros((3, 3))
    A[0, 1], A[1, 0], A[1, 1], A[2, 1] = (
        1.0 / data.inertia,
        -lag * winch.back * winch.gain,
        -lag,
        1.0,
    )
    over, held = zero_order_hold(
        A, np.array([[0.0, -1.0 / data.inertia], [lag, 0.0], [0.0, 0.0]]), T
    )
    ends = np.column_stack([over[:, 1], held])
    shown = np.vstack([ends[0], ends[1] - np.eye(3)[0], ends[1]])
    by_change, by_rise, _ = np.linalg.solve(shown.T, ends[2] / T - ends[1])
    return float(by_change), float(by_rise)
