"""The optimal linear predictor of the hook's motion: what the predictors are held against.

Finite past, normal equations, exact covariances: those of the hook from its true spectrum, those
of the reference unit's error in closed form.  Nothing here knows of a shaping filter or of a
Kalman filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.linalg

from models.hook import HookMotion
from models.sensing import MruModel, unit_response

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def error_covariance(width: float, lag: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Covariances n n, n n' and n' n' at lags >= 0 of a Butterworth error of variance one.

    E n(t + lag) n(t) = exp(-a lag) (cos a lag + sin a lag), a = width/sqrt(2); the second is
    E n(t + lag) n'(t), minus the first's derivative.
    """
    a = width / math.sqrt(2.0)
    decay, cos, sin = np.exp(-a * lag), np.cos(a * lag), np.sin(a * lag)
    return decay * (cos + sin), 2.0 * a * decay * sin, 2.0 * a**2 * decay * (cos - sin)


@dataclass(frozen=True)
class Wiener:
    """Optimal linear predictor of the hook from `past` seconds of heave and rate.

    All samples of the last `fine` seconds count, and every `stride`-th one before.  `floor` is
    white noise on top, a share of the rms of displacement and velocity.  The spectrum is summed
    in lines 2 pi/`period` apart: covariances at all samples are then Fourier transforms.
    """

    hook: HookMotion
    unit: MruModel
    past: float = 80.0
    fine: float = 8.0
    stride: int = 2
    floor: float = 0.0
    period: float = 4000.0

    @cached_property
    def samples(self) -> npt.NDArray[np.int64]:
        """Samples ago that count, 0 the present one."""
        recent = round(self.fine / self.unit.sample_time)
        last = round(self.past / self.unit.sample_time)
        return np.concatenate([np.arange(recent), np.arange(recent, last + 1, self.stride)])

    @cached_property
    def _size(self) -> int:
        return round(self.period / self.unit.sample_time)

    @cached_property
    def _omega(self) -> FloatArray:
        spacing = 2.0 * math.pi / (self._size * self.unit.sample_time)
        assert self.hook.band[1] < math.pi / self.unit.sample_time
        return spacing * np.arange(1, math.floor(self.hook.band[1] / spacing) + 1)

    @cached_property
    def _lines(self) -> FloatArray:
        """Variance of each line [m2]."""
        return np.asarray(self.hook.density(self._omega) * self._omega[0])

    @cached_property
    def _shown(self) -> ComplexArray:
        """What the unit makes of a harmonic of heave, interpolated between samples."""
        omega, T = self._omega, self.unit.sample_time
        whole = math.floor(self.unit.delay / T + 1e-9)
        share = self.unit.delay / T - whole
        step = np.exp(-1j * omega * T)
        late = step**whole * (1.0 - share + share * step)
        return np.asarray(
            unit_response(self.unit.mru, 1j * omega) * np.exp(1j * omega * self.unit.delay) * late
        )

    def _series(self, lines: npt.NDArray[np.generic]) -> FloatArray:
        """Real part of the sum of lines times exp(i omega t) at all samples."""
        padded = np.zeros(self._size, dtype=np.complex128)
        padded[1 : lines.size + 1] = lines
        return np.asarray(np.fft.ifft(padded).real * self._size)

    @cached_property
    def _factor(self) -> FloatArray:
        """Cholesky factor of the covariance of what was seen."""
        omega, through = self._omega, self._lines * np.abs(self._shown) ** 2
        reach = self.samples[-1] + 1
        powers = (np.ones_like(omega), -1j * omega, omega**2)
        tables = np.array([self._series(through * power)[:reach] for power in powers])
        if self.unit.mru is not None:
            lag = self.unit.sample_time * np.arange(reach)
            noise = error_covariance(self.unit.mru.noise_bandwidth, lag)
            tables += self.unit.error_rms**2 * np.array(noise)
        # Positive where the row is later than the column.
        later = self.samples[None, :] - self.samples[:, None]
        heave, cross, rate = (table[np.abs(later)] for table in tables)
        cross = np.sign(later) * cross
        total = np.block([[heave, cross], [-cross, rate]])
        white = self.floor**2 * self._variances
        total += np.diag(np.repeat(white, self.samples.size))
        return np.asarray(scipy.linalg.cholesky(total))

    @property
    def _variances(self) -> FloatArray:
        return np.array([self._lines.sum(), self._lines @ self._omega**2])

    def errors(self, leads: npt.ArrayLike) -> FloatArray:
        """Standard deviations of the best forecasts of displacement and velocity, (2, n)."""
        ahead = np.round(np.asarray(leads) / self.unit.sample_time).astype(int)
        omega, lines = self._omega, self._lines * np.conj(self._shown)
        found = []
        for truth in (np.ones_like(omega), 1j * omega):
            heave = self._series(lines * truth)
            rate = self._series(lines * truth * -1j * omega)
            at = self.samples[:, None] + ahead
            moved = np.concatenate([heave[at], rate[at]])
            explained = scipy.linalg.solve_triangular(self._factor, moved, trans=1)
            found.append((explained**2).sum(axis=0))
        return np.asarray(np.sqrt(self._variances[:, None] - np.array(found)))
