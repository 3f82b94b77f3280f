"""How well a hook's motion can be foretold: the least error that any linear predictor leaves.

The hook in a sea is a Gaussian process of known spectrum, and a motion reference unit shows its
heave and heave rate with a noise of known spectrum, too.  What the unit showed over the last
seconds and what the hook will do are then jointly Gaussian, and the best forecast is the
conditional mean.  Its error is a Schur complement of their covariances: no predictor, however
clever, does better on average from this unit alone (Wiener 1949, for a finite past).

MPC's own filter hears the payload as well, and assumes less about the unit.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg

from models import Case, HookMotion


def least_error(case: Case, leads: np.ndarray, *, past: float = 60.0) -> np.ndarray:
    """Return the standard deviation of the best forecast of the hook over the hook's own, (n,).

    Parameters
    ----------
    case
        Its sea moves the hook; its `sensors.mru` says how noisy the unit is.
    leads
        How far ahead, in multiples of 0.05 s [s].
    past
        For how long the unit has been heard [s]: all samples of the last 8 s, then every second.
    """
    T, spacing = 0.05, 2.0 * math.pi / 2000.0
    size = round(2000.0 / T)
    hook, unit = HookMotion.from_case(case), case.sensors.mru
    omega = spacing * np.arange(1, math.floor(hook.band[1] / spacing) + 1)
    variance = hook.density(omega) * spacing  # of each line [m2]
    rms = math.sqrt(float(variance.sum()))

    def covariance(power: np.ndarray) -> np.ndarray:
        """Real part of the sum of `power` exp(i omega k T), for k = 0, 1, ..."""
        lines = np.zeros(size, dtype=np.complex128)
        lines[1 : omega.size + 1] = power
        return np.asarray((np.fft.ifft(lines) * size).real)

    heave, cross, rate = (covariance(variance * p) for p in (1.0, -1j * omega, omega**2))
    # The unit's error: white noise through a Butterworth filter of second order.
    recent, last = round(8.0 / T), round(past / T)
    ago = np.concatenate([np.arange(recent), np.arange(recent, last + 1, 2)])
    lag = T * np.arange(last + 1)
    a = unit.noise_bandwidth / math.sqrt(2.0)
    noise = (math.hypot(unit.noise_floor, unit.noise_fraction * rms)) ** 2 * np.exp(-a * lag)
    errors = (
        noise * (np.cos(a * lag) + np.sin(a * lag)),
        2.0 * a * noise * np.sin(a * lag),
        2.0 * a**2 * noise * (np.cos(a * lag) - np.sin(a * lag)),
    )
    later = ago[None, :] - ago[:, None]
    k, sign = np.abs(later), np.sign(later)
    truths = (heave, cross, rate)
    shown = [(t[: last + 1] + error)[k] for t, error in zip(truths, errors, strict=True)]
    shown[1] = sign * shown[1]
    factor = scipy.linalg.cholesky(np.block([[shown[0], shown[1]], [-shown[1], shown[2]]]))
    at = ago[:, None] + np.round(np.asarray(leads) / T).astype(int)
    wanted = np.concatenate([heave[at], cross[at]])
    explained = (scipy.linalg.solve_triangular(factor, wanted, trans=1) ** 2).sum(axis=0)
    return np.asarray(np.sqrt(np.maximum(rms**2 - explained, 0.0)) / rms)
