"""Forecasts of the hook's motion, mean and standard deviation over the leads, and `Predictor`.

    MRU --> Predictor.update --> Predictor.forecast --> Forecast --> QP

First room of `mpc`: the controllers preview the hook's motion through this protocol and do not
know which predictor stands behind it: `AdaptiveAR` (knows the record alone), `PerfectPreview`
(knows the future, for reference) or one of the user's own.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np

from models.basics import FloatArray, check_range, read_only

_MOST_LEADS = 100_000
# [s], in which what a shorter forecast has put right, or a better start, is forgotten beyond it.
_FADING = 1.0


@dataclass(frozen=True, eq=False, slots=True)
class Forecast:
    """The hook's motion at the leads of the predictor that made it; lead 0 is now.

    The arrays are the caller's own to read: they are not copied, as a controller makes one forecast
    a sample, and a predictor never writes to them again.  The mean of the true motion is up
    positive [m], [m/s], (n,); each ``_std`` is the standard deviation of what will be minus the
    mean, likewise.
    """

    displacement: FloatArray
    velocity: FloatArray
    displacement_std: FloatArray
    velocity_std: FloatArray

    def begun_at(self, displacement: float, velocity: float, sample_time: float) -> "Forecast":
        """Return this forecast with another motion now [m], [m/s], of which it loses sight.

        A filter's errors of the hook and of the load belong together: the rope between them is
        known well.  A forecast that begins elsewhere stretches the rope by the difference.
        """
        fading = _fading(self.displacement.size, sample_time)
        return replace(
            self,
            displacement=self.displacement + (displacement - self.displacement[0]) * fading,
            velocity=self.velocity + (velocity - self.velocity[0]) * fading,
        )


@runtime_checkable
class Predictor(Protocol):
    """Anything that foretells the hook's motion from what the reference unit has shown."""

    @property
    def sample_time(self) -> float:
        """Time from one `update` to the next, and from lead to lead [s]."""

    @property
    def leads(self) -> FloatArray:
        """Leads from 0 to the horizon, spaced by the sample time [s], (n,)."""

    def reset(self) -> None:
        """Forget every earlier sample."""

    def update(self, heave: float, rate: float, valid: bool, time: float) -> None:
        """Take what the unit shows at a time [s]: heave [m] and heave rate [m/s].

        Call it once a sample.  A sample that is not valid or not finite does not enter the
        state: the predictor goes on by its model.
        """

    def forecast(self) -> Forecast:
        """Return the motion now and at the leads, given the samples so far."""


def leads_of(owner: str, sample_time: float, horizon: float) -> FloatArray:
    """Return the leads 0, Ts, 2 Ts .. horizon [s], read-only; the horizon is rounded to samples.

    Raises InputError if one is out of its range, or the horizon is longer than 100 000 samples.
    """
    step = check_range(owner, "sample_time", sample_time, low=0.0, unit="s", open_low=True)
    last = check_range(owner, "horizon", horizon, low=0.0, high=_MOST_LEADS * step, unit="s")
    return read_only(step * np.arange(round(last / step) + 1))


@lru_cache(maxsize=8)
def _fading(size: int, sample_time: float) -> FloatArray:
    """Return what is left of a start after so many samples, (size,)."""
    return read_only(np.exp(-sample_time / _FADING * np.arange(size)))


def fused(own: Forecast, other: Forecast, sample_time: float) -> Forecast:
    """Return two forecasts as one, each weighed by its variance.

    Where the other ends sooner, what it has put right at its end fades out.
    """
    n, size = other.displacement.size, own.displacement.size
    at = np.minimum(np.arange(size), n - 1)
    fading = np.exp(-sample_time / _FADING * (np.arange(size) - at))
    found = []
    for name in ("displacement", "velocity"):
        mean, std = getattr(own, name), getattr(own, f"{name}_std")
        variance = std[:n] ** 2
        share = variance / np.maximum(variance + getattr(other, f"{name}_std") ** 2, 1e-300)
        change = share * (getattr(other, name) - mean[:n])
        found += [mean + fading * change[at], std * np.sqrt(1.0 - share[at] * fading**2)]
    return Forecast(found[0], found[2], found[1], found[3])
