"""The payload feedback on rows of a spread: the vectorised engine behind a sweep.

    rows (n, d) -> numbers, gains, densities -> spring or chain of loops -> drag -> stability
                -> variances, M_s -> metrics, (n,) each; NaN where a loop is unstable

One spring without delay goes through polynomials (`synth.sweeps.kernel`), everything else through
the rope's recursion (`synth.sweeps.chain`).  Rows whose variances two rules disagree on begin
again on finer nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import BoolArray, ComplexArray, FloatArray, IndexArray, Quadrature
from models.plant import lump_rope
from models.spread import GAINS, Spread

from ..design import GainDesign
from .chain import ChainLoops, abs2
from .kernel import SpringLoops, spring_peaks
from .metrics import FrequencyMetric, finished
from .numbers import PlantNumbers, numbers_of
from .sea_rows import SeaRows
from .sweep_nodes import SweepNodes, sweep_nodes
from .winding_count import calming_drag, count_unstable, light_poles, peak_sensitivity

Loops = SpringLoops | ChainLoops
Velocity = Callable[[IndexArray, FloatArray], FloatArray]

_REFERENCE = 3.0  # frequency by which polynomials are scaled [rad/s]
_LEVELS = 6  # of nodes, each with panels half as long
_VELOCITY = "payload.velocity"
_AT_ONCE = 2000  # rows of one pass where each has a density of its own, or finer nodes
_EDGE = 1.0 + 1e-6  # drag over the least that is stable, up to which a loop counts as unstable
_LAST = 1e-3  # difference of two rules that is told where no finer nodes are left
_DRAG_ROUNDS = 60
_AGREES = 3e-13  # of the logarithm of C
_CLOSE = 1e-10  # ... and what will do
_STEP = 1.5  # of it, at most
_CHAINS = 64  # chains whose responses are kept while their drag is found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Batch:
    """Rows with all that their loops are made of."""

    rows: FloatArray
    numbers: PlantNumbers
    gains: FloatArray

    def __len__(self) -> int:
        return len(self.rows)

    def part(self, index: IndexArray) -> _Batch:
        gains = self.gains[index] if len(self.gains) > 1 else self.gains
        return _Batch(rows=self.rows[index], numbers=self.numbers.part(index), gains=gains)


class GainRows:
    """A design of the payload feedback, asked about rows of a spread.

    Parameters
    ----------
    design
        The design.
    spread
        The spread on its case (`Spread.on`).
    metrics
        What is wanted.
    accuracy
        Relative difference of two rules from which a variance gets finer nodes.
    nodes
        Nodes to use for all, with no look at their error; chosen here if left out.
    """

    def __init__(
        self,
        design: GainDesign,
        spread: Spread,
        metrics: Sequence[FrequencyMetric],
        *,
        accuracy: float,
        nodes: Quadrature | None = None,
    ) -> None:
        case = design.sea_case
        self.design, self.spread, self.case = design, spread, case
        self.metrics = tuple(metrics)
        self.accuracy = accuracy
        self.given = None if nodes is None else SweepNodes.of(nodes)
        self.lumps = lump_rope(design.masses, case.rope.lumping)
        self.sea = SeaRows(case, spread)
        delayed = case.sensors.telemetry.delay > 0.0 or "sensors.telemetry.delay" in spread.paths
        self.spring = design.masses == 1 and not delayed
        self._nodes: dict[int, SweepNodes] = {}  # by level
        self.columns = True  # whether column arithmetic has sufficed so far
        self.refined = 0  # rows that needed finer nodes
        self.unresolved = 0  # ... and those that none of them resolved
        self._outputs = tuple(dict.fromkeys(m.output for m in metrics if m.output))
        self._second = tuple(
            dict.fromkeys(m.output for m in metrics if m.kind in ("peak", "least", "period"))
        )

    @property
    def block(self) -> int:
        """Rows that are best looked at together: their columns stay in the cache."""
        return 8192 if self.spring else 2048

    def evaluate(self, rows: FloatArray) -> dict[str, FloatArray | BoolArray]:
        """Return ``stable`` and the metrics of rows, (n,) each.

        Raises
        ------
        InputError
            If a row is no valid case.
        """
        numbers, quick = numbers_of(
            self.case, self.spread, rows, checked=None if self._nodes else 6
        )
        self.columns &= quick
        batch = _Batch(rows=rows, numbers=numbers, gains=self._gains(rows))
        drag = np.full(len(rows), np.nan)
        stable = np.zeros(len(rows), dtype=bool)
        moments = {
            key: np.full(len(rows), np.nan)
            for key in [*((o, 0) for o in self._outputs), *((o, 2) for o in self._second)]
        }
        # All rows on common nodes first; those whose two rules disagree begin again on panels half
        # as long, and so on: narrow resonances are few, and pay for themselves.
        at: IndexArray = np.arange(len(rows))
        for level in range(_LEVELS):
            doubtful = []
            step = _AT_ONCE if level or self.sea.varies else max(len(rows), 1)
            for k in range(0, at.size, step):
                some = at[k : k + step]
                own = batch.part(some) if some.size < len(rows) else batch
                drag[some], stable[some], found, doubt = self._solved(own, level)
                for key, column in found.items():
                    moments[key][some] = column
                doubtful.append(some[doubt])
            at = np.concatenate(doubtful) if doubtful else at[:0]
            if not at.size:
                break
            self.refined += at.size if level == 0 else 0
        for k in at:  # at the very edge of stability: nodes that know the loop's own poles
            own = batch.part(np.array([k]))
            drag[[k]], stable[[k]], found, doubt = self._solved(
                own, _LEVELS, self._closely(own, drag[[k]])
            )
            for key, column in found.items():
                moments[key][[k]] = column
            self.unresolved += doubt.size
        chosen = np.flatnonzero(stable)
        peaks = np.full(len(rows), np.nan)
        if any(m.name == "max_sensitivity" for m in self.metrics) and chosen.size:
            peaks[chosen] = self._peaks(batch, drag, chosen)
        values = finished(
            self.metrics,
            moments=moments,
            drag=drag,
            max_sensitivity=peaks,
            tension=numbers.static_tension,
            arm=numbers["drum_radius"] / (numbers["gear_ratio"] * numbers["gear_efficiency"]),
            exposure=self.case.limits.exposure_time,
            count=len(rows),
        )
        kept = {name: np.where(stable, column, np.nan) for name, column in values.items()}
        return {"stable": stable, **kept}

    def loop_gain(self, rows: FloatArray, omega: FloatArray) -> ComplexArray:
        """Return L(i omega) of rows, (n, k), at frequencies above zero [rad/s]."""
        numbers, _ = numbers_of(self.case, self.spread, rows)
        batch = _Batch(rows=rows, numbers=numbers, gains=self._gains(rows))
        drag = self._drag(batch, self.level_nodes())
        sound = np.where(np.isfinite(drag), drag, 0.0)
        loops = ChainLoops(numbers, batch.gains, sound, lumps=self.lumps)
        closed, free = loops.responses(
            np.arange(len(rows)), np.asarray(1j * omega, dtype=np.complex128)
        )
        return np.asarray(closed / free - 1.0)

    def level_nodes(self, level: int = 0) -> SweepNodes:
        """Return the common nodes of a level."""
        if self.given is not None:
            return self.given
        if level not in self._nodes:
            low, high, splits = self._frame
            self._nodes[level] = sweep_nodes(low, high, splits, level=level, marks=self._marks)
        return self._nodes[level]

    @cached_property
    def _frame(self) -> tuple[float, float, list[float]]:
        return self.sea.frame()

    @cached_property
    def _marks(self) -> tuple[complex, ...]:
        """Poles of the design itself, the upper half: most rows have something like them."""
        if self.design.margins is None:
            return ()
        poles = self.design.assessment.poles
        return tuple(complex(p) for p in poles if p.imag > 0.0 and p.real < -1e-3 * abs(p))

    def _gains(self, rows: FloatArray) -> FloatArray:
        own = {name: np.array([value]) for name, value in self.design.gains.items()}
        for j, path in enumerate(self.spread.paths):
            if path.startswith(GAINS):
                own[path.removeprefix(GAINS)] = rows[:, j]
        products = [own["A"] * own[name] for name in ("a", "a1", "a2")]
        return np.stack(np.broadcast_arrays(*products), axis=1)

    def _loops(self, batch: _Batch, drag: FloatArray) -> Loops:
        if self.spring:
            return SpringLoops(
                batch.numbers,
                batch.gains,
                drag,
                mass_share=float(self.lumps.masses[0]),
                reference=_REFERENCE,
            )
        return ChainLoops(batch.numbers, batch.gains, drag, lumps=self.lumps)

    def _solved(
        self, batch: _Batch, level: int, nodes: SweepNodes | None = None
    ) -> tuple[FloatArray, BoolArray, dict[tuple[str, int], FloatArray], IndexArray]:
        """Return drag, stability, moments by (output, order), and the rows to be refined."""
        nodes = nodes or self.level_nodes(level)
        drag = self._drag(batch, nodes)
        sound = np.isfinite(drag)
        loops = self._loops(batch, np.where(sound, drag, 0.0))
        stable = sound & _stable(loops)
        error = np.zeros(len(batch))
        found = {}
        with np.errstate(all="ignore"):
            for order, outputs in ((0, self._outputs), (2, self._second)):
                if not outputs:
                    continue
                several = self._variances(loops, outputs, nodes, batch.rows, second=order == 2)
                for name, columns in several.items():
                    found[name, order] = columns[:, 0]
                    if columns.shape[1] > 1:
                        gap = np.abs(columns[:, 1] - columns[:, 0])
                        error = np.maximum(error, gap / columns[:, 0])
        limit = self.accuracy if level < _LEVELS else max(self.accuracy, _LAST)
        doubt = np.flatnonzero(stable & ~(error <= limit))
        return drag, stable, found, doubt

    def _closely(self, batch: _Batch, drag: FloatArray) -> SweepNodes:
        """Return nodes for one row, its panels short near its own poles."""
        loops = self._loops(batch, np.where(np.isfinite(drag), drag, 0.0))
        if isinstance(loops, SpringLoops):
            poles = loops.poles(np.zeros(1, dtype=np.intp))[0]
        else:
            poles = light_poles(loops, 0)
        marks = [complex(p) for p in poles if p.real < 0.0 and p.imag >= 0.0]
        low, high, splits = self._frame
        return sweep_nodes(low, high, splits, level=1, marks=marks, clearance=0.6)

    def _variances(
        self,
        loops: Loops,
        outputs: Sequence[str],
        nodes: SweepNodes,
        rows: FloatArray,
        *,
        second: bool = False,
    ) -> dict[str, FloatArray]:
        """Return moments of outputs by both rules, (n, rules)."""
        ratios = self.sea.ratios(rows, nodes.omega)
        weights = nodes.weights
        if ratios is None:
            weights = weights * self.sea.density(nodes.omega)
        found = loops.moments(outputs, nodes.omega, weights, ratios, second=second)
        factors = self.sea.factors(rows)[:, None]
        return {name: columns * factors for name, columns in found.items()}

    def _peaks(self, batch: _Batch, drag: FloatArray, chosen: IndexArray) -> FloatArray:
        loops = self._loops(batch, np.where(np.isfinite(drag), drag, 0.0))
        if isinstance(loops, SpringLoops):
            return spring_peaks(loops, chosen)
        return peak_sensitivity(loops, chosen)

    def _drag(self, batch: _Batch, nodes: SweepNodes) -> FloatArray:
        """Return the drag coefficient of each row [N s/m], infinite where none agrees."""
        count = len(batch)
        drag = np.broadcast_to(batch.numbers.fixed_drag, (count,)).copy()
        at = np.flatnonzero(np.isnan(drag))
        if not at.size:
            return drag
        quadratic = np.broadcast_to(batch.numbers["quadratic_drag"], (count,))
        start = self.design.drag or 1.0
        if self.spring:
            own = batch.part(at)

            def spring(some: IndexArray, C: FloatArray) -> FloatArray:
                loops = self._loops(own.part(some), C)
                seen = self._variances(loops, [_VELOCITY], nodes, own.rows[some])
                return np.where(_stable(loops), np.sqrt(seen[_VELOCITY][:, 0]), np.inf)

            found = _agreeing_drag(quadratic[at], start, spring)
            below = np.where(np.isfinite(found), found, 0.0) / _EDGE
            drag[at] = np.where(_stable(self._loops(own, below)), found, np.inf)
            return drag
        # Whether a chain is stable costs more than its variance: it is asked at the answer first.
        for careful in (False, True):
            for k in range(0, at.size, _CHAINS):
                some = at[k : k + _CHAINS]
                part = batch.part(some)
                edge = np.zeros(some.size)
                if careful:
                    bare = self._loops(part, np.zeros(1))
                    assert isinstance(bare, ChainLoops)
                    edge = calming_drag(bare)
                velocity = self._chain_velocity(part, nodes, edge)
                found = _agreeing_drag(quadratic[some], start, velocity)
                # At the very edge the motion that calms a loop is that of its own instability.
                drag[some] = np.where(found <= _EDGE * edge, np.inf, found)
            if not careful:
                loops = self._loops(batch, np.where(np.isfinite(drag), drag, 0.0))
                assert isinstance(loops, ChainLoops)
                at = at[count_unstable(loops, at) != 0]
        return drag

    def _chain_velocity(self, batch: _Batch, nodes: SweepNodes, edge: FloatArray) -> Velocity:
        loops = self._loops(batch, np.zeros(1))
        assert isinstance(loops, ChainLoops)
        c0, c1, driven = loops.velocity_of_drag(np.arange(len(batch)), nodes.omega)
        ratios = self.sea.ratios(batch.rows, nodes.omega)
        density = self.sea.density(nodes.omega) if ratios is None else ratios
        factors = self.sea.factors(batch.rows)[:, None]
        driven = driven * (density * factors * nodes.weights[0])

        def velocity(some: IndexArray, C: FloatArray) -> FloatArray:
            closed = c0[some] + C[:, None] * c1[some]
            sigma = np.sqrt((driven[some] / abs2(closed)).sum(axis=1))
            return np.where(edge[some] < C, sigma, np.inf)

        return velocity


def _stable(loops: Loops) -> BoolArray:
    if isinstance(loops, SpringLoops):
        return loops.stable
    return np.asarray(count_unstable(loops) == 0)


def _agreeing_drag(quadratic: FloatArray, start: float, velocity: Velocity) -> FloatArray:
    """Return the drag that agrees with each loop's response, (n,) [N s/m]; infinite for none.

    C = q sqrt(8/pi) sigma_v(C), by the secant rule on logarithms, as `synth.robust.plant_stack`
    does.  More drag means less motion, so that the right side falls; where a loop is unstable it
    is given more.

    Parameters
    ----------
    quadratic
        q of the drag force q |v| v of each, (n,) [N s2/m2].
    start
        About where to begin [N s/m].
    velocity
        rms of the payload's velocity of loops `rows` with drag C, (m,); infinite if unstable.
    """
    slope = quadratic * np.sqrt(8.0 / np.pi)
    x = np.full(quadratic.size, np.log(max(start, 1.0)))
    found = np.where(quadratic > 0.0, np.inf, 0.0)
    left, right = np.full_like(x, -np.inf), np.full_like(x, np.inf)
    before, gap_before = np.full_like(x, np.nan), np.full_like(x, np.nan)
    rows = np.flatnonzero(quadratic > 0.0)
    for _ in range(_DRAG_ROUNDS):
        if not rows.size:
            break
        sigma = velocity(rows, np.exp(x[rows]))
        sound = np.isfinite(sigma)
        with np.errstate(divide="ignore"):
            gap = np.where(sound, np.log(np.maximum(slope[rows] * sigma, 1e-300)) - x[rows], _STEP)
        done = np.abs(gap) < _AGREES
        found[rows[done]] = np.exp(x[rows[done]])
        # The gap falls with x: its sign says on which side the answer lies.
        left[rows] = np.where(gap > 0.0, x[rows], left[rows])
        right[rows] = np.where(gap > 0.0, right[rows], x[rows])
        with np.errstate(all="ignore"):
            rise = (gap - gap_before[rows]) / (x[rows] - before[rows])
        rise = np.where(np.isfinite(rise) & sound, np.clip(rise, -3.0, -0.3), -1.5)
        before[rows], gap_before[rows] = x[rows], np.where(sound, gap, np.nan)
        step = np.clip(-gap / rise, -_STEP, _STEP)
        ahead = x[rows] + step
        outside = (ahead <= left[rows]) | (ahead >= right[rows])
        middle = 0.5 * (left[rows] + right[rows])
        ahead = np.where(outside & np.isfinite(middle), middle, ahead)
        x[rows] = ahead
        narrow = right[rows] - left[rows] < _AGREES
        found[rows[narrow & ~done]] = np.exp(right[rows[narrow & ~done]])
        # Rounding may keep the last digits from agreeing.
        close = np.abs(gap) < _CLOSE
        found[rows[close & ~done]] = np.exp(before[rows[close & ~done]])
        rows = rows[~(done | narrow)]
    return found
