r"""The noise of losses that switch with the direction of motion.

    hook's velocity --> autocorrelation --> what no friction stands for --> density of the command

To a Gaussian speed the loss Delta sign(omega) is the friction b omega, b = sqrt(2/pi) Delta/sigma,
and a remnant that is not correlated with the speed.  Its autocovariance is

    R(tau) = Delta^2 (2/pi) (asin(kappa rho) - kappa rho),

rho the speed's autocorrelation (Van Vleck and Middleton 1966; Price 1958), with
kappa = sigma^2/(sigma^2 + (2/pi) omega_0^2) where the switch takes a speed of omega_0 to turn: a
variance of (1 - 2/pi) Delta^2 whatever the sea.  Its harmonics reach the rope's modes, which may
have no damping but that of steel, and its slow part lets the drum drift.  A drum that holds its
load turns as the hook heaves, so that rho is the hook's, and the noise one that no gain changes.

A torque tau on the motor's shaft does to every signal what tau/K(s) on the command does, K the
torque per command of a motor that stands; of the motor's torque, current and voltage what is left
is what they hold beside the loss itself.  So the remnant is noise on the drive's set point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray
from ..hook import HookMotion
from ..plant import PlantData

SET_POINT = "drive.set_point"
"""The disturbance that stands for it, on the drive's command."""

_STEP, _COUNT = 0.02, 2**16  # of the autocorrelation [s]
_TOP = 70.0  # frequency up to which the hook's velocity counts [rad/s]
_TURN = 1.0  # motor speed over which a loss changes sides, as in a simulation [rad/s]
_KNOTS = 400
_FAINT = 1e-12  # of the largest density, below which there is none


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchingNoise:
    """The remnant as noise on the drive's command, in the command's unit u.

    Attributes
    ----------
    torque
        Loss Delta to either side of its mean [N m].
    hook
        Motion of the hook.
    per_heave
        Motor's speed over the hook's [rad/m].
    gain, lag
        Torque per command [N m/u] of a motor that stands, and its lag [s].
    """

    torque: float
    hook: HookMotion
    per_heave: float
    gain: float
    lag: float

    @classmethod
    def of(cls, data: PlantData, hook: HookMotion) -> SwitchingNoise | None:
        """Return it for a plant's numbers; None where nothing switches or moves."""
        if not (data.switching and data.switching_torque > 0.0 and hook.velocity.rms > 0.0):
            return None
        if data.motor == "dc":
            gain, lag = data.torque_constant / data.resistance, data.inductance / data.resistance
        else:
            gain, lag = data.speed_gain or 1.0, 1.0 / data.torque_bandwidth
        return cls(
            torque=data.switching_torque,
            hook=hook,
            per_heave=data.falls * data.gear_ratio / data.drum_radius,
            gain=gain,
            lag=lag,
        )

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the variance [rad/s]: a slow drum drifts for as long as it likes."""
        return 1e-6, math.pi / _STEP / 1.5

    @property
    def splits(self) -> tuple[float, ...]:
        """It has no kinks."""
        return ()

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided density [u^2 s/rad] at `omega` [rad/s]."""
        lagged = 1.0 + (self.lag * np.asarray(omega, dtype=np.float64)) ** 2
        return np.asarray((self.torque / self.gain) ** 2 * self.shape(omega) * lagged)

    def shape(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the density of the torque over Delta^2 at `omega` [rad/s], [s/rad]."""
        frequency = np.asarray(omega, dtype=np.float64)
        log_shape = self._log_shape(np.log(np.maximum(frequency, self._lowest)))
        return np.asarray(np.exp(log_shape), dtype=np.float64)

    @property
    def _lowest(self) -> float:
        return 4.0 * math.pi / (_COUNT * _STEP)

    @cached_property
    def _log_shape(self) -> Any:
        """The logarithm of the density of the torque over Delta^2, over that of frequency."""
        from scipy.interpolate import CubicSpline

        step = 2.0 * math.pi / (_COUNT * _STEP)
        omega = step * np.arange(_COUNT // 2 + 1)
        seen = (omega > 0.0) & (omega < _TOP)
        velocity = np.zeros(omega.size)
        velocity[seen] = omega[seen] ** 2 * self.hook.density(omega[seen])
        covariance = np.fft.irfft(velocity, _COUNT)
        speed = (self.per_heave * float(self.hook.velocity.rms)) ** 2
        kappa = speed / (speed + 2.0 / math.pi * _TURN**2)
        rho = kappa * covariance / covariance[0]
        remnant = 2.0 / math.pi * (np.arcsin(rho) - rho)
        found = np.fft.rfft(remnant).real * _STEP / math.pi
        knots = np.geomspace(self._lowest, self.band[1], _KNOTS)
        values = np.interp(knots, omega, np.maximum(found, _FAINT * found.max()))
        return CubicSpline(np.log(knots), np.log(values))
