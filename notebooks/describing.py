r"""Describing functions of a saturation: what a limit leaves of a signal, in one gain.

A motor that holds a load works off the middle of its torque limits.  What comes out of
clip(b + e, -limit, limit) is then, for an oscillation e about the bias b, a mean and a gain N < 1
by which e goes through:

* for a sine of amplitude A, the first harmonic (the sinusoidal-input describing function with a
  bias; A. Gelb and W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System
  Design, 1968, chapters 2 and 6);
* for a Gaussian e, the least-mean-square gain (Booton 1954), which is the probability of being
  within the limits (Price's theorem).

`limit_cycles` closes a loop around them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from scipy.optimize import brentq
from scipy.special import ndtr

from models.basics import check_range

_OWNER = "describing function"

Response = Callable[[float, float, float], tuple[float, float]]


def sine_response(limit: float, bias: float, amplitude: float) -> tuple[float, float]:
    """Return mean and gain of a saturation for bias + amplitude sin(theta).

    With theta_1 and theta_2 in [-pi/2, pi/2], where the sine enters and leaves the range between
    the limits, the gain is [theta + sin(theta) cos(theta)] / pi between the two.

    Parameters
    ----------
    limit
        The output stays within [-limit, limit], in any unit.
    bias, amplitude
        Of the input, in the same unit.

    Returns
    -------
    mean, gain
        Mean of the output, in that unit, and amplitude of its first harmonic over that of the
        input [-].

    Raises
    ------
    InputError
        If limit or amplitude is not above zero, or a number is not finite.

    Examples
    --------
    >>> mean, gain = sine_response(1.0, 0.0, 2.0)
    >>> print(f"{mean:.3f}, {gain:.3f}")
    0.000, 0.609
    """
    _check(limit, bias, "amplitude", amplitude)
    enter, leave = (
        math.asin(min(1.0, max(-1.0, (end - bias) / amplitude))) for end in (-limit, limit)
    )
    gain = _half_gain(leave) - _half_gain(enter)
    inside = bias * (leave - enter) + amplitude * (math.cos(enter) - math.cos(leave))
    mean = (inside - limit * (enter + leave)) / math.pi
    return mean, gain


def gaussian_response(limit: float, bias: float, sigma: float) -> tuple[float, float]:
    """Return mean and gain of a saturation for a Gaussian signal about a bias.

    Parameters
    ----------
    limit
        The output stays within [-limit, limit], in any unit.
    bias, sigma
        Mean and standard deviation of the input, in the same unit.

    Returns
    -------
    mean, gain
        Mean of the output, in that unit, and its least-mean-square gain [-].

    Raises
    ------
    InputError
        If limit or sigma is not above zero, or a number is not finite.

    Examples
    --------
    >>> mean, gain = gaussian_response(1.0, 0.5, 1.0)
    >>> print(f"{mean:.4f}, {gain:.4f}")
    0.3315, 0.6247
    """
    _check(limit, bias, "sigma", sigma)
    low, high = (-limit - bias) / sigma, (limit - bias) / sigma
    under, over = float(ndtr(low)), float(ndtr(-high))
    gain = float(ndtr(high)) - under
    mean = limit * (over - under) + bias * gain + sigma * (_bell(low) - _bell(high))
    return mean, gain


def bias_for(mean: float, limit: float, size: float, response: Response = sine_response) -> float:
    """Return the bias with which the output has a given mean.

    A motor in a loop finds it by itself: its mean torque is what the load asks for, however it
    oscillates.

    Parameters
    ----------
    mean
        Mean of the output, within the limits.
    limit
        The output stays within [-limit, limit].
    size
        Amplitude or standard deviation of the input.
    response
        `sine_response` or `gaussian_response`.

    Raises
    ------
    InputError
        If the mean is not within the limits, or a number is out of its range.
    """
    _check(limit, mean, "size", size)
    check_range(_OWNER, "mean", mean, low=-limit, high=limit, open_low=True, open_high=True)
    reach = limit + size
    while response(limit, reach, size)[0] < abs(mean):
        reach *= 2.0

    def off(bias: float) -> float:
        return response(limit, bias, size)[0] - mean

    return float(brentq(off, -reach, reach, xtol=1e-13 * reach, rtol=1e-14))


def _half_gain(theta: float) -> float:
    return (theta + math.sin(theta) * math.cos(theta)) / math.pi


def _bell(x: float) -> float:
    return math.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)


def _check(limit: float, bias: float, name: str, size: float) -> None:
    check_range(_OWNER, "limit", limit, low=0.0, open_low=True)
    check_range(_OWNER, "bias", bias)
    check_range(_OWNER, name, size, low=0.0, open_low=True)
