"""Bounds on the moves from the drive's torque, power, voltage and temperature: `DriveWindow`.

    motor speeds, thermal budget --> lowest and highest torque of each move

Peak torque and current are constants; the power limit narrows the window with the speed, which is
taken from the last plan; the voltage of a DC drive bounds the first move by the speed that is there
now.  The windings' temperature follows from the torque that the drive reports.
"""

from __future__ import annotations

import math

import numpy as np

from models.basics import FloatArray
from models.case import Case
from models.plant import DriveLimits

from ..winch import SampledWinch

_EDGE = 1e-7  # of a move that is at its bound
_MOST = 0.2  # of the peak: half of what the torque may fall by over a sample
_MORE = 0.2  # of the fall, so that the drive stays at its peak though the plan is off
_STATIC = 1.2  # of the static torque: never less, whatever the temperature


class DriveWindow:
    """Bounds on the moves, in units of a torque.

    Parameters
    ----------
    winch
        The sampled winch.
    limits
        Limits of the drive.
    moves
        How many there are.
    unit
        Torque of a move of one [N m].
    """

    def __init__(self, winch: SampledWinch, limits: DriveLimits, moves: int, unit: float) -> None:
        self._winch, self._unit = winch, unit
        constant = winch.data.torque_constant if winch.dc else 1.0
        self.peak = min(limits.torque, constant * limits.current)
        self.voltage = limits.voltage if winch.dc else math.inf
        self.power = limits.power
        #: What the torque of a held command falls by for each rad/s that the motor gets faster.
        self.fall = winch.gain * winch.back
        self._low = np.full(moves, (-self.peak - winch.rest_torque) / unit)
        self._high = np.full(moves, (self.peak - winch.rest_torque) / unit)

    def bounds(
        self,
        speed: float,
        speeds: FloatArray,
        cap: float,
        changes: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and the highest value of each move.

        A move is the torque at the start of a sample, from which a held command lets it fall as
        the drum gets faster.  A drive that is asked for more holds its peak to the end of the
        sample: the peak is then the mean, and the move that stands for it half the fall higher.

        Parameters
        ----------
        speed
            Motor speed now [rad/s].
        speeds
            Motor speed at the start of each move, by the last plan [rad/s], (n,).
        cap
            Highest torque for now, such as that of the thermal budget [N m].
        changes
            Change of speed over the first sample of each move, by the last plan [rad/s], (n,);
            None to keep the torque at the start of a sample within the peak.
        """
        low, high = self._low, self._high
        rest, unit = self._winch.rest_torque, self._unit
        if cap < self.peak:
            low = np.maximum(low, (-cap - rest) / unit)
            high = np.minimum(high, (cap - rest) / unit)
        if self.power < math.inf:
            there = np.abs(speeds)
            there[0] = abs(speed)
            top = self.power / np.maximum(there, self.power / self.peak)
            low, high = np.maximum(low, (-top - rest) / unit), np.minimum(high, (top - rest) / unit)
        if changes is not None:
            most = _MOST * self.peak
            fall = np.clip(0.5 * self.fall * changes, -most, most) / unit
            low, high = low + fall, high + fall
        if self.voltage < math.inf:
            # u = u_rest + K omega + d / b within the voltage
            middle = self._winch.rest_command + self._winch.back * speed
            gain = self._winch.gain / unit
            first_low = (-self.voltage - middle) * gain
            first_high = (self.voltage - middle) * gain
            low, high = low.copy(), high.copy()
            # Where the two leave nothing, the speed is beyond what the voltage can brake: the
            # torque's bound counts, and the drive cuts the rest.
            low[0] = min(max(float(low[0]), first_low), float(high[0]))
            high[0] = max(min(float(high[0]), first_high), float(low[0]))
        return low, high

    def within(
        self, low: FloatArray, high: FloatArray, last: float, step: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the bounds with the first move within a step [N m] of the last input [N m]."""
        low, high = low.copy(), high.copy()
        first = (last - step) / self._unit, (last + step) / self._unit
        # Where the window has moved away from the last torque, the window counts.
        low[0], high[0] = (min(max(float(e), first[0]), first[1]) for e in (low[0], high[0]))
        return low, high

    def asked(self, move: float, low: float, high: float, change: float) -> tuple[float, float]:
        """Return the input to ask of the drive, and the torque it then holds over the sample.

        A move at the edge of the window asks for as much more as keeps the drive at its peak to
        the end of the sample; elsewhere the held torque is NaN.

        Parameters
        ----------
        move, low, high
            The first move and its bounds.
        change
            Change of speed over the sample, as planned [rad/s].
        """
        torque = min(max(move, low), high) * self._unit
        fall = min(max(self.fall * change, -2.0 * _MOST * self.peak), 2.0 * _MOST * self.peak)
        for edge, side in ((high, 1.0), (low, -1.0)):
            if abs(move - edge) < _EDGE:
                held = side * self.peak - self._winch.rest_torque
                more = max(0.0, side * 0.5 * fall) + _MORE * abs(fall)
                return torque + side * more, held
        return torque, math.nan


class TorqueBudget:
    """The motor's temperature, and the torque that keeps it below its rated rise.

    A winding of one time constant, theta' = ((tau / tau_rated)^2 - theta) / T_th, starting cold;
    the cap is the torque which, held over the horizon, would just bring it to its rated rise.

    Parameters
    ----------
    case
        For the rating and the time constant.
    sample_time, horizon
        [s].
    """

    def __init__(self, case: Case, sample_time: float, horizon: float) -> None:
        constant = case.winch.motor.thermal_time_constant
        self._rated = case.winch.drive.torque_continuous
        self._share = -math.expm1(-sample_time / constant)
        self._ahead = -math.expm1(-horizon / constant)
        self._least = _STATIC * abs(case.static_torque_budget)
        self.reset()

    def reset(self) -> None:
        """Let the motor be cold."""
        self.rise = 0.0

    def update(self, torque: float) -> float:
        """Return the cap [N m] after a sample with a torque [N m]."""
        if math.isfinite(torque):
            self.rise += self._share * ((torque / self._rated) ** 2 - self.rise)
        left = (1.0 - self.rise * (1.0 - self._ahead)) / self._ahead
        return max(self._rated * math.sqrt(max(left, 0.0)), self._least)
