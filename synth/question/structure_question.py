"""`StructureQuestion`: a case and a structure, with sensors and noise, as a synthesis problem.

    Case, name -> StructureQuestion -> Problem

The sea, the errors of the reference unit and the noise of the sensors are disturbances in one
cost, so that no gain grows without a price.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import White
from models.case import Case
from models.plant import LinearPlant
from models.sensing import SAMPLE_TIME, sensed_plant, sensed_spectra

from ..limits import HOOK, PAYLOAD, Limit, LowFrequency, drive_limits
from ..loop import disturbances
from ..structures import LowOrderFeedback, ParametrisedController, WinchStructure, structure_named
from .problem import Problem
from .question import DesignQuestion, pose, with_masses

_LATE = 0.2  # delay beyond which the guard's model of it needs a higher order [s]
_HIGH_ORDER = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledNoise:
    """White noise as samples carry it: the density of white noise, up to pi/T [rad/s].

    Its variance is that of the samples, so that what a direct gain makes of it has one too.
    """

    intensity: float
    sample_time: float = SAMPLE_TIME

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the variance [rad/s]."""
        return 1e-5 / self.sample_time, np.pi / self.sample_time

    @property
    def splits(self) -> tuple[float, ...]:
        """No kinks."""
        return ()

    def density(self, omega: Any) -> Any:
        """Return the one-sided density per rad/s at `omega` [rad/s]."""
        return White(self.intensity).density(omega)


@dataclass(frozen=True, kw_only=True, eq=False)
class _LateProblem(Problem):
    """A problem whose delay is so long that the guard of the search needs more of it."""

    @cached_property
    def rational(self) -> LinearPlant:
        """The plant with Pade models of high order for its delays."""
        return self.plant.without_delays(_HIGH_ORDER)


@dataclass(frozen=True, kw_only=True, eq=False)
class StructureQuestion:
    """A case and a structure as `synth.search.multistart` sees them.

    Attributes
    ----------
    question
        The case as `synth.design.optimise` sees it: limits, drag, what there is before
        compensation.
    structure
        The structure.
    plant
        The plant with the sensors that the structure hears.
    spectra
        What shakes it, by name of the disturbance.
    limits, drive, reported
        Limits of the loop, limits of the drive, and limits that are reported only.
    """

    question: DesignQuestion
    structure: WinchStructure | LowOrderFeedback
    plant: LinearPlant
    spectra: Mapping[str, Any]
    limits: tuple[Limit, ...]
    drive: tuple[Limit, ...]
    reported: tuple[Limit, ...]

    @cached_property
    def law(self) -> ParametrisedController:
        """The structure, bound to the plant."""
        return self.structure.bind(self.plant)

    def problem(self, limits: Sequence[Limit]) -> Problem:
        """Return the problem with some limits."""
        late = max(self.plant.delays, default=0.0) > _LATE
        return (_LateProblem if late else Problem)(
            plant=self.plant,
            law=self.law,
            disturbances=disturbances(self.spectra, self.plant.independent_disturbances),
            minimise={PAYLOAD: 1.0},
            limits=tuple(limits),
            drag=self.question.drag,
        )


def pose_structure(case: Case, name: str, masses: int | None = None) -> StructureQuestion:
    """Return the question of a case and a structure.

    A structure that does not hear the payload cannot do anything about its slow drift with the
    ship: for it the limit on slow motion is reported only.

    Parameters
    ----------
    case
        The case.
    name
        Name of the structure, see `synth.structures.winch_structures.structure_names`.
    masses
        Rope masses; by default the case's, or those below 40 rad/s.
    """
    structure = structure_named(name, case)
    question = pose(case)
    if masses is not None and masses != question.masses:
        question = with_masses(question, masses)
    full = sensed_plant(case, masses=question.masses, drag=question.drag_before)
    plant = full.select(measurements=structure.measurements)
    heard = set(structure.measurements)
    spectra = {
        source: SampledNoise(intensity=value.intensity) if isinstance(value, White) else value
        for source, value in sensed_spectra(case, question.hook).items()
        if source == HOOK
        or (source == "mru.error" and "mru.heave" in heard)
        or source.removesuffix("_noise") in heard
    }
    drive = drive_limits(case, plant) if case.limits.drive == "enforce" else ()
    names = {limit.name for limit in drive}
    loop = [limit for limit in question.limits if limit.name not in names]
    slow = [lim for lim in loop if isinstance(lim, LowFrequency) and not structure.hears_payload]
    return StructureQuestion(
        question=question,
        structure=structure,
        plant=plant,
        spectra=spectra,
        limits=tuple(limit for limit in loop if limit not in slow),
        drive=drive,
        reported=(*slow, *question.reported),
    )
