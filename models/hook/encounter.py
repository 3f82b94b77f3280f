r"""Frequencies of encounter, under way or in a current, and spectra of waves met at them.

A wave of frequency omega and wave number k that travels at the angle beta to a vessel which moves
through the water at U passes the vessel at the frequency of encounter

.. math:: \omega_e = \omega - k U \cos\beta

(time factor e^{+i omega t}, heading where the waves go to; 180 deg is a head sea, met faster).
What the hook does in a wave is the operator at the wave's own frequency; that it does so at
|omega_e| moves its energy along the axis and changes none of it, but the velocity's does change.

Seas from astern are folded: waves slower than the vessel are overtaken (omega_e < 0), so that up
to three waves are met at one frequency, and at the highest, g/(4 U cos beta), the density of the
waves has an integrable pole.  Hence the energy is mapped and not the density: its sum E(w) up to
each frequency w is taken exactly from the waves met more slowly, and the density is the slope of
a monotone curve through E (Fritsch and Carlson 1980).  No energy is lost or added anywhere.

The operators are those of the file, which as a rule hold for a vessel at rest: what speed does to
them is not in it, and is small up to a Froude number of about 0.1 (6 knots on 80 m).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..basics import GRAVITY, FloatArray, ReadOnlyArrays, read_only, wave_number
from ..case import Case
from ..vessel import HeaveRao, hook_operators, rao_of_hook, vessel_raos

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

# Spacing of the waves whose energy is mapped, and of the curve through E, relative to frequency.
_FINE, _COARSE = 0.0015, 0.006
_KNOT, _WIDE_KNOT = 0.02, 0.1
# Shares of the energy below which, and above which, the wide spacing is enough.
_QUIET = (1e-4, 3e-3)
_NOTHING = 1e-9


def speed_along(case: Case, headings: npt.ArrayLike) -> FloatArray:
    """Return how fast the vessel moves through the water along waves of headings [rad], [m/s]."""
    angle = np.asarray(headings, dtype=np.float64)
    found = (case.vessel.speed or 0.0) * np.cos(angle)
    current = case.vessel.current
    if current is not None:
        found = found - current.speed * np.cos(angle - current.heading)
    return np.asarray(found, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Encounter(ReadOnlyArrays):
    """How a vessel that moves through the water meets the waves."""

    #: Speed of the vessel through the water along the waves of each heading, positive where it runs
    #: with them (n,) [m/s].
    along: FloatArray
    weights: FloatArray  #: Share of the sea's energy in each heading (n,).
    #: Heave of the hook in each heading (n), or None: one for all, see :class:`HookMotion`.
    operators: tuple[HeaveRao, ...] | None = None
    depth: float = math.inf  #: Water depth [m].

    @classmethod
    def from_case(cls, case: Case, *, hook: bool = True) -> Encounter | None:
        """Return how a case's vessel meets the waves; None if it lies still in the water.

        Without its hook's operators it is for other motions in the same waves.
        """
        if not case.vessel.moves:
            return None
        omega, table, headings, weights = hook_operators(
            case.vessel, case.sea.to_spectrum().spreading, case.label
        )
        operators = None
        if hook:
            operators = tuple(
                rao_of_hook(case.vessel, omega, np.abs(column), np.angle(column))
                for column in table.T
            )
        return cls(
            along=speed_along(case, headings),
            weights=weights,
            operators=operators,
            depth=vessel_raos(case.vessel, case.label).depth,
        )

    def frequency(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the frequencies of encounter (n, k) by heading and wave frequency (k,) [rad/s].

        They are negative for waves that are overtaken.
        """
        wave = np.asarray(omega, dtype=np.float64)
        met: FloatArray = wave - np.multiply.outer(self.along, wave_number(wave, self.depth))
        return met

    def wave_frequency(self, met: npt.ArrayLike) -> FloatArray:
        """Return the frequency of the longest wave of the mean direction met at `met` [rad/s].

        In deep water; beyond the fold of a following sea it is that of the fold.
        """
        frequency = np.asarray(met, dtype=np.float64)
        a = float(self.weights @ self.along) / GRAVITY  # omega_e = omega - a omega^2
        if a == 0.0:
            return frequency
        root = np.sqrt(np.maximum(1.0 - 4.0 * a * frequency, 0.0))
        # The form without cancellation: 2 w / (1 + sqrt(1 - 4 a w)).
        found: FloatArray = np.where(
            4.0 * a * frequency < 1.0, 2.0 * frequency / (1.0 + root), 1.0 / (2.0 * abs(a))
        )
        return found

    def met(
        self,
        density: Callable[[FloatArray], FloatArray],
        band: tuple[float, float],
        rao: HeaveRao,
        splits: tuple[float, ...] = (),
    ) -> MetSpectrum:
        """Return the spectrum of a motion as it is met, of the sea's density over its band [rad/s].

        It ends at the band's upper end too.  `rao` is the motion's operator where one holds for
        all headings; else those of the hook count.  At `splits` the density has a kink [rad/s].
        """
        wave = self._waves(band, splits)
        middle = np.sqrt(wave[1:] * wave[:-1])
        energies = []
        for k, share in enumerate(self.weights):
            own = rao if self.operators is None else self.operators[k]
            a, b = own.gain(wave) ** 2 * density(wave), own.gain(middle) ** 2 * density(middle)
            # Simpson's rule over ln omega, in which the waves are evenly spaced.
            log_step = np.log(wave[1:] / wave[:-1])
            cells = log_step / 6.0 * (a[:-1] * wave[:-1] + 4.0 * b * middle + a[1:] * wave[1:])
            energies.append(share * np.concatenate([[0.0], np.cumsum(cells)]))
        return _mapped(self.frequency(wave), np.array(energies), band[1])

    def _waves(self, band: tuple[float, float], splits: tuple[float, ...]) -> FloatArray:
        """Return the waves whose energy is mapped, closer where most of it is."""
        low, high = band
        middle = min(30.0 * low, high)
        parts = [_spaced(low, middle, _FINE), _spaced(middle, high, _COARSE), np.array(splits)]
        # At the fold, so that each side of it is met at frequencies in one order.
        turn = np.argmax(self.frequency(parts[0]), axis=1)
        parts.append(parts[0][turn])
        every = np.unique(np.concatenate(parts))
        return every[(every >= low) & (every <= high)]


@dataclass(frozen=True, kw_only=True, eq=False)
class MetSpectrum:
    """A spectrum by its energy: a monotone curve through the sum of energy up to each frequency."""

    knots: FloatArray  #: Frequencies, strictly ascending (m,) [rad/s].
    energy: FloatArray  #: Variance up to each knot, from zero on (m,) [m^2].
    slope: FloatArray  #: Density at each knot (m,) [m^2 s/rad].

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided variance density, zero outside the knots [m^2 s/rad]."""
        frequency = np.asarray(omega, dtype=np.float64)
        low, high = self.band
        slope = self._curve(np.clip(frequency, low, high))
        inside = (frequency >= low) & (frequency <= high)
        result: FloatArray = np.where(inside, np.maximum(slope, 0.0), 0.0)
        return result

    @cached_property
    def _curve(self) -> PPoly:
        """The slope of the cubic through the energies with the slopes at the knots."""
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.knots, self.energy, self.slope).derivative()

    @property
    def band(self) -> tuple[float, float]:
        """Band of the spectrum [rad/s]."""
        return float(self.knots[0]), float(self.knots[-1])

    @property
    def splits(self) -> tuple[float, ...]:
        """Frequencies at which the density has a kink [rad/s]."""
        return tuple(float(w) for w in self.knots[1:-1])

    @property
    def peak_frequency(self) -> float:
        """Knot at which the density is highest [rad/s]."""
        return float(self.knots[int(np.argmax(self.slope))])


def _mapped(met: FloatArray, energy: FloatArray, high: float) -> MetSpectrum:
    """Return the spectrum over |omega_e| of waves met at (n, k) with energies up to each (n, k)."""
    # Up to the fold waves are met ever faster, beyond it ever slower, then overtaken (met < 0).
    turns = np.argmax(met, axis=1)

    def total(w: FloatArray) -> FloatArray:
        # The energy met at |omega_e| <= w, of each branch by itself, as each is monotone.
        found = np.zeros_like(w)
        for row, sums, turn in zip(met, energy, turns, strict=True):
            up, down = slice(None, turn + 1), slice(turn, None)
            found += np.interp(w, row[up], sums[up]) - np.interp(-w, row[up], sums[up])
            if turn + 1 < row.size:
                x, y = row[down][::-1], sums[down][::-1]
                found += np.interp(-w, x, y) - np.interp(w, x, y)
        return found

    grid = _spaced(1e-3 * high / 60.0, high, 0.01)
    share = total(grid)
    if share[-1] <= 0.0:
        return MetSpectrum(
            knots=np.array([1e-3 * high, high]), energy=np.zeros(2), slope=np.zeros(2)
        )
    share = share / share[-1]
    low, rise, top = np.interp(
        [_NOTHING, _QUIET[0], 1.0 - _QUIET[1]], share, grid
    )  # on the flat part of `share` any of its frequencies will do
    parts = [
        _spaced(low, rise, _WIDE_KNOT),
        _spaced(rise, top, _KNOT),
        _spaced(top, high, _WIDE_KNOT),
    ]
    folds = met[np.arange(turns.size), turns]
    # Many headings smear their poles out; that of a single one wants knots of its own.
    if turns.size == 1 and low < folds[0] < top and turns[0] + 1 < met.shape[1]:
        parts.append(folds[0] * np.array([0.985, 0.995, 1.0, 1.005]))
    knots = np.unique(np.concatenate(parts))
    knots = knots[np.concatenate([[True], np.diff(knots) > 1e-4 * knots[1:]])]
    energy_up_to = total(knots)
    energy_up_to[0] = 0.0  # what little lies below goes into the first cell
    means = np.diff(energy_up_to) / np.diff(knots)
    # A slope over a short stretch, not at a point: the sums are interpolated linearly.
    near = 0.003 * knots
    slope = (total(knots + near) - total(knots - near)) / (2.0 * near)
    # No more than three times the mean of either side: then the curve rises everywhere.
    largest = 3.0 * np.minimum(np.append(means, means[-1]), np.insert(means, 0, means[0]))
    slope = np.clip(slope, 0.0, largest)
    return MetSpectrum(
        knots=read_only(knots), energy=read_only(energy_up_to), slope=read_only(slope)
    )


def _spaced(low: float, high: float, ratio: float) -> FloatArray:
    """Return frequencies in equal ratios."""
    if high <= low * (1.0 + 1e-9):
        return np.array([low])
    return np.geomspace(low, high, max(2, math.ceil(math.log(high / low) / ratio) + 1))
