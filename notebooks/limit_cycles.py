r"""Oscillations that a loop sustains once its motor's torque is clipped: harmonic balance.

A saturated loop oscillates at omega with a demand of amplitude A about a bias b where

    1 + N(A, b) L_tau(i omega) = 0,    mean(A, b) = static torque,

with N and the mean of `describing`.  A conditionally stable loop has two such
cycles: a small one which is a threshold, as a loop pushed beyond it keeps losing gain, and a large
one in which it ends, bounded by nothing but the payload's quadratic drag.  That takes part as the
linear drag that takes as much energy from the payload's first harmonic.

One harmonic, the describing function, is good where the loop filters the others off.  A motor
that carries a load is clipped on one side first, and the even harmonics that this makes are not
small; `limit_cycles` balances as many as it is asked to (A. Gelb and W. E. Vander Velde 1968,
chapter 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from describing import bias_for, sine_response
from scipy.optimize import brentq, root
from torque_loop import TorqueLoop

from models.basics import ComplexArray, FloatArray, check_range
from models.rig import energy_equivalent
from synth.loop import loop_margins

_POINTS = 512  # of a cycle
_RESIDUAL = 1e-8
_SAME = 1e-5  # relative difference of two solutions that are one
_STEP = 1e-4  # relative, of the derivatives in Loeb's criterion
_SPEEDS = np.geomspace(1e-2, 1e2, 5)  # of the payload, for whose drag cycles are looked for [m/s]
_MOST = 1e9  # largest amplitude of the demand that is looked at, over the limit


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitCycle:
    """An oscillation of the clipped loop.

    Attributes
    ----------
    omega
        Frequency [rad/s].
    payload, offset
        Amplitude of the payload's first harmonic, and its mean [m].
    bias
        Mean of the torque asked for [N m].
    harmonics
        Harmonics of the torque asked for, (n,) complex, the first one real [N m].
    gain
        First harmonic of the torque over that of what is asked for, N [-].
    drag
        Linear drag coefficient of the payload [N s/m].
    stable
        Whether a larger oscillation shrinks to it and a smaller one grows (Loeb's criterion, with
        the first harmonic).  A cycle that is not stable is a threshold.
    """

    omega: float
    payload: float
    offset: float
    bias: float
    harmonics: ComplexArray
    gain: float
    drag: float
    stable: bool

    def __post_init__(self) -> None:
        """Make the array read-only."""
        harmonics = np.array(self.harmonics, dtype=np.complex128)
        harmonics.setflags(write=False)
        object.__setattr__(self, "harmonics", harmonics)


def limit_cycles(loop: TorqueLoop, *, harmonics: int = 1) -> tuple[LimitCycle, ...]:
    """Return the oscillations that a loop sustains at its torque limit, smallest first.

    They are looked for from every frequency at which the loop, with any of a range of drags,
    would be on the verge of instability if it had less gain.

    Parameters
    ----------
    loop
        The loop; it must be stable while nothing is clipped.
    harmonics
        How many are balanced, 1 to 50; with one it is the describing function.

    Raises
    ------
    InputError
        If `harmonics` is out of its range.
    """
    check_range("limit cycles", "harmonics", harmonics, low=1, high=50)
    found: list[LimitCycle] = []
    for guess in _guesses(loop):
        cycle = _balanced(loop, guess)
        if cycle is not None and not any(_alike(cycle, other) for other in found):
            found.append(replace(cycle, stable=_attracts(loop, cycle)))
    # Harmonics join one by one: each balance begins at the one before, where it nearly holds.
    for _ in range(1, harmonics):
        more = [replace(c, harmonics=np.append(c.harmonics, np.zeros(1))) for c in found]
        found = [c for c in (_balanced(loop, guess) for guess in more) if c is not None]
    return tuple(sorted(found, key=lambda cycle: cycle.payload))


def clipped_harmonics(
    limit: float, bias: float, harmonics: ComplexArray
) -> tuple[float, ComplexArray]:
    """Return mean and harmonics (n,) of clip(bias + Re sum c_k e^{ik theta}, -limit, limit).

    Integrated exactly over straight pieces, with corners where the limits are met: a demand far
    beyond them is a square wave, and its edges must not sit on a grid.

    Parameters
    ----------
    limit, bias
        Limit and mean of the input.
    harmonics
        c_k of the input, k = 1 .. n, (n,).
    """
    theta = np.linspace(0.0, 2.0 * math.pi, _POINTS + 1)
    k = np.arange(1, harmonics.size + 1)
    x = bias + np.real(np.exp(1j * np.outer(theta, k)) @ harmonics)
    for end in (-limit, limit):
        step = np.flatnonzero((x[:-1] - end) * (x[1:] - end) < 0.0)
        share = (end - x[step]) / (x[step + 1] - x[step])
        theta = np.insert(theta, step + 1, theta[step] + share * np.diff(theta)[step])
        x = np.insert(x, step + 1, end)
    y = np.clip(x, -limit, limit)
    width = np.diff(theta)
    mean = float(np.sum(0.5 * (y[1:] + y[:-1]) * width)) / (2.0 * math.pi)
    # By parts: the integral of y e^{-ik theta} is that of y' e^{-ik theta} over ik.
    slope = np.divide(np.diff(y), width, out=np.zeros_like(width), where=width > 0.0)
    turns = np.exp(-1j * np.outer(k, theta))
    return mean, (turns[:, 1:] - turns[:, :-1]) @ slope / (math.pi * k**2)


def _guesses(loop: TorqueLoop) -> list[LimitCycle]:
    """Return where the loop is on the verge, at the amplitude that has that gain."""
    grid = loop.grid
    # Quadratic drag is not known before the motion is: each drag of a range has its crossings,
    # and the balance then makes drag and motion agree.
    drags = loop.quadratic * _SPEEDS if loop.quadratic > 0.0 else np.zeros(1)
    found = []
    for drag in drags:

        def gain_of(omega: FloatArray, drag: float = float(drag)) -> ComplexArray:
            return loop.responses(omega, drag)[0]

        crossings = loop_margins(gain_of, grid, gain_of(grid)).real_axis_crossings
        for omega, value in zip(crossings, gain_of(crossings).real, strict=True):
            if -_MOST < value < -1.0:
                amplitude = _amplitude(loop, -1.0 / value)
                bias = bias_for(loop.static, loop.limit, amplitude)
                guess = LimitCycle(
                    omega=float(omega),
                    payload=math.nan,
                    offset=math.nan,
                    bias=bias,
                    harmonics=np.array([amplitude]),
                    gain=-1.0 / value,
                    drag=float(drag),
                    stable=False,
                )
                found.append(guess)
    return found


def _amplitude(loop: TorqueLoop, gain: float) -> float:
    """Return the amplitude of the demand of which so much goes through [N m]."""

    def over(logarithm: float) -> float:
        return math.log(_gain(loop, math.exp(logarithm)) / gain)

    barely = loop.limit - abs(loop.static)
    return math.exp(brentq(over, math.log(barely), math.log(10.0 * _MOST * loop.limit)))


def _gain(loop: TorqueLoop, amplitude: float) -> float:
    bias = bias_for(loop.static, loop.limit, amplitude)
    return sine_response(loop.limit, bias, amplitude)[1]


def _balanced(loop: TorqueLoop, guess: LimitCycle) -> LimitCycle | None:
    """Return the cycle near a guess, with as many harmonics; None if none is found."""
    n, dragged = guess.harmonics.size, loop.quadratic > 0.0
    first = float(guess.harmonics[0].real)

    def balance(v: FloatArray) -> tuple[FloatArray, LimitCycle]:
        """Return what is off balance, and the cycle, for ln omega, ln A, b/A, c_k/A, ln C."""
        # Ten decades about the guess: a step too far must not end in inf.
        logarithms = np.clip(np.append(v[:2], v[2 * n + 1 :]), near - 23.0, near + 23.0)
        omega, amplitude, *drag = np.exp(logarithms)
        higher = v[3 : 2 * n + 1].reshape(-1, 2)
        asked = amplitude * np.append(1.0, higher[:, 0] + 1j * higher[:, 1])
        coefficient = float(drag[0]) if dragged else 0.0
        mean, given = clipped_harmonics(loop.limit, v[2] * amplitude, asked)
        gains, per_torque = loop.responses(omega * np.arange(1, n + 1), coefficient)
        cycle = LimitCycle(
            omega=float(omega),
            payload=float(abs(per_torque[0] * given[0])),
            offset=loop.offset(float(v[2] * amplitude)),
            bias=float(v[2] * amplitude),
            harmonics=asked,
            gain=float(abs(given[0]) / amplitude),
            drag=coefficient,
            stable=guess.stable,
        )
        residual = [(mean - loop.static) / loop.limit, *_pairs((asked + gains * given) / amplitude)]
        if dragged:
            wanted = energy_equivalent(loop.quadratic, cycle.payload, cycle.omega)
            residual.append(math.log(max(wanted / coefficient, 1e-30)))
        return np.array(residual), cycle

    def off_balance(v: FloatArray) -> FloatArray:
        return balance(v)[0]

    near = np.log([guess.omega, first, *([guess.drag] if dragged else [])])
    higher = _pairs(guess.harmonics[1:] / first)
    start = [float(x) for x in (*near[:2], guess.bias / first, *higher, *near[2:])]
    solution = root(off_balance, start, tol=1e-12)
    residual, cycle = balance(solution.x)
    # With a gain of one nothing is clipped, and any amplitude would do.
    sound = float(np.abs(residual).max()) < _RESIDUAL and cycle.gain < 1.0 - _SAME
    return cycle if sound else None


def _attracts(loop: TorqueLoop, cycle: LimitCycle) -> bool:
    """Return whether an oscillation nearby comes back to the cycle (Loeb 1956).

    With F(s, A) = 1 + N(A) L_tau(s), drag included, an oscillation of another amplitude has the
    exponent s with F = 0, so that ds/dA = -F_A/F_s: it shrinks back if the real part is negative.
    """
    omega, amplitude = cycle.omega, float(cycle.harmonics[0].real)

    def characteristic(size: float) -> complex:
        gain = _gain(loop, size)
        drag = _drag(loop, cycle, gain * size)
        return complex(1.0 + gain * loop.responses([omega], drag)[0][0])

    less, more = (1.0 - _STEP) * amplitude, (1.0 + _STEP) * amplitude
    of_amplitude = (characteristic(more) - characteristic(less)) / (more - less)
    slow, fast = (1.0 - _STEP) * omega, (1.0 + _STEP) * omega
    gains = loop.responses([slow, fast], cycle.drag)[0]
    of_exponent = cycle.gain * (gains[1] - gains[0]) / (1j * (fast - slow))
    return bool((-of_amplitude / of_exponent).real < 0.0)


def _drag(loop: TorqueLoop, cycle: LimitCycle, torque: float) -> float:
    """Return the drag that agrees with the payload's motion at an amplitude of the torque."""
    if loop.quadratic == 0.0:
        return 0.0

    def lacking(logarithm: float) -> float:
        drag = math.exp(logarithm)
        payload = torque * abs(loop.responses([cycle.omega], drag)[1][0])
        return math.log(energy_equivalent(loop.quadratic, payload, cycle.omega) / drag)

    near = math.log(cycle.drag)
    return math.exp(brentq(lacking, near - 1.0, near + 1.0, xtol=1e-14))


def _alike(one: LimitCycle, other: LimitCycle) -> bool:
    pairs = ((one.omega, other.omega), (one.payload, other.payload))
    return all(abs(a / b - 1.0) < _SAME for a, b in pairs)


def _pairs(values: ComplexArray) -> list[float]:
    """Return real and imaginary parts, one after the other."""
    return [float(part) for value in values for part in (value.real, value.imag)]
