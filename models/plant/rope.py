"""The rope as masses and springs, the axial modes that say how many are needed, and its damping.

A rope of N masses has N springs between the drum and the payload, the N-th mass being the
payload with its share of rope.  `lump_rope` gives lengths only (of each spring, and of the
rope that each mass stands for), so that the symbolic plant can multiply them by parameters.
The exact modes, of a rope whose upper end is held, are the yardstick.

`chain_of` makes the springs and masses of a lifting rig of them: a tip that gives is a spring in
series with the uppermost piece of rope, and slings are one more spring below the rope's last
mass, which then is the hook block, with the payload as one more mass.

`zener_branches` are the hysteretic damping law: a loss factor that hardly depends on frequency, as
a few springs with dampers, so that it is causal and rational, the same in frequency and in time.
"""

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg
from scipy.optimize import brentq, nnls

from ..basics import FloatArray, InputError, ReadOnlyArrays, read_only

MAX_MASSES = 40  # more states cost more in every eigenvalue than they add to any design

# Decades over which two, three, .. branches hold the loss factor within 5 %.
_DECADES = (1.1, 2.0, 2.85, 3.7, 4.55, 5.4)
MAX_BRANCHES = len(_DECADES) + 1
_LOW_END = 0.5  # where their band begins, in first modes
_INSIDE = 1.11  # how far the outermost branches lie within it
_NODES = 300
_NEWTON = 30  # steps at most
_EXACT = 1e3  # weight of the first mode, whose ratio is the one that is given


@dataclass(frozen=True, kw_only=True, eq=False)
class RopeLumps(ReadOnlyArrays):
    """Lengths of rope that springs and masses stand for, from the drum down, over its own [-].

    Those of the springs (N,) add to 1; the last of the masses (N,) is the payload's share.
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


@dataclass(frozen=True, kw_only=True)
class Link:
    """A spring of the chain from the vessel to the payload, and the mass below it.

    Its numbers are floats or symbols, as were those that it was made of.
    """

    stiffness: Any  #: k of the rope in it, or of the slings [N/m].
    #: k over the stiffness of what stands in series with it, the crane's tip [-]; 0 without.
    give: Any
    damping_time: Any  #: Kelvin-Voigt time tau of k [s].
    is_rope: bool  #: Whether it is rope.
    carried: Any  #: Weight below its top, its tension at rest [N].
    #: Of rope and hook block in the mass below it [kg], [N]; the payload's own are not in them.
    mass: Any
    weight: Any

    @property
    def series(self) -> Any:
        """Stiffness of both springs in series [N/m]."""
        return self.stiffness / (1.0 + self.give)

    @property
    def series_time(self) -> Any:
        """Kelvin-Voigt time of both in series [s], to first order in omega tau.

        The error falls with the uppermost piece of rope as more masses make it shorter.
        """
        return self.damping_time / (1.0 + self.give)


def chain_of(p: Mapping[str, Any], lumps: RopeLumps, length: Any) -> list[Link]:
    """Return the chain of springs and masses of a plant's parameters, from the drum down.

    These are numbers or symbols by name, as of `models.plant.equations.parameter_values`; the
    length [m] is ``rope.length`` unless it grows.
    """
    weight = p["payload.submerged_weight"]
    of_rope = p["rope.submerged_weight_per_length"] * p["rope.length"]
    block = "rigging.block_mass" in p
    slings = "rigging.stiffness" in p
    links = []
    for j, (spring, share) in enumerate(zip(lumps.springs, lumps.masses, strict=True)):
        piece = length * share
        carried = weight + of_rope * float(lumps.hanging[j])
        mass = p["rope.mass_per_length"] * piece
        own = p["rope.submerged_weight_per_length"] * piece
        if block:
            carried = carried + p["rigging.block_weight"]
            if j + 1 == len(lumps.masses):
                mass = mass + p["rigging.block_mass"]
                own = own + p["rigging.block_weight"]
        stiffness = p["rope.axial_stiffness"] / (length * spring)
        tip = j == 0 and "crane.tip_stiffness" in p
        links.append(
            Link(
                stiffness=stiffness,
                give=stiffness / p["crane.tip_stiffness"] if tip else 0.0,
                damping_time=p["rope.damping_time"],
                is_rope=True,
                carried=carried,
                mass=mass,
                weight=own,
            )
        )
    if slings:
        links.append(
            Link(
                stiffness=p["rigging.stiffness"],
                give=0.0,
                damping_time=0.0,
                is_rope=False,
                carried=weight,
                mass=0.0,
                weight=0.0,
            )
        )
    return links


@functools.lru_cache(maxsize=256)
def fixed_top_modes(
    axial_stiffness: float,
    length: float,
    mass_per_length: float,
    payload_mass: float,
    count: int,
    *,
    tip_stiffness: float = math.inf,
    sling_stiffness: float = math.inf,
    block_mass: float = 0.0,
) -> FloatArray:
    """Return the exact axial modes of a rope with a payload, its upper end held [rad/s].

    The roots of nu tan nu = eps, eps = m L / M_1, with omega = (nu / L) sqrt(EA / m); one
    root lies in each interval (j pi, j pi + pi/2), j = 0, 1, ...

    With a tip, slings and a block the phase of the standing wave at its two ends,

        nu + arctan(nu K/k_t) - arg(nu (m_b (1 - x) + M_1) + i m L (1 - x)) = j pi,

    K = EA/L and x = omega^2 M_1/k_s, whose left side rises from -pi/2: one root for each j.

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
    tip_stiffness, sling_stiffness
        k_t and k_s of the crane's tip and of the slings [N/m], infinite where rigid.
    block_mass
        m_b of the hook block between rope and slings [kg].

    Raises
    ------
    InputError
        If a massless rope is asked for more modes than it has.
    """
    rigid = math.isinf(tip_stiffness) and math.isinf(sling_stiffness)
    if mass_per_length == 0.0:
        held = 2 if block_mass > 0.0 and not math.isinf(sling_stiffness) else 1
        if count > held:
            word = "one axial mode" if held == 1 else "two axial modes"
            raise InputError(f"rope: a massless rope has {word}, got count {count}")
        stiffness = 1.0 / (length / axial_stiffness + 1.0 / tip_stiffness)
        if held == 2:
            springs, masses = [stiffness, sling_stiffness], [block_mass, payload_mass]
            return read_only(_chain_modes(np.array(springs), np.array(masses))[:count])
        stiffness = stiffness if rigid else 1.0 / (1.0 / stiffness + 1.0 / sling_stiffness)
        return read_only(np.array([math.sqrt(stiffness / (payload_mass + block_mass))]))
    if math.isinf(sling_stiffness):
        payload_mass, block_mass = payload_mass + block_mass, 0.0
    eps = mass_per_length * length / payload_mass

    def excess(nu: float) -> float:  # no poles, unlike the tangent
        return nu * math.sin(nu) - eps * math.cos(nu)

    tip = axial_stiffness / length / tip_stiffness
    sling = axial_stiffness / (length * eps * sling_stiffness)
    block = block_mass / payload_mass

    def phase(nu: float, j: int) -> float:
        free = 1.0 - nu * nu * sling
        lower = math.atan2(eps * free, nu * (block * free + 1.0))
        return nu + math.atan(nu * tip) - lower - j * math.pi

    if rigid:
        roots = [brentq(excess, j * math.pi, (j + 0.5) * math.pi, xtol=1e-15) for j in range(count)]
    else:
        roots = [
            brentq(phase, max(0.0, (j - 1.5) * math.pi), (j + 0.5) * math.pi, (j,), xtol=1e-15)
            for j in range(count)
        ]
    return read_only(np.array(roots) / length * math.sqrt(axial_stiffness / mass_per_length))


def first_root(eps: FloatArray) -> FloatArray:
    """Return the root of nu tan nu = eps in (0, pi/2), by Newton's rule; sqrt(eps) for small.

    That of the first axial mode, omega = (nu / L) sqrt(EA / m), eps being the rope's mass over the
    load's, (n,).
    """
    nu = np.sqrt(3.0 * eps / (3.0 + eps))
    nu = np.minimum(nu, 0.5 * np.pi * eps / (1.0 + eps) + 1e-3)
    for _ in range(_NEWTON):
        value = nu * np.sin(nu) - eps * np.cos(nu)
        slope = np.sin(nu) + nu * np.cos(nu) + eps * np.sin(nu)
        step = value / slope
        nu = np.clip(nu - step, 0.25 * nu, 0.5 * np.pi)
        if np.all(np.abs(step) <= 1e-15 * nu):
            break
    return nu


def skin_drag_share(eps: FloatArray) -> FloatArray:
    """Return the share of the rope's skin drag that the load has to bear for it [-].

    Drag q v|v| per length takes as much power out of the first mode, upper end held, as drag of
    that share of q L at the load: the mean of the cube of the mode's shape sin(nu x/L) / sin(nu),

        tan(nu/2) (2 + cos nu) / (6 nu cos^2(nu/2)),

    which is a quarter for a light rope.  Stochastic linearisation keeps it, as all velocities of a
    mode are in proportion.  `eps` is the mass of the rope over that of the load, (n,).
    """
    nu = np.maximum(first_root(np.maximum(eps, 0.0)), 1e-9)
    half = 0.5 * nu
    return np.asarray(np.tan(half) * (2.0 + np.cos(nu)) / (6.0 * nu * np.cos(half) ** 2))


def lumped_modes(
    lumps: RopeLumps,
    axial_stiffness: float,
    length: float,
    mass_per_length: float,
    payload_mass: float,
    *,
    tip_stiffness: float = math.inf,
    sling_stiffness: float = math.inf,
    block_mass: float = 0.0,
) -> FloatArray:
    """Return the undamped axial modes of a lumped rope, its upper end held [rad/s].

    (N,), and one more with slings; the arguments are those of `fixed_top_modes`.
    """
    k = axial_stiffness / (length * lumps.springs)
    mass = mass_per_length * length * lumps.masses
    k[0] /= 1.0 + k[0] / tip_stiffness
    mass[-1] += block_mass
    if not math.isinf(sling_stiffness):
        k, mass = np.append(k, sling_stiffness), np.append(mass, 0.0)
    mass[-1] += payload_mass
    return _chain_modes(k, mass)


def _chain_modes(k: FloatArray, mass: FloatArray) -> FloatArray:
    """Return the modes of springs with a mass below each, the upper end held, (n,) [rad/s]."""
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

    zeta of the first mode [-], the first mode with the upper end held, and the highest mode whose
    damping is to hold, at least the first [rad/s], are (n,) or one number each; without damping
    there are no branches.  Returned are the share k_0 of the slow stiffness (n,), and shares k and
    times tau [s] of the branches (7, n), by falling time, zero where a rope has fewer.
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
