r"""Mean torque of a sample as the move, in place of the torque at its start.

A command is held over a sample, and so the torque falls while the motor speeds up: of a DC motor by
its back-EMF, of a speed regulator by its gain.  A plan that keeps the torque *at the start* of
each sample within the limit therefore gives away what it falls by, a twentieth of the peak on the
thesis's winch and a third on a drive with a stiff speed regulator.  The drive does not mind being
asked for more: it cuts what is too much, and its torque stays at the limit as long as the demand is
beyond it.

Here a move is the mean torque of a sample.  The linear plant follows exactly (`mean_torque`), and
the command is found by turning the drive's clipping round (`start_torque`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from models.basics import FloatArray, ReadOnlyArrays

from ..winch import SampledWinch


@dataclass(frozen=True, kw_only=True, eq=False)
class Drift(ReadOnlyArrays):
    """By how much the torque at the start of a sample is over its mean [N m].

    Of the winch's state, of the hook's (z, z') at both ends of the sample and of the constants it
    is (n,), (4,), (2,); of the mean torque a number [-].
    """

    state: FloatArray
    mean: float
    hook: FloatArray
    constants: FloatArray

    @classmethod
    def none(cls, size: int) -> Drift:
        """Return that of a move which is the torque at the start."""
        return cls(state=np.zeros(size), mean=0.0, hook=np.zeros(4), constants=np.zeros(2))

    def __call__(self, x: FloatArray, d: float, ends: FloatArray, c: FloatArray) -> float:
        """Return it for a state, a mean torque [N m], the hook's ends and the constants."""
        return float(self.state @ x + self.hook @ ends + self.constants @ c) + self.mean * d


def mean_torque(winch: SampledWinch) -> tuple[SampledWinch, Drift]:
    r"""Return the winch whose input is the mean torque of a sample, and the drift.

    With theta the motor's angle, the demand d_0 = b (u - u_rest - K omega_0) at the start has the
    mean d = d_0 - b K ((theta_1 - theta_0)/T - omega_0), which is linear in all that is known.
    A command that comes late acts on speeds which are not: there the motor alone counts.
    """
    if winch.waiting:
        T, falls = winch.sample_time, winch.gain * winch.back
        alone = falls * T / winch.data.inertia
        mean = alone / -math.expm1(-alone) - 1.0 if alone > 0.0 else 0.0
        drift = replace(Drift.none(winch.size), mean=mean)
        return replace(winch, B=winch.B * (1.0 + mean)), drift
    angle = winch.plant.states.index("motor.angle")
    n, T, falls = winch.size, winch.sample_time, winch.gain * winch.back
    turned = (winch.A - np.eye(n))[angle] / T - winch.speed
    per_start = falls * float(winch.B[angle, 0]) / T
    # e = state x + ... + per_start (d + e)
    share = falls / (1.0 - per_start)
    drift = Drift(
        state=share * turned,
        mean=per_start / (1.0 - per_start),
        hook=share * winch.from_hook[angle] / T,
        constants=share * winch.from_constants[angle] / T,
    )
    B = winch.B[:, 0]
    changed = replace(
        winch,
        A=winch.A + np.outer(B, drift.state),
        B=winch.B * (1.0 + drift.mean),
        from_hook=winch.from_hook + np.outer(B, drift.hook),
        from_constants=winch.from_constants + np.outer(B, drift.constants),
    )
    return changed, drift


def start_torque(mean: float, drift: float, peak: float) -> float:
    """Return the demand at the start of a sample that gives a mean torque, cut at the peak [N m].

    The demand is taken to fall evenly, from s to s - 2 drift; what lies beyond the peak is cut, and
    s is raised until the rest has the mean that is wanted.  The mean is cut to the peak, what the
    drive gives at most, either way; the drift is that of start over mean without a limit [N m].
    """
    mean = min(max(mean, -peak), peak)
    half = abs(drift)
    if half == 0.0:
        return mean
    # The end that is higher, for a torque that pulls up; both signs mirrored.
    sign = 1.0 if mean >= 0.0 else -1.0
    left = (peak - sign * mean) / half
    farther = 2.0 * half * (1.0 - math.sqrt(left)) + peak if left < 1.0 else sign * mean + half
    falls = sign * drift > 0.0
    return sign * (farther if falls else farther - 2.0 * half)
