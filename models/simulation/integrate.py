"""How the plant moves over one control sample: Runge-Kutta steps, and how long they may be.

The classical fourth-order method, several steps to a control sample.  The hook's motion is
given at the ends of a step only; a cubic through displacement, velocity and acceleration
stands for it in the middle, so that the method keeps its order.  `rk4_step` builds one step,
in symbols or numbers, from any right-hand side; `choose_step` says how many a sample takes
and refuses a step that would be unstable or would blur the plant's fastest mode.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from ..basics import InputError, check_finite, check_range

# casadi.SX, casadi.MX, an array or a float: the formulas are the same.
Value: TypeAlias = Any
# What moves the plant over a step, as the right-hand side takes it.
Driven = TypeVar("Driven")
Motion: TypeAlias = tuple[Value, Value]

ACCURACY = 1.0  # largest h |lambda| [-], see `choose_step`
MAX_SUBSTEPS = 1000
_ROUNDING = 1e-9  # [-] of a frequency, or of a ratio of times


def hermite_midpoint(
    z0: Value, v0: Value, a0: Value, z1: Value, v1: Value, a1: Value, h: float
) -> Motion:
    """Return displacement and velocity in the middle of a step of length `h`.

    Cubic Hermite interpolation, of the displacement from the velocities and of the velocity
    from the accelerations: z = (z0 + z1)/2 + h/8 (v0 - v1), v = (v0 + v1)/2 + h/8 (a0 - a1);
    the errors are h^4/384 times the fourth derivative.

    Parameters
    ----------
    z0, v0, a0, z1, v1, a1
        Displacement [m], velocity [m/s], acceleration [m/s2] at both ends.
    h
        Length of the step [s].
    """
    displacement = 0.5 * (z0 + z1) + (h / 8.0) * (v0 - v1)
    velocity = 0.5 * (v0 + v1) + (h / 8.0) * (a0 - a1)
    return displacement, velocity


def rk4_step(
    rhs: Callable[[Value, Driven], Value],
    x: Value,
    motions0: Driven,
    motions_mid: Driven,
    motions1: Driven,
    h: float,
) -> Value:
    """Return the state after one step of the classical Runge-Kutta method.

    Parameters
    ----------
    rhs
        (x, motions) -> x'; whatever else it needs is held over the step.
    x
        State at the beginning.
    motions0, motions_mid, motions1
        What moves the plant (displacement and velocity of every motion, say) at the beginning,
        in the middle (`hermite_midpoint`) and at the end.
    h
        Length of the step [s].
    """
    k1 = rhs(x, motions0)
    k2 = rhs(x + (0.5 * h) * k1, motions_mid)
    k3 = rhs(x + (0.5 * h) * k2, motions_mid)
    k4 = rhs(x + h * k3, motions1)
    return x + (h / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def rk4_stability_limit(eigenvalue: complex) -> float:
    """Return the longest stable step for one eigenvalue [s]: |R(h lambda)| <= 1.

    R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24; 2.785/|lambda| on the negative real axis, sqrt(8)
    /|lambda| on the imaginary one.  Infinite for lambda = 0 and for one with a positive real
    part: what grows in truth may grow in the simulation.
    """
    size = abs(eigenvalue)
    if size == 0.0 or eigenvalue.real > _ROUNDING * size:
        return math.inf
    if eigenvalue.real > -_ROUNDING * size:
        return math.sqrt(8.0) / size
    ray = eigenvalue / size
    # The region's boundary crosses every ray of the left half-plane once, between 2.6 and 3.0.
    radius = brentq(lambda rho: abs(_growth(rho * ray)) - 1.0, 2.5, 3.5, xtol=1e-12)
    return float(radius) / size


@dataclass(frozen=True, kw_only=True)
class StepChoice:
    """How a control sample is divided into integration steps.

    Parameters
    ----------
    sample_time
        Control sample [s].
    substeps
        Steps to a sample.
    step
        Length of a step, sample_time / substeps [s].
    largest
        Longest step that is allowed, before it was made to divide the sample [s]; at most
        the sample itself.
    fastest
        The mode that sets it [rad/s]; zero if nothing but the sample does.
    """

    sample_time: float
    substeps: int
    step: float
    largest: float
    fastest: float

    @property
    def added_damping(self) -> float:
        """Damping ratio that the method adds to the fastest mode if undamped [-]."""
        angle = self.step * self.fastest
        if angle == 0.0:
            return 0.0
        return -math.log(abs(_growth(1j * angle))) / angle

    @property
    def phase_error(self) -> float:
        """Part of its frequency by which the fastest mode swings too slowly if undamped [-]."""
        angle = self.step * self.fastest
        if angle == 0.0:
            return 0.0
        grown = _growth(1j * angle)
        return 1.0 - math.atan2(grown.imag, grown.real) / angle

    def __str__(self) -> str:
        """Return one line."""
        return (
            f"{self.substeps} integration steps of {self.step:.4g} s in a sample of "
            f"{self.sample_time:.4g} s (fastest mode {self.fastest:.4g} rad/s)"
        )


def choose_step(
    A: npt.ArrayLike,
    sample_time: float,
    step: float | None = None,
    *,
    extra_rates: Sequence[float] = (),
    accuracy: float = ACCURACY,
) -> StepChoice:
    """Return the integration step: the longest allowed that divides the sample, or `step`.

    A step is allowed if no eigenvalue lambda has h |lambda| above `accuracy` and none that
    is stable grows by it.

    Parameters
    ----------
    A
        Jacobian of the plant (n, n) [1/s], or several (k, n, n), such as over rope lengths.
    sample_time
        Control sample [s].
    step
        The step that is asked for [s]; it must divide the sample.
    extra_rates
        Further rates [rad/s] that the Jacobians do not show: friction about zero speed, the
        stiffness of a contact.  Stability and accuracy are asked of them as of a real pole.
    accuracy
        Largest h |lambda| [-].

    Raises
    ------
    InputError
        If a number is out of range, or `step` is too long or does not divide the sample.

    Notes
    -----
    Over a step h the method adds (h w)^5/144 to the damping ratio of a mode w and slows it by
    the part (h w)^4/120.  With h w = 1 the fastest mode itself gets 0.6 % of critical damping
    (it loses 3.8 % of its amplitude in a period) and is 0.6 % slow; one at a fifth of it,
    where the loop's crossover may be, gets 2e-6 and 1e-5.  Kelvin-Voigt damping gives the
    fast modes of a rope more than that in truth.
    """
    check_range("integration", "sample_time", sample_time, low=0.0, unit="s", open_low=True)
    check_range("integration", "accuracy", accuracy, low=0.0, high=2.5, open_low=True)
    eigenvalues = [complex(value) for value in _eigenvalues(A)]
    for rate in extra_rates:
        check_range("integration", "extra_rates", rate, low=0.0, unit="rad/s")
        eigenvalues.append(complex(-rate))
    longest, fastest = float(sample_time), 0.0
    for value in eigenvalues:
        allowed = rk4_stability_limit(value)
        if abs(value) > 0.0:
            allowed = min(allowed, accuracy / abs(value))
        if allowed < longest:
            longest, fastest = allowed, abs(value)
    if not fastest:
        fastest = max((abs(value) for value in eigenvalues), default=0.0)
    if step is None:
        substeps = max(1, math.ceil(sample_time / longest * (1.0 - _ROUNDING)))
    else:
        substeps = _substeps(step, sample_time, longest, fastest)
    if substeps > MAX_SUBSTEPS:
        raise InputError(
            f"integration: a sample of {sample_time:g} s would take {substeps} steps, at most "
            f"{MAX_SUBSTEPS} are allowed; the plant's fastest mode is at {fastest:.4g} rad/s and "
            f"allows {longest:.3g} s a step"
        )
    return StepChoice(
        sample_time=float(sample_time),
        substeps=substeps,
        step=sample_time / substeps,
        largest=longest,
        fastest=fastest,
    )


def _substeps(step: float, sample_time: float, longest: float, fastest: float) -> int:
    check_range("integration", "step", step, low=0.0, unit="s", open_low=True)
    bound = longest < sample_time
    why = f"the plant's fastest mode, at {fastest:.4g} rad/s," if bound else "the sample time"
    if step > longest * (1.0 + _ROUNDING):
        raise InputError(
            f"integration: step must be at most {longest:.4g} s, which {why} allows, got {step!r}"
        )
    ratio = sample_time / step
    substeps = round(ratio)
    if abs(ratio - substeps) > _ROUNDING * ratio:
        raise InputError(
            f"integration: step must divide the sample time {sample_time:g} s into a whole number "
            f"of steps and be at most {longest:.4g} s, which {why} allows, got {step!r}"
        )
    return substeps


def _eigenvalues(A: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    matrices = check_finite("integration", "A", A)
    if matrices.ndim not in (2, 3) or matrices.shape[-1] != matrices.shape[-2]:
        raise InputError(
            f"integration: A must be one square matrix or several, got shape {matrices.shape}"
        )
    return np.linalg.eigvals(matrices).ravel().astype(np.complex128)


def _growth(z: complex) -> complex:
    return 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)))
