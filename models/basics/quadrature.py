r"""Quadrature nodes for integrals over frequency.

Every variance in the toolkit is an integral of a spectrum over frequency.  This module turns such
an integral into a weighted sum, :math:`\int f\,d\omega \approx \sum_k w_k f(\omega_k)`, once, so
that everything behind it works on plain arrays of nodes.

The nodes are Gauss-Legendre on panels in log-frequency, because the features of a response are
about equally wide on that axis wherever they lie.  A panel ends wherever the integrand has a
kink (the peak of a JONSWAP spectrum, the rows of a RAO table).  An n-point rule converges like
:math:`\rho^{-2n}`, with :math:`\rho` the size of the ellipse around the panel that stays clear of
all poles (Trefethen, *Approximation Theory and Approximation Practice*, 2013, ch. 19): a panel
whose half-length is at most its distance from them has :math:`\rho \ge 1 + \sqrt 2`.  About a
lightly damped pole c + i d the rule is one in u, t = c + d sinh u, which puts the pole at i pi/2
and a panel of many widths on a few units of u.

Two ways to get nodes: :func:`spectral_nodes` from what is known of the integrand (kinks and
poles), and :func:`adaptive_nodes` from the integrands themselves, several at once.  The second is
our own rather than `scipy.integrate.quad_vec` or `cubature`, because these measure the error in
one norm over all integrands (a torque variance of 1e7 would drown a displacement variance of
1e-4) and call the integrand one panel at a time.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from .arrays import FloatArray
from .checks import InputError, ReadOnlyArrays, SolverError, check_finite, check_range
from .panels import FrequencyAxis, cut_panels, longest_panel, stretched_panels

# Rules that the adaptive scheme tries on a panel before it cuts the panel in two.
# Shorter ones (3, 5) were tried: across an unannounced kink two of them can agree by accident.
_LADDER = (4, 7, 11, 16)
# Growth of the ellipse of a panel whose half-length equals its distance from the nearest pole.
_RHO_REFERENCE = 1.0 + math.sqrt(2.0)


class SpectralDensity(Protocol):
    """What a one-sided spectrum offers: a sea, a hook motion, or a user's own."""

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Variance density per rad/s at `omega` [rad/s]."""
        ...

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the variance [rad/s]."""
        ...

    @property
    def splits(self) -> tuple[float, ...]:
        """Frequencies at which the density has a kink or a sharp peak [rad/s]."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Quadrature(ReadOnlyArrays):
    """Nodes, ascending (k,) [rad/s], and positive weights (k,) [rad/s] of an integral.

    That of f is ``sum(weights * f(omega))``.
    """

    omega: FloatArray
    weights: FloatArray

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        omega = check_finite("quadrature", "omega", self.omega)
        weights = check_finite("quadrature", "weights", self.weights)
        if omega.ndim != 1 or omega.shape != weights.shape:
            raise InputError(
                "quadrature: omega and weights must be one-dimensional and equally long, "
                f"got shapes {omega.shape} and {weights.shape}"
            )
        super().__post_init__()

    def __len__(self) -> int:
        """Return the number of nodes."""
        return int(self.omega.size)

    def integrate(self, values: npt.ArrayLike, axis: int = -1) -> FloatArray:
        """Integrate real values that were sampled at the nodes, which `axis` runs over, along it.

        Raises InputError if the samples are complex: take the modulus or the parts first.
        """
        array = np.moveaxis(_real(values), axis, -1)
        result: FloatArray = array @ self.weights
        return result


def spectral_nodes(
    low: float,
    high: float,
    *,
    splits: Iterable[float] = (),
    poles: Iterable[complex] = (),
    per_panel: int = 12,
    panels_per_decade: float = 4.0,
    half_line: bool = False,
) -> Quadrature:
    r"""Return Gauss-Legendre nodes in log-frequency for an integral whose features are known.

    Parameters
    ----------
    low, high
        Band of the integral [rad/s], ``0 < low < high``.
    splits
        Frequencies where the integrand has a kink [rad/s]; those outside the band are ignored.
    poles
        Poles s [rad/s] of what is integrated, in any half plane; nodes crowd about near ones.  What
        is no pole, such as the hump of a JONSWAP spectrum, is given as :math:`-b + i \omega` with
        its half-width b.  Poles at zero are ignored (infinitely far away in log-frequency).
    per_panel
        Nodes on a panel that is twice as long as its distance from all poles; shorter ones get
        fewer, and those about a pole more.
    panels_per_decade
        Least number of panels per decade, which stands for the smoothness of everything that
        is not a pole.
    half_line
        Integrate over [0, inf) instead: a linear panel down from `low` and a panel in 1/omega up
        from `high`.  For white noise, whose response must fall off at least as omega^-2.

    Raises
    ------
    InputError
        If the band is empty, or a pole lies on the imaginary axis (the integral diverges).

    Examples
    --------
    The variance of an oscillator with 1 % damping under white noise is pi / (4 zeta) for a
    one-sided density of one and unit mass and stiffness.

    >>> zeta = 0.01
    >>> pole = complex(-zeta, (1 - zeta**2) ** 0.5)
    >>> q = spectral_nodes(0.1, 10.0, poles=[pole], half_line=True)
    >>> h = 1 / (1 - q.omega**2 + 2j * zeta * q.omega)
    >>> bool(abs(q.integrate(abs(h) ** 2) / (3.141592653589793 / (4 * zeta)) - 1) < 1e-8)
    True
    """
    axis = FrequencyAxis(low, high, half_line)
    if per_panel < 2:
        raise InputError(f"quadrature: per_panel must be at least 2, got {per_panel!r}")
    longest = longest_panel(panels_per_decade)
    panels, about, ratio = stretched_panels(axis, splits, axis.poles(poles), longest)
    counts = per_panel * math.log(_RHO_REFERENCE) / np.log(ratio + np.hypot(ratio, 1.0))
    counts = np.maximum(np.ceil(counts), min(3, per_panel // 2)).astype(np.int64)
    omega, weights = axis.rules(panels, counts, about)
    return Quadrature(omega=omega, weights=weights)


def adaptive_nodes(
    f: Callable[[FloatArray], npt.ArrayLike],
    low: float,
    high: float,
    *,
    splits: Iterable[float] = (),
    poles: Iterable[complex] = (),
    rtol: float = 1e-8,
    panels_per_decade: float = 4.0,
    half_line: bool = False,
    max_panels: int = 3000,
) -> Quadrature:
    """Return nodes on which the integral of every given integrand is accurate.

    On each panel Gauss-Legendre rules of 4, 7, 11 and 16 points are tried in turn; the difference
    of the last two estimates the error.  Panels on which the longest rule is not enough are cut
    in two.  It ends when, for every integrand, the errors of all panels add up to at most `rtol`
    times the integral of its modulus.  The estimate is that of the shorter rule while the longer
    one is returned, so a smooth integrand comes out some four digits better than asked for.  A
    kink that is not among `splits` spoils this margin and costs many nodes.

    Parameters
    ----------
    f
        Integrands: omega (k,) [rad/s] -> values (k,), or (m, k) for m integrands at once.  Real.
    low, high, splits, poles, panels_per_decade, half_line
        As in :func:`spectral_nodes`.  Poles are optional here but make sure that a very narrow
        resonance is not overlooked.
    rtol
        Relative accuracy, in [1e-12, 0.1].
    max_panels
        Where to give up.

    Raises
    ------
    InputError
        If an integrand is not finite at a node, or the band or `rtol` is out of range.
    SolverError
        If `max_panels` are not enough: the integrand is not integrable, or not smooth.
    """
    check_range("quadrature", "rtol", rtol, low=1e-12, high=0.1)
    axis = FrequencyAxis(low, high, half_line)
    # A loose clearance: poles only make the panels short enough to notice them.
    edges = cut_panels(
        axis, splits, axis.poles(poles), longest_panel(panels_per_decade), clearance=4.0
    )
    panels = _fresh(f, axis, edges)
    while True:
        errors = np.array([p.error for p in panels])
        scale = np.sum([p.modulus for p in panels], axis=0)
        # An integrand that is zero everywhere has no error either.
        allowed = np.where(scale > 0.0, rtol * scale, np.inf)
        if np.all(errors.sum(axis=0) <= allowed):
            break
        if len(panels) > max_panels:
            worst = panels[int(np.argmax((errors / allowed).max(axis=1)))]
            raise SolverError(
                f"quadrature: {max_panels} panels do not reach a relative accuracy of {rtol:g}; "
                f"the integrand is hardest near {worst.omega.mean():.4g} rad/s"
            )
        # What stays unmarked adds up to at most half of what is allowed.
        marked = (errors / allowed).max(axis=1) > 0.5 / len(panels)
        keep = [p for p, m in zip(panels, marked, strict=True) if not m]
        climb = [p for p, m in zip(panels, marked, strict=True) if m and p.rung + 1 < len(_LADDER)]
        cut = [p for p, m in zip(panels, marked, strict=True) if m and p.rung + 1 == len(_LADDER)]
        halves = [half for p in cut for half in ((p.a, p.middle), (p.middle, p.b))]
        panels = keep + _climb(f, axis, climb) + _fresh(f, axis, halves)
    panels.sort(key=lambda p: p.a)
    return Quadrature(
        omega=np.concatenate([p.omega for p in panels]),
        weights=np.concatenate([p.weights for p in panels]),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Panel:
    """One panel of the adaptive scheme with the best rule tried on it so far."""

    a: float
    b: float
    rung: int
    omega: FloatArray
    weights: FloatArray
    integral: FloatArray
    modulus: FloatArray
    error: FloatArray

    @property
    def middle(self) -> float:
        return 0.5 * (self.a + self.b)


def _fresh(
    f: Callable[[FloatArray], npt.ArrayLike],
    axis: FrequencyAxis,
    edges: Sequence[tuple[float, float]],
) -> list[_Panel]:
    """Measure new panels with the first two rules."""
    return _climb(f, axis, _measure(f, axis, [(a, b, 0, None) for a, b in edges]))


def _climb(
    f: Callable[[FloatArray], npt.ArrayLike], axis: FrequencyAxis, panels: Sequence[_Panel]
) -> list[_Panel]:
    """Measure panels with the next longer rule."""
    return _measure(f, axis, [(p.a, p.b, p.rung + 1, p.integral) for p in panels])


def _measure(
    f: Callable[[FloatArray], npt.ArrayLike],
    axis: FrequencyAxis,
    wanted: Sequence[tuple[float, float, int, FloatArray | None]],
) -> list[_Panel]:
    """Evaluate the integrands on all wanted panels in one call."""
    if not wanted:
        return []
    counts = [_LADDER[rung] for _, _, rung, _ in wanted]
    omega, weights = axis.rules([(a, b) for a, b, _, _ in wanted], counts)
    values = np.atleast_2d(_real(f(omega)))
    if values.shape[-1] != omega.size or values.ndim != 2:
        raise InputError(
            f"quadrature: the integrand must return ({omega.size},) or (m, {omega.size}) values "
            f"for {omega.size} frequencies, got shape {values.shape}"
        )
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        raise InputError(
            "quadrature: the integrand must be finite, "
            f"got {values[tuple(bad[0])]} at {omega[bad[0][1]]:.6g} rad/s"
        )
    first = np.cumsum([0, *counts[:-1]])
    integrals = np.add.reduceat(values * weights, first, axis=1).T
    moduli = np.add.reduceat(np.abs(values) * weights, first, axis=1).T
    return [
        _Panel(
            a=a,
            b=b,
            rung=rung,
            omega=omega[start : start + count],
            weights=weights[start : start + count],
            integral=integral,
            modulus=modulus,
            error=np.abs(integral - (0.0 if previous is None else previous)),
        )
        for (a, b, rung, previous), start, count, integral, modulus in zip(
            wanted, first, counts, integrals, moduli, strict=True
        )
    ]


def _real(values: npt.ArrayLike) -> FloatArray:
    """Return samples as floats; numpy would drop an imaginary part with a mere warning."""
    if np.iscomplexobj(values):
        raise InputError("quadrature: the integrand must be real, got complex values")
    return np.asarray(values, dtype=np.float64)
