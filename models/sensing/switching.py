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
from typing import TYPE_CHECKING, Generic, Protocol

import numpy as np
import numpy.typing as npt
from typing_extensions import TypeVar

from ..basics import FloatArray
from ..hook import HookMotion
from ..plant import PlantData

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

SET_POINT = "drive.set_point"  #: The disturbance that stands for it, on the drive's command.

_STEP, _COUNT = 0.02, 2**16  # of the autocorrelation [s]
#: Band that holds the variance [rad/s]: a slow drum drifts for as long as it likes.
SWITCHING_BAND = 1e-6, math.pi / _STEP / 1.5
_TOP = 70.0  # frequency up to which the hook's velocity counts [rad/s]
SWITCHING_TURN = 1.0  #: Motor speed over which a loss changes sides, as in a simulation [rad/s].
_SPLITS = 32  # with which nodes made from poles alone have a peak's torque to some 3e-7
_FAINT = 1e-12  # of the largest density, below which there is none
_PER_DECADE, _POINTS = 16, 10  # motor speeds between which shapes are interpolated


class _Moving(Protocol):
    def density(self, omega: FloatArray, /) -> FloatArray: ...


_Motion = TypeVar("_Motion", bound=_Moving, default=HookMotion)


class SwitchingShape(Generic[_Motion]):
    """The density of the remnant over Delta^2, with one motion: the hook's, or another.

    Only the shape of its velocity's density counts.
    """

    def __init__(self, hook: _Motion) -> None:
        self.hook = hook
        self._levels: dict[float, CubicSpline] = {}

    def at(self, omega: npt.ArrayLike, speed: float) -> FloatArray:
        """Return the one-sided density [s/rad] at `omega` [rad/s], of a motor's rms speed [rad/s].

        Its integral over omega is 1 - 2/pi, but for a motor that hardly turns.
        """
        return np.asarray(np.exp(self._level(speed)(np.minimum(omega, SWITCHING_BAND[1]))))

    def rows(self, omega: FloatArray, speeds: FloatArray) -> FloatArray:
        """Return the densities (n, k) at `omega` (k,), of rms speeds (n,) [rad/s].

        Interpolated between 16 speeds in a decade, to some 1e-9.
        """
        place = np.log10(np.maximum(speeds, _FAINT)) * _PER_DECADE
        first = np.floor(place).astype(np.int64) - (_POINTS // 2 - 1)
        known = np.unique(first[:, None] + np.arange(_POINTS))
        inside = np.minimum(omega, SWITCHING_BAND[1])
        table = np.stack([self._level(10.0 ** (float(j) / _PER_DECADE))(inside) for j in known])
        found = np.zeros((speeds.size, omega.size))
        for j in range(_POINTS):
            weight = np.ones(speeds.size)
            for m in range(_POINTS):
                if m != j:
                    weight *= (place - first - m) / (j - m)
            found += weight[:, None] * table[np.searchsorted(known, first + j)]
        return np.asarray(np.exp(found))

    def _level(self, speed: float) -> CubicSpline:
        """Return the logarithm of the density as a function of omega [rad/s].

        The remnant forgets within minutes, so that its density is smooth between the transform's
        frequencies.
        """
        from scipy.interpolate import CubicSpline

        if speed not in self._levels:
            kappa = speed**2 / (speed**2 + 2.0 / math.pi * SWITCHING_TURN**2)
            rho = kappa * self._correlation
            omega, found = density_of(2.0 / math.pi * (np.arcsin(rho) - rho))
            least = max(_FAINT * float(found.max()), np.finfo(float).tiny)
            held = slice(int(np.searchsorted(omega, SWITCHING_BAND[1])) + 1)
            level = np.log(np.maximum(found, least)[held])
            self._levels[speed] = CubicSpline(
                omega[held],
                level,
                bc_type=("clamped", "not-a-knot"),  # it is even in omega
            )
        return self._levels[speed]

    @cached_property
    def _correlation(self) -> FloatArray:
        return velocity_correlation(self.hook)


def velocity_correlation(motion: _Moving) -> FloatArray:
    """Return the autocorrelation of a motion's velocity, 1 at first, as `density_of` takes it."""
    omega = _omega()
    seen = (omega > 0.0) & (omega < _TOP)
    velocity = np.zeros(omega.size)
    velocity[seen] = omega[seen] ** 2 * motion.density(omega[seen])
    covariance = np.fft.irfft(velocity, _COUNT)
    return np.asarray(covariance / covariance[0])


def density_of(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return frequencies [rad/s], and there the one-sided density of an autocovariance."""
    return _omega(), np.fft.rfft(covariance).real * _STEP / math.pi


def _omega() -> FloatArray:
    return np.asarray(2.0 * math.pi / (_COUNT * _STEP) * np.arange(_COUNT // 2 + 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchingNoise:
    """The remnant as noise on the drive's command, in the command's unit u."""

    torque: float  #: Loss Delta to either side of its mean [N m].
    hook: HookMotion  #: Motion of the hook.
    per_heave: float  #: Motor's speed over the hook's [rad/m].
    #: Torque per command [N m/u] of a motor that stands, and its lag [s].
    gain: float
    lag: float
    slowest: float = SWITCHING_BAND[0]  #: Frequency below which none is counted [rad/s].

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
            per_heave=data.gear_ratio / data.drum_radius,
            gain=gain,
            lag=lag,
        )

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the variance [rad/s]."""
        return self.slowest, SWITCHING_BAND[1]

    @property
    def splits(self) -> tuple[float, ...]:
        """Where panels end that follow its harmonics [rad/s]; it has no kinks."""
        return tuple(np.geomspace(0.05, 10.0, _SPLITS).tolist())

    @property
    def speed(self) -> float:
        """Standard deviation of the speed of a motor that follows the hook [rad/s]."""
        return self.per_heave * float(self.hook.velocity.rms)

    @cached_property
    def shape(self) -> SwitchingShape:
        """The torque's density over Delta^2."""
        return SwitchingShape(self.hook)

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided density [u^2 s/rad] at `omega` [rad/s]."""
        return self.as_command(omega, self.shape.at(omega, self.speed))

    def as_command(self, omega: npt.ArrayLike, shape: FloatArray) -> FloatArray:
        """Return the density [u^2 s/rad] of a torque's over Delta^2."""
        lagged = 1.0 + (self.lag * np.asarray(omega, dtype=np.float64)) ** 2
        return np.asarray((self.torque / self.gain) ** 2 * shape * lagged)
