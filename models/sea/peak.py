"""Where a spectrum with several humps is highest."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..basics import FloatArray


def highest_of(density: Callable[[FloatArray], FloatArray], peaks: Sequence[float]) -> float:
    """Return the frequency at which a sum of spectra is highest [rad/s].

    Parameters
    ----------
    density
        The sum, (k,) -> (k,).
    peaks
        Where its parts are highest, above zero [rad/s]: the maximum of the sum is near one of
        them, and may be the kink of a JONSWAP, so they stay among the candidates throughout.

    Examples
    --------
    >>> def humps(w):
    ...     return np.exp(-((w - 1.0) ** 2)) + np.exp(-((w - 1.5) ** 2))
    >>> round(highest_of(humps, [1.0, 1.5]), 6)
    1.25
    """
    grid = np.unique(np.concatenate([np.geomspace(0.5, 2.0, 801) * peak for peak in peaks]))
    for _ in range(6):
        at = int(np.argmax(density(grid)))
        low, high = grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)]
        grid = np.union1d(np.linspace(low, high, 101), [p for p in peaks if low < p < high])
    return float(grid[int(np.argmax(density(grid)))])
