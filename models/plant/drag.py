"""Linear drag that stands for quadratic drag, in a sine and in a random sea.

The payload's drag is q v|v|, q = 1/2 rho C_D A, and its slope at rest is zero; a linear plant
needs a coefficient C [N s/m] in its place.  The case says which: a given C, that of equal
energy in a given sine (the 1975 thesis), or that of the least mean square error in the
Gaussian motion that the plant itself makes with it (stochastic linearisation), for which C and
the motion have to be found together: `consistent_drag`.
"""

import math
from collections.abc import Callable

from scipy.optimize import brentq

from ..basics import SolverError

_ROUNDS = 12  # of finding nodes for a drag; two are the rule
_SETTLED = 1e-3  # relative change of a drag for which adapted nodes need not change


def stochastic_equivalent(quadratic: float, sigma: float) -> float:
    """Return the C of stochastic linearisation, q sqrt(8/pi) sigma [N s/m], of q [N s2/m2].

    The mean slope of q v|v|, v Gaussian, which is also its least-mean-square gain (Price's theorem;
    Borgman, J. Waterways Harbors 93, 1967).  The velocity's standard deviation sigma is [m/s].
    """
    return quadratic * math.sqrt(8.0 / math.pi) * sigma


def consistent_drag(
    quadratic: float, velocity_rms: Callable[[float], float], *, tolerance: float = 1e-10
) -> float:
    """Return the C that agrees with the motion it leads to [N s/m], for q [N s2/m2].

    Solves C = q sqrt(8/pi) sigma_v(C).  More drag means less motion, so that the difference of both
    sides changes sign once: a bracketing root finder cannot settle on the wrong root, as the usual
    substitution of C into its own equation can swing about it.  `velocity_rms` leads from C to the
    rms of the payload's velocity [m/s], infinite where there is no stationary motion; the tolerance
    of C is relative.

    Raises SolverError if the motion does not shrink however large the drag: the plant is unstable
    with any.
    """
    if quadratic == 0.0:
        return 0.0

    def target(C: float) -> float:
        return stochastic_equivalent(quadratic, velocity_rms(C))

    # A loop may be unstable at low drag (infinite motion) and calm at high: go up until it is.
    low, high = 0.0, quadratic  # the drag of about 0.6 m/s rms
    for _ in range(60):
        if target(high) <= high:
            break
        low, high = high, 4.0 * high
    else:
        raise SolverError(
            "drag: no linear drag coefficient agrees with the motion it leads to; at "
            f"{high:.3g} N s/m the payload's velocity is still {velocity_rms(high):.3g} m/s rms"
        )
    if target(low) == low:
        return low

    # In ratios, as an infinite motion at low drag then is a finite number of the right sign.
    def surplus(C: float) -> float:
        return 1.0 if math.isinf(found := target(C)) else (found - C) / (found + C)

    return float(brentq(surplus, low, high, xtol=1e-12 * high, rtol=max(tolerance, 1e-14)))


def settled_drag(
    quadratic: float,
    about: Callable[[float], Callable[[float], float]],
    start: float,
    *,
    settled: float = _SETTLED,
) -> float:
    """Return `consistent_drag` where the motion is an integral over frequencies.

    What costs is to find nodes for the integral; on given nodes a change of C costs next to
    nothing.  So the equation is solved on the nodes that suit a first C, then on those that suit
    its solution, until that no longer moves.  `about` leads from a C to the `velocity_rms` of
    `consistent_drag` on nodes that suit it; it may raise SolverError where there are none (an
    undamped motion).  A relative change of C below `settled` leaves the nodes as they are.

    Raises SolverError if no C agrees with the motion it leads to, or none has nodes.
    """
    if quadratic == 0.0:
        return 0.0
    current = start or quadratic
    for _ in range(_ROUNDS):
        try:
            found = consistent_drag(quadratic, about(current))
        except SolverError:
            current *= 4.0  # more drag damps the motion, so that it can be integrated
            continue
        if found == 0.0 or abs(found - current) <= settled * found:
            return found
        current = found
    return consistent_drag(quadratic, lambda C: about(C)(C))
