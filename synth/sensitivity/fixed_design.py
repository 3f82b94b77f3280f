"""A fixed design on a case that changes: `FixedDesign`.

    Design -> FixedDesign -> closed loop on its case, or with a number or a gain moved

The controller is that of the design whatever the case becomes: sensitivity is about a world that
differs from the one designed for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from models.basics import InputError, SolverError
from models.case import Case
from models.hook import HookMotion
from models.plant import LinearPlant, PlantData, build_plant

from ..design import Design
from ..loop import Assessment, Coefficients, Element, disturbances
from ..question import equivalent_elements, heard_spectra, loaded_plant
from ..structures import ParametrisedController
from .fields import numbers_of


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedDesign:
    """A design as sensitivity sees it."""

    design: Design  #: The design, whose structure stays bound to the plant that it was made for.
    #: The case that the figures hold for, and the structure's parameters.
    case: Case
    values: tuple[float, ...]
    #: Coefficients of the elements that are linearised with the response, where they are known: on
    #: the unchanged case.
    known: Coefficients | None

    @classmethod
    def of(cls, design: Design) -> FixedDesign:
        """Return a design on its own case."""
        question = design.question
        return cls(
            design=design,
            case=design.sea_case,
            values=tuple(question.values(design.parameters)),
            known=question.coefficients_of(design.drag, design.friction),
        )

    @property
    def law(self) -> ParametrisedController:
        """The structure."""
        return self.design.question.law

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(p.name for p in self.law.parameters)

    @property
    def stochastic(self) -> bool:
        """Whether the drag is linearised with the response."""
        quadratic = PlantData.from_case(self.case).quadratic_drag
        return self.case.payload.fixed_drag is None and quadratic > 0.0

    @property
    def fixed_drag(self) -> float:
        """The case's own linear drag, if it gives one [N s/m]."""
        return self.case.payload.fixed_drag or 0.0

    def assessment(self, shaken: Case | None = None) -> Assessment | None:
        """Return the closed loop, shaken by its own or another case's sea; None if unstable."""
        shaken = shaken or self.case
        hook = HookMotion.from_case(shaken, warn=False)
        spectra = heard_spectra(shaken, hook, self.design.measurements)
        plant, elements = self._plant
        assessment = Assessment(
            plant,
            self.law.controller(list(self.values)),
            disturbances(spectra, tuple(spectra)),
            elements=elements,
            coefficients=self.known,
        )
        try:
            return assessment if assessment.stable else None
        except SolverError:
            return None  # no drag agrees: unstable with any

    @cached_property
    def _plant(self) -> tuple[LinearPlant, tuple[Element, ...]]:
        """The plant, and what of it is linearised with the response."""
        # Where a consistent drag is counted from: that before compensation.
        start = self.design.question.drag_before if self.stochastic else self.fixed_drag
        data = PlantData.from_case(self.case)
        model = build_plant(data, self.design.masses)
        plant = loaded_plant(self.case, data, model, start, self.design.measurements)
        hook = HookMotion.from_case(self.case, warn=False)
        return plant, equivalent_elements(self.case, data, hook, plant, start)

    def with_number(self, path: str, factor: float) -> FixedDesign | None:
        """Return the same design with a number of its case, or a gain, times a factor.

        None at the end of the number's range.  The amplifier ``gains.A`` moves all gains.

        Raises InputError if there is no such number or gain.
        """
        if path.startswith("gains."):
            gain = path.removeprefix("gains.")
            if gain != "A" and gain not in self.names:
                raise InputError(f"sensitivity: there is no gain {gain!r}; there are: {self.names}")
            pairs = zip(self.names, self.values, strict=True)
            values = (value * factor if gain in (name, "A") else value for name, value in pairs)
            return replace(self, values=tuple(values), known=None)
        number = next((n for n in numbers_of(self.case) if n.path == path), None)
        if number is None:
            raise InputError(f"sensitivity: there is no number {path!r} in the case")
        try:
            case = self.case.variant(number.change(number.value * factor))
        except InputError:
            return None
        return replace(self, case=case, known=None)
