"""Limiting H_s in the seas of a series, from the contour of a study.

    contour on a coarse grid -> normalised by the hook's own motion -> fine contour
    series, rule of the vessel's heading -> T_p, headings of each record -> limit, what binds

A contour at 30 degrees and one or two seconds says too little between its points: there the hook's
motion changes by its own size.  But what a limit asks of the hook hardly changes: a motor's
speed limit is reached at one speed of the hook, whatever heading makes it.  So each limit is
multiplied by an rms in a sea of one metre, of the hook's displacement, speed or acceleration or of
one of the system's signals with the drag of a usual sea, whichever leaves the least to interpolate;
its inverse is linear between the points; and it is divided by that rms where it is wanted, every
few degrees and half a second, where a spectrum costs little.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError, Quadrature, check_range
from models.case import Case
from models.sea import SeaSeries

from .columns import SeaColumn, sea_column
from .contour import Contour, heading_shares
from .limiting import LOWEST
from .systems import System

_TURN = math.radians(5.0)  # between the headings of a fine contour, at most
_PERIOD = 0.5  # between its periods [s], at most
_GROWTH = 1.13  # from one period of a study's contour to the next
_OMEGA = np.geomspace(0.08, 8.0, 1000)  # at which the hook's motion is summed up [rad/s]
_AXIS = math.radians(30.0)  # between the headings of a study's contour
_ORDERS = (0, 2, 4)  # moments of displacement, speed and acceleration
_SILENT = 1e-30  # variance of a signal that does not move


@dataclass(frozen=True, kw_only=True)
class VesselHeading:
    """How the vessel lies in the sea.

    With a `bow` she lies on that compass heading, or on the best within so much of it; with
    `within` alone on the best within so much of head seas; with neither she keeps the heading to
    the waves that the case has.

    Raises InputError if a value is out of range.
    """

    bow: float | None = None  #: Compass heading of the bow, clockwise from north [rad].
    within: float = 0.0  #: How far to either side she may turn, 0 to pi [rad].

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.bow is not None:
            check_range("operability", "bow", self.bow, low=-math.tau, high=math.tau, unit="rad")
        check_range("operability", "within", self.within, low=0.0, high=math.pi, unit="rad")

    def __str__(self) -> str:
        """Return it in words."""
        turn = f"best within {math.degrees(self.within):.4g} deg of "
        if self.bow is not None:
            bow = f"{math.degrees(self.bow) % 360.0:.4g} deg by the compass"
            return f"{turn}{bow}" if self.within else f"bow at {bow}"
        if self.within:
            return f"{turn}head seas"
        return "the case's own heading to the waves, in every sea"

    @property
    def turns(self) -> FloatArray:
        """Angles that she may turn by, itself among them (m,) [rad]."""
        count = math.ceil(self.within / _TURN - 1e-9)
        return np.linspace(-self.within, self.within, 2 * count + 1)

    def relative(self, seas: SeaSeries, case: Case) -> FloatArray:
        """Return where waves may travel to, counter-clockwise from the bow (m, n) [rad].

        Raises InputError if directions are wanted and the series has none.
        """
        if self.bow is not None:
            return np.asarray(seas.relative(self.bow) + self.turns[:, None])
        own = math.pi if self.within else getattr(case.vessel, "heading", None) or 0.0
        return np.asarray(np.tile(own + self.turns[:, None], len(seas)))


def study_axes(
    case: Case, seas: SeaSeries, heading: VesselHeading
) -> tuple[list[float], list[float] | None]:
    """Return the periods [s] and headings [rad] of a contour that reaches every sea of a series.

    Headings are None where they go all round the vessel.
    """
    low, high = float(seas.peak_period.min()), float(seas.peak_period.max())
    low, high = max(0.999 * low, 1.0), min(1.001 * high, 60.0)
    count = max(2, math.ceil(math.log(high / low) / math.log(_GROWTH)) + 1)
    periods = np.geomspace(low, high, count).tolist()
    wanted = np.mod(heading.relative(known_directions(seas, heading), case), math.tau)
    sectors = np.unique(np.floor(wanted / _AXIS + 1e-9).astype(int))
    every = round(math.tau / _AXIS)
    # A sector that runs over 0 deg is no ascending axis; few save little.
    if sectors.size > 0.7 * every or (sectors[0] == 0 and sectors[-1] == every - 1):
        return periods, None
    ends = np.arange(sectors[0], sectors[-1] + 2) * _AXIS
    return periods, [float(angle) for angle in ends[ends < math.tau - 1e-9]]


def known_directions(seas: SeaSeries, heading: VesselHeading) -> SeaSeries:
    """Return the records whose direction is known, all where none is needed.

    Raises InputError if directions are needed and the series has none.
    """
    if heading.bow is None:
        return seas
    if seas.direction is None or not np.any(np.isfinite(seas.direction)):
        raise InputError(f"{seas.source}: has no directions for a vessel's compass heading")
    keep = np.isfinite(seas.direction)
    return seas if bool(np.all(keep)) else seas.of(keep, "no direction")


def gains_of(system: System | None, contour: Contour) -> FloatArray:
    """Return squared moduli of responses to the hook's displacement at `_OMEGA` (k, n).

    Those of the hook's own displacement, speed and acceleration, then of the signals of a system,
    if it is known, with the drag that is usual on a contour.
    """
    rows = [_OMEGA**order for order in _ORDERS]
    if system is not None:
        drag = contour.drag[np.isfinite(contour.drag)]
        known = [float(np.median(drag)) if drag.size else system.reference]
        known += [] if system.loss is None else [system.loss.begin]
        nodes = Quadrature(omega=_OMEGA, weights=np.ones_like(_OMEGA))
        rows += list(system.responses(nodes).gains(known)[:, 0])
    return np.array(rows)


def fine_contours(
    contours: Mapping[str, Contour],
    columns: Sequence[SeaColumn],
    gains: Mapping[str, FloatArray],
) -> dict[str, Contour]:
    """Return contours every few degrees and half a second, as the module says.

    `columns` are the seas of all of them, `gains` by name as `gains_of` has them.
    """
    first = next(iter(contours.values()))
    periods = _refined(first.periods, _PERIOD)
    angles = None if first.headings is None else _turned(first.headings)
    wanted = None if angles is None else angles.tolist()
    case = columns[0].cases[0]
    fine = np.array([_densities(sea_column(case, float(t), wanted)) for t in periods])  # (p, h, n)
    coarse = np.array([_densities(column) for column in columns])
    along = np.array([np.interp(periods, first.periods, r) for r in np.eye(first.periods.size)])
    around = np.ones((1, 1)) if angles is None else heading_shares(first.headings, angles)

    def rms(densities: FloatArray, name: str) -> FloatArray:
        return np.asarray(np.sqrt(np.maximum(densities @ gains[name].T, _SILENT)))

    return {
        name: Contour(
            criteria=contour.criteria,
            periods=periods,
            headings=angles,
            heights=_between(contour, rms(coarse, name), rms(fine, name), along, around),
            drag=np.full((around.shape[1], periods.size), np.nan),
            highest=contour.highest,
        )
        for name, contour in contours.items()
    }


def _between(
    contour: Contour, coarse: FloatArray, fine: FloatArray, along: FloatArray, around: FloatArray
) -> FloatArray:
    """Return a contour's heights on the fine axes, by rms values there and here (p, h, k)."""
    rows = []
    for limit in contour.heights:
        order = _smoothest(limit, coarse)
        # No limit is no demand, 1/inf; what is broken in a flat sea is broken in any.
        asked = 1.0 / (np.maximum(limit, 1e-3 * LOWEST) * coarse[..., order].T)
        inverse = (around.T @ asked @ along) * fine[..., order].T
        found = 1.0 / np.where(inverse > 0.0, inverse, np.nan)
        found = np.where(np.isnan(found) | (found > contour.highest), np.inf, found)
        rows.append(np.where(found < LOWEST, 0.0, found))
    return np.array(rows)


def limits_at(
    contour: Contour, seas: SeaSeries, relative: FloatArray
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.str_]]:
    """Return the limiting H_s in each sea (n,) [m], its heading [rad] and what binds there.

    Of the headings that the vessel may take to the waves (m, n) [rad] it is the best; NaN where the
    sea's period lies outside the contour.

    Raises InputError if the contour's headings do not reach those of the seas.
    """
    rows = np.arange(len(seas))
    if contour.headings is None:
        limit = contour.at(seas.peak_period, None)
        return limit, np.full(rows.size, np.nan), contour.binding_at(seas.peak_period, None)
    each = np.array([contour.at(seas.peak_period, angle) for angle in relative])
    best = np.where(np.isnan(each), -1.0, each).argmax(axis=0)
    turned = relative[best, rows]
    return each[best, rows], turned, contour.binding_at(seas.peak_period, turned)


def _densities(column: SeaColumn) -> FloatArray:
    """Return the hook's spectra per metre of H_s, with the weights of an integral (h, n)."""
    steps = np.gradient(_OMEGA)
    return np.array(
        [hook.density(_OMEGA) * steps / hook.sea.significant_height**2 for hook in column.hooks]
    )


def _smoothest(limit: FloatArray, rms: FloatArray) -> int:
    """Return which of some rms values (p, h, k) a limit (h, p) goes with best."""
    rough, known = [], []
    for k in range(rms.shape[-1]):
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.log(limit * rms[..., k].T)
            steps = np.concatenate([np.diff(size, axis=a).ravel() for a in (0, 1)])
        known.append(int(np.isfinite(steps).sum()) if rms[..., k].min() > 1e-12 else -1)
        rough.append(float(np.abs(steps[np.isfinite(steps)]).sum()))
    # A signal that stands still in some sea tells nothing.
    return int(np.argmin(np.where(np.array(known) == max(known), rough, np.inf)))


def _refined(axis: FloatArray, most: float) -> FloatArray:
    """Return an axis with points between its own, at most so far apart."""
    parts = [
        np.linspace(a, b, math.ceil((b - a) / most - 1e-9) + 1)[:-1] for a, b in pairwise(axis)
    ]
    return np.concatenate([*parts, axis[-1:]])


def _turned(headings: FloatArray | None) -> FloatArray:
    """Return the headings of a fine contour, round the vessel where the coarse ones go round."""
    assert headings is not None
    gap = headings[0] + math.tau - headings[-1]
    if headings.size > 1 and gap <= math.radians(90.0) + 1e-9:
        return _refined(np.append(headings, headings[0] + math.tau), _TURN)[:-1] % math.tau
    return _refined(headings, _TURN)
