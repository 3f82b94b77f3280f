"""Derivatives by central differences with Richardson's extrapolation, and from either side.

Used for the algebra that stands before the loop: how the numbers of a case become those of the
loop.  Those are short formulas without cancellation, for which two steps leave some ten digits; the
loop itself is differentiated automatically (`slopes`).  Integrals over the sea have corners where a
table has them; there the two sides have slopes of their own.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError

_STEP = 2e-3  # of the value: truncation is its fourth power, cancellation its inverse
_ROUGH = 0.02  # share by which derivatives from two steps may differ before it is a jump ...
_NOISE = 1e-3  # ... beyond this elasticity
_SAME = 1e-3  # share by which slopes from two sides may differ before it is a corner
_FINER = 0.125  # of the step, where a corner is near
_ONE_SIDED = (-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25)  # of fourth order, at 0, 1 .. 4 steps


class StepError(ArithmeticError):
    """A function that steps where its derivative was asked for."""


def derivative(
    function: Callable[[float], npt.NDArray[np.generic]], at: float
) -> npt.NDArray[np.generic]:
    """Return the derivative of a function of one number, of fourth order, shaped as its value.

    The function may refuse values (`InputError`) on one side of `at`, where a range ends: then the
    differences are one-sided, of the same order.  The step is a share of `at`.

    Raises InputError if `at` is zero, or the function refuses both sides; StepError if the function
    steps within the differences, as a drum's radius does where one more turn fits into a layer.
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
    allowed = _ROUGH * np.abs(small) + _NOISE * scale / abs(at)
    if np.any(np.abs(small - large) > allowed):
        raise StepError(f"not smooth at {at:g}")
    return np.asarray((4.0 * small - large) / 3.0)


def sided_derivatives(
    function: Callable[[float], FloatArray], at: float
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives from below and from above, the same but at a corner.

    The function gives logarithms, (n,), continuous; as for `derivative` it may refuse a side.

    Raises InputError if the function refuses both sides; StepError if the function is neither
    smooth nor has it a corner exactly there.
    """
    step, here = _STEP * abs(at), function(at)
    sides = []
    for size in (step, _FINER * step):
        try:
            near = {place: function(at + place * size) for place in (-2, -1, 1, 2)}
        except InputError:
            one = np.asarray(_one_sided(function, at, step), dtype=np.float64)
            return one, one
        below = (3.0 * here - 4.0 * near[-1] + near[-2]) / (2.0 * size)
        above = (4.0 * near[1] - near[2] - 3.0 * here) / (2.0 * size)
        if _alike(below, above, at, _SAME):
            central = (8.0 * (near[1] - near[-1]) - (near[2] - near[-2])) / (12.0 * size)
            return central, central
        sides.append((below, above))
    if not all(_alike(coarse, fine, at, _ROUGH) for coarse, fine in zip(*sides, strict=True)):
        raise StepError(f"not smooth at {at:g}")
    below, above = (
        np.asarray(_from_side(function, at, signed), dtype=np.float64) for signed in (-step, step)
    )
    return below, above


def _alike(one: FloatArray, other: FloatArray, at: float, share: float) -> bool:
    """Return whether slopes of logarithms agree to a share of them, or of a slope of 0.2."""
    allowed = share * (np.maximum(np.abs(one), np.abs(other)) + 0.2 / abs(at))
    return bool(np.all(np.abs(one - other) <= allowed))


def _one_sided(
    function: Callable[[float], npt.NDArray[np.generic]], at: float, step: float
) -> npt.NDArray[np.generic]:
    """Return the derivative from the side that the function accepts."""
    for signed in (-step, step):
        try:
            return _from_side(function, at, signed)
        except InputError:
            continue
    raise InputError(f"derivative: the function refuses both sides of {at:g}")


def _from_side(
    function: Callable[[float], npt.NDArray[np.generic]], at: float, signed: float
) -> npt.NDArray[np.generic]:
    """Return the derivative from one side, of fourth order."""
    values = [w * np.asarray(function(at + k * signed)) for k, w in enumerate(_ONE_SIDED)]
    return np.asarray(sum(values[1:], start=values[0]) / signed)
