"""Sample points of the unit cube, from which every row of a spread is made.

Row i of a Monte Carlo or a Sobol design depends on the seed, i and the number of columns only;
row i of a Latin hypercube on the number of rows as well, as every row takes a stratum that
others then cannot have.  Any piece of a design can be had without the rest.
"""

import itertools
import warnings
from collections.abc import Mapping

import numpy as np
from scipy.special import ndtr, ndtri

from ..basics import FloatArray, InputError, check_choice, check_range

METHODS = ("sobol", "lhs", "random", "grid", "corners", "given")
"""Ways to choose samples, by their names."""

_BITS = 32  # of a Sobol point: SciPy can go on from any row with up to 32 only
_WORDS = 4  # of random numbers that one step of Philox's counter gives
_MOST_CORNERS = 1 << 20


def counted(method: str, samples: int, columns: int) -> int:
    """Return how many rows a design really has: a grid and the corners have their own number.

    Raises InputError if the method is unknown or there are too many corners.
    """
    check_choice("spread", "method", method, METHODS)
    check_range("spread", "samples", samples, low=1)
    if method == "corners":
        if 1 << columns > _MOST_CORNERS:
            raise InputError(
                f"spread: {columns} parameters have 2^{columns} corners, more than "
                f"{_MOST_CORNERS}; use another method"
            )
        return int(1 << columns)
    if method == "grid":
        per_axis: int = _per_axis(samples, columns)
        return int(per_axis**columns)
    return int(samples)


def unit_points(
    method: str, samples: int, columns: int, seed: int, start: int, stop: int
) -> FloatArray:
    """Return rows `start` to `stop` of a design of points in (0, 1), (stop - start, columns).

    A grid has its ends at 0 and 1, corners have nothing else.
    """
    from scipy.stats import qmc  # slow to load, and not wanted until rows are

    count = stop - start
    if method == "sobol":
        # Points lie at the lower ends of cells of 2^-32; half a cell on, none is at zero.
        sampler = qmc.Sobol(columns, scramble=True, bits=_BITS, seed=seed)
        with warnings.catch_warnings():
            # Balance wants a power of two; whoever asks for another number gets it.
            warnings.simplefilter("ignore", UserWarning)
            if start:
                sampler.fast_forward(start)
            points = sampler.random(count)
        return np.asarray(points + 0.5 ** (_BITS + 1), dtype=np.float64)
    if method == "lhs":
        every = qmc.LatinHypercube(columns, seed=seed).random(samples)
        return _open(np.asarray(every, dtype=np.float64)[start:stop])
    if method == "random":
        # A generator that counts: it goes to any row without drawing those before it.
        steps = -(-columns // _WORDS)
        bits = np.random.Philox(key=seed)
        bits.advance(start * steps)
        draws = np.random.Generator(bits).random((count, steps * _WORDS))
        return _open(draws[:, :columns])
    if method == "corners":
        sides = itertools.islice(itertools.product((0.0, 1.0), repeat=columns), start, stop)
        return np.array(list(sides)).reshape(count, columns)
    per_axis = _per_axis(samples, columns)
    at = np.stack(np.unravel_index(np.arange(start, stop), (per_axis,) * columns), axis=1)
    return np.asarray(at / (per_axis - 1.0) if per_axis > 1 else at + 0.5)


def copula_factor(
    paths: tuple[str, ...], pairs: Mapping[tuple[str, str], float]
) -> FloatArray | None:
    """Return the Cholesky factor of the normal scores' correlation, None if there is none.

    A Gaussian copula with correlation r has the rank correlation 6/pi asin(r/2) (Pearson 1907).
    """
    if not pairs:
        return None
    matrix = np.eye(len(paths))
    for (one, other), rank in pairs.items():
        i, j = paths.index(one), paths.index(other)
        matrix[i, j] = matrix[j, i] = 2.0 * np.sin(np.pi * rank / 6.0)
    try:
        return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise InputError(
            "spread: the correlations contradict each other: no numbers can have them all"
        ) from None


def correlated(points: FloatArray, factor: FloatArray) -> FloatArray:
    """Return points with a Gaussian copula, (n, d), from independent ones.

    `factor` (d, d) is the lower Cholesky factor of the normal scores' correlation.
    """
    return np.asarray(np.clip(ndtr(ndtri(points) @ factor.T), 2.0**-53, 1.0 - 2.0**-53))


def _per_axis(samples: int, columns: int) -> int:
    """Return the most values per axis whose grid has at most `samples` points."""
    per_axis: int = max(1, round(float(samples) ** (1.0 / columns)))
    while per_axis > 1 and per_axis**columns > samples:
        per_axis -= 1
    return per_axis


def _open(points: FloatArray) -> FloatArray:
    """Move a zero, of which quantiles may be infinite, off the edge."""
    return np.maximum(points, 2.0**-53)
