"""The problem of synthesis: plant, structure, disturbances, weights and limits."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray
from models.plant import LinearPlant

from ..limits import Limit
from ..loop import (
    DECAY,
    Assessment,
    Coefficients,
    Disturbance,
    Element,
    LinearController,
    LoopBlocks,
    abscissa,
    lively_poles,
    with_delay_models,
    with_elements,
    without_losses,
)
from ..structures import ParametrisedController

Values = Sequence[float] | FloatArray

_SLOW = 1e-4  # no real pole slower than this share of the plant's slowest one


class Goal(Enum):
    """What a programme looks for."""

    COST = "least variance within the limits"
    SEA = "largest disturbance for which the limits can be kept"
    RELAX = "least factor on the chosen limits for which they can be kept"
    FEASIBLE = "least violation of the limits"


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """The question: plant, law, what shakes it, what is minimised, what limits it."""

    plant: LinearPlant
    law: ParametrisedController
    disturbances: tuple[Disturbance, ...]
    minimise: dict[str, float]
    limits: tuple[Limit, ...]
    elements: tuple[Element, ...] = ()

    @cached_property
    def slow_point(self) -> float:
        """Point -decay on the real axis that no closed-loop pole may pass [1/s]."""
        sizes = np.abs(self.plant.poles())
        return -_SLOW * float(sizes[sizes > 1e-6 * sizes.max(initial=1.0)].min(initial=1.0))

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs that cost, limits and elements speak of."""
        wanted = {*self.minimise, *(output for limit in self.limits for output in limit.signals)}
        return tuple(sorted(wanted | {element.velocity for element in self.elements}))

    @cached_property
    def modelled(self) -> tuple[LinearPlant, ComplexArray]:
        """The plant with Pade models for its delays, and the poles of these models [1/s]."""
        return with_delay_models(self.plant)

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """Names of the disturbances that shake the plant, then of others that limits speak of."""
        spoken = [limit.channel[1] for limit in self.limits if limit.channel is not None]
        return tuple(dict.fromkeys([*(d.name for d in self.disturbances), *spoken]))

    @cached_property
    def _channels(self) -> tuple[LinearPlant, list[str]]:
        """What margins need of the plant, and the disturbances that limits on them speak of."""
        channels = [limit.channel for limit in self.limits if limit.channel is not None]
        outputs = dict.fromkeys(output for output, _ in channels)
        opened = _opened(self.plant, self.elements)
        return opened.select(outputs=[*outputs]), [*dict.fromkeys(w for _, w in channels)]

    def blocks(self, s: npt.ArrayLike) -> LoopBlocks:
        """Return what the plant's loop is closed about at points `s` [1/s], elements too."""
        opened = _opened(self.plant, self.elements)
        return LoopBlocks.of(opened.response_at(s), self.outputs, self.sources)

    def margin_blocks(self, s: npt.ArrayLike) -> LoopBlocks:
        """Return as much of `blocks` as the limits on the loop need."""
        plant, sources = self._channels
        return LoopBlocks.of(plant.response_at(s), sources=sources)

    @property
    def begin(self) -> tuple[float, ...]:
        """Coefficients of the elements of usual size."""
        return tuple(element.begin for element in self.elements)

    @property
    def nothing(self) -> list[float]:
        """Coefficients of a loop without its elements."""
        return [0.0] * len(self.elements)

    @property
    def dragged(self) -> bool:
        """Whether there is drag that vanishes in small motion."""
        return any(element.lasting for element in self.elements)

    def coefficients_in(self, variance: Callable[[str], Any]) -> list[Any]:
        """Return the coefficients that variances of the elements' velocities ask for."""
        return [element.coefficient(variance(element.velocity)) for element in self.elements]

    def still(self, coefficients: Coefficients) -> list[float]:
        """Return coefficients without those of losses."""
        return without_losses(self.elements, coefficients)

    def loop_poles(self, values: Values, coefficients: Coefficients | None = None) -> ComplexArray:
        """Return the closed loop's poles [1/s], delays as Pade models."""
        matrix = self.loop_matrix(self.modelled[0], values, coefficients)
        return np.asarray(np.linalg.eigvals(matrix), dtype=np.complex128)

    def loop_matrix(
        self, plant: LinearPlant, values: Values, coefficients: Coefficients | None = None
    ) -> FloatArray:
        """Return the closed loop's state matrix on a rational model of the plant."""
        if coefficients is not None:
            plant = with_elements(plant, self.elements, coefficients)
        return self.law.closed_loop_matrix(plant, [float(v) for v in values])

    def lively_poles(self, values: Values, *asked: Coefficients | None) -> Iterator[ComplexArray]:
        """Yield the closed loop's poles [1/s] for sets of coefficients, each when it is asked for.

        Without damped poles of the plant that no loop moves: what stability is asked of.
        """
        controller = _controller(self.law, tuple(map(float, values)))
        references = [element.reference for element in self.elements]
        for coefficients in asked:
            known = references if coefficients is None else coefficients
            yield lively_poles(self.plant, controller, self.elements, tuple(map(float, known)))

    def growth(self, values: Values) -> float:
        """Return the largest real part of a closed-loop pole [1/s], drag as the plant holds it."""
        return float(self.loop_poles(values).real.max(initial=-np.inf))

    def abscissas(self, values: Values) -> Iterator[float]:
        """Yield `abscissa`, then that without drag if the loop swings by itself there."""
        found = map(abscissa, self.lively_poles(values, None, self.nothing))
        yield next(found)
        if self.dragged and (calm := next(found)) > DECAY:
            yield calm

    def abscissa(self, values: Values, coefficients: Coefficients | None = None) -> float:
        """Return the largest real part of a lively pole over the size of the largest."""
        return abscissa(next(self.lively_poles(values, coefficients)))

    def stable(self, values: Values, coefficients: Coefficients | None = None) -> bool:
        """Return whether the closed loop is stable, with these coefficients and in small motion."""
        asked = dict.fromkeys(self._sides(coefficients), -DECAY)
        if self.dragged:
            asked.setdefault(tuple(self.nothing), DECAY)
        found = self.lively_poles(values, *asked)
        return all(
            abscissa(poles) < most for poles, most in zip(found, asked.values(), strict=True)
        )

    def _sides(self, coefficients: Coefficients | None) -> list[tuple[float, ...] | None]:
        """Return the coefficients given, and those without losses if they are others."""
        if coefficients is None:
            return [None]
        return [*dict.fromkeys([tuple(coefficients), tuple(self.still(coefficients))])]

    def assess(self, values: Values, coefficients: Coefficients | None = None) -> Assessment:
        """Return the closed loop in numbers, its elements solved for where nothing is given."""
        return Assessment(
            self.plant,
            self.law.controller([float(v) for v in values]),
            self.disturbances,
            elements=self.elements,
            coefficients=coefficients,
        )


# Problems that differ in limits or shaking alone have these in common.
@lru_cache(maxsize=16)
def _opened(plant: LinearPlant, elements: tuple[Element, ...]) -> LinearPlant:
    """Return a plant with its elements' loops open, their inputs and measurements the last."""
    for element in elements:
        plant = plant.opened(element.velocity, element.force)
    return plant


@lru_cache(maxsize=16)
def _controller(law: ParametrisedController, values: tuple[float, ...]) -> LinearController:
    """Return a controller, the same if asked again: a step asks for its poles more than once."""
    return law.controller(values)
