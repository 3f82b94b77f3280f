"""Any design on rows of a spread: the vectorised engine behind sweeps and robust designs.

    rows (n, d) -> numbers, controllers, densities -> loops -> drag, variances, stability, M_s

Everything goes through the rope's recursion (`synth.sweeps.chain`) but variances and stability of
three gains on one Kelvin-Voigt spring without delay, noise and quadratic drag, for which
polynomials (`synth.sweeps.kernel`) are a hundred times faster.  Rows whose variances two rules
disagree on begin again on finer nodes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from itertools import product

import numpy as np

from models.basics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    FrequencyAxis,
    IndexArray,
    Quadrature,
    White,
)
from models.plant import lump_rope
from models.sensing import DRIFT_BAND, SWITCHING_BAND, sensed_plant
from models.spread import Spread

from ..loop import switching_friction
from ..question import DesignQuestion, SampledNoise
from .chain import BLOCK, SPEED, VELOCITY, Chain, ChainLoops, Motion, Pair, Shaken
from .kernel import SpringLoops
from .law_rows import DesignLaw
from .numbers import NOISE_OF, at_rest, numbers_of, part_of
from .sea_rows import SeaRows
from .sweep_nodes import Panel, SweepNodes, halved, sweep_nodes, sweep_panels
from .winding_count import calming_drag, light_poles, survey

ACCURACY = 1e-5  # difference of two rules from which a variance gets finer nodes
_REFERENCE = 3.0  # frequency by which polynomials are scaled [rad/s]
_LEVELS = 6  # of nodes, each with panels half as long
_PILOTS = 16  # rows that ask for panels
_SHARE = 0.005  # of the accuracy, that a panel of theirs may take
_SHORT_SHARE = 1e-4  # ... that one of fewer nodes may take: so little that no result moves
_MOST_PANELS = 200
_AT_ONCE = 2000  # rows of one pass where each has a density of its own, or finer nodes
_EDGE = 1.0 + 1e-6  # drag over the least that is stable, up to which a loop counts as unstable
_LAST = 1e-3  # difference of two rules that is told where no finer nodes are left
_ROUNDS, _LATE = 40, 12  # of drag and friction that agree; from when on what is near will do
_AGREES, _CLOSE = 1e-12, 1e-10  # of their logarithms
_CLEAR = 0.4  # of the drag's above its edge, where the search begins
_STEP = 1.5  # of it, at most


class SolvedRows:
    """What is known of the loops of n rows.

    Attributes
    ----------
    drag, friction
        Linear drag coefficient, (n,) [N s/m]; friction of losses that switch, (n,) [N m s/rad].
    heave
        Standard deviation of the hook's heave, (n,) [m].
    stable
        Whether each is stable, (n,).
    peak
        M_s, (n,); NaN where it was not asked for.
    moments
        Variances of each output, and of its rate where that is wanted, by all rules, (n, 1 or 2,
        rules).
    products
        Covariances of pairs of outputs and of their rates, and what signs of the reference unit's
        gain and phase error add to them, (n, 3, 2), where those are wanted; see `Chain.products`.
    """

    def __init__(
        self,
        loops: ChainLoops,
        orders: Mapping[str, int],
        rules: int = 1,
        pairs: Sequence[Pair] = (),
    ) -> None:
        count, self._numbers = len(loops), loops.numbers
        self.drag, self.heave = np.full(count, np.nan), np.full(count, np.nan)
        self.friction = np.zeros(count)
        self.stable = np.zeros(count, dtype=bool)
        self.peak = np.full(count, np.nan)
        self.moments = {name: np.full((count, k, rules), np.nan) for name, k in orders.items()}
        self.products = {pair: np.full((count, 3, 2), np.nan) for pair in pairs}

    @cached_property
    def holding(self) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
        """What holding the load takes, and its loss to both sides, by output, (n,) or (1,)."""
        return at_rest(self._numbers)

    def signed(self, output: str) -> list[FloatArray]:
        """Return variances of an output and of its rate, (n, 2), by signs of the unit's errors.

        One alone where nothing hangs on signs.
        """
        mean, both = self.moments[output][:, :, 0], self.products.get((output, output))
        if both is None:
            return [mean]
        return [mean + of_signs(both, signs) for signs in SIGNS]

    def sigma(self, output: str) -> FloatArray:
        """Return the standard deviation of an output, (n,)."""
        with np.errstate(all="ignore"):
            return np.asarray(np.sqrt(self.moments[output][:, 0, 0]))

    def period(self, output: str) -> FloatArray:
        """Return the mean zero-crossing period of an output, (n,) [s]."""
        zero, second = self.moments[output][:, :, 0].T
        with np.errstate(all="ignore"):
            return np.asarray(2.0 * np.pi * np.sqrt(zero / second))

    def put(self, at: IndexArray, other: SolvedRows) -> None:
        """Take over some rows' numbers, of the rule that counts."""
        self.drag[at], self.heave[at] = other.drag, other.heave
        self.friction[at] = other.friction
        self.stable[at], self.peak[at] = other.stable, other.peak
        for name, column in other.moments.items():
            self.moments[name][at] = column[:, :, :1]
        for pair, column in other.products.items():
            self.products[pair][at] = column


SIGNS = [*product((1.0, -1.0), repeat=2)]  #: Of gain and phase error.


def of_signs(products: FloatArray, signs: Sequence[float]) -> FloatArray:
    """Return what signs of gain and phase error add to products (n, 3, 2): (n, 2)."""
    return np.asarray(np.tensordot(products[:, 1:], signs, axes=(1, 0)))


class DesignRows:
    """A structure with its parameters, asked about rows of a spread.

    Parameters
    ----------
    question
        The structure on the plant that it is bound to.
    parameters
        Its parameters by name.
    spread
        The spread on its case (`Spread.on`).
    outputs
        The outputs whose variances are wanted.
    second
        Those of them whose rates' variances are wanted too.
    peaks
        Whether M_s is.
    masses
        Rope masses of all plants; by default those of the question.
    start
        About what the drag is, where it agrees with the response [N s/m].
    accuracy
        Relative difference of two rules from which a variance gets finer nodes.
    nodes
        Nodes to use for all, with no look at their error; chosen here if left out.
    """

    def __init__(
        self,
        question: DesignQuestion,
        parameters: Mapping[str, float],
        spread: Spread,
        *,
        outputs: Sequence[str],
        second: Sequence[str],
        peaks: bool,
        start: float,
        masses: int | None = None,
        accuracy: float = ACCURACY,
        nodes: Quadrature | None = None,
        together: Sequence[Pair] = (),
    ) -> None:
        assert spread.case is not None
        case = spread.case
        self.spread, self.case = spread, case
        self.accuracy = accuracy
        self.law = DesignLaw(question, parameters)
        self.lumps = lump_rope(masses or question.masses, case.rope.lumping)
        self.sea = SeaRows(case, spread)
        self._nodes: dict[int, SweepNodes] = {}  # by level
        if nodes is not None:
            given = SweepNodes.of(nodes, self.sea.density)
            self._nodes = dict.fromkeys(range(_LEVELS), given)
        self.columns: bool | None = None  # whether column arithmetic suffices
        self.refined = 0  # rows that needed finer nodes
        self.unresolved = 0  # ... and those that none of them resolved
        pilots = self._loops(self._pilots)
        consistent = bool(np.isnan(pilots.drag).any())
        self._losses = bool(np.any(at_rest(pilots.numbers)[1]["motor.torque"] > 0.0))
        # Drag and losses agree with the speeds.
        wanted = [*outputs, *([VELOCITY] * consistent), *([SPEED] * self._losses)]
        self._orders = {name: 2 if name in second else 1 for name in wanted}
        self._peaks, self._start = peaks, start
        # A variance whose largest is asked for hangs on the signs of the reference unit's errors.
        self._pairs = [*together]
        if "mru.heave" in self._noisy:
            numbers = self._loops(self._pilots).numbers
            if any(np.any(numbers[name] > 0.0) for name in ("mru_gain", "mru_phase")):
                self._pairs += [(name, name) for name in second]
        delayed = any(sensed_plant(case, masses=1, drag=0.0).delays) or any(
            path.endswith(("delay", "latency", "rate")) for path in spread.paths
        )
        three = question.structure.name == "payload-feedback"
        alone = self.lumps.masses.size == 1 and not (
            delayed or consistent or self._noisy or self._losses
        )
        alone = alone and case.crane.tip_stiffness is None and case.rigging.stiffness is None
        alone = alone and not self._pairs
        self.spring = alone and three and case.rope.damping_law == "kelvin-voigt"

    @property
    def block(self) -> int:
        """Rows that are best looked at together: their columns stay in the cache."""
        return 16_384 if self.spring else 2048

    def solve(self, rows: FloatArray) -> SolvedRows:
        """Return drag, stability, M_s and variances of rows, (n, d).

        Raises InputError if a row is no valid case.
        """
        loops = self._loops(rows)
        solved = SolvedRows(loops, self._orders, pairs=self._pairs)
        # All rows on common nodes first; those whose two rules disagree begin again on panels half
        # as long, and so on: narrow resonances are few, and pay for themselves.
        at: IndexArray = np.arange(len(rows))
        for level in range(_LEVELS):
            doubtful = []
            step = _AT_ONCE if level or self.sea.varies else max(len(rows), 1)
            for k in range(0, at.size, step):
                some = at[k : k + step]
                own = loops.part(some) if some.size < len(rows) else loops
                found = self._solved(rows[some], own, self.level_nodes(level))
                if own is loops:  # all rows at once
                    solved = found
                else:
                    solved.put(some, found)
                doubtful.append(some[self._doubt(found, level)])
            at = np.concatenate(doubtful) if doubtful else at[:0]
            if not at.size:
                break
            self.refined += at.size if level == 0 else 0
        for k in at:  # at the very edge of stability: nodes that know the loop's own poles
            one = np.array([k])
            own = loops.part(one)
            nodes = self._closely(own.with_drag(_sound(solved.drag[one]), solved.friction[one]))
            found = self._solved(rows[one], own, nodes)
            solved.put(one, found)
            self.unresolved += self._doubt(found, _LEVELS).size
        if self._peaks and self.spring and solved.stable.any():
            chosen = np.flatnonzero(solved.stable)
            solved.peak[chosen] = survey(loops, chosen)[1]
        return solved

    def loop_gain(self, rows: FloatArray, omega: FloatArray) -> ComplexArray:
        """Return L(i omega) of rows, (n, k), at frequencies above zero [rad/s]."""
        loops = self._loops(rows)
        found = self._solved(rows, loops, self.level_nodes())
        loops = loops.with_drag(_sound(found.drag), found.friction)
        s = np.asarray(1j * omega, dtype=np.complex128)
        closed, free = loops.responses(np.arange(len(rows)), s)
        return np.asarray(closed / free - 1.0)

    def level_nodes(self, level: int = 0) -> SweepNodes:
        """Return the common nodes of a level."""
        if level not in self._nodes:
            panels = self._panels
            # Where all pilots are smooth, fewer nodes do; rows that are not begin again anyway.
            short = () if level else {*panels}.difference(self._coarse(panels, short=True))
            for _ in range(level):
                panels = halved(panels)
            self._nodes[level] = self._nodes_on(panels, short=short)
        return self._nodes[level]

    @cached_property
    def _pilots(self) -> FloatArray:
        """The design's own row and some others."""
        nominal = [self.spread.nominal[path] for path in self.spread.paths]
        return np.vstack([nominal, self.spread.sample(_PILOTS - 1, "random", 1)])

    @cached_property
    def _noisy(self) -> set[str]:
        """What the controller hears with errors or noise, if they count."""
        numbers = self._loops(self._pilots).numbers
        heard = [name for name in self.law.measurements if name in NOISE_OF]
        return {y for y in heard if any(np.any(numbers[name] > 0.0) for name in NOISE_OF[y])}

    @cached_property
    def _panels(self) -> list[Panel]:
        """The panels that the pilots ask for."""
        axis, splits = self._frame
        panels = sweep_panels(axis, splits if self.sea.varies else [])
        while len(panels) < _MOST_PANELS and (coarse := self._coarse(panels)):
            panels = sorted(set(panels).difference(coarse).union(halved(coarse)))
        return panels

    def _coarse(self, panels: Sequence[Panel], *, short: bool = False) -> list[Panel]:
        """Return the panels on which the pilots' two rules disagree, the long pair or the short."""
        nodes = self._nodes_on(panels, short=panels if short else (), apart=True)
        found = self._solved(self._pilots, self._loops(self._pilots), nodes, alone=True)
        error = np.zeros(len(panels))
        for column in found.moments.values():
            with np.errstate(all="ignore"):
                share = np.abs(column[:, :, 1:]) / column[:, :, :1]
            error = np.maximum(error, np.nanmax(share, axis=(0, 1), initial=0.0))
        limit = (_SHORT_SHARE if short else _SHARE) * self.accuracy
        return [p for p, e in zip(panels, error, strict=True) if e > limit]

    def _nodes_on(
        self, panels: Sequence[Panel], *, short: Collection[Panel] = (), apart: bool = False
    ) -> SweepNodes:
        axis, splits = self._frame
        kinks = [] if self.sea.varies else splits
        return sweep_nodes(axis, panels, self.sea.density, kinks=kinks, short=short, apart=apart)

    @cached_property
    def _frame(self) -> tuple[FrequencyAxis, list[float]]:
        """The band of all disturbances, and kinks of the hook's density [rad/s]."""
        low, high, splits = self.sea.frame()
        if self._losses:
            low, high = min(low, SWITCHING_BAND[0]), max(high, SWITCHING_BAND[1])
        if not self._noisy:
            return FrequencyAxis(low, high, half_line=False), splits
        noise = SampledNoise(spectrum=White().density).band
        numbers = self._loops(self._pilots).numbers
        if "mru.heave" in self._noisy and np.any(numbers["mru_drift"] > 0.0):
            low = min(low, DRIFT_BAND)
        return FrequencyAxis(min(low, noise[0]), max(high, noise[1]), half_line=False), splits

    def _loops(self, rows: FloatArray) -> ChainLoops:
        """Return the loops of rows with the drag that is given; NaN where it is to be found."""
        numbers, self.columns = numbers_of(self.case, self.spread, rows, columns=self.columns)
        return ChainLoops(
            count=len(rows),
            numbers=numbers,
            law=self.law.columns(self.spread, rows),
            drag=numbers["fixed_drag"],
            lumps=self.lumps,
        )

    def _doubt(self, found: SolvedRows, level: int) -> IndexArray:
        """Return the stable rows whose two rules disagree."""
        error = np.zeros(found.stable.size)
        for column in found.moments.values():
            if column.shape[2] > 1:
                with np.errstate(all="ignore"):
                    gap = np.abs(column[:, :, 1] - column[:, :, 0]) / column[:, :, 0]
                error = np.maximum(error, gap.max(axis=1))
        limit = self.accuracy if level < _LEVELS else max(self.accuracy, _LAST)
        return np.flatnonzero(found.stable & ~(error <= limit))

    def _closely(self, loops: ChainLoops) -> SweepNodes:
        """Return nodes for one loop, its panels short near its own poles."""
        poles = light_poles(loops, 0)
        marks = [complex(p) for p in poles if p.real < 0.0 and p.imag >= 0.0]
        axis, splits = self._frame
        return sweep_nodes(axis, sweep_panels(axis, splits, marks), self.sea.density)

    def _solved(
        self, rows: FloatArray, loops: ChainLoops, nodes: SweepNodes, *, alone: bool = False
    ) -> SolvedRows:
        """Return drag, stability and moments of the loops of rows; M_s too, but of springs.

        `alone` leaves stability and M_s out: all count as stable.
        """
        found = SolvedRows(loops, self._orders, len(nodes.weights), self._pairs)
        ratios = self.sea.ratios(rows, nodes.omega)
        shaken = Shaken(
            factors=self.sea.factors(rows),
            ratios=ratios,
            heave_rms=self.sea.heave_rms(rows, ratios, nodes.weights[0]),
            noisy=bool(self._noisy) or self._losses,
            switching=self.sea.switching(rows, nodes.omega, loops.numbers["haul"])
            if self._losses
            else None,
        )
        found.drag[:], found.heave[:] = loops.drag, shaken.heave_rms
        if self.spring:
            springs = SpringLoops(loops, amplifier=self.law.amplifier, reference=_REFERENCE)
            found.stable[:] = springs.stable
            with np.errstate(all="ignore"):
                found.moments |= springs.moments(self._orders, nodes, shaken)
            return found
        at = np.arange(len(loops))
        free = np.isnan(found.drag)
        self._settle(loops, at, nodes, shaken, np.zeros(at.size), found, free)
        if alone:
            return found
        # Whether a chain is stable costs more than its variance: it is asked at the answer first.
        count, found.peak[:] = self._surveyed(loops, found, at)
        again = np.flatnonzero(free & (count != 0))
        if again.size:
            edge = np.zeros(at.size)
            edge[again] = calming_drag(loops.part(again))
            again = again[edge[again] > 0.0]  # others have been looked for from zero
            self._settle(loops, again, nodes, shaken, edge, found, free)
            again = again[np.isfinite(found.drag[again])]
            count[again], found.peak[again] = self._surveyed(loops, found, again)
        found.stable[:] = np.isfinite(found.drag) & (count == 0)
        return found

    def _surveyed(
        self, loops: ChainLoops, found: SolvedRows, chosen: IndexArray
    ) -> tuple[IndexArray, FloatArray]:
        """Return unstable poles and M_s of chosen loops, (m,) each, with losses or without."""
        drag = _sound(found.drag)
        count, peak = survey(loops.with_drag(drag), chosen, peaks=self._peaks)
        if not self._losses:
            return count, peak
        with_losses = loops.with_drag(drag, found.friction)
        other = survey(with_losses, chosen, peaks=self._peaks)
        return np.maximum(count, other[0]), np.maximum(peak, other[1])

    def _settle(
        self,
        loops: ChainLoops,
        chosen: IndexArray,
        nodes: SweepNodes,
        shaken: Shaken,
        edge: FloatArray,
        found: SolvedRows,
        free: BoolArray,
    ) -> None:
        """Find the drag of chosen loops where it is free, above its edge, and their moments."""
        s = np.asarray(1j * nodes.omega, dtype=np.complex128)
        step = max(1, BLOCK // len(nodes))
        quadratic = np.broadcast_to(loops.numbers["quadratic_drag"], (len(loops),))
        for at in range(0, chosen.size, step):
            rows = chosen[at : at + step]
            chain = Chain(loops, rows, s)
            if self._losses or free[rows].any():
                known = np.stack([found.drag[rows], np.zeros(rows.size)], axis=1)
                known[free[rows], 0] = np.where(quadratic[rows] > 0.0, np.nan, 0.0)[free[rows]]
                torque = part_of(found.holding[1]["motor.torque"], rows)
                known[:, 1] = np.where(torque > 0.0, np.nan, 0.0)
                ask = _Asked(chain.motion(nodes, shaken), quadratic[rows], torque)
                agreed = ask.agreed(known, self._start, edge[rows])
                found.drag[rows], found.friction[rows] = agreed.T
                if not np.isfinite(found.drag[rows]).any():
                    continue  # none of them is stable
                chain = chain.with_friction(found.friction[rows])
            if self._orders:
                moments = chain.moments(self._orders, nodes, shaken, _sound(found.drag[rows]))
                for name, column in moments.items():
                    both = column.reshape(rows.size, 2, -1)
                    found.moments[name][rows] = both[:, : self._orders[name]]
            if self._pairs:
                products = chain.products(self._pairs, nodes, shaken, _sound(found.drag[rows]))
                for pair, column in zip(self._pairs, products, strict=True):
                    found.products[pair][rows] = column


def _sound(drag: FloatArray) -> FloatArray:
    """Return drag coefficients, zero where none agrees or none has been found yet."""
    return np.where(np.isfinite(drag), drag, 0.0)


class _Asked:
    """What drag and friction the motion of m loops asks for: C = q sqrt(8/pi) sigma_v, and b.

    q is of the drag force q |v| v of each, (m,) [N s2/m2]; `torque` is what the losses come to
    either way, (m,) or (1,) [N m].
    """

    def __init__(self, motion: Motion, quadratic: FloatArray, torque: FloatArray) -> None:
        self._motion, self._quadratic = motion, quadratic
        self._torque = np.broadcast_to(torque, quadratic.shape)

    def by(self, held: FloatArray, rows: IndexArray | slice = slice(None)) -> FloatArray:
        """Return C and b that the motion of some loops with some C and b asks for, (m, 2)."""
        variances = self._motion.variances(held, rows)
        drag = self._quadratic[rows] * np.sqrt(8.0 / np.pi * variances[:, 0])
        return np.stack([drag, switching_friction(self._torque[rows], variances[:, 1])], axis=1)

    def agreed(self, known: FloatArray, start: float, edge: FloatArray) -> FloatArray:
        """Return C and b that agree with the motion, (m, 2); C is infinite where none does.

        What is known stays as it is; NaN is to be found, C from about `start` and above its edge.
        """
        free, least = np.isnan(known[:, 0]), _EDGE * edge
        if edge.any():
            # More drag means less motion: what asks for less at the edge does so above it.
            held = known.copy()
            held[free, 0] = np.where(np.isinf(edge), 0.0, least)[free]
            held = self._together(held, held, edge)
            # At the very edge the motion that calms a loop is of its own instability.
            lost = free & ~(self.by(held)[:, 0] > least)
            known = np.where(lost[:, None], held, known)
        begin = known.copy()
        begin[:, 0] = np.where(np.isnan(known[:, 0]), max(start, 1.0), known[:, 0])
        found = self._together(known, begin, edge)
        found[free & ~(found[:, 0] > least), 0] = np.inf
        return found

    def _together(self, known: FloatArray, begin: FloatArray, edge: FloatArray) -> FloatArray:
        """Return C and b by secants on logarithms (Broyden 1965), (m, 2); C is NaN if none agree.

        The search starts where the motion with `begin` leads.
        """
        free = np.isnan(known)
        open_ = free.any(axis=1)
        asked = self.by(np.nan_to_num(begin))
        found = np.where(free, asked, known)
        with np.errstate(all="ignore"):
            x, least = np.where(free, np.log(asked), 0.0), np.log(edge)
            x[:, 0] = np.where(free[:, 0], np.maximum(x[:, 0], least + _CLEAR), 0.0)
            step, before = np.zeros_like(x), np.zeros_like(x)
            inverse = np.tile(np.eye(2), (len(x), 1, 1))
            for turn in range(_ROUNDS):
                some = slice(None) if 2 * open_.sum() > open_.size else np.flatnonzero(open_)
                asked[some] = self.by(np.where(free, np.exp(x), known)[some], some)
                gap = np.where(free, np.log(asked) - x, 0.0)
                found[open_] = np.where(free, asked, known)[open_]
                # Rounding may keep the last digits from agreeing.
                open_ &= ~(np.abs(gap).max(axis=1) < (_AGREES if turn < _LATE else _CLOSE))
                if not open_.any():
                    break
                turned = np.einsum("mij,mj->mi", inverse, before - gap)
                along = np.einsum("mi,mij->mj", step, inverse) / (step * turned).sum(1)[:, None]
                update = (step - turned)[:, :, None] * along[:, None]
                inverse += np.where(np.isfinite(update), update, 0.0)
                ahead = x + np.clip(np.einsum("mij,mj->mi", inverse, gap), -_STEP, _STEP)
                ahead[:, 0] = np.maximum(ahead[:, 0], 0.5 * (x[:, 0] + least))
                step, before, x = ahead - x, gap, ahead
        found[open_ & free[:, 0], 0] = np.nan
        return found
