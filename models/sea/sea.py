r"""The sea: one-sided spectra of the surface elevation.

First room in the data's way: sea -> vessel -> hook motion -> plant.  A spectrum here is a variance
density S(omega) [m^2 s/rad], so its integral over omega from 0 is the variance, H_s^2 / 16.

A sea is a standard form (`models.sea.shapes`), a measured table (`models.sea.table`), or a sum of
these, such as a wind sea and a swell.  All of them answer the same few questions (density, band,
splits, peak, moments), and nothing downstream asks which it is.

Standard forms are those of the library `waveresponse` where it has them, with their analytic
normalisations: JONSWAP's :math:`1 - 0.287 \ln\gamma` is 0.1 % off in H_s at gamma = 3.3 and less
than 1 % anywhere up to gamma = 7.  Torsethaugen's is 0.8 % too high at H_s = 4 m and T_p = 10 s and
more elsewhere, and TMA has none: the H_s of these two is made right by the integral.

The thesis (M. Fakharmanesh, 1975, App. B) writes Bretschneider's spectrum in its own variables and
for wave *height*, S(f) = 3.434 H^2 T (f T)^-5 exp(-0.675 (f T)^-4) with the mean height
H = 0.625 H_S and the mean period T = 0.9 T_S.  Its integral is H_S^2 / 2, eight times the variance
of the elevation, so it is divided by 8, and by 2 pi because S(f) df = S(omega) d omega.  Its
rounded constants make H_s = 4 sqrt(m0) come out 0.3 % below H_S.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ..basics import (
    FloatArray,
    InputError,
    Quadrature,
    SpectrumStatistics,
    adaptive_nodes,
    check_choice,
    check_range,
    spectrum_statistics,
)
from . import shapes
from .spreading import Spreading
from .table import SpectrumTable

STANDARD_SPECTRA = (
    "bretschneider-1975", "bretschneider", "pierson-moskowitz", "jonswap", "tma", "torsethaugen",
    "ochi-hubble", "gaussian-swell",
)  # fmt: skip
"""The standard forms by their names in a case file."""

SPECTRA = (*STANDARD_SPECTRA, "measured", "sum")  #: All spectra by their names in a case file.

FIELDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(STANDARD_SPECTRA, ("peak_period",)),
    "bretschneider-1975": ("significant_period",),
    "pierson-moskowitz": (),
    "tma": ("peak_period", "depth"),
    "gaussian-swell": ("peak_period", "width"),
    "measured": ("table",),
    "sum": ("parts",),
}
"""What each kind needs, besides the height that all standard forms do."""

SHORTEST = 0.5  #: Shortest period of a sea [s]: of ripples 0.4 m long.
SHALLOWEST = 1.0  #: Least depth of a sea [m]: in less nobody lifts anything.
_LEAST = {"s": SHORTEST, "m": SHALLOWEST}
_UNITS = {"peak_period": "s", "significant_period": "s", "depth": "m", "width": "rad/s"}

HIGHEST_FREQUENCY = 60.0
"""Where integrals over a sea end [rad/s]: a resonant loop still answers to the tail at 10 rad/s."""

# Below this fraction of the (lowest) peak frequency the densities are under 1e-25 of their peak;
# below the second one exp(-B / omega^4) is zero in double precision and omega^-5 could overflow.
_LOWEST = 0.35
_NOTHING = 0.1

_GAUSSIAN_END = 12.0  # standard deviations: exp(-72)


@dataclass(frozen=True, kw_only=True)
class SeaSpectrum:
    """A sea state by its spectrum.

    Raises InputError if a value is out of range, or a field is missing or is not for the kind.

    Examples
    --------
    >>> sea = SeaSpectrum(kind="bretschneider", significant_height=2.0, peak_period=10.0)
    >>> s = sea.statistics
    >>> round(s.significant_height, 4), round(s.zero_crossing_period, 2)
    (2.0, 7.1)
    """

    kind: str  #: One of :data:`SPECTRA`.
    #: H_s [m]; of `measured` and `sum` what their data have, unless given to scale them.
    significant_height: float = math.nan
    #: T_p [s]; for the standard forms but `bretschneider-1975` and `pierson-moskowitz`.
    peak_period: float | None = None
    #: T_S, the mean period of the highest third of the waves [s]; for `bretschneider-1975` only.
    significant_period: float | None = None
    #: Peak enhancement of `jonswap` and `tma` [-], 1 to 7: beyond, its normalisation is 1 % off.
    gamma: float = 3.3
    order: float = 2.0  #: The shape parameter q of `ochi-hubble` [-]; 1 gives `bretschneider`.
    #: Water depth of `tma` [m]; standard deviation of `gaussian-swell`'s frequency [rad/s].
    depth: float | None = None
    width: float | None = None
    #: The rows of `measured`; the seas of `sum`, none a sum itself.
    table: SpectrumTable | None = None
    parts: tuple[SeaSpectrum, ...] | None = None
    #: H_s that the shape of `pierson-moskowitz` and `torsethaugen` is taken at [m]; its own if left
    #: out.  `scaled` sets it.
    shape_height: float | None = None
    #: How the energy divides over headings, for the vessel's response; None if long-crested.
    spreading: Spreading | None = None

    def __post_init__(self) -> None:
        """Check the values, and give a measured sea or a sum its height."""
        check_choice("sea", "spectrum", self.kind, SPECTRA)
        self._check_fields()
        if self.parts is not None:
            object.__setattr__(self, "parts", tuple(self.parts))
            if not self.parts or any(part.kind == "sum" for part in self.parts):
                raise InputError("sea: parts must be one or more seas that are no sums themselves")
        if self.kind in ("measured", "sum") and math.isnan(self.significant_height):
            object.__setattr__(self, "significant_height", self._own_height)
        for name in ("significant_height", "shape_height"):
            value = getattr(self, name)
            if value is not None:
                check_range("sea", name, value, low=0.0, unit="m", open_low=True)
        if self.kind in ("jonswap", "tma"):
            check_range("sea", "gamma", self.gamma, low=1.0, high=7.0)
        if self.kind == "ochi-hubble":
            check_range("sea", "order", self.order, low=0.5, high=20.0)
        if self.width is not None:
            low, high = shapes.gaussian_widths(self.peak_frequency)
            check_range("sea", "width", self.width, low=low, high=high, unit="rad/s")
        peak = np.array([self.peak_frequency])
        if self.kind == "torsethaugen" and not np.all(np.isfinite(self._formula(peak))):
            # Where its peak enhancement falls below one, its normalisation is no number.
            raise InputError(
                "sea: spectrum torsethaugen is not defined for so low a steepness: "
                f"significant_height {self._shape_height:g} m with "
                f"peak_period {self.peak_period:g} s; use jonswap or bretschneider"
            )

    @classmethod
    def from_table(
        cls, omega: npt.ArrayLike, density: npt.ArrayLike, *, beyond: str = "decay"
    ) -> SeaSpectrum:
        """Return a measured sea, (k,) [rad/s], (k,) [m^2 s/rad]; :meth:`scaled` makes it higher.

        Above the last row it may `decay`, falling as omega^-5, or be `zero`.
        """
        rows, values = (tuple(np.ravel(column).tolist()) for column in (omega, density))
        return cls(kind="measured", table=SpectrumTable(omega=rows, density=values, beyond=beyond))

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided density [m^2 s/rad], any shape; zero at and below omega = 0."""
        frequency = np.asarray(omega, dtype=np.float64)
        result = np.zeros(frequency.shape)
        some = frequency > self._zero_below
        if np.any(some):
            result[some] = self._factor * self._formula(frequency[some])
        return result

    def __call__(self, omega: npt.ArrayLike) -> FloatArray:
        """Return :meth:`density`: a sea may stand wherever a function of omega is wanted."""
        return self.density(omega)

    @cached_property
    def peak_frequency(self) -> float:
        """Frequency of the spectral peak [rad/s].

        Of the primary one for `torsethaugen`; of `tma` that of its JONSWAP, a little below its
        own; of `measured` that of its highest row.
        """
        if self.significant_period is not None:
            # d/df of (fT)^-5 exp(-0.675 (fT)^-4) is zero where (fT)^4 = 4/5 x 0.675.
            mean_period = 0.9 * self.significant_period
            return 2.0 * math.pi * math.sqrt(math.sqrt(0.54)) / mean_period
        if self.table is not None:
            return self.table.peak_frequency
        if self.parts is not None:
            return highest_of(self._formula, [part.peak_frequency for part in self.parts])
        return 2.0 * math.pi / self._period

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the spectrum [rad/s]; below it is nothing, above it a tail is cut."""
        if self.table is not None:
            return self.table.band
        if self.parts is not None:
            bands = [part.band for part in self.parts]
            return min(low for low, _ in bands), max(high for _, high in bands)
        high = max(HIGHEST_FREQUENCY, 20.0 * self.peak_frequency)
        if self.width is not None:
            low = self.peak_frequency - _GAUSSIAN_END * self.width
            return max(low, 1e-3 * self.peak_frequency), high
        return _LOWEST * self._lowest_peak, high

    @property
    def splits(self) -> tuple[float, ...]:
        """Frequencies at which a quadrature has to begin a new panel [rad/s]."""
        if self.table is not None:
            return tuple(omega for omega in self.table.omega if omega > 0.0)
        if self.parts is not None:
            return tuple(sorted({omega for part in self.parts for omega in part.splits}))
        if self.width is None:
            return (self.peak_frequency,)
        sides = (self.peak_frequency + k * self.width for k in (-8.0, -4.0, 0.0, 4.0, 8.0))
        return tuple(omega for omega in sides if omega > 0.0)

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
        return spectrum_statistics(self.quadrature(), self.density)

    def scaled(self, significant_height: float) -> SeaSpectrum:
        """Return the sea with the same shape and another H_s [m].

        The shape of `pierson-moskowitz` and `torsethaugen` follows from H_s; here it stays that of
        the sea that is scaled, while `case.replace` with another height takes another shape.
        """
        if self.kind not in ("pierson-moskowitz", "torsethaugen"):
            return replace(self, significant_height=significant_height)
        return replace(self, significant_height=significant_height, shape_height=self._shape_height)

    def _check_fields(self) -> None:
        """Check that the sea has the fields of its kind and none of another's."""
        own, every = FIELDS[self.kind], {name for names in FIELDS.values() for name in names}
        for name in (*sorted(every.difference(own)), *own):
            wanted, value, unit = name in own, getattr(self, name), _UNITS.get(name)
            if not wanted and value is not None:
                raise InputError(f"sea: spectrum {self.kind} takes {takes(self.kind)}, not {name}")
            if wanted and value is None:
                needed = f"{name} [{unit}]" if unit else name
                raise InputError(f"sea: spectrum {self.kind} needs {needed}")
            if wanted and unit in _LEAST:
                check_range("sea", name, value, low=_LEAST[unit], unit=unit)
            elif wanted and unit:
                check_range("sea", name, value, low=0.0, unit=unit, open_low=True)

    @property
    def _shape_height(self) -> float:
        return self.significant_height if self.shape_height is None else self.shape_height

    @property
    def _period(self) -> float:
        if self.kind == "pierson-moskowitz":
            return shapes.fully_developed_period(self._shape_height)
        return self.peak_period or math.nan

    @property
    def _lowest_peak(self) -> float:
        if self.kind != "torsethaugen":
            return self.peak_frequency
        # The secondary system of a wind sea is longer than T_p: T_f + 2 s with T_f = 6.6 H_s^(1/3)
        # (Torsethaugen and Haver 2004, Table 1).
        longest = 6.6 * math.cbrt(self._shape_height) + 2.0
        return min(self.peak_frequency, 2.0 * math.pi / longest)

    @property
    def _zero_below(self) -> float:
        if self.table is not None or self.parts is not None or self.width is not None:
            return 0.0
        return _NOTHING * self._lowest_peak

    @property
    def _own_height(self) -> float:
        """H_s of the data of a measured sea or a sum [m]."""
        if self.table is not None:
            return 4.0 * math.sqrt(self.table.variance)
        return math.sqrt(math.fsum(part.significant_height**2 for part in self.parts or ()))

    @cached_property
    def _factor(self) -> float:
        """What the formula is multiplied by, so that H_s is what was asked for."""
        if self.kind in ("measured", "sum"):
            return (self.significant_height / self._own_height) ** 2
        share = (self.significant_height / self._shape_height) ** 2
        if self.kind not in ("torsethaugen", "tma"):
            return share
        q = adaptive_nodes(self._formula, *self.band, splits=self.splits, rtol=1e-9)
        variance = float(q.integrate(self._formula(q.omega)))
        return share * self._shape_height**2 / 16.0 / variance

    def _formula(self, omega: FloatArray) -> FloatArray:
        """Evaluate the spectrum at the shape's height, where it is not negligible."""
        if self.table is not None:
            return self.table(omega)
        if self.parts is not None:
            total: FloatArray = np.sum([part.density(omega) for part in self.parts], axis=0)
            return total
        height = self._shape_height
        if self.significant_period is not None:
            return shapes.thesis_density(omega, height, self.significant_period)
        if self.width is not None:
            return shapes.gaussian_density(omega, height, self.peak_frequency, self.width)
        result = shapes.library_density(
            self.kind, omega, height, self._period, gamma=self.gamma, order=self.order
        )
        return result if self.depth is None else result * shapes.depth_function(omega, self.depth)


def takes(kind: str) -> str:
    """Return what a kind takes besides its height, in words."""
    named = [f"{name} [{_UNITS[name]}]" if name in _UNITS else name for name in FIELDS[kind]]
    return ", ".join(named) or "no period"


def highest_of(density: Callable[[FloatArray], FloatArray], peaks: Sequence[float]) -> float:
    """Return the frequency at which a sum of spectra, (k,) -> (k,), is highest [rad/s].

    It is near one of the `peaks` of its parts [rad/s], and may be the kink of a JONSWAP, so they
    stay among the candidates throughout.

    Examples
    --------
    >>> def humps(w):
    ...     return np.exp(-((w - 1.0) ** 2)) + np.exp(-((w - 1.5) ** 2))
    >>> round(highest_of(humps, [1.0, 1.5]), 6)
    1.25
    """
    grid = np.unique(np.concatenate([np.geomspace(0.5, 2.0, 801) * peak for peak in peaks]))
    for _ in range(6):
        at = int(np.argmax(density(grid)))
        low, high = grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)]
        grid = np.union1d(np.linspace(low, high, 101), [p for p in peaks if low < p < high])
    return float(grid[int(np.argmax(density(grid)))])
