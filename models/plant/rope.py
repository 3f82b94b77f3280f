"""The rope as masses and springs, the axial modes that say how many are needed, and its damping.

A rope of N masses has N springs between the drum and the payload, the N-th mass being the
payload with its share of rope.  `lump_rope` gives lengths only (of each spring, and of the
rope that each mass stands for), so that the symbolic plant can multiply them by parameters.
The exact modes, of a rope whose upper end is held, are the yardstick.

`zener_branches` are the hysteretic damping law: a loss factor that hardly depends on frequency, as
a few springs with dampers, so that it is causal and rational, the same in frequency and in time.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
from scipy.optimize import brentq, nnls

from ..basics import FloatArray, InputError, ReadOnlyArrays

MAX_MASSES = 40  # more states cost more in every eigenvalue than they add to any design

# Decades over which two, three, .. branches hold the loss factor within 5 %.
_DECADES = (1.1, 2.0, 2.85, 3.7, 4.55, 5.4)
MAX_BRANCHES = len(_DECADES) + 1
_LOW_END = 0.5  # where their band begins, in first modes
_INSIDE = 1.11  # how far the outermost branches lie within it
_NODES = 300
_EXACT = 1e3  # weight of the first mode, whose ratio is the one that is given


@dataclass(frozen=True, kw_only=True, eq=False)
class RopeLumps(ReadOnlyArrays):
    """Lengths of rope that the springs and the masses stand for, from the drum down.

    Parameters
    ----------
    springs
        Length of rope in each spring, (N,), as a fraction of the rope [-]; they add to 1.
    masses
        Length of rope in each mass, (N,), as a fraction of the rope [-], the last being
        the payload's share.
    """

    springs: FloatArray
    masses: FloatArray

    @property
    def hanging(self) -> FloatArray:
        """Rope that hangs below the top of each spring and is carried by it, (N,) [-]."""
        return np.cumsum(self.masses[::-1])[::-1]

    @property
    def at_drum(self) -> float:
        """Rope whose weight the drum carries without a mass: 2/3 for one mass, else 0 [-]."""
        return max(0.0, 1.0 - float(self.masses.sum()))


def lump_rope(masses: int, lumping: str = "distributed") -> RopeLumps:
    """Return the lumping of a rope into `masses` masses, the payload's included.

    ``distributed``, two masses and more: N - 1 pieces of length h = L/(N - 1/2), each with
    its mass in its middle, and half a piece at the payload.  So the uppermost spring is h/2
    long, the others h.  All rope mass is there, frequencies *and* the tension at the drum
    converge as 1/N^2, and nothing of the rope has to move with the drum (a mass at the
    drum would need the hook's acceleration as an input).  One mass: a third of the rope at
    the payload, the first term of the exact first mode.

    ``thesis``: every piece of length L/N has its mass at its lower end.  One mass: the 1975
    thesis, all rope mass at the payload.  Converges only as 1/N, the payload being heavier
    by half a piece; kept to reproduce figures that were computed in this way.
    """
    if lumping == "thesis":
        return RopeLumps(
            springs=np.full(masses, 1.0 / masses), masses=np.full(masses, 1.0 / masses)
        )
    if masses == 1:
        return RopeLumps(springs=np.ones(1), masses=np.full(1, 1.0 / 3.0))
    piece = 1.0 / (masses - 0.5)
    springs, shares = np.full(masses, piece), np.full(masses, piece)
    springs[0] = shares[-1] = piece / 2.0
    return RopeLumps(springs=springs, masses=shares)


def fixed_top_modes(
    axial_stiffness: float,
    length: float,
    mass_per_length: float,
    payload_mass: float,
    count: int,
) -> FloatArray:
    """Return the exact axial modes of a rope with a payload, its upper end held [rad/s].

    The roots of nu tan nu = eps, eps = m L / M_1, with omega = (nu / L) sqrt(EA / m); one
    root lies in each interval (j pi, j pi + pi/2), j = 0, 1, ...

    Parameters
    ----------
    axial_stiffness
        EA [N].
    length
        L [m].
    mass_per_length
        m [kg/m]; zero is a massless rope with one mode.
    payload_mass
        M_1, added mass included [kg].
    count
        How many modes, from the lowest.

    Raises
    ------
    InputError
        If more than one mode of a massless rope is asked for.
    """
    if mass_per_length == 0.0:
        if count > 1:
            raise InputError(f"rope: a massless rope has one axial mode, got count {count}")
        return np.array([math.sqrt(axial_stiffness / (length * payload_mass))])
    eps = mass_per_length * length / payload_mass

    def excess(nu: float) -> float:  # no poles, unlike the tangent
        return nu * math.sin(nu) - eps * math.cos(nu)

    roots = [brentq(excess, j * math.pi, (j + 0.5) * math.pi, xtol=1e-15) for j in range(count)]
    return np.array(roots) / length * math.sqrt(axial_stiffness / mass_per_length)


def lumped_modes(
    lumps: RopeLumps,
    axial_stiffness: float,
    length: float,
    mass_per_length: float,
    payload_mass: float,
) -> FloatArray:
    """Return the undamped axial modes of a lumped rope, its upper end held, (N,) [rad/s]."""
    k = axial_stiffness / (length * lumps.springs)
    mass = mass_per_length * length * lumps.masses
    mass[-1] += payload_mass
    # K x = omega^2 M x in mass-scaled coordinates is a symmetric tridiagonal problem.
    diagonal = (k + np.append(k[1:], 0.0)) / mass
    beside = -k[1:] / np.sqrt(mass[1:] * mass[:-1])
    return np.sqrt(scipy.linalg.eigvalsh_tridiagonal(diagonal, beside))


def zener_branches(
    damping_ratio: npt.ArrayLike, first_mode: npt.ArrayLike, highest: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the hysteretic law EA(s) = EA (k_0 + sum_j k_j s tau_j / (1 + s tau_j)).

    Its loss factor is 2 zeta at the first mode, where its real part is EA, and within 5 % of it
    from half the first to twice the highest mode (for a zeta up to 0.1; 13 % at 0.5).  The law
    is EA_0 prod_j (1 + s b_j) / (1 + s a_j) with b_j / a_j = exp(w_j arctan 2 zeta) about fixed
    multiples of the first mode: the w_j are a non-negative least-squares fit of a constant phase,
    the k_j their partial fractions, all positive, as zeros and poles alternate (the product is
    that of A. Oustaloup's approximation of s^alpha, which has a constant phase).

    What is held when a number changes: the branches' places and widths depend on their count
    alone.  So the law follows zeta and the first mode smoothly, and steps, by the few per cent of
    its loss, where another highest mode over first mode asks for another branch.

    Parameters
    ----------
    damping_ratio
        zeta of the first mode [-], (n,) or one number; zero has no branches.
    first_mode
        The first mode, upper end held, likewise [rad/s].
    highest
        Highest mode whose damping is to hold, likewise [rad/s]; at least the first.

    Returns
    -------
    k_0, k, tau : ndarray
        Share of the slow stiffness (n,); shares (7, n) and times (7, n) [s] of the branches, by
        falling time, zero where a rope has fewer.
    """
    ratio, first, top = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(v, dtype=np.float64))
            for v in (damping_ratio, first_mode, highest)
        )
    )
    slow, gains = np.ones(ratio.size), np.zeros((MAX_BRANCHES, ratio.size))
    times = np.zeros_like(gains)
    decades = np.log10(2.0 / _LOW_END * np.maximum(top / first, 1.0))
    counts = np.minimum(2 + np.searchsorted(_DECADES, decades - 1e-9), MAX_BRANCHES)
    counts = np.where(ratio > 0.0, counts, 0)
    for count in np.unique(counts[counts > 0]):
        at = counts == count
        corners, widths = _branch_shape(int(count))
        half = 0.5 * np.arctan(2.0 * ratio[at]) * widths[:, None]
        poles, zeros = np.exp(-half) / corners[:, None], np.exp(half) / corners[:, None]
        own = np.expm1(2.0 * half)
        for j in range(count):
            for i in range(count):
                if i != j:
                    own[j] *= (poles[j] - zeros[i]) / (poles[j] - poles[i])
        # EA is the real part at the first mode, where s a = i a.
        slow[at] = 1.0 / (1.0 + (own * poles**2 / (1.0 + poles**2)).sum(axis=0))
        gains[:count, at], times[:count, at] = own * slow[at], poles / first[at]
    return slow, gains, times


@functools.cache
def _branch_shape(count: int) -> tuple[FloatArray, FloatArray]:
    """Return corner frequencies [first modes] and widths, ln(b/a) per loss angle, (count,) each.

    To first order in the angle a branch with the corner w_c turns the phase by w x/(1 + x^2), x =
    omega/w_c; the widths make the sum one over the band, and exactly so at the first mode.
    """
    top = _LOW_END * 10.0 ** _DECADES[count - 2]
    corners = np.geomspace(_LOW_END * _INSIDE, top / _INSIDE, count)
    nodes = np.append(np.geomspace(_LOW_END, top, _NODES), 1.0)
    weights = np.append(np.ones(_NODES), _EXACT)
    x = nodes[:, None] / corners
    widths, _ = nnls(weights[:, None] * x / (1.0 + x**2), weights)
    return corners, np.asarray(widths)
