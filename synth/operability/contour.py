"""Contour of one system: limiting H_s over peak period and heading, and what binds it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError, read_only

from ..limits import Limit
from .columns import SeaColumn
from .limiting import HIGHEST, SeaStates, limiting_heights
from .systems import System

_FULL_CIRCLE_GAP = math.radians(90.0)  # between headings that still stand for a full circle
_ROUND = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Contour:
    """Limiting significant heights over heading and peak period."""

    criteria: tuple[Limit, ...]  #: What must be kept (c,).
    periods: FloatArray  #: Peak periods, ascending (p,) [s].
    #: Headings, ascending (h,) [rad], or None where the case knows none (h is then 1).
    headings: FloatArray | None
    #: By criterion, heading and period (c, h, p) [m]: 0 where the criterion is broken in a flat
    #: sea, infinite where it is kept up to `highest`.
    heights: FloatArray
    drag: FloatArray  #: Drag coefficient at the lowest of them (h, p) [N s/m].
    highest: float = HIGHEST  #: Highest H_s that was looked at [m].

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

        Beyond the ends of the periods (n,) [s] nothing is known: NaN.  Without headings (n,) [rad]
        it is the best of the contour at each period.

        Raises InputError if headings are given and the contour has none, or does not reach them.
        """
        finite, along = np.minimum(self.limit, self.highest), self._period_shares(periods)
        if headings is None:
            return np.asarray(finite.max(axis=0) @ along)
        turned = heading_shares(self.headings, headings)
        return np.asarray(np.einsum("hp,pn,hn->n", finite, along, turned))

    def binding_at(
        self, periods: npt.ArrayLike, headings: npt.ArrayLike | None
    ) -> npt.NDArray[np.str_]:
        """Return the name of the criterion with the lowest limit, as `at` has it (n,)."""
        finite, along = np.minimum(self.heights, self.highest), self._period_shares(periods)
        turned = np.ones((1, along.shape[1]))
        if self.headings is not None and headings is not None:
            turned = heading_shares(self.headings, headings)
        each = np.einsum("chp,pn,hn->cn", finite, along, turned)
        names = np.array([c.name for c in self.criteria])
        return np.asarray(names[each.argmin(axis=0)])

    def _period_shares(self, periods: npt.ArrayLike) -> FloatArray:
        """Return what each peak period of the contour counts (p, n); NaN beyond its ends."""
        wanted, ends = np.asarray(periods, dtype=np.float64), self.periods[[0, -1]]
        near = np.clip(wanted, *ends)
        wanted = np.where(np.isclose(wanted, near, rtol=_ROUND, atol=0.0), near, wanted)
        rows = np.eye(self.periods.size)
        return np.array(
            [np.interp(wanted, self.periods, r, left=np.nan, right=np.nan) for r in rows]
        )


def heading_shares(axis: FloatArray | None, headings: npt.ArrayLike) -> FloatArray:
    """Return what each heading of an axis, ascending (h,) [rad], counts at others, (h, n).

    Between them it is linear.

    Raises InputError if there is no axis, or it neither goes round nor reaches what is wanted.
    """
    if axis is None:
        raise InputError("operability: this contour has no headings")
    turn = 2.0 * math.pi
    angle = np.mod(np.asarray(headings) - axis[0] + _ROUND, turn) + axis[0] - _ROUND
    whole = np.diff(np.append(axis, axis[0] + turn)).max() <= _FULL_CIRCLE_GAP + _ROUND
    if not whole and np.any(angle > axis[-1] + _ROUND):
        worst = float(np.degrees(angle.max()))
        raise InputError(
            f"operability: the headings must reach {worst:.4g} deg or go round, got "
            f"{math.degrees(axis[0]):.4g} to {math.degrees(axis[-1]):.4g} deg"
        )
    period = turn if whole else None
    return np.array([np.interp(angle, axis, row, period=period) for row in np.eye(axis.size)])


def contour_of(
    system: System,
    criteria: Sequence[Limit],
    columns: Sequence[SeaColumn],
    *,
    highest: float = HIGHEST,
    step: Callable[[], None] = lambda: None,
) -> Contour:
    """Return the contour of a system over the columns of a study, in order of their periods.

    H_s is looked at up to `highest` [m]; `step` is called after each column.
    """
    found = []
    for column in columns:
        states = SeaStates(system=system, column=column)
        found.append(limiting_heights(states, criteria, highest=highest))
        step()
    return assembled(criteria, columns, found, highest)


def assembled(
    criteria: Sequence[Limit],
    columns: Sequence[SeaColumn],
    found: Sequence[tuple[FloatArray, FloatArray]],
    highest: float,
) -> Contour:
    """Return the contour of what `limiting_heights` found in each column."""
    headings = columns[0].headings
    return Contour(
        criteria=tuple(criteria),
        periods=np.array([column.period for column in columns]),
        headings=None if headings is None else np.array(headings),
        heights=np.stack([heights for heights, _ in found], axis=2),
        drag=np.stack([drag for _, drag in found], axis=1),
        highest=highest,
    )
