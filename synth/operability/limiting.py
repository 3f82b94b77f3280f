"""Limiting H_s: the lowest at which a criterion breaks, in all headings of a column at once.

For each H_s of a coarse grid the drag coefficient that agrees with the motion is found, then the
variances, then by how much each criterion is broken.  Between two heights at which it is kept it
may break and hold again: a cubic through four neighbours tells where that could be, and how well it
foretells a height left out tells how far to trust it; there the grid is made finer.  The first
step up of a criterion from kept to broken is a bracket; in it the limiting H_s is found by
Chandrupatla's method (1997), which never leaves its bracket.  No answer is interpolated: every step
solves for the drag anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.optimize import elementwise

from models.basics import BoolArray, FloatArray, IndexArray, SolverError
from models.sensing import SET_POINT, SwitchingShape, error_density

from ..limits import Limit
from .columns import SeaColumn
from .responses import DragResponses, SeaMoments, quadratic
from .systems import System

LOWEST, HIGHEST = 0.01, 30.0  # H_s that are looked at [m]
_INSIDE = 1e-12  # how far inside the edge of stability, in the logarithm
_SCAN = 55  # coefficients that are tried where drag can be too much, six a decade
_STEPS = 25  # of the coarse grid
_ROUNDS = 10  # of making it finer, each by halves
_BETWEEN = np.linspace(0.0, 1.0, 11)  # where a cubic is looked at between two heights
_SPEEDS = (1e-9, 1e3)  # rms speeds of the payload between which the drag's is looked for [m/s]
_LOSS_ROUNDS, _LOSS_AGREES = 60, 1e-10  # of the coefficients of losses beside the drag's
_FAINT = 1e-6  # of the friction at the edge, below which none is looked for
_DRAG_RTOL = 1e-13  # of the logarithm's step, so of the drag
_HEIGHT_TOL = 1e-10  # of the logarithm of H_s
_BROKEN = 10.0  # excess of what is broken beyond measure


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaStates:
    """A system in the seas of a column, at any H_s: drag, variances, all at once."""

    system: System
    column: SeaColumn

    @cached_property
    def responses(self) -> DragResponses:
        """The system's responses on nodes that suit both."""
        return self.system.responses(self.column.nodes(self.system))

    @cached_property
    def _unit(self) -> FloatArray:
        """The hook's densities at H_s = 1 m, (h, n)."""
        omega = self.responses.nodes.omega
        return np.array([hook.scaled(1.0).density(omega) for hook in self.column.hooks])

    def heave(self, heights: FloatArray, index: IndexArray) -> FloatArray:
        """Return the hook's density (r, n) at heights (r,) [m] in headings `index` (r,)."""
        if self.column.scalable:
            return np.asarray(heights[:, None] ** 2 * self._unit[index])
        rows = np.empty((heights.size, self.responses.nodes.omega.size))
        for k, (height, i) in enumerate(zip(heights, index, strict=True)):
            defined = max(float(height), self.column.floor)
            density = self.column.hook(int(i), defined).density(self.responses.nodes.omega)
            rows[k] = (height / defined) ** 2 * density
        return rows

    def densities(self, heights: FloatArray, index: IndexArray) -> list[FloatArray]:
        """Return the disturbances' densities at heights (r,) [m] in headings `index` (r,)."""
        omega = self.responses.nodes.omega
        heave = self.heave(heights, index)
        found = [heave]
        for noise in self.system.noises:
            if noise.name == "mru.error":
                rms = np.sqrt(heave @ self.responses.nodes.weights)
                found.append(error_density(self.system.mru, omega, heave, rms[:, None]))
            elif noise.name == SET_POINT:
                found.append(self._switching(heave, heights, index))
            else:
                found.append(noise.density(omega)[None])
        return found

    @cached_property
    def _shapes(self) -> list[SwitchingShape]:
        return [SwitchingShape(hook) for hook in self.column.hooks]

    def _switching(self, heave: FloatArray, heights: FloatArray, index: IndexArray) -> FloatArray:
        """Return the density of the noise of losses that switch (r, n), see `densities`."""
        nodes, noise = self.responses.nodes, self.system.switching
        assert noise is not None
        speeds = noise.per_heave * np.sqrt(heave @ (nodes.weights * nodes.omega**2))
        shape = np.empty_like(heave)
        if self.column.scalable:
            for k in np.unique(index):
                shape[index == k] = self._shapes[k].rows(nodes.omega, speeds[index == k])
        else:
            for row, (height, i) in enumerate(zip(heights, index, strict=True)):
                hook = self.column.hook(int(i), max(float(height), self.column.floor))
                shape[row] = SwitchingShape(hook).at(nodes.omega, float(speeds[row]))
        return noise.as_command(nodes.omega, np.where(speeds[:, None] > 0.0, shape, 0.0))

    def coefficients(self, densities: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the coefficients of drag [N s/m] and losses that agree with the motion, (r,) each.

        NaN where there are none: no stationary motion, or one that does not vanish with the sea.
        """
        system, rows = self.system, densities[0].shape[0]
        speeds = self.responses.speeds(densities)
        if system.loss is None:
            return [self._drag(speeds[0][0], self.responses.denominators(np.zeros(rows)))]
        # By substitution; where that leaves the bracket, as it would go back and forth between
        # a drum that is stuck and one that swings, by its middle.
        edge = system.friction_edge
        slack = np.full(rows, min(system.loss.begin, 0.5 * edge))
        low, high = np.full(rows, _FAINT * edge), np.full(rows, edge)
        for _ in range(_LOSS_ROUNDS):
            below = self.responses.denominators(slack)
            C = self._drag(quadratic(speeds[0], slack), below)
            D = np.where(np.isfinite(C), C, system.reference) - system.reference
            turned = quadratic(speeds[1], D) / quadratic(below, D)
            found = system.loss.coefficient(turned.sum(axis=1))
            low, high = np.where(found > slack, slack, low), np.where(found < slack, slack, high)
            if np.all(np.abs(found - slack) <= _LOSS_AGREES * slack):
                break
            inside = (low < found) & (found < high)
            ahead = np.where(inside, found, np.sqrt(low * high))
            if np.all(np.abs(ahead - slack) <= _LOSS_AGREES * slack):
                break
            slack = ahead
        return [C, slack]

    def _drag(self, weighted: FloatArray, below: FloatArray) -> FloatArray:
        """Return the drag that agrees with the motion for known losses, (r,) [N s/m].

        By the numerator of the spectrum of the payload's velocity (r, n) and its denominator, a
        quadratic in the drag (3, r, n), see `DragResponses.speeds`.
        """
        system = self.system
        rows = len(weighted)
        low, high = system.stable_range
        if low > high or system.swings:
            return np.full(rows, np.nan)
        if system.slope == 0.0:
            return np.full(rows, system.reference)
        below = np.broadcast_to(below, (3, *weighted.shape))

        # C = slope sigma_v(C) is one equation in one unknown: its sides are compared in a bounded
        # ratio over log C, which a bracketing method likes whatever the sea.
        def surplus(size: FloatArray, row: FloatArray) -> FloatArray:
            C, at = np.exp(size), row.astype(np.intp)
            spectra = weighted[at] / quadratic(below[:, at], C - system.reference)
            wanted = system.slope * np.sqrt(np.maximum(spectra.sum(axis=1), 0.0))
            # An unstable loop moves without end, however large its spectral integral.
            found = (wanted - C) / (wanted + C)
            return np.where((low < C) & (high > C), found, 1.0)

        first, last = np.log(system.slope * np.array(_SPEEDS))
        begin, end = np.full(rows, first), np.full(rows, last)
        if high < np.inf:
            # Too much drag destabilises it: the least coefficient that is enough is looked for.
            edge = min(last, float(np.log(high)) - _INSIDE)
            end, steps = np.full(rows, np.nan), np.linspace(first, edge, _SCAN)
            for before, after in pairwise(steps):
                enough = surplus(np.full(rows, after), np.arange(float(rows))) <= 0.0
                new = enough & np.isnan(end)
                begin[new], end[new] = before, after
            end = np.where(np.isnan(end), last, end)
        solved = elementwise.find_root(
            surplus,
            (begin, end),
            args=(np.arange(float(rows)),),
            tolerances={"xatol": _DRAG_RTOL, "xrtol": 0.0, "fatol": 0.0, "frtol": 0.0},
        )
        C = np.exp(np.asarray(solved.x, dtype=np.float64))
        # What is no root is a jump: from too much drag to a loop that is unstable with less.
        good = np.asarray(solved.success) & (np.abs(np.asarray(solved.f_x)) < 1e-6)
        still = np.all(weighted == 0.0, axis=1)  # no motion, no drag
        return np.where(still, max(low, 0.0), np.where(good, C, np.nan))

    def moments_at(self, heights: FloatArray, index: IndexArray) -> tuple[SeaMoments, FloatArray]:
        """Return moments and drag coefficients at heights (r,) [m] in headings `index` (r,)."""
        densities = self.densities(heights, index)
        C, *slack = self.coefficients(densities)
        known = np.where(np.isfinite(C), C, self.system.reference)
        return self.responses.moments(densities, [known, *slack]), C


def _excess(limit: Limit, moments: SeaMoments, stationary: BoolArray) -> FloatArray:
    """Return by how much a limit is broken, relative; at most 0 where it is kept (r,).

    `stationary` says where there is a stationary motion at all (r,).
    """
    each = moments.members if limit.drive else [moments]
    # All that the limit asks of a programme's symbols is there.
    raw = np.max([limit.rows(one, limit.bound) for one in each], axis=0)  # type: ignore[arg-type]
    # Finite, as a root finder takes differences of it.
    return np.where(stationary & np.isfinite(raw), np.minimum(raw, _BROKEN), _BROKEN)


def limiting_heights(
    states: SeaStates, criteria: Sequence[Limit], *, highest: float = HIGHEST
) -> tuple[FloatArray, FloatArray]:
    """Return the lowest H_s, up to `highest` [m], at which each criterion breaks, in each heading.

    Heights are by criterion and heading (c, h) [m], 0 where the criterion is broken in a flat sea,
    infinite where it is kept up to the highest; behind them is the drag coefficient at the lowest
    of them (h,) [N s/m], NaN where that is 0 or infinite.

    Raises SolverError if a root is not found in its bracket.
    """
    headings, count = len(states.column.hooks), len(criteria)
    heights = np.full((count, headings), np.inf)
    brackets: list[tuple[int, int, float, float]] = []
    for h, (sizes, excess) in enumerate(_scanned(states, criteria, highest)):
        for c in np.flatnonzero((excess > 0.0).any(axis=1)):
            first = int((excess[c] > 0.0).argmax())
            if first == 0:
                heights[c, h] = 0.0
            else:
                brackets.append((int(c), h, sizes[first - 1], sizes[first]))
    if brackets:
        which, heading = np.array([pair[:2] for pair in brackets], dtype=np.intp).T
        low, high = np.array([pair[2:] for pair in brackets]).T
        heights[which, heading] = _refined(states, criteria, which, heading, low, high)
    lowest = heights.min(axis=0)
    drag = np.full(headings, np.nan)
    some = np.flatnonzero((lowest > 0.0) & np.isfinite(lowest))
    if some.size:
        drag[some] = states.moments_at(lowest[some], some)[1]
    return heights, drag


def _scanned(
    states: SeaStates, criteria: Sequence[Limit], highest: float
) -> list[tuple[FloatArray, FloatArray]]:
    """Return logarithms of H_s (n,) and the excess of each criterion at them (c, n), by heading."""
    sizes = [np.log(np.geomspace(LOWEST, highest, _STEPS))] * len(states.column.hooks)
    found = _excesses(states, criteria, sizes)
    for _ in range(_ROUNDS):
        between = [_unsettled(*pair) for pair in zip(sizes, found, strict=True)]
        if not any(new.size for new in between):
            break
        # All headings and heights are rows of one array: drag, moments and verdicts in a few calls.
        more = _excesses(states, criteria, between)
        for h, new in enumerate(between):
            place = np.searchsorted(sizes[h], new)
            sizes[h] = np.insert(sizes[h], place, new)
            found[h] = np.insert(found[h], place, more[h], axis=1)
    return list(zip(sizes, found, strict=True))


def _excesses(
    states: SeaStates, criteria: Sequence[Limit], sizes: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the excess of each criterion at logarithms of H_s in each heading, (c, n) each."""
    counts = [size.size for size in sizes]
    index = np.repeat(np.arange(len(sizes)), counts)
    moments, C = states.moments_at(np.exp(np.concatenate(sizes)), index)
    excess = np.array([_excess(limit, moments, np.isfinite(C)) for limit in criteria])
    return np.split(excess, np.cumsum(counts)[:-1], axis=1)


def _unsettled(sizes: FloatArray, excess: FloatArray) -> FloatArray:
    """Return the middles of intervals in which a criterion may break unseen, (m,), by log H_s (n,).

    The excess of each criterion there is (c, n).
    """
    n = sizes.size
    excess = np.minimum(excess, 1.0)
    broken = excess > 0.0
    first = np.where(broken.any(axis=1), broken.argmax(axis=1), n)  # of each criterion, (c,)
    # How well the four neighbours of a height foretell it, over twice the step: sixteen times the
    # error of a cubic between two heights.
    error = np.zeros_like(excess)
    for j in range(2, n - 2):
        near = [j - 2, j - 1, j + 1, j + 2]
        told = excess[:, near] @ _cubic(sizes[near], sizes[[j]])
        error[:, j] = np.abs(told[:, 0] - excess[:, j])
    error[:, :2], error[:, n - 2 :] = error[:, 2:3], error[:, n - 3 : n - 2]
    wanted = []
    for i in range(min(int(first.max()), n - 1)):
        begin = min(max(i - 1, 0), n - 4)
        at = sizes[i] + (sizes[i + 1] - sizes[i]) * _BETWEEN
        curve = excess[:, begin : begin + 4] @ _cubic(sizes[begin : begin + 4], at)
        doubt = np.maximum(error[:, i], error[:, i + 1])
        may_break = (i + 1 < first) & (curve.max(axis=1) + doubt > 0.0)
        turns = (i + 1 == first) & (np.count_nonzero(np.diff(curve > 0.0), axis=1) > 1)
        if np.any(may_break | turns):
            wanted.append(0.5 * (sizes[i] + sizes[i + 1]))
    return np.array(wanted)


def _cubic(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """Return what each of four nodes counts in the cubic through them, (4, m)."""
    ratios = (at - nodes[:, None, None]) / (nodes[None, :] - nodes[:, None] + np.eye(4))[..., None]
    # ratios[j, k] = (at - x_j) / (x_k - x_j); its product over j other than k is k's share.
    ratios[np.arange(4), np.arange(4)] = 1.0
    return np.asarray(ratios.prod(axis=0))


def _refined(
    states: SeaStates,
    criteria: Sequence[Limit],
    which: IndexArray,
    heading: IndexArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    def excess(size: FloatArray, w: FloatArray, h: FloatArray) -> FloatArray:
        # Every row is looked at for all criteria, which costs no more than for one.
        moments, C = states.moments_at(np.exp(size), h.astype(np.intp))
        stationary = np.isfinite(C)
        found = np.zeros(size.size)
        for k in np.unique(w.astype(np.intp)):
            mine = w == k
            found[mine] = _excess(criteria[k], moments, stationary)[mine]
        return found

    solved = elementwise.find_root(
        excess,
        (low, high),
        args=(which.astype(np.float64), heading.astype(np.float64)),
        tolerances={"xatol": _HEIGHT_TOL, "xrtol": 0.0, "fatol": 0.0, "frtol": 0.0},
    )
    if not np.all(solved.success):
        bad = criteria[int(which[int(np.argmin(solved.success))])].name
        raise SolverError(
            f"operability: the limiting H_s of {bad} was not found within its bracket"
        )
    # The side on which the criterion is kept.
    ends = np.asarray(solved.bracket), np.asarray(solved.f_bracket)
    kept = np.where(ends[1][0] <= 0.0, ends[0][0], ends[0][1])
    return np.asarray(np.exp(kept), dtype=np.float64)
