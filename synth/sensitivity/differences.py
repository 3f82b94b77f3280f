"""Derivatives of smooth functions by central differences with Richardson's extrapolation.

Used for the algebra that stands before the loop: how the numbers of a case become those of the
loop and the spectrum.  Those are short formulas without cancellation, for which two steps leave
some ten digits; the loop itself is differentiated automatically (`slopes`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from models.basics import InputError

_STEP = 2e-3  # of the value: truncation is its fourth power, cancellation its inverse
_ROUGH = 0.02  # share by which derivatives from two steps may differ before it is a jump ...
_NOISE = 1e-3  # ... beyond this elasticity
_ONE_SIDED = (-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25)  # of fourth order, at 0, 1 .. 4 steps


class StepError(ArithmeticError):
    """A function that steps where its derivative was asked for."""


def derivative(
    function: Callable[[float], npt.NDArray[np.generic]], at: float, *, common: bool = False
) -> npt.NDArray[np.generic]:
    """Return the derivative of a function of one number, of fourth order.

    Parameters
    ----------
    function
        From the number to an array; it may refuse values (`InputError`) on one side of `at`,
        where a range ends: then the differences are one-sided, of the same order.
    at
        Where; not zero, as the step is a share of it.
    common
        Whether the entries are of one kind, so that a step counts against the largest of them.

    Returns
    -------
    numpy.ndarray
        In the shape of the function's value.

    Raises
    ------
    InputError
        If `at` is zero, or the function refuses both sides.
    StepError
        If the function steps within the differences, as a drum's radius does where one more turn
        fits into a layer.
    """
    if at == 0.0:
        raise InputError("derivative: the step is a share of the value, which must not be zero")
    step = _STEP * abs(at)
    try:
        near = {place: np.asarray(function(at + place * step)) for place in (-2, -1, 1, 2)}
    except InputError:
        return _one_sided(function, at, step)
    small, large = (near[1] - near[-1]) / (2.0 * step), (near[2] - near[-2]) / (4.0 * step)
    scale = np.maximum(np.abs(near[1]), np.abs(near[-1]))
    if common:
        scale = np.full_like(scale, scale.max(initial=0.0))
    allowed = _ROUGH * np.abs(small) + _NOISE * scale / abs(at)
    if np.any(np.abs(small - large) > allowed):
        raise StepError(f"not smooth at {at:g}")
    return np.asarray((4.0 * small - large) / 3.0)


def _one_sided(
    function: Callable[[float], npt.NDArray[np.generic]], at: float, step: float
) -> npt.NDArray[np.generic]:
    """Return the derivative from the side that the function accepts."""
    for signed in (-step, step):
        try:
            values = [w * np.asarray(function(at + k * signed)) for k, w in enumerate(_ONE_SIDED)]
        except InputError:
            continue
        return np.asarray(sum(values[1:], start=values[0]) / signed)
    raise InputError(f"derivative: the function refuses both sides of {at:g}")
