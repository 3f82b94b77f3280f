"""A fixed design on a case that changes: `FixedDesign`.

    Design -> FixedDesign -> closed loop on any case, with any gain moved

The controller is that of the design whatever the case becomes: sensitivity is about a world that
differs from the one designed for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, InputError, SolverError
from models.case import Case
from models.hook import HookMotion
from models.plant import PlantData
from models.sensing import sensed_plant

from ..design import Design
from ..loop import Assessment, Disturbance, DragElement, disturbances
from ..question import heard_spectra
from ..structures import ParametrisedController
from .differences import derivative
from .fields import numbers_of


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedDesign:
    """A design as sensitivity sees it.

    Attributes
    ----------
    case, masses
        The case that the figures hold for, and its rope masses.
    law, names, values, units
        The structure bound to its plant, its parameters' names, values and units.
    measurements
        What it hears of the plant with all sensors.
    reference
        The drag before compensation [N s/m]: where a consistent drag is counted from.
    drag
        The design's own drag coefficient [N s/m], which is that of the unchanged case.
    """

    case: Case
    masses: int
    law: ParametrisedController
    names: tuple[str, ...]
    values: tuple[float, ...]
    units: Mapping[str, str]
    measurements: tuple[str, ...]
    reference: float
    drag: float | None

    @property
    def stochastic(self) -> bool:
        """Whether the drag is linearised with the response."""
        quadratic = PlantData.from_case(self.case).quadratic_drag
        return self.case.payload.fixed_drag is None and quadratic > 0.0

    @property
    def fixed_drag(self) -> float:
        """The case's own linear drag, if it gives one [N s/m]."""
        return self.case.payload.fixed_drag or 0.0

    @property
    def shaken_by(self) -> tuple[str, ...]:
        """Sections of the case that the disturbances' spectra depend on."""
        return ("sea.", "vessel.", "sensors.")

    @cached_property
    def disturbances(self) -> tuple[Disturbance, ...]:
        """What shakes the plant."""
        return self.disturbances_of(self.case)

    def disturbances_of(self, case: Case) -> tuple[Disturbance, ...]:
        """Return what shakes the plant of a changed case."""
        hook = HookMotion.from_case(case, warn=False)
        spectra = heard_spectra(case, hook, self.measurements)
        return disturbances(spectra, tuple(spectra))

    def assessment(
        self, case: Case | None = None, *, gain: str | None = None, factor: float = 1.0
    ) -> Assessment | None:
        """Return the closed loop on a case, a gain times a factor; None if it is unstable."""
        here = self.case if case is None else case
        values = [
            value * (factor if name == gain or gain == "A" else 1.0)
            for name, value in zip(self.names, self.values, strict=True)
        ]
        if gain is not None and gain != "A" and gain not in self.names:
            raise InputError(f"sensitivity: there is no gain {gain!r}; there are: {self.names}")
        quadratic = PlantData.from_case(here).quadratic_drag
        stochastic = here.payload.fixed_drag is None and quadratic > 0.0
        start = self.reference if stochastic else here.payload.fixed_drag or 0.0
        plant = sensed_plant(here, masses=self.masses, drag=start)
        plant = plant.select(measurements=self.measurements)
        drag = DragElement(quadratic=quadratic, reference=start) if stochastic else None
        assessment = Assessment(
            plant,
            self.law.controller(values),
            self.disturbances if case is None else self.disturbances_of(here),
            drag=drag,
            coefficient=self.drag if case is None and gain is None else None,
        )
        try:
            return assessment if assessment.stable else None
        except SolverError:
            return None  # no drag agrees: unstable with any

    def with_number(self, path: str, factor: float) -> FixedDesign | None:
        """Return the same design with a number of its case, or a gain, times a factor."""
        if path.startswith("gains."):
            name = path.removeprefix("gains.")
            values = [
                value * (factor if known == name else 1.0)
                for known, value in zip(self.names, self.values, strict=True)
            ]
            return replace(self, values=tuple(values), drag=None)
        number = next(n for n in numbers_of(self.case) if n.path == path)
        try:
            case = self.case.variant(number.change(number.value * factor))
        except InputError:
            return None  # at the end of its range
        return replace(self, case=case, drag=None)

    def law_slopes(self, s: ComplexArray) -> Iterator[tuple[str, float, ComplexArray]]:
        """Yield name, value and the slope of C(s) of every parameter that is not zero."""
        for name, value in zip(self.names, self.values, strict=True):
            if value != 0.0:
                yield name, value, self.law_slope(name, s)

    def law_slope(self, name: str, s: ComplexArray) -> ComplexArray:
        """Return the slope of C(s) in a parameter, (k, nu, ny)."""
        at = self.names.index(name)

        def response(value: float) -> ComplexArray:
            values = list(self.values)
            values[at] = value
            return self.law.controller(values).response_at(s)

        return np.asarray(derivative(response, self.values[at], common=True), np.complex128)


def fixed_design(design: Design) -> FixedDesign:
    """Return a design as sensitivity sees it."""
    question = design.question
    return FixedDesign(
        case=design.sea_case,
        masses=design.masses,
        law=question.law,
        names=tuple(p.name for p in question.law.parameters),
        values=tuple(question.values(design.parameters)),
        units=design.units,
        measurements=design.measurements,
        reference=question.drag_before,
        drag=design.drag if question.drag is not None else None,
    )
