r"""The sea: one-sided spectra of the surface elevation.

First room in the data's way: sea -> vessel -> hook motion -> plant.  A spectrum here is a variance
density S(omega) [m^2 s/rad], so its integral over omega from 0 is the variance, H_s^2 / 16.

The standard spectra are those of the library `waveresponse`, evaluated point by point on whatever
frequencies are asked for; its formulas are pointwise, so they need no uniform grid.  Their
normalisations are the analytic ones: JONSWAP's :math:`1 - 0.287 \ln\gamma` is 0.1 % off in H_s at
gamma = 3.3, Torsethaugen's is 0.8 % off at H_s = 4 m and T_p = 10 s.

The thesis (M. Fakharmanesh, 1975, App. B) writes Bretschneider's spectrum in its own variables and
for wave *height*, S(f) = 3.434 H^2 T (f T)^-5 exp(-0.675 (f T)^-4) with the mean height
H = 0.625 H_S and the mean period T = 0.9 T_S.  Its integral is H_S^2 / 2, eight times the variance
of the elevation, so it is divided by 8, and by 2 pi because S(f) df = S(omega) d omega.  Its
rounded constants make H_s = 4 sqrt(m0) come out 0.3 % below H_S.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .checks import InputError, check_range
from .metrics import SpectrumStatistics, spectrum_statistics
from .quadrature import Quadrature, adaptive_nodes

if TYPE_CHECKING:
    from .case import Case

__all__ = ["HIGHEST_FREQUENCY", "SPECTRA", "SeaSpectrum"]

FloatArray = npt.NDArray[np.float64]

SPECTRA = ("bretschneider-1975", "bretschneider", "jonswap", "ochi-hubble", "torsethaugen")
"""The spectra by their names in a case file."""

HIGHEST_FREQUENCY = 60.0
"""Where integrals over a sea end [rad/s]: a resonant loop still answers to the tail at 10 rad/s."""

# Below this fraction of the (lowest) peak frequency the densities are under 1e-25 of their peak;
# below the second one exp(-B / omega^4) is zero in double precision and omega^-5 could overflow.
_LOWEST = 0.35
_NOTHING = 0.1


@dataclass(frozen=True, kw_only=True)
class SeaSpectrum:
    """A long-crested sea state by its standard spectrum.

    Attributes
    ----------
    kind
        One of :data:`SPECTRA`.
    significant_height
        H_s [m].
    peak_period
        T_p [s]; for every kind but `bretschneider-1975`.
    significant_period
        T_S, the mean period of the highest third of the waves [s]; for `bretschneider-1975` only.
    gamma
        Peak enhancement of `jonswap` [-], 1 to 7: beyond, its normalisation is over 1 % off.
    order
        The shape parameter q of `ochi-hubble` [-]; 1 gives `bretschneider`.

    Raises
    ------
    InputError
        If a value is out of range, or the period is not the one that the kind wants.

    Examples
    --------
    >>> sea = SeaSpectrum(kind="bretschneider", significant_height=2.0, peak_period=10.0)
    >>> s = sea.statistics
    >>> round(s.significant_height, 4), round(s.zero_crossing_period, 2)
    (2.0, 7.1)
    """

    kind: str
    significant_height: float
    peak_period: float | None = None
    significant_period: float | None = None
    gamma: float = 3.3
    order: float = 2.0

    def __post_init__(self) -> None:
        """Check the values."""
        if self.kind not in SPECTRA:
            raise InputError(
                f"sea: spectrum must be one of {', '.join(SPECTRA)}; got {self.kind!r}"
            )
        check_range(
            "sea", "significant_height", self.significant_height, low=0.0, unit="m", open_low=True
        )
        thesis = self.kind == "bretschneider-1975"
        wanted, other = "peak_period", "significant_period"
        if thesis:
            wanted, other = other, wanted
        if getattr(self, other) is not None:
            raise InputError(f"sea: spectrum {self.kind} takes {wanted} [s], not {other}")
        if getattr(self, wanted) is None:
            raise InputError(f"sea: spectrum {self.kind} needs {wanted} [s]")
        check_range("sea", wanted, getattr(self, wanted), low=0.0, unit="s", open_low=True)
        if self.kind == "jonswap":
            check_range("sea", "gamma", self.gamma, low=1.0, high=7.0)
        if self.kind == "ochi-hubble":
            check_range("sea", "order", self.order, low=0.5, high=20.0)
        if self.kind == "torsethaugen" and not math.isfinite(
            float(self.density(self.peak_frequency))
        ):
            # Where its peak enhancement falls below one, its normalisation is no number.
            raise InputError(
                "sea: spectrum torsethaugen is not defined for so low a steepness: "
                f"significant_height {self.significant_height:g} m with "
                f"peak_period {self.peak_period:g} s; use jonswap or bretschneider"
            )

    @classmethod
    def from_case(cls, case: Case) -> SeaSpectrum:
        """Return the sea of a case."""
        sea = case.sea
        return cls(
            kind=sea.spectrum,
            significant_height=sea.significant_height,
            peak_period=sea.peak_period,
            significant_period=sea.significant_period,
            gamma=sea.gamma,
        )

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the variance density of the surface elevation.

        Parameters
        ----------
        omega
            Frequencies [rad/s], any shape; at and below zero the density is zero.

        Returns
        -------
        FloatArray
            S(omega) [m^2 s/rad], one-sided, same shape.
        """
        frequency = np.asarray(omega, dtype=np.float64)
        result = np.zeros(frequency.shape)
        some = frequency > _NOTHING * self._lowest_peak
        if np.any(some):
            result[some] = self._formula(frequency[some])
        return result

    def __call__(self, omega: npt.ArrayLike) -> FloatArray:
        """Return :meth:`density`: a sea may stand wherever a function of omega is wanted."""
        return self.density(omega)

    @property
    def peak_frequency(self) -> float:
        """Frequency of the spectral peak [rad/s] (of the primary one for `torsethaugen`)."""
        if self.significant_period is not None:
            # d/df of (fT)^-5 exp(-0.675 (fT)^-4) is zero where (fT)^4 = 4/5 x 0.675.
            mean_period = 0.9 * self.significant_period
            return 2.0 * math.pi * math.sqrt(math.sqrt(0.54)) / mean_period
        return 2.0 * math.pi / (self.peak_period or math.nan)

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the spectrum [rad/s]; below it is nothing, above it a tail is cut."""
        return (_LOWEST * self._lowest_peak, max(HIGHEST_FREQUENCY, 20.0 * self.peak_frequency))

    @property
    def splits(self) -> tuple[float, ...]:
        """Frequencies at which a quadrature has to begin a new panel [rad/s]."""
        return (self.peak_frequency,)

    def quadrature(self, rtol: float = 1e-9) -> Quadrature:
        """Return nodes over the band on which all moments up to m4 are accurate to `rtol`."""
        powers = np.array([[0.0], [1.0], [2.0], [4.0]])
        return adaptive_nodes(
            lambda omega: omega**powers * self.density(omega),
            *self.band,
            splits=self.splits,
            rtol=rtol,
        )

    @cached_property
    def statistics(self) -> SpectrumStatistics:
        """Moments and periods over :attr:`band`.

        m4 of a spectrum with an omega^-5 tail grows with the logarithm of the band's upper end
        without limit, and so has no meaning of its own.
        """
        return spectrum_statistics(self.quadrature(), self.density, self.band)

    def scaled(self, significant_height: float) -> SeaSpectrum:
        """Return the sea with the same shape and another H_s [m].

        Raises
        ------
        InputError
            For `torsethaugen`, whose shape depends on H_s: build a new one instead.
        """
        if self.kind == "torsethaugen":
            raise InputError(
                "sea: spectrum torsethaugen cannot be scaled to another significant_height, "
                "its shape depends on it"
            )
        return replace(self, significant_height=significant_height)

    @property
    def _lowest_peak(self) -> float:
        if self.kind != "torsethaugen":
            return self.peak_frequency
        # The secondary system of a wind sea is longer than T_p: T_f + 2 s with T_f = 6.6 H_s^(1/3)
        # (Torsethaugen and Haver 2004, Table 1).
        longest = 6.6 * math.cbrt(self.significant_height) + 2.0
        return min(self.peak_frequency, 2.0 * math.pi / longest)

    def _formula(self, omega: FloatArray) -> FloatArray:
        """Evaluate the spectrum where it is not negligible."""
        if self.significant_period is not None:
            height = 0.625 * self.significant_height
            period = 0.9 * self.significant_period
            nu = omega * period / (2.0 * math.pi)
            per_hertz = 3.434 * height**2 * period * nu**-5 * np.exp(-0.675 * nu**-4)
            result: FloatArray = per_hertz / 8.0 / (2.0 * math.pi)
            return result
        import waveresponse  # here, because it loads pandas and more: 0.7 s

        library: dict[str, tuple[Callable[..., Any], dict[str, float]]] = {
            "bretschneider": (waveresponse.ModifiedPiersonMoskowitz, {}),
            "jonswap": (waveresponse.JONSWAP, {"gamma": self.gamma}),
            "ochi-hubble": (waveresponse.OchiHubble, {"q": self.order}),
            "torsethaugen": (waveresponse.Torsethaugen, {}),
        }
        spectrum, shape = library[self.kind]
        with np.errstate(invalid="ignore"):  # a NaN is caught, with words, on construction
            _, values = spectrum(omega, freq_hz=False)(
                self.significant_height, self.peak_period, freq_hz=False, **shape
            )
        return np.asarray(values, dtype=np.float64)
