"""White noise, as a spectrum: what disturbs sensors, and drives shaping filters.

It has the same ``density`` as a sea or a hook's motion, but no finite variance and no band.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .arrays import FloatArray
from .checks import check_range


@dataclass(frozen=True)
class White:
    """White noise of E[w(t) w(t+s)] = intensity * delta(s).

    Its one-sided density is intensity/pi per rad/s: twice the two-sided density
    intensity/(2 pi), so that a filter h has the output variance intensity * integral h(t)^2.

    Parameters
    ----------
    intensity
        [unit of w, squared, times s].
    """

    intensity: float = 1.0

    def __post_init__(self) -> None:
        check_range("White", "intensity", self.intensity, low=0.0)

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided density per rad/s at `omega`."""
        return np.full(np.shape(omega), self.intensity / np.pi)
