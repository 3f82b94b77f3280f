"""The rope as masses and springs, and the axial modes that say how many are needed.

A rope of N masses has N springs between the drum and the payload, the N-th mass being the
payload with its share of rope.  `lump_rope` gives lengths only (of each spring, and of the
rope that each mass stands for), so that the symbolic plant can multiply them by parameters.
The exact modes, of a rope whose upper end is held, are the yardstick.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.optimize import brentq

from ..basics import FloatArray, InputError, ReadOnlyArrays

MAX_MASSES = 40  # more states cost more in every eigenvalue than they add to any design


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
