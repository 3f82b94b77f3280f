"""Statistics of a spectrum: moments, periods, significant and extreme values.

A zero-mean Gaussian process is known by its one-sided variance density S(omega).  Its spectral
moments m_n, the integrals of omega^n S, give its rms sqrt(m0), its mean zero-up-crossing period
T_z = 2 pi sqrt(m0 / m2) (Rice 1944) and, with maxima taken as Rayleigh distributed, the most
probable maximum in a given time, sigma sqrt(2 ln(T / T_z)) (Longuet-Higgins 1952; DNV-RP-C205,
3.3.4).  "rms" is the standard deviation, "significant" is 4 sigma for a height (double amplitude)
and 2 sigma for an amplitude.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .arrays import FloatArray
from .checks import check_range
from .quadrature import Quadrature

Density = Callable[[FloatArray], npt.ArrayLike]

THREE_HOURS = 10800.0  #: The usual exposure of a sea state [s].

_HOOK, _HELD = "the hook's motion", "the payload's with the drum held"


def attenuation(residual: float) -> float:
    """Return a residual, one motion over another, as a loss [dB]: -20 log10.

    Examples
    --------
    >>> attenuation(0.1), attenuation(0.0)
    (20.0, inf)
    """
    return -20.0 * math.log10(residual) if residual > 0.0 else math.inf


def residual_text(residual: float, held: float = math.nan) -> str:
    """Return what is left of a motion: of the hook's, and of the payload's with the drum held.

    Every command tells compensation in these words.

    Examples
    --------
    >>> residual_text(0.0432)
    "residual 4.3 % of the hook's motion (27.3 dB)"
    >>> residual_text(0.809, 0.615)[47:]
    "61.5 % of the payload's with the drum held (4.2 dB)"
    """

    def told(share: float, whose: str) -> str:
        size = f"{100.0 * share:.1f}" if 100.0 * share < 99.95 else f"{100.0 * share:.0f}"
        return f"{size} % of {whose} ({attenuation(share):.1f} dB)"

    text = f"residual {told(residual, _HOOK)}"
    return text if math.isnan(held) else f"{text}, {told(held, _HELD)}"


def moments(
    quadrature: Quadrature, density: Density | npt.ArrayLike, orders: Sequence[float] = (0, 1, 2, 4)
) -> FloatArray:
    """Return spectral moments, the integrals of omega^n S(omega) over the nodes, one an order.

    The one-sided variance density [u^2 s/rad] is a function of omega, or its values at the nodes;
    the moments are [u^2 (rad/s)^n].
    """
    values = density(quadrature.omega) if callable(density) else density
    powers = quadrature.omega ** np.asarray(orders, dtype=np.float64)[:, np.newaxis]
    return quadrature.integrate(powers * np.asarray(values, dtype=np.float64))


def zero_crossing_period(m0: float, m2: float) -> float:
    """Return the mean zero-up-crossing period T_z = 2 pi sqrt(m0 / m2) [s].

    A signal that does not move (m2 = 0) never crosses zero: its period is infinite.

    Examples
    --------
    A sine of 0.5 rad/s has m2 = 0.25 m0 and a period of 4 pi.

    >>> round(zero_crossing_period(2.0, 0.5) / math.pi, 12)
    4.0
    >>> zero_crossing_period(0.0, 0.0)
    inf
    """
    first = check_range("spectrum", "m0", m0, low=0.0)
    second = check_range("spectrum", "m2", m2, low=0.0)
    return math.inf if second == 0.0 else 2.0 * math.pi * math.sqrt(first / second)


def peak_factor(t_z: float, duration: float = THREE_HOURS) -> float:
    r"""Return the most probable maximum in units of sigma, :math:`k = \sqrt{2 \ln(T / T_z)}`.

    The formula is asymptotic in the number of crossings, T / T_z.  It is held at one sigma where
    that number is below :math:`e^{1/2}`: there is then no maximum worth the name, and no jump.
    Mean zero-crossing period T_z and exposure time T are above zero [s]; the period is infinite for
    a signal at rest.

    Raises InputError if a period or a duration is not above zero.

    Examples
    --------
    Three hours, that is exp(k^2/2) crossings:

    >>> for t_z in (4.0, 6.0, 8.0, 10.8, 15.0):
    ...     print(f"T_z {t_z:4.1f} s, k {peak_factor(t_z):.4f}")
    T_z  4.0 s, k 3.9752
    T_z  6.0 s, k 3.8718
    T_z  8.0 s, k 3.7968
    T_z 10.8 s, k 3.7169
    T_z 15.0 s, k 3.6275
    >>> peak_factor(math.inf)
    1.0
    """
    time = check_range("extremes", "duration", duration, low=0.0, unit="s", open_low=True)
    if t_z == math.inf:
        return 1.0
    period = check_range("extremes", "t_z", t_z, low=0.0, unit="s", open_low=True)
    return math.sqrt(max(2.0 * math.log(time / period), 1.0))


def fractile_factor(t_z: float, probability: float, duration: float = THREE_HOURS) -> float:
    r"""Return what the largest maximum stays below with a probability, in units of sigma.

    With Rayleigh maxima the largest of N = T/T_z stays below x sigma with the probability
    exp(-N exp(-x^2/2)), so

    .. math:: x_p = \sqrt{2 \ln N - 2 \ln \ln (1/p)},

    which is the most probable maximum at p = 1/e = 0.37 (DNV-RP-C205 3.3.4).  The period T_z is
    above zero [s], infinite for a signal at rest; p is between 0 and 1, T in s.

    Raises InputError if a figure is out of range.

    Examples
    --------
    >>> round(fractile_factor(8.0, 0.9), 3), round(fractile_factor(8.0, math.exp(-1.0)), 3)
    (4.349, 3.797)
    """
    p = check_range(
        "extremes", "fractile", probability, low=0.0, high=1.0, open_low=True, open_high=True
    )
    return math.sqrt(max(peak_factor(t_z, duration) ** 2 - 2.0 * math.log(-math.log(p)), 0.0))


def exceedance_probability(factor: float, t_z: float, duration: float = THREE_HOURS) -> float:
    r"""Return the probability that a level of `factor` sigmas is exceeded in a time [-].

    A Gaussian signal crosses it upwards 1/T_z exp(-x^2/2) times a second (Rice 1944).  High levels
    are crossed as seldom as by a Poisson process, so that one is reached at all with

    .. math:: 1 - \exp\left(-\frac{T}{T_z} e^{-x^2/2}\right),

    which is :func:`fractile_factor` turned round.  A level at the mean or below it is exceeded
    with certainty; the period T_z [s] is infinite for a signal at rest, T in s.

    Raises InputError if a period or a duration is not above zero.

    Examples
    --------
    The most probable maximum of many, and what nine of ten largest ones stay below:

    >>> round(exceedance_probability(peak_factor(8.0), 8.0), 3)
    0.632
    >>> round(exceedance_probability(fractile_factor(8.0, 0.9), 8.0), 3)
    0.1
    """
    time = check_range("extremes", "duration", duration, low=0.0, unit="s", open_low=True)
    if factor <= 0.0:
        return 1.0
    if t_z == math.inf:
        return 0.0
    period = check_range("extremes", "t_z", t_z, low=0.0, unit="s", open_low=True)
    return -math.expm1(-time / period * math.exp(-0.5 * factor**2))


def most_probable_maximum(sigma: float, t_z: float, duration: float = THREE_HOURS) -> float:
    """Return the most probable maximum of a Gaussian signal of deviation `sigma` [its unit].

    Period and exposure time [s] are as in :func:`peak_factor`.

    Examples
    --------
    >>> round(most_probable_maximum(0.5, 10.8), 4)
    1.8585
    """
    return check_range("extremes", "sigma", sigma, low=0.0) * peak_factor(t_z, duration)


@dataclass(frozen=True, kw_only=True)
class SpectrumStatistics:
    """What a spectrum says about its signal, in the signal's unit u.

    Its spectral moments are over the spectrum's band [u^2 (rad/s)^n].  The m4 of a wave spectrum
    with an omega^-5 tail grows with the logarithm of the band's upper end, so it means nothing
    without it.
    """

    m0: float
    m1: float
    m2: float
    m4: float

    @property
    def rms(self) -> float:
        """Standard deviation [u]."""
        return math.sqrt(self.m0)

    @property
    def significant_height(self) -> float:
        """Significant double amplitude, 4 sigma [u]."""
        return 4.0 * self.rms

    @property
    def significant_amplitude(self) -> float:
        """Significant amplitude, 2 sigma [u]."""
        return 2.0 * self.rms

    @property
    def zero_crossing_period(self) -> float:
        """Mean zero-up-crossing period T_z [s]."""
        return zero_crossing_period(self.m0, self.m2)

    @property
    def mean_period(self) -> float:
        """Mean period T_1 = 2 pi m0 / m1 [s]."""
        return math.inf if self.m1 == 0.0 else 2.0 * math.pi * self.m0 / self.m1

    @property
    def width(self) -> float:
        """Spectral width, sqrt(m0 m2 / m1^2 - 1) [-]; 0 is a sine (Longuet-Higgins 1975)."""
        if self.m1 <= 0.0:
            return 0.0
        return math.sqrt(max(self.m0 * self.m2 / self.m1**2 - 1.0, 0.0))

    def most_probable_maximum(self, duration: float = THREE_HOURS) -> float:
        """Most probable maximum in `duration` [s], in three hours unless told otherwise [u]."""
        return most_probable_maximum(self.rms, self.zero_crossing_period, duration)

    def fractile(self, probability: float, duration: float = THREE_HOURS) -> float:
        """Return what the largest maximum stays below with this probability [u]."""
        return self.rms * fractile_factor(self.zero_crossing_period, probability, duration)


def spectrum_statistics(
    quadrature: Quadrature, density: Density | npt.ArrayLike
) -> SpectrumStatistics:
    """Return the statistics of a spectrum over the band that `quadrature` covers.

    Examples
    --------
    White noise of density 3 u^2 s/rad up to 2 rad/s:

    >>> from models.basics.quadrature import spectral_nodes
    >>> q = spectral_nodes(1e-9, 2.0)
    >>> s = spectrum_statistics(q, lambda omega: 3.0 + 0.0 * omega)
    >>> round(s.m0, 6), round(s.m2, 6), round(s.rms, 6)
    (6.0, 8.0, 2.44949)
    """
    m0, m1, m2, m4 = (float(m) for m in moments(quadrature, density))
    return SpectrumStatistics(m0=m0, m1=m1, m2=m2, m4=m4)
