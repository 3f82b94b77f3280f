"""`Assessment`: the closed loop of any linear controller in numbers.

This is what every report looks through, and the warm view on nodes and frequencies that are made
from poles alone: one plant, one controller, what shakes them, and (if there is quadratic drag, or
losses that switch) the coefficients that agree with the response.  Everything is computed when
asked for and kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import cache, cached_property, lru_cache, partial

import numpy as np
from scipy.optimize import brentq

from models.basics import (
    ComplexArray,
    FloatArray,
    Quadrature,
    SolverError,
    adaptive_nodes,
    peak_factor,
    spectral_nodes,
)
from models.plant import LinearPlant, consistent_drag, settled_drag

from .controller import LinearController, closed_loop_plant, closed_loop_poles
from .disturbance import CoherentError, Disturbance
from .elements import (
    Coefficients,
    DragElement,
    Element,
    with_elements,
    without_losses,
)
from .loop_model import DECAY, abscissa, lively_poles
from .margins import Margins, least_distances, loop_margins, refine_minima
from .pole_region import PoleRegion, with_delay_models
from .responses import Closing, LoopBlocks, LoopResponses, blocks_with, with_loops

_RTOL = 1e-8  # of every variance
_CANCELLED = 1e-5  # ... where rounding leaves no more digits
_GRID_PER_DECADE = 150
_LOW = 0.3  # of the largest value on the grid, below which no peak between its points is looked for
_SETTLED = 1e-3  # ... and for which adapted nodes do
_SAME_NODES = 0.05  # relative change of the drag for which nodes made from poles do
_NODE_ROUNDS = 6  # of finding nodes for losses
_LOSS_ROUNDS, _LOSS_AGREES = 200, 1e-12  # of their coefficients on given nodes
_SECANTS, _AGREED, _LONGEST = 25, 1e-12, 2.0  # steps, accuracy, longest step in logarithms
_LEAST = -12.0  # logarithm of the share of its losses with which a stuck loop may move
_GLANCED = 1e-8  # relative error of margins where nodes are made from poles
_VERGE = 1e-5  # damping ratio below which only its own nodes see a pole

Nodes = Callable[[ComplexArray], Quadrature]
Grid = Callable[[ComplexArray], FloatArray]


class Assessment:
    """What a controller does to a plant.

    Parameters
    ----------
    plant, controller
        The two ends of the loop.
    disturbances
        What shakes the plant.
    elements
        Quadratic drag and losses that switch, if any, drag first; their coefficients are then
        solved with the response.  Stability and margins hold with the losses and without.
    coefficients
        The coefficients if they are known already (the optimiser's own).
    nodes, grid
        From the closed loop's poles [1/s] to quadrature nodes for its variances, and to frequencies
        [rad/s] dense enough to see every peak and crossing; by default nodes that adapt to the
        spectra, and `frequency_grid`.
    """

    def __init__(
        self,
        plant: LinearPlant,
        controller: LinearController,
        disturbances: Sequence[Disturbance],
        *,
        elements: Sequence[Element] = (),
        coefficients: Coefficients | None = None,
        nodes: Nodes | None = None,
        grid: Grid | None = None,
    ) -> None:
        self._bare = plant
        self.controller = controller
        self.disturbances = tuple(disturbances)
        self.elements = tuple(elements)
        self._given = coefficients
        self._nodes, self._dense = nodes, grid
        self._signs: FloatArray = np.zeros(0)
        # What `members` share: nodes; m_0 and m_2 of outputs and covariances of pairs, the means
        # over the signs and what each sign adds, (.., 1 + e); and standard deviations by cause.
        self._kept: dict[tuple[str, ...], Quadrature] = {}
        self._moments: dict[str, FloatArray] = {}
        self._products: dict[tuple[str, str], FloatArray] = {}
        self._shares: dict[str, dict[str, float]] = {}

    @cached_property
    def coefficients(self) -> tuple[float, ...]:
        """The coefficients of the elements that agree with the response."""
        if not self.elements:
            return ()
        if self._given is not None:
            return tuple(self._given)
        return consistent_coefficients(
            self._bare, self.controller, self.disturbances, self.elements, nodes=self._nodes
        )

    @cached_property
    def plant(self) -> LinearPlant:
        """The plant with its elements."""
        return with_elements(self._bare, self.elements, self.coefficients)

    @cached_property
    def _sides(self) -> list[Coefficients]:
        """The coefficients of the loop that moves, and without its losses where it has some."""
        still = without_losses(self.elements, self.coefficients)
        return [self.coefficients, *([] if still == list(self.coefficients) else [still])]

    @cached_property
    def _plants(self) -> list[LinearPlant]:
        """The plant at each of the sides."""
        still = (with_elements(self._bare, self.elements, side) for side in self._sides[1:])
        return [self.plant, *still]

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the closed loop [1/s], delays as Pade models.

        Where nodes are made from them, without damped poles of the plant that no loop moves.
        """
        return self._every if self._nodes is None else self._lively(self.coefficients)

    @cached_property
    def _every(self) -> ComplexArray:
        return closed_loop_poles(self._modelled[0], self.controller)

    def _lively(self, coefficients: Coefficients) -> ComplexArray:
        """Return the poles that a loop moves, on few states."""
        return lively_poles(self._bare, self.controller, self.elements, tuple(coefficients))

    @cached_property
    def pole_region(self) -> PoleRegion:
        """Decay, damping and frequency of the closed loop's poles, without the delay models'."""
        return PoleRegion.of(self._every, self._modelled[1])

    @cached_property
    def _modelled(self) -> tuple[LinearPlant, ComplexArray]:
        return with_delay_models(self.plant)

    @property
    def decays(self) -> bool:
        """Whether all poles lie in the left half plane."""
        return bool(self.poles.real.max(initial=-np.inf) < 0.0)

    @property
    def stable(self) -> bool:
        """Whether all poles lie in the left half plane, without losses too."""
        return self.decays and all(self._abscissa(side) < 0.0 for side in self._sides[1:])

    @property
    def held(self) -> bool:
        """Whether the poles that a loop moves lie left of the axis by more than rounding."""
        return all(self._abscissa(side) < -DECAY for side in self._sides)

    @property
    def swings(self) -> bool:
        """Whether it swings by itself in small motion, where quadratic drag vanishes."""
        dragged = any(element.lasting for element in self.elements)
        return dragged and self._abscissa([0.0] * len(self.elements)) > DECAY

    def _abscissa(self, coefficients: Coefficients) -> float:
        """Return the largest real part of a lively pole over the size of the largest."""
        return abscissa(self._lively(coefficients))

    @cached_property
    def grid(self) -> FloatArray:
        """Frequencies dense enough to see every peak and crossing [rad/s]."""
        if self._dense is not None:
            return self._dense(self.poles)
        open_poles = np.concatenate([self.plant.poles(), np.linalg.eigvals(self.controller.A)])
        return frequency_grid(np.concatenate([self.poles, open_poles]))

    @cached_property
    def margins(self) -> Margins:
        """Margins of the loops broken at the inputs."""
        return loop_margins(self._gains, self.grid, self.gains, self._minima, self._error)

    @cached_property
    def gains(self) -> ComplexArray:
        """L of each loop on the grid, (loops, k); with the losses first, then without."""
        return self._gains(self.grid)

    @cached_property
    def _minima(self) -> list[list[tuple[FloatArray, FloatArray]]]:
        """Places and values of the local minima of |1 + L| and of 1/|S - 1/2| of each loop."""
        return least_distances(self._gains, self.grid, self.gains, self._error)

    @property
    def _error(self) -> float:
        """The relative error that margins may have: none but rounding if nodes adapt."""
        return 0.0 if self._nodes is None else _GLANCED

    @property
    def max_sensitivity(self) -> float:
        """M_s of the worst loop, as in `margins` but without the crossings."""
        return float(1.0 / min(least.min() for (_, least), _ in self._minima))

    def loop_gain(self, omega: FloatArray, index: int = 0) -> ComplexArray:
        """Return L of the loop broken at input `index`, (k,); further ones are without losses."""
        return np.asarray(self._gains(np.asarray(omega, dtype=np.float64))[index])

    def response(self, output: str, disturbance: str, omega: FloatArray) -> ComplexArray:
        """Return the closed-loop response of `output` to `disturbance`, (k,)."""
        return np.asarray(self.responses([output], [disturbance], omega)[0, 0])

    def sigma(self, output: str) -> float:
        """Return the standard deviation of `output`."""
        return float(np.sqrt(self._moment(output)[0]))

    def shares(self, output: str) -> dict[str, float]:
        """Return the standard deviation that each disturbance alone makes of `output`, by name.

        Their squares add up to the variance, of a sensor's error over its signs.
        """
        self._moment(output)
        return dict(self._shares[output])

    def mean_period(self, output: str) -> float:
        """Return the mean zero-crossing period of `output` [s]."""
        m0, m2 = self._moment(output)
        return float(2.0 * np.pi * np.sqrt(m0 / m2)) if 0.0 < m2 < np.inf else np.inf

    def peak(self, output: str, duration: float) -> float:
        """Return the most probable maximum of `output` in `duration` [s], without its mean."""
        return peak_factor(self.mean_period(output), duration) * self.sigma(output)

    def covariance(self, one: str, other: str) -> float:
        """Return the covariance of two outputs."""
        if (one, other) not in self._products:
            outputs = self.plant.outputs if self.plant.outputs in self._kept else (one, other)
            nodes = self._on(outputs)
            every, shaken = self._on_nodes(outputs, nodes)
            responses = every[[outputs.index(one), outputs.index(other)]]
            mean = np.sum((responses[0].conj() * responses[1]).real * shaken * nodes.weights)
            first, second = responses
            added = self._crossed(first, second, shaken, nodes)[0]
            added = added + self._crossed(second, first, shaken, nodes)[0]
            self._products[one, other] = np.append(mean, added)
        return float(self._of_signs(self._products[one, other]))

    @cached_property
    def members(self) -> tuple[Assessment, ...]:
        """The loop with each combination of signs that sensors' errors may have; or itself.

        Their variances are those of one combination, where its own are the mean over all.
        """
        if self._signs.size or self._coherent is None:
            return (self,)
        found = []
        for signs in self._coherent.signs:
            own = copy(self)
            own._signs = np.array(signs)
            found.append(own)
        return tuple(found)

    def sensitivity_peaks(self, above: float) -> FloatArray:
        """Return the frequencies of all peaks of |S| above a value [rad/s]."""
        found = [at[least < 1.0 / above] for (at, least), _ in self._minima]
        return np.unique(np.concatenate(found))

    def largest(
        self,
        size: Callable[[FloatArray, ComplexArray], FloatArray],
        weight: Callable[[FloatArray], FloatArray],
        edges: Sequence[float] = (),
        channel: tuple[str, str] | None = None,
    ) -> float:
        """Return the largest size of 1 + L of any loop, or of a response.

        `size` leads from frequencies [rad/s] and what the curve is there to its size, `weight` from
        frequencies to the weight there, zero where the size does not matter, (k,) each.  At `edges`
        [rad/s] the weight has a kink or an end.  `channel` is output and disturbance of the
        closed-loop response that is looked at, if one is.
        """

        def sizes(omega: FloatArray) -> FloatArray:
            curves: Sequence[ComplexArray]
            if channel is None:
                curves = [np.asarray(1.0 + gain) for gain in self._gains(omega)]
            else:
                names, sides = ([channel[0]], [channel[1]]), range(len(self._sides))
                curves = [self._closed(*names, omega, side)[0, 0] for side in sides]
            return np.asarray(np.max([size(omega, curve) for curve in curves], axis=0))

        places = np.append(self.grid, [share * edge for edge in edges for share in (1e-4, 1.0)])
        grid = np.unique(places[weight(places) > 0.0])
        if not grid.size:
            return 0.0
        found = sizes(grid)
        high = found > _LOW * found.max()
        return float(-refine_minima(lambda w: -sizes(w), grid, -found, high)[1].min())

    def spectrum(self, output: str, omega: FloatArray) -> FloatArray:
        """Return the one-sided density of `output` at `omega` [rad/s], (k,)."""
        return np.asarray(np.sum(self._spectra([output], omega)[0], axis=0), dtype=np.float64)

    def curves(
        self, output: str, disturbance: str, omega: FloatArray
    ) -> tuple[ComplexArray, FloatArray]:
        """Return `response` to one of the disturbances that shake the plant, and `spectrum`."""
        (responses,), shaken = self._all([output], omega)
        names = [d.name for d in self.disturbances]
        return responses[names.index(disturbance)], np.sum(np.abs(responses) ** 2 * shaken, axis=0)

    def quadrature(
        self, outputs: Sequence[str], rtol: float = _RTOL, *, strict: bool = False
    ) -> Quadrature:
        """Return nodes on which the variance and the second moment of `outputs` are accurate.

        Raises SolverError if rounding leaves too few digits for that; if `strict`, for `rtol`.
        """
        if self._nodes is not None:
            return self._nodes(self.poles)
        low, high, half_line = integration_band(self.disturbances, self.poles)
        adapted = partial(
            adaptive_nodes,
            lambda omega: np.concatenate(self._spectra(outputs, omega)),
            low,
            high,
            splits=[w for d in self.disturbances for w in d.splits],
            poles=_off_axis(self.poles),
            half_line=half_line,
        )
        try:
            return adapted(rtol=rtol)
        except SolverError:
            if strict:
                raise
            # Of a motion that is cancelled to a thousandth the rest has fewer digits.
            return adapted(rtol=max(rtol, _CANCELLED))

    def _moment(self, output: str) -> tuple[float, float]:
        if output not in self._moments and not self._moments and self._bounded:
            # One set of nodes for all outputs costs little more than one for this.
            with suppress(SolverError):
                self._integrate(self.plant.outputs)
        if output not in self._moments:
            try:
                self._integrate([output])
            except SolverError:
                # A pole so close to the axis that the variance has no digits: it has no bound.
                self._moments[output] = np.full((2, 1), np.inf)
                self._shares[output] = dict.fromkeys((d.name for d in self.disturbances), np.inf)
        # Never below zero by rounding, where error and motion cancel.
        m0, m2 = np.maximum(self._of_signs(self._moments[output]), 0.0).tolist()
        return m0, m2

    def _of_signs(self, integrals: FloatArray) -> FloatArray:
        """Return integrals with the error's signs, of the mean and what each adds, (.., 1 + e)."""
        mean, added = integrals[..., 0], integrals[..., 1:]
        return np.asarray(mean + added @ self._signs if added.size and self._signs.size else mean)

    @property
    def _bounded(self) -> bool:
        """Whether every variance is finite: no disturbance is white without end."""
        return all(d.band is not None for d in self.disturbances)

    def _integrate(self, outputs: Sequence[str]) -> None:
        nodes = self._on(outputs)
        responses, shaken = self._on_nodes(outputs, nodes)
        parts = np.abs(responses) ** 2 * shaken * nodes.weights
        variances, rates = parts.sum(axis=2), parts @ nodes.omega**2
        means = np.stack([variances.sum(axis=1), rates.sum(axis=1)], axis=1)
        for i, output in enumerate(outputs):
            names = (d.name for d in self.disturbances)
            self._shares[output] = dict(zip(names, np.sqrt(variances[i]).tolist(), strict=True))
            added = 2.0 * self._crossed(responses[i], responses[i], shaken, nodes)
            self._moments[output] = np.concatenate([means[i, :, None], added], axis=1)

    def _on(self, outputs: Sequence[str]) -> Quadrature:
        """Return the nodes of some outputs, the same for every combination of signs."""
        key = tuple(outputs)
        if key not in self._kept:
            # Among several, one that is cancelled costs the others no digits.
            self._kept[key] = self.quadrature(outputs, strict=len(key) > 1)
        return self._kept[key]

    @cached_property
    def _coherent(self) -> CoherentError | None:
        return CoherentError.among(self.disturbances)

    def _crossed(
        self, one: ComplexArray, other: ComplexArray, shaken: FloatArray, nodes: Quadrature
    ) -> FloatArray:
        """Return what each of the error's signs adds to integrals of conj(F) F and its like.

        From responses of two outputs to all disturbances, (w, k); of the powers 0 and 2 of omega,
        (2, e).
        """
        if self._coherent is None:
            return np.zeros((2, 0))
        source, error, shares = self._coherent.source, self._coherent.error, self._coherent.shares
        product = one[source].conj() * other[error] * shaken[source] * nodes.weights
        powers = np.stack([np.ones_like(nodes.omega), nodes.omega**2])
        return np.asarray((powers @ (product * shares(nodes.omega)).T).real)

    def responses(
        self,
        outputs: Sequence[str],
        sources: Sequence[str],
        omega: FloatArray,
        *,
        losses: bool = True,
    ) -> ComplexArray:
        """Return the closed-loop responses of outputs to disturbances, (z, w, k).

        Without the friction that losses come to, if they are left out.
        """
        return self._closed(outputs, sources, omega, 0 if losses else len(self._sides) - 1)

    def _closed(
        self,
        outputs: Sequence[str],
        sources: Sequence[str],
        omega: FloatArray,
        side: int,
    ) -> ComplexArray:
        """Return closed-loop responses, (z, w, k), at one of the sides."""
        plant, elements = self._base(side)
        names = tuple(outputs), tuple(sources)
        found = _plain(plant, self.controller, elements, *names, omega)
        return self._with_elements(found, side)[: len(outputs), : len(sources)]

    def _base(self, side: int) -> tuple[LinearPlant, tuple[Element, ...]]:
        """Return a plant whose responses are asked for, and what of its elements is changed in it.

        On nodes that are made from poles that is the plant as it is.  Nodes that adapt want all
        digits, of which a change of a plant without damping costs some.
        """
        if self._nodes is None:
            return self._plants[side], ()
        return self._bare, self.elements

    def _with_elements(self, plain: LoopBlocks, side: int) -> ComplexArray:
        elements = self._base(side)[1]
        return blocks_with(plain, elements, self._sides[side][: len(elements)]).zw

    def _spectra(self, outputs: Sequence[str], omega: FloatArray) -> FloatArray:
        """Return what each disturbance alone makes of each output, (z, w, k)."""
        responses, shaken = self._all(outputs, omega)
        return np.asarray(np.abs(responses) ** 2 * shaken)

    def _all(self, outputs: Sequence[str], omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return the responses of outputs to all disturbances, (z, w, k), and densities (w, k)."""
        densities = np.array([d.density(omega) for d in self.disturbances])
        return self.responses(outputs, [d.name for d in self.disturbances], omega), densities

    def _gains(self, omega: FloatArray) -> ComplexArray:
        """Return L of each loop, (loops, k); with the losses first, then without."""
        velocities, forces = _ends(self.elements)
        part = _part(self._bare, velocities, forces)
        blocks = LoopBlocks.of(part.response(part.beside_poles(omega)))
        law, inputs = Closing.of(self.controller, blocks.s), range(len(self._bare.inputs))
        sides = (blocks_with(blocks, self.elements, side) for side in self._sides)
        loops = [LoopResponses(side, law) for side in sides]
        return np.array([loop.difference(i) - 1.0 for loop in loops for i in inputs])

    def _on_nodes(
        self, outputs: Sequence[str], nodes: Quadrature
    ) -> tuple[ComplexArray, FloatArray]:
        """Return what `_all` does, on nodes that others ask for as well."""
        plant, elements = self._base(0)
        end = plant, self.controller, elements, self.disturbances
        plain, densities = _plain_on(*end, tuple(outputs), nodes)
        responses = self._with_elements(plain, 0)
        return responses[: len(outputs), : len(self.disturbances)], densities


@lru_cache(maxsize=64)
def _part(
    plant: LinearPlant, outputs: tuple[str, ...], disturbances: tuple[str, ...]
) -> LinearPlant:
    """Return some of a plant's signals, of which many controllers ask for the same."""
    return plant.select(outputs=outputs, disturbances=disturbances)


@lru_cache(maxsize=4)
def _rational(plant: LinearPlant, controller: LinearController) -> LinearPlant:
    """Return a closed loop as a plant, finite at the poles of the open one."""
    return closed_loop_plant(plant, controller)


def _ends(elements: Sequence[Element]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names of the velocities and of the forces of elements."""
    return tuple(e.velocity for e in elements), tuple(e.force for e in elements)


def _plain(
    plant: LinearPlant,
    controller: LinearController,
    elements: Sequence[Element],
    outputs: tuple[str, ...],
    sources: tuple[str, ...],
    omega: FloatArray,
) -> LoopBlocks:
    """Return the closed loop's responses with the elements as the plant holds them.

    Velocities and forces of the elements stand behind the outputs and the disturbances.
    """
    velocities, forces = _ends(elements)
    outputs, sources = (*dict.fromkeys(outputs + velocities),), (*dict.fromkeys(sources + forces),)
    late = any(plant.delays)
    part = _part(plant if late else _rational(plant, controller), outputs, sources)
    blocks = LoopBlocks.of(part.response(part.beside_poles(omega)))
    if late:
        closed = LoopResponses(blocks, Closing.of(controller, blocks.s)).responses
        blocks = replace(blocks, zw=closed)
    # All commands are made in the loop.
    return replace(blocks, zu=blocks.zu[:, :0], yw=blocks.yw[:0], yu=blocks.yu[:0, :0])


@lru_cache(maxsize=2)
def _plain_on(
    plant: LinearPlant,
    controller: LinearController,
    elements: tuple[Element, ...],
    disturbances: tuple[Disturbance, ...],
    outputs: tuple[str, ...],
    nodes: Quadrature,
) -> tuple[LoopBlocks, FloatArray]:
    """Return `_plain` on nodes, and the densities there, (w, k).

    The coefficients are looked for on the nodes that variances are then taken on.
    """
    sources = tuple(d.name for d in disturbances)
    plain = _plain(plant, controller, elements, outputs, sources, nodes.omega)
    return plain, np.array([d.density(nodes.omega) for d in disturbances])


def frequency_grid(poles: ComplexArray) -> FloatArray:
    """Return a logarithmic grid [rad/s] with clusters at lightly damped `poles` [1/s]."""
    sizes = np.abs(poles)
    sizes = sizes[sizes > 1e-6 * max(1.0, float(sizes.max(initial=1.0)))]
    smallest = float(sizes.min(initial=1.0))
    low = min(1e-4, 0.01 * smallest)
    high = 100.0 * float(sizes.max(initial=1.0))
    count = int(_GRID_PER_DECADE * np.log10(high / low))
    omega, damping = np.abs(poles.imag), np.abs(poles.real)
    light = (omega > 0.0) & (damping < 0.3 * omega)
    steps = np.array([0.0, 0.1, 0.25, 0.5, 0.8, 1.2, 2.0, 3.5, 6.0, 10.0])
    steps = np.concatenate([-steps[:0:-1], steps])
    widths = np.maximum(damping[light], 1e-7 * omega[light])
    near = omega[light, None] + widths[:, None] * steps
    near[damping[light] <= 1e-9 * omega[light], steps == 0.0] = np.inf  # at an undamped one is none
    grid = np.concatenate([np.geomspace(low, high, count), near.ravel()])
    return np.unique(grid[(grid >= low) & (grid <= high)])


def integration_band(
    disturbances: Sequence[Disturbance], poles: ComplexArray
) -> tuple[float, float, bool]:
    """Return the band [rad/s] of variances, and whether to go on to 0 and infinity."""
    if any(d.band is None for d in disturbances):
        sizes = np.abs(poles)
        sizes = sizes[sizes > 1e-6 * max(1.0, float(sizes.max(initial=1.0)))]
        return (
            0.1 * float(sizes.min(initial=1.0)),
            10.0 * float(sizes.max(initial=1.0)),
            True,
        )
    bands = [d.band for d in disturbances if d.band is not None]
    return min(b[0] for b in bands), max(b[1] for b in bands), False


def consistent_coefficients(
    plant: LinearPlant,
    controller: LinearController,
    disturbances: Sequence[Disturbance],
    elements: Sequence[Element],
    *,
    start: Coefficients | None = None,
    nodes: Nodes | None = None,
) -> tuple[float, ...]:
    """Return the coefficients of elements that agree with the closed loop's own velocities.

    The search begins with `start`, by default coefficients of usual size; the rest is as
    `Assessment` takes it.

    Raises SolverError if none agree: the loop is unstable with any drag.
    """
    if nodes is None and start is None and all(d.band is not None for d in disturbances):
        # Nodes that adapt are dear: the search on them begins where that on others ends.
        end = plant, controller, disturbances, elements
        with suppress(SolverError):
            start = consistent_coefficients(*end, nodes=partial(_known_nodes, disturbances))
    drag = next((e for e in elements if isinstance(e, DragElement)), None)
    losses = [e for e in elements if e is not drag]
    first = [e.begin for e in elements] if start is None else list(start)
    slack = first[len(first) - len(losses) :]  # coefficients of the losses, as known so far
    asked = list(slack)  # what the motion with these asks for
    held = False  # whether they stay as they are

    @cache
    def loop(*known: float) -> Assessment:
        return Assessment(
            plant, controller, disturbances, elements=elements, coefficients=known, nodes=nodes
        )

    def all_with(coefficient: float) -> list[float]:
        return [*([] if drag is None else [coefficient]), *slack]

    def swings(coefficient: float) -> bool:
        return not loop(*all_with(coefficient)).decays

    at = np.nan  # the coefficient that the nodes are for
    velocities, _ = _ends(elements)
    # On nodes that are made from poles alone the variances are taken, too.
    wanted = velocities if nodes is None else plant.outputs
    loop_on = plant, controller, tuple(elements), tuple(disturbances)

    def moved(known: Sequence[float]) -> Callable[[Sequence[float]], FloatArray]:
        """Return the variances of the velocities by coefficients, on nodes that suit some."""
        found = loop(*known).quadrature(velocities)
        plain, densities = _plain_on(*loop_on, wanted, found)
        rows = [plain.outputs.index(e.velocity) for e in elements]
        forces = [plain.sources.index(e.force) for e in elements]
        shaken, felt = plain.zw[rows, : len(densities)], plain.zw[rows][:, forces]
        cross = np.einsum("awk,bwk->abk", shaken * (densities * found.weights), shaken.conj())
        reference = np.array([e.reference for e in elements])

        def variances(others: Sequence[float]) -> FloatArray:
            return with_loops(cross, felt, np.array(others) - reference)

        return variances

    def agreed(known: Sequence[float], settled: float) -> Sequence[float] | None:
        """Return all coefficients together, as near to known ones as they mostly are."""
        for _ in range(_NODE_ROUNDS):
            variances = moved(known)
            found = _fixed_point(
                lambda others, variances=variances: [  # type: ignore[misc]  # it is bound here
                    float(e.coefficient(v))
                    for e, v in zip(elements, variances(others), strict=True)
                ],
                known,
            )
            if found is None or not loop(*found).decays:
                return None
            if np.all(np.abs(found - np.array(known)) <= settled * found):
                damping = [PoleRegion.of(loop(*each).poles).damping for each in (found, known)]
                on_the_verge = damping[0] < max(0.5 * damping[1], _VERGE)
                return None if on_the_verge and nodes is not None else found.tolist()
            known = found.tolist()
        return None

    def about(coefficient: float) -> Callable[[float], float]:
        nonlocal at
        at, calm, variances = coefficient, np.inf, moved(all_with(coefficient))

        def velocity(other: float) -> float:
            nonlocal calm  # the least drag known to do; more of it does too, as is checked below
            if other < calm and drag is not None:
                if swings(other):
                    return np.inf
                calm = other
            for _ in range(_LOSS_ROUNDS):
                found = variances(all_with(other))
                own = found[len(found) - len(losses) :]
                before = np.array(slack)
                asked[:] = [float(e.coefficient(v)) for e, v in zip(losses, own, strict=True)]
                if held or not losses:
                    break
                slack[:] = asked
                if np.all(np.abs(slack - before) <= _LOSS_AGREES * before):
                    break
            return float(np.sqrt(found[0]))

        return velocity

    if losses:
        with suppress(SolverError):
            together = agreed(first, _SETTLED if nodes is None else _SAME_NODES)
            if together is not None:
                return tuple(together)

    def solved(begin: float, settled: float | None = None) -> float:
        """Return the drag that agrees, the losses with it, on nodes that suit both."""
        for _ in range(_NODE_ROUNDS):
            before = np.array(slack)
            if drag is None:
                about(begin)(begin)
            elif settled is None:
                begin = settled_drag(drag.quadratic, about, begin)
            else:
                begin = settled_drag(drag.quadratic, about, begin, settled=settled)
            if np.all(np.abs(slack - before) <= (settled or _SETTLED) * before):
                break
        return begin

    begin = first[0] if drag is not None else 0.0
    found = None
    if nodes is None:
        try:
            found = solved(begin)
        except SolverError:
            if any(d.band is None for d in disturbances):
                raise
            # On the verge of stability no cut finds a peak, but it is known where it stands.
            nodes = partial(_known_nodes, disturbances)
            loop.cache_clear()  # those are on no such nodes
    if found is None:
        # Nodes that do not adapt are as good for a loop with a little more drag, unless it is on
        # the verge of stability, where nothing but its own nodes sees how it swings.
        found = solved(begin, _SAME_NODES)
        damping = [PoleRegion.of(loop(*all_with(C)).poles).damping for C in (found, at)]
        if drag is not None and damping[0] < max(0.5 * damping[1], _VERGE):
            found = consistent_drag(drag.quadratic, lambda C: about(C)(C))
            about(found)
    if swings(found) and losses:
        # Stuck by its losses it swings: it moves as much as leaves it less of them.
        held, stuck = True, np.array(slack)

        def surplus(size: float) -> float:
            nonlocal found
            slack[:] = (np.exp(size) * stuck).tolist()
            with suppress(SolverError):
                found = solved(begin, _SAME_NODES)
                if not swings(found):
                    return float(np.log(asked[0] / slack[0]))
            return -1.0

        if surplus(_LEAST) > 0.0:
            if surplus(0.0) < 0.0:
                surplus(float(brentq(surplus, _LEAST, 0.0, xtol=1e-10)))
        elif drag is None:
            return (0.0,) * len(losses)  # it moves without end, and losses count for nothing
    if swings(found):
        raise SolverError(f"drag: the loop is unstable at {found:.4g} N s/m but not with less")
    return (*([] if drag is None else [found]), *slack)


def _fixed_point(
    function: Callable[[FloatArray], Sequence[float]], begin: Sequence[float]
) -> FloatArray | None:
    """Return positive numbers that a function leaves as they are, or None.

    By secants of as many steps as there are numbers (Anderson, J. ACM 12, 1965), in logarithms.
    """
    if not np.all(np.array(begin) > 0.0):
        return None
    at = np.log(begin)
    steps: list[FloatArray] = []
    turns: list[FloatArray] = []
    for _ in range(_SECANTS):
        found = np.array(function(np.exp(at)))
        if not np.all((found > 0.0) & np.isfinite(found)):
            return None
        apart = np.log(found) - at
        if np.all(np.abs(apart) <= _AGREED):
            return found
        if steps:
            turns[-1] = apart - turns[-1]
        step = apart
        if steps:
            kept = slice(-at.size, None)
            moved, turned = np.array(steps[kept]).T, np.array(turns[kept]).T
            step = apart - (moved + turned) @ np.linalg.lstsq(turned, apart, rcond=None)[0]
        steps.append(np.clip(step, -_LONGEST, _LONGEST))
        turns.append(apart)
        at = at + steps[-1]
    return None


def _known_nodes(disturbances: Sequence[Disturbance], poles: ComplexArray) -> Quadrature:
    """Return nodes that are made from the poles of a loop [1/s] alone."""
    low, high, half_line = integration_band(disturbances, poles)
    splits = [w for d in disturbances for w in d.splits]
    return spectral_nodes(low, high, splits=splits, poles=_off_axis(poles), half_line=half_line)


def _off_axis(poles: ComplexArray) -> list[complex]:
    return [complex(p) for p in poles if abs(p.real) > 1e-12 * max(1.0, abs(p)) and p.imag >= 0.0]
