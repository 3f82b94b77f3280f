"""`Assessment`: the closed loop of any linear controller in numbers.

This is what every report looks through, and the warm view on nodes and frequencies that are made
from poles alone: one plant, one controller, what shakes them, and (if there is quadratic drag) the
drag coefficient that agrees with the response.  Everything is computed when asked for and kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import copy
from functools import cache, cached_property, partial

import numpy as np

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
from .elements import DragElement, with_drag
from .margins import Margins, least_distances, loop_margins, refine_minima, worst_margins
from .pole_region import PoleRegion, with_delay_models
from .responses import LoopBlocks, LoopResponses

_RTOL = 1e-8  # of every variance
_GRID_PER_DECADE = 150
_LOW = 0.3  # of the largest value on the grid, below which no peak between its points is looked for
_SAME_NODES = 0.05  # relative change of the drag for which nodes made from poles do
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
    drag
        Quadratic drag, if any; its coefficient is then solved with the response.
    coefficient
        The drag coefficient [N s/m] if it is known already (the optimiser's own).
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
        drag: DragElement | None = None,
        coefficient: float | None = None,
        nodes: Nodes | None = None,
        grid: Grid | None = None,
    ) -> None:
        self._bare = plant
        self.controller = controller
        self.disturbances = tuple(disturbances)
        self._drag = drag
        self._given = coefficient
        self._nodes, self._dense = nodes, grid
        self._parts: dict[tuple[str, ...], LinearPlant] = {}
        self._signs: FloatArray = np.zeros(0)
        # What `members` share: nodes; m_0 and m_2 of outputs and covariances of pairs, the means
        # over the signs and what each sign adds, (.., 1 + e); and standard deviations by cause.
        self._kept: dict[tuple[str, ...], Quadrature] = {}
        self._moments: dict[str, FloatArray] = {}
        self._products: dict[tuple[str, str], FloatArray] = {}
        self._shares: dict[str, dict[str, float]] = {}

    @cached_property
    def coefficient(self) -> float:
        """The drag coefficient that agrees with the response [N s/m]; 0 without drag."""
        if self._drag is None:
            return 0.0
        if self._given is not None:
            return self._given
        return consistent_coefficient(
            self._bare, self.controller, self.disturbances, self._drag, nodes=self._nodes
        )

    @cached_property
    def plant(self) -> LinearPlant:
        """The plant with its drag."""
        if self._drag is None:
            return self._bare
        return with_drag(self._bare, self._drag, self.coefficient)

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the closed loop [1/s], delays as Pade models."""
        return closed_loop_poles(self._modelled[0], self.controller)

    @cached_property
    def pole_region(self) -> PoleRegion:
        """Decay, damping and frequency of the closed loop's poles, without the delay models'."""
        return PoleRegion.of(self.poles, self._modelled[1])

    @cached_property
    def _modelled(self) -> tuple[LinearPlant, ComplexArray]:
        return with_delay_models(self.plant)

    @property
    def stable(self) -> bool:
        """Whether all poles lie in the left half plane."""
        return bool(self.poles.real.max(initial=-np.inf) < 0.0)

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
        return worst_margins(
            [
                loop_margins(partial(self.loop_gain, index=i), self.grid, gain, self._minima[i])
                for i, gain in enumerate(self.gains)
            ]
        )

    @cached_property
    def gains(self) -> list[ComplexArray]:
        """L of each loop on the grid, (k,) each."""
        return self._gains(self.grid)

    @cached_property
    def _minima(self) -> list[list[tuple[FloatArray, FloatArray]]]:
        """Places and values of the local minima of |1 + L| and of 1/|S - 1/2| of each loop."""
        return [
            least_distances(partial(self.loop_gain, index=i), self.grid, gain)
            for i, gain in enumerate(self.gains)
        ]

    @property
    def max_sensitivity(self) -> float:
        """M_s of the worst loop, as in `margins` but without the crossings."""
        return float(1.0 / min(least.min() for (_, least), _ in self._minima))

    def loop_gain(self, omega: FloatArray, index: int = 0) -> ComplexArray:
        """Return L of the loop broken at input `index`, (k,)."""
        return self._gains(np.asarray(omega, dtype=np.float64))[index]

    def response(self, output: str, disturbance: str, omega: FloatArray) -> ComplexArray:
        """Return the closed-loop response of `output` to `disturbance`, (k,)."""
        return np.asarray(self._responses([output], [disturbance], omega)[0, 0])

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
            nodes = self._kept.get(self.plant.outputs) or self._on([one, other])
            responses, shaken = self._all([one, other], nodes.omega)
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

        Parameters
        ----------
        size
            From frequencies [rad/s] and what the curve is there to its size, (k,) each.
        weight
            From frequencies [rad/s] to the weight there, zero where the size does not matter.
        edges
            Frequencies [rad/s] at which the weight has a kink or an end.
        channel
            Output and disturbance of the closed-loop response that is looked at, if one is.
        """

        def sizes(omega: FloatArray) -> FloatArray:
            curves: Sequence[ComplexArray]
            if channel is None:
                curves = [np.asarray(1.0 + gain) for gain in self._gains(omega)]
            else:
                curves = [self.response(*channel, omega)]
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

    def quadrature(self, outputs: Sequence[str], rtol: float = _RTOL) -> Quadrature:
        """Return nodes on which the variance and the second moment of `outputs` are accurate."""
        if self._nodes is not None:
            return self._nodes(self.poles)
        low, high, half_line = integration_band(self.disturbances, self.poles)
        return adaptive_nodes(
            lambda omega: np.concatenate(self._spectra(outputs, omega)),
            low,
            high,
            splits=[w for d in self.disturbances for w in d.splits],
            poles=_off_axis(self.poles),
            rtol=rtol,
            half_line=half_line,
        )

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
        responses, shaken = self._all(outputs, nodes.omega)
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
            self._kept[key] = self.quadrature(outputs)
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

    def _responses(
        self, outputs: Sequence[str], sources: Sequence[str], omega: FloatArray
    ) -> ComplexArray:
        """Return the closed-loop responses of outputs to disturbances, (z, w, k)."""
        if self._rational is None:
            return self._closed(outputs, sources, omega).responses
        found = LoopBlocks.of(self._rational.response(omega), outputs, sources)
        return found.zw

    def _closed(
        self, outputs: Sequence[str], sources: Sequence[str], omega: FloatArray
    ) -> LoopResponses:
        key = tuple(outputs)
        if key not in self._parts:
            self._parts[key] = self.plant.select(outputs=key)
        plant = self._parts[key]
        response = plant.response(plant.beside_poles(omega))
        return LoopResponses.of(response, self.controller, sources)

    @cached_property
    def _rational(self) -> LinearPlant | None:
        """The closed loop as a plant, finite at the poles of the open one; None if it is late."""
        return None if any(self.plant.delays) else closed_loop_plant(self.plant, self.controller)

    def _spectra(self, outputs: Sequence[str], omega: FloatArray) -> FloatArray:
        """Return what each disturbance alone makes of each output, (z, w, k)."""
        responses, shaken = self._all(outputs, omega)
        return np.asarray(np.abs(responses) ** 2 * shaken)

    def _all(self, outputs: Sequence[str], omega: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return the responses of outputs to all disturbances, (z, w, k), and densities (w, k)."""
        densities = np.array([d.density(omega) for d in self.disturbances])
        return self._responses(outputs, [d.name for d in self.disturbances], omega), densities

    def _gains(self, omega: FloatArray) -> list[ComplexArray]:
        """Return L of each loop, (k,) each."""
        loop = self._closed((), (), omega)  # no loop gain needs an output
        return [np.asarray(loop.difference(i) - 1.0) for i in range(len(self.plant.inputs))]


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


def consistent_coefficient(
    plant: LinearPlant,
    controller: LinearController,
    disturbances: Sequence[Disturbance],
    drag: DragElement,
    *,
    start: float | None = None,
    nodes: Nodes | None = None,
) -> float:
    """Return the drag coefficient [N s/m] that agrees with the closed loop's own velocity.

    Parameters
    ----------
    plant, controller, disturbances, drag, nodes
        As `Assessment` takes them.
    start
        A coefficient to begin with [N s/m]; by default that of the plant.

    Raises
    ------
    SolverError
        If no coefficient agrees: the loop is unstable with any drag.
    """

    @cache
    def loop(coefficient: float) -> Assessment:
        return Assessment(
            plant, controller, disturbances, drag=drag, coefficient=coefficient, nodes=nodes
        )

    at = np.nan  # the coefficient that the nodes are for
    plain = loop(drag.reference)  # the plant as it is, decomposed once for all

    def about(coefficient: float) -> Callable[[float], float]:
        nonlocal at
        at, calm, found = coefficient, np.inf, loop(coefficient).quadrature([drag.velocity])
        names = [*(d.name for d in disturbances), drag.force]
        *shaken, felt = plain._responses([drag.velocity], names, found.omega)[0]
        pairs = zip(disturbances, shaken, strict=True)
        density = np.sum([np.abs(v) ** 2 * d.density(found.omega) for d, v in pairs], axis=0)
        weights = found.weights * density

        def velocity(other: float) -> float:
            nonlocal calm  # the least drag known to do; more of it does too, as is checked below
            if other < calm:
                if not loop(other).stable:
                    return np.inf
                calm = other
            # More drag is a rank-one change of the closed loop (Woodbury).
            return float(np.sqrt(np.abs(1.0 + (other - drag.reference) * felt) ** -2 @ weights))

        return velocity

    begin = drag.reference if start is None else start
    found = None
    if nodes is None:
        try:
            found = settled_drag(drag.quadratic, about, begin)
        except SolverError:
            if any(d.band is None for d in disturbances):
                raise
            # On the verge of stability no cut finds a peak, but it is known where it stands.
            nodes = partial(_known_nodes, disturbances)
            loop.cache_clear()  # those are on no such nodes
    if found is None:
        # Nodes that do not adapt are as good for a loop with a little more drag, unless it is on
        # the verge of stability, where nothing but its own nodes sees how it swings.
        found = settled_drag(drag.quadratic, about, begin, settled=_SAME_NODES)
        damping = [PoleRegion.of(loop(C).poles).damping for C in (found, at)]
        if damping[0] < max(0.5 * damping[1], _VERGE):
            found = consistent_drag(drag.quadratic, lambda C: about(C)(C))
            about(found)
    if not loop(found).stable:
        raise SolverError(f"drag: the loop is unstable at {found:.4g} N s/m but not with less")
    return found


def _known_nodes(disturbances: Sequence[Disturbance], poles: ComplexArray) -> Quadrature:
    """Return nodes that are made from the poles of a loop [1/s] alone."""
    low, high, half_line = integration_band(disturbances, poles)
    splits = [w for d in disturbances for w in d.splits]
    return spectral_nodes(low, high, splits=splits, poles=_off_axis(poles), half_line=half_line)


def _off_axis(poles: ComplexArray) -> list[complex]:
    return [complex(p) for p in poles if abs(p.real) > 1e-12 * max(1.0, abs(p)) and p.imag >= 0.0]
