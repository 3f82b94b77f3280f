"""The hook's motion over headings, peak periods and both sides of the ship.

What a crane master asks first: in which heading, with which waves, over which side.  Every point
is the hook motion of the case with that heading and that peak period; all of them share one set of
quadrature nodes, so that hundreds of points take the time of a few.  On a vessel that moves
through the water the moments are taken over the waves' own frequency with the frequency of
encounter as weight, which needs no mapped spectrum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..basics import (
    BoolArray,
    FloatArray,
    InputError,
    ReadOnlyArrays,
    check_choice,
    check_finite,
    check_range,
    spectral_nodes,
)
from ..case import Case
from ..sea import SeaSpectrum
from ..vessel import (
    Point,
    across,
    equivalent,
    heave_operators,
    hook_rao,
    rao_of_hook,
    sea_directions,
    vessel_raos,
)
from .encounter import Encounter, speed_along
from .hook import ORDERS
from .hook_demand import HookDemand

HEADINGS = tuple(float(b) for b in range(0, 360, 15))
PEAK_PERIODS = (5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0)

_MOTIONS = ("displacement", "velocity", "acceleration")


@dataclass(frozen=True, kw_only=True, eq=False)
class HookSurvey(ReadOnlyArrays):
    """Hook motion over side of the ship, heading and peak period."""

    case: Case  #: The case.
    #: Where the waves travel to (h,) [rad]; empty for a case with `heave_rao`, which holds for one
    #: heading.
    headings: FloatArray
    peak_periods: FloatArray  #: (t,) [s].
    #: The hook's place, and the same place across the ship (s, 3) [m]; empty with `heave_rao`.
    points: tuple[Point, ...]
    #: Moments of order 0 to 8 of the displacement (s, h, t, 9); s = h = 1 with `heave_rao`.
    moments: FloatArray
    steep: BoolArray  #: Whether a sea of this peak period would be steeper than breaking (t,).
    own: HookDemand  #: The figures of the case as it stands.

    def rms(self, motion: str = "velocity") -> FloatArray:
        """Return deviations (s, h, t) of `displacement`, `velocity` or `acceleration` [SI]."""
        check_choice("hook", "motion", motion, _MOTIONS)
        return np.sqrt(np.maximum(self.moments[..., 2 * _MOTIONS.index(motion)], 0.0))

    def figures(self, side: int, heading: int, period: int) -> HookDemand:
        """Return all figures of one point, by its indices."""
        return replace(self.own, moments=self.moments[side, heading, period])

    @cached_property
    def best(self) -> tuple[int, int]:
        """Side and heading with the least rope speed at the case's peak period, by index."""
        speeds = self.rms("velocity")[:, :, self.nearest_period]
        side, heading = np.unravel_index(int(np.argmin(speeds)), speeds.shape)
        return int(side), int(heading)

    @property
    def nearest_period(self) -> int:
        """Index of the peak period next to the case's own."""
        own = self.case.sea.spectral_peak_period
        return int(np.argmin(np.abs(self.peak_periods - own)))

    def to_csv(self) -> str:
        """Return every point as a row: place, sea, and the figures of the three motions in SI."""
        names = [
            f"{motion}_{what}"
            for motion in _MOTIONS
            for what in ("rms", "T_z", "width", "most_probable_max", "fractile_max")
        ]
        head = ["x", "y", "heading_deg", "peak_period", "significant_height", *names]
        lines = [",".join([*head, "peak_power", "mean_power"])]
        height = self.case.sea.significant_height
        for s in range(self.moments.shape[0]):
            place = self.points[s][:2] if self.points else (math.nan, math.nan)
            for h in range(self.moments.shape[1]):
                heading = math.degrees(self.headings[h]) if self.headings.size else math.nan
                for t, period in enumerate(self.peak_periods):
                    demand = self.figures(s, h, t)
                    row = [*place, heading, period, height]
                    for m in demand.motions:
                        row += [m.rms, m.zero_crossing_period, m.width]
                        row.append(m.most_probable_maximum(demand.duration))
                        row.append(m.fractile(demand.probability, demand.duration))
                    row += [demand.peak_power, demand.mean_power]
                    lines.append(",".join("" if math.isnan(v) else f"{v:.6g}" for v in row))
        return "\n".join(lines) + "\n"


def hook_motion(
    case: Case,
    *,
    headings: Sequence[float] | None = None,
    peak_periods: Sequence[float] | None = None,
    fractile: float = 0.9,
) -> HookSurvey:
    """Return the hook's motion over headings, peak periods and both sides of the ship.

    Parameters
    ----------
    case
        The case: its sea's shape and H_s, its vessel, its rope tension and exposure time.
    headings
        Where the waves travel to, relative to the bow [deg]; every 15 degrees if left out.  Not
        for a case with `heave_rao`.
    peak_periods
        T_p [s]; 5 to 16 s if left out.  A sea whose spectrum has no peak period to choose (a
        measured one, a sum) is taken as it is.
    fractile
        Probability of the second extreme value, beside the most probable one.

    Raises
    ------
    InputError
        If a heading or period is out of range, or the vessel has not been computed there.

    Examples
    --------
    >>> from models import load_case
    >>> survey = hook_motion(load_case("thesis-1975"), peak_periods=[6.0, 8.0, 10.0])
    >>> [round(float(z), 2) for z in survey.rms("displacement")[0, 0]]
    [0.37, 0.56, 0.65]
    """
    own = HookDemand.from_case(case, probability=fractile)
    periods, seas, steep = _seas(case, peak_periods)
    if case.vessel.raos is None:
        if headings is not None:
            raise InputError(
                f"{case.label}: vessel.heave_rao: is that of one hook in one "
                "heading; headings need vessel.raos"
            )
        rao = hook_rao(case.vessel, owner=case.label)
        waves = _Waves.of(seas, rao.omega)
        angles, sides = np.array([]), tuple[Point, ...]()
        table = waves.moments(rao.gain(waves.omega))[None, None]
    else:
        asked = check_finite("hook", "headings", HEADINGS if headings is None else headings)
        if asked.ndim != 1 or not asked.size:
            raise InputError("hook: headings must be at least one angle [deg]")
        angles, place = np.radians(asked), case.vessel.hook_point
        assert place is not None  # the section's own check
        sides = (place, across(place)) if abs(place[1]) > 1e-9 else (place,)
        waves = _Waves.of(seas, vessel_raos(case.vessel, case.label).omega)
        table = np.array([[_point(case, waves, side, angle) for angle in angles] for side in sides])
    return HookSurvey(
        case=case, headings=angles, peak_periods=periods, points=sides, moments=table,
        steep=steep, own=own,
    )  # fmt: skip


def _seas(
    case: Case, wanted: Sequence[float] | None
) -> tuple[FloatArray, list[SeaSpectrum], BoolArray]:
    """Return peak periods (t,) [s], the seas, and which of them are steeper than breaking (t,)."""
    if wanted is None and not case.sea.period_field:
        sea = case.sea.to_spectrum()
        return np.array([2.0 * math.pi / sea.peak_frequency]), [sea], np.array([False])
    periods = np.atleast_1d(check_finite("hook", "peak periods", wanted or PEAK_PERIODS))
    seas, steep = [], []
    for period in map(float, periods):
        check_range("hook", "peak period", period, low=0.0, high=60.0, unit="s", open_low=True)
        there = case.variant(case.sea.peaking_at(period))
        seas.append(there.sea.to_spectrum())
        steep.append(there.sea.steepness > there.sea.breaking_steepness)
    return periods, seas, np.array(steep)


@dataclass(frozen=True, eq=False)
class _Waves:
    """Nodes that suit every sea of a survey: energies of the waves by sea and node."""

    omega: FloatArray
    energies: FloatArray
    highest: float

    @classmethod
    def of(cls, seas: Sequence[SeaSpectrum], rows: FloatArray) -> _Waves:
        low = min(sea.band[0] for sea in seas)
        high = max(sea.band[1] for sea in seas)
        splits = {float(w) for w in rows} | {w for sea in seas for w in (*sea.splits, sea.band[0])}
        nodes = spectral_nodes(low, high, splits=sorted(w for w in splits if low < w < high))
        energies = nodes.weights * np.array([sea.density(nodes.omega) for sea in seas])
        return cls(nodes.omega, energies, high)

    def moments(self, gain: FloatArray, met: FloatArray | None = None) -> FloatArray:
        """Return moments of order 0 to 8 by sea (t, 9) of a motion with this amplitude (n,)."""
        frequency = self.omega if met is None else np.abs(met)
        kept = gain**2 * (frequency <= self.highest)
        return np.asarray((self.energies * kept) @ (frequency**ORDERS).T)


def _point(case: Case, waves: _Waves, place: Point, heading: float) -> FloatArray:
    """Return the moments (t, 9) of the hook at one place in waves of one mean heading."""
    raos = vessel_raos(case.vessel, case.label)
    angles, weights = sea_directions(heading, case.sea.to_spectrum().spreading)
    operators = heave_operators(raos, place, angles)

    def gain(amplitude: FloatArray) -> FloatArray:
        return rao_of_hook(case.vessel, raos.omega, amplitude).gain(waves.omega)

    if not case.vessel.moves:
        return waves.moments(gain(equivalent(operators, weights)[0]))
    along = speed_along(case, angles)
    met = Encounter(along=along, weights=weights, depth=raos.depth).frequency(waves.omega)
    parts = [
        share * waves.moments(gain(np.abs(column)), row)
        for share, column, row in zip(weights, operators.T, met, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0))
