"""Contour of one system: limiting H_s over peak period and heading, and what binds it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError, read_only

from .columns import SeaColumn
from .criteria import Criterion
from .limiting import HIGHEST, SeaStates, limiting_heights
from .systems import System

_FULL_CIRCLE_GAP = math.radians(90.0)  # between headings that still stand for a full circle
_ROUND = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Contour:
    """Limiting significant heights over heading and peak period.

    Attributes
    ----------
    criteria
        What must be kept (c,).
    periods
        Peak periods, ascending (p,) [s].
    headings
        Headings, ascending (h,) [rad], or None where the case knows none (h is then 1).
    heights
        By criterion, heading and period (c, h, p) [m]: 0 where the criterion is broken in a flat
        sea, infinite where it is kept up to `highest`.
    drag
        Drag coefficient at the lowest of them (h, p) [N s/m].
    highest
        Highest H_s that was looked at [m].
    """

    criteria: tuple[Criterion, ...]
    periods: FloatArray
    headings: FloatArray | None
    heights: FloatArray
    drag: FloatArray
    highest: float = HIGHEST

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name in ("periods", "headings", "heights", "drag"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, read_only(value))

    @cached_property
    def limit(self) -> FloatArray:
        """The lowest limiting H_s (h, p) [m]."""
        return read_only(self.heights.min(axis=0))

    @cached_property
    def binding(self) -> npt.NDArray[np.str_]:
        """Name of the criterion that binds (h, p); empty where none does."""
        names = np.array([c.name for c in self.criteria])
        return np.where(np.isfinite(self.limit), names[self.heights.argmin(axis=0)], "")

    def at(self, periods: npt.ArrayLike, headings: npt.ArrayLike | None = None) -> FloatArray:
        """Return the limiting H_s between the points of the contour [m], linear in both.

        Parameters
        ----------
        periods
            Peak periods (n,) [s].  Beyond the ends of the contour nothing is known: NaN.
        headings
            Headings (n,) [rad]; None takes the best of the contour at each period.

        Raises
        ------
        InputError
            If headings are given and the contour has none, or does not reach them.
        """
        wanted = np.asarray(periods, dtype=np.float64)
        finite = np.minimum(self.limit, self.highest)
        if headings is None:
            return self._over_periods(finite.max(axis=0), wanted)
        rows = np.array([self._over_periods(row, wanted) for row in finite])  # (h, n)
        return over_headings(self.headings, rows, np.asarray(headings, dtype=np.float64))

    def _over_periods(self, values: FloatArray, wanted: FloatArray) -> FloatArray:
        if self.periods.size == 1:
            near = np.isclose(wanted, self.periods[0], rtol=_ROUND)
            return np.where(near, values[0], np.nan)
        slack = _ROUND * self.periods[-1]
        found = np.interp(wanted, self.periods, values)
        inside = (wanted >= self.periods[0] - slack) & (wanted <= self.periods[-1] + slack)
        return np.where(inside, found, np.nan)


def over_headings(axis: FloatArray | None, rows: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return values (h, n) on an axis of headings at the headings wanted (n,), linear between.

    Parameters
    ----------
    axis
        Headings, ascending (h,) [rad].
    rows
        Values of each heading (h, n).
    wanted
        Headings (n,) [rad].

    Raises
    ------
    InputError
        If there is no axis, or it neither goes round nor reaches what is wanted.
    """
    if axis is None:
        raise InputError("operability: this contour has no headings")
    turn = 2.0 * math.pi
    gaps = np.diff(np.append(axis, axis[0] + turn))
    angle = np.mod(wanted - axis[0], turn) + axis[0]
    angle = np.where(np.isclose(angle, axis[0] + turn, rtol=0.0, atol=_ROUND), axis[0], angle)
    if gaps.max() <= _FULL_CIRCLE_GAP + _ROUND:
        axis, rows = np.append(axis, axis[0] + turn), np.vstack([rows, rows[:1]])
    elif np.any(angle > axis[-1] + _ROUND):
        worst = float(np.degrees(angle.max()))
        raise InputError(
            f"operability: the headings must reach {worst:.4g} deg or go round, got "
            f"{math.degrees(axis[0]):.4g} to {math.degrees(axis[-1]):.4g} deg"
        )
    if axis.size == 1:
        return np.asarray(rows[0])
    place = np.clip(np.searchsorted(axis, angle, side="right") - 1, 0, axis.size - 2)
    share = np.clip((angle - axis[place]) / (axis[place + 1] - axis[place]), 0.0, 1.0)
    column = np.arange(wanted.size)
    return np.asarray((1.0 - share) * rows[place, column] + share * rows[place + 1, column])


def contour_of(
    system: System,
    criteria: Sequence[Criterion],
    columns: Sequence[SeaColumn],
    *,
    highest: float = HIGHEST,
    step: Callable[[], None] = lambda: None,
) -> Contour:
    """Return the contour of a system over the columns of a study.

    Parameters
    ----------
    system, criteria
        What is moved, and what must be kept.
    columns
        The seas, in order of their periods.
    highest
        Highest H_s that is looked at [m].
    step
        Called after each column.
    """
    found = []
    for column in columns:
        states = SeaStates.of(system, column)
        found.append(limiting_heights(states, criteria, highest=highest))
        step()
    headings = columns[0].headings
    return Contour(
        criteria=tuple(criteria),
        periods=np.array([column.period for column in columns]),
        headings=None if headings is None else np.array(headings),
        heights=np.stack([limits.heights for limits in found], axis=2),
        drag=np.stack([limits.drag for limits in found], axis=1),
        highest=highest,
    )
