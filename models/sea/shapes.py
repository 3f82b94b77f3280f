r"""Standard forms of a sea's spectrum, point by point, and the sea of a wind.

Those that the library `waveresponse` has (Bretschneider, JONSWAP, Ochi-Hubble, Torsethaugen) are
evaluated by it: its formulas are pointwise, so they need no uniform grid.  TMA and the Gaussian
swell are in `wavespectra` alone, an extra that needs a grid and labelled arrays and normalises on
that grid (five milliseconds a call); they are a line each and are written here, and tested against
it.  The 1975 form and its variables are described in `models.sea.sea`.

Sources: DNV-RP-C205 (2021), 3.5.5 (JONSWAP, gamma from T_p and H_s); Bouws, Guenther, Rosenthal
and Vincent, *J. Geophys. Res.* 90 (1985) 975 (TMA); Kitaigorodskii, Krasitskii and Zaslavskii,
*J. Phys. Oceanogr.* 5 (1975) 410 (its depth function); Bunney, Saulter and Palmer, OMAE2014-24129
(Gaussian swell); Pierson and Moskowitz, *J. Geophys. Res.* 69 (1964) 5181.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..basics import GRAVITY, FloatArray, InputError, wave_number

_PHILLIPS = 0.0081  # alpha of Pierson and Moskowitz
_FOOT = 0.3048
_KNOT = 1852.0 / 3600.0

WIND_TABLE: tuple[tuple[float, float, float], ...] = (
    (18.0, 6.1, 5.1), (19.0, 6.9, 5.4), (20.0, 8.0, 5.7), (22.0, 10.0, 6.3), (24.0, 12.0, 6.8),
    (24.5, 13.0, 7.0),
)  # fmt: skip
"""Wind [knots], significant height [ft] and average period [s]: 1975 thesis, Table 3.

Only its sea states 4 to 6 have survived the scan.  Below, the rows are lost; above, the one row
that is left (15 ft) has lost its wind.  Neither is made up here: such a wind needs a spectrum with
H_s and T_p.
"""


def jonswap_gamma(peak_period: float, significant_height: float) -> float:
    """Return the JONSWAP peak enhancement of T_p [s] and H_s [m] (DNV-RP-C205, 3.5.5.5).

    Examples
    --------
    >>> [round(jonswap_gamma(period, 4.0), 2) for period in (7.0, 9.0, 10.0)]
    [5.0, 1.78, 1.0]
    """
    ratio = peak_period / math.sqrt(significant_height)
    if ratio <= 3.6:
        return 5.0
    return math.exp(5.75 - 1.15 * ratio) if ratio < 5.0 else 1.0


def breaking_steepness(peak_period: float | FloatArray) -> FloatArray:
    """Return the significant steepness above which seas are not observed [-], by T_p [s].

    1/15 for peak periods up to 8 s, 1/25 from 15 s, linear in between (DNV-RP-C205, 3.5.4).
    """
    return np.asarray(np.interp(peak_period, (8.0, 15.0), (1.0 / 15.0, 1.0 / 25.0)))


def breaking_height(periods: FloatArray) -> FloatArray:
    """Return the H_s above which seas of a peak period are not observed [m]."""
    return np.asarray(breaking_steepness(periods) * GRAVITY * periods**2 / (2.0 * math.pi))


def fully_developed_period(significant_height: float) -> float:
    r"""Return the peak period of a fully developed sea of H_s [m], by Pierson and Moskowitz [s].

    Their spectrum :math:`\alpha g^2 \omega^{-5} \exp(-\tfrac54 (\omega_p/\omega)^4)` with alpha =
    0.0081 has the variance :math:`\alpha g^2 / (5 \omega_p^4)`, so H_s alone gives its peak.

    Examples
    --------
    >>> round(fully_developed_period(4.0), 2)
    10.0
    """
    squared = 4.0 * GRAVITY * math.sqrt(_PHILLIPS / 5.0) / significant_height
    return 2.0 * math.pi / math.sqrt(squared)


def thesis_density(omega: FloatArray, height: float, significant_period: float) -> FloatArray:
    """Return the 1975 form, as a density of the elevation [m^2 s/rad]; see `models.sea.sea`."""
    mean_height = 0.625 * height
    period = 0.9 * significant_period
    nu = omega * period / (2.0 * math.pi)
    per_hertz = 3.434 * mean_height**2 * period * nu**-5 * np.exp(-0.675 * nu**-4)
    result: FloatArray = per_hertz / 8.0 / (2.0 * math.pi)
    return result


def library_density(
    kind: str, omega: FloatArray, height: float, period: float, *, gamma: float, order: float
) -> FloatArray:
    """Return a spectrum of `waveresponse` [m^2 s/rad] at frequencies above zero (k,) [rad/s].

    Pierson and Moskowitz's is Bretschneider's with a period of its own, and TMA's is JONSWAP's
    before the depth comes in.  Heights are H_s [m], periods T_p [s]; `gamma` is the peak
    enhancement of `jonswap` and `tma`, `order` the q of `ochi-hubble` [-].
    """
    import waveresponse  # here, because it loads pandas and more: 0.7 s

    library: dict[str, tuple[Callable[..., Any], dict[str, float]]] = {
        "bretschneider": (waveresponse.ModifiedPiersonMoskowitz, {}),
        "pierson-moskowitz": (waveresponse.ModifiedPiersonMoskowitz, {}),
        "jonswap": (waveresponse.JONSWAP, {"gamma": gamma}),
        "tma": (waveresponse.JONSWAP, {"gamma": gamma}),
        "ochi-hubble": (waveresponse.OchiHubble, {"q": order}),
        "torsethaugen": (waveresponse.Torsethaugen, {}),
    }
    spectrum, shape = library[kind]
    with np.errstate(invalid="ignore"):  # a NaN is caught, with words, on construction
        _, values = spectrum(omega, freq_hz=False)(height, period, freq_hz=False, **shape)
    return np.asarray(values, dtype=np.float64)


def depth_function(omega: FloatArray, depth: float) -> FloatArray:
    r"""Return what water of a depth d [m] leaves of a spectrum [-]: Kitaigorodskii's function.

    .. math:: \phi = \tanh^2(kd) / (1 + 2 k d / \sinh 2 k d), \qquad \omega^2 = g k \tanh k d

    Examples
    --------
    >>> depth_function(np.array([0.1, 1.0, 10.0]), 20.0).round(4)
    array([0.0102, 0.8367, 1.    ])
    """
    kd = wave_number(omega, depth) * depth
    # 2 kd / sinh(2 kd), without overflow in deep water.
    ratio = 4.0 * kd * np.exp(-2.0 * kd) / -np.expm1(-4.0 * kd)
    result: FloatArray = np.tanh(kd) ** 2 / (1.0 + ratio)
    return result


def gaussian_density(omega: FloatArray, height: float, peak: float, width: float) -> FloatArray:
    """Return a swell of H_s [m] whose energy is normally distributed over frequency [m^2 s/rad].

    Its mean is `peak`, its standard deviation `width` [rad/s].
    """
    z = (omega - peak) / width
    result: FloatArray = (
        height**2 / 16.0 / (width * math.sqrt(2.0 * math.pi)) * np.exp(-0.5 * z * z)
    )
    return result


def gaussian_widths(peak: float) -> tuple[float, float]:
    """Return the least and the largest width of a Gaussian swell with a peak there [rad/s].

    The time series' harmonics are 1/200 of its frequency apart, and from a sixth on there would be
    energy at zero frequency.
    """
    return peak / 200.0, peak / 6.0


def fully_arisen(wind_speed: float) -> tuple[float, float]:
    """Return H_s [m] and T_S [s] of a wind [m/s], linear between the rows of :data:`WIND_TABLE`.

    The table gives the average period; the period of the energy's maximum in such a sea (Pierson,
    Neumann and James 1955) is sqrt(2) times as long, and this is what the thesis takes as T_S:
    8.1 s at 20 knots, where the table has 5.7 s.

    Raises InputError if the wind is outside the table.

    Examples
    --------
    >>> height, period = fully_arisen(20 * 1852 / 3600)
    >>> round(height, 4), round(period, 2)
    (2.4384, 8.06)
    """
    wind, height, period = np.array(WIND_TABLE).T
    knots = wind_speed / _KNOT
    span = (
        f"{wind[0]:g} to {wind[-1]:g} knots ({wind[0] * _KNOT:.2f} to {wind[-1] * _KNOT:.2f} m/s)"
    )
    got = f"got {knots:.4g} knots ({wind_speed:.4g} m/s)"
    tiny = 1e-9 * knots
    if not math.isfinite(knots) or knots < wind[0] - tiny:
        raise InputError(
            f"must be {span}, {got}: the rows of the 1975 thesis's Table 3 below 18 knots are "
            "lost; give significant_height and a period instead"
        )
    if knots > wind[-1] + tiny:
        raise InputError(
            f"must be {span}, {got}: the 1975 thesis's Table 3 ends there; give "
            "significant_height and a period instead"
        )
    return (
        float(np.interp(knots, wind, height)) * _FOOT,
        math.sqrt(2.0) * float(np.interp(knots, wind, period)),
    )
