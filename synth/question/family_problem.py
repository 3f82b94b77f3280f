"""Several loops with one set of parameters: the problem of robust and of scheduled design.

    plants x seas -> FamilyLoop, FamilyLoop, ... -> FamilyProblem -> search

A scenario is a `Problem` of its own, with its occurrence and, for the regret, the best cost
that gains of its own would reach.  The parameters that are searched for are the same for all;
where gains follow a schedule, a *blend* makes each scenario's gains from them, so that
robust design and gain scheduling are one problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError, check_range

from ..loop import Coefficients, Disturbance
from ..structures import Parameter
from .problem import Problem, Values


class Objective(Enum):
    """What one set of gains is to make small over all scenarios."""

    WORST = "worst"
    MEAN = "mean"
    REGRET = "regret"

    @classmethod
    def of(cls, name: str | Objective) -> Objective:
        """Return the objective of a name.

        Raises InputError if there is none of that name.
        """
        if isinstance(name, Objective):
            return name
        try:
            return cls(name)
        except ValueError:
            names = ", ".join(o.value for o in cls)
            raise InputError(f"objective: must be one of {names}, got {name!r}") from None


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilyLoop:
    """One loop of a family."""

    name: str  #: How reports call it.
    problem: Problem  #: Its plant, disturbances and limits.
    weight: float = 1.0  #: Its occurrence; only ratios count.
    best: float = 1.0  #: The least cost that parameters of its own would reach, for the regret.
    #: Its parameters as a matrix times the searched ones, (own, searched); None: the same.
    blend: FloatArray | None = None

    def __post_init__(self) -> None:
        check_range("scenario", "weight", self.weight, low=0.0)
        check_range("scenario", "best", self.best, low=0.0, open_low=True)

    def values(self, searched: Values) -> FloatArray:
        """Return the scenario's own parameters."""
        given = np.asarray(searched, dtype=np.float64)
        return given if self.blend is None else np.asarray(self.blend @ given, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilyProblem:
    """Scenarios with one set of searched parameters, and what is made small.

    Raises InputError if there is no scenario, no weight, or the numbers of parameters disagree.
    """

    scenarios: tuple[FamilyLoop, ...]  #: At least one.
    #: Worst cost, root of the occurrence-weighted mean square, or worst ratio to `best`.
    objective: Objective = Objective.WORST
    #: The searched parameters; by default those of the first scenario's law.
    parameters: tuple[Parameter, ...] = ()

    def __post_init__(self) -> None:
        if not self.scenarios:
            raise InputError("family: must have at least one scenario, got none")
        if not self.parameters:
            object.__setattr__(self, "parameters", self.scenarios[0].problem.law.parameters)
        if not any(s.weight > 0.0 for s in self.scenarios):
            raise InputError("family: at least one scenario must have a weight above 0")
        for scenario in self.scenarios:
            own = len(scenario.problem.law.parameters)
            found = (own, own) if scenario.blend is None else scenario.blend.shape
            if found != (own, len(self.parameters)):
                raise InputError(
                    f"family: scenario {scenario.name} must make its {own} parameters of the "
                    f"{len(self.parameters)} searched ones, got a blend of shape {found}"
                )

    @classmethod
    def of(cls, asked: FamilyProblem | Problem) -> FamilyProblem:
        """Return a family, that of one problem where it is asked about one."""
        if isinstance(asked, FamilyProblem):
            return asked
        return cls(scenarios=(FamilyLoop(name="", problem=asked),))

    @cached_property
    def scales(self) -> FloatArray:
        """Typical sizes of the searched parameters."""
        return np.array([p.scale for p in self.parameters])

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Scenarios that share one loop and differ in what shakes it, by index.

        With drag or losses no two share a loop: their coefficients follow the sea.
        """
        found: dict[tuple[object, ...], list[int]] = {}
        for i, scenario in enumerate(self.scenarios):
            problem, blend = scenario.problem, scenario.blend
            loop_limits = tuple(lim for lim in problem.limits if not lim.drive)
            key: tuple[object, ...] = (id(problem.plant), loop_limits)
            key += (None if blend is None else blend.tobytes(),)
            found.setdefault((i,) if problem.elements else key, []).append(i)
        return tuple(tuple(members) for members in found.values())

    def shaken_by_all(self, group: Sequence[int]) -> Problem:
        """Return a group's first problem, shaken by what shakes any of the group."""
        problems = [self.scenarios[i].problem for i in group]
        if len(problems) == 1:
            return problems[0]
        every = [d for problem in problems for d in problem.disturbances]
        names = dict.fromkeys(d.name for d in every)
        summed = tuple(_summed([d for d in every if d.name == name]) for name in names)
        return replace(problems[0], disturbances=summed)

    def stable(
        self, values: Values, coefficients: Sequence[Coefficients | None] | None = None
    ) -> bool:
        """Return whether every loop is stable."""
        for group in self.groups:
            scenario = self.scenarios[group[0]]
            coefficient = None if coefficients is None else coefficients[group[0]]
            if not scenario.problem.stable(scenario.values(values), coefficient):
                return False
        return True

    def abscissa(self, values: Values, enough: float = np.inf) -> float:
        """Return the largest `Problem.abscissa` of all loops; from `enough` on any such value.

        Of a loop that swings by itself it is that without drag.
        """
        largest = -np.inf
        for group in self.groups:
            scenario = self.scenarios[group[0]]
            for found in scenario.problem.abscissas(scenario.values(values)):
                largest = max(largest, found)
                if largest >= enough:
                    return largest
        return largest

    def growth(self, values: Values) -> float:
        """Return the largest real part of any loop's lively poles [1/s], with drag and without."""
        found: list[ComplexArray] = []
        for scenario in (self.scenarios[group[0]] for group in self.groups):
            problem = scenario.problem
            asked = [None, problem.nothing] if problem.dragged else [None]
            found += problem.lively_poles(scenario.values(values), *asked)
        return max(float(poles.real.max(initial=-np.inf)) for poles in found)

    def total(self, costs: Sequence[float] | FloatArray) -> float:
        """Return what the objective makes of the scenarios' costs."""
        values = np.asarray(costs, dtype=np.float64)
        if self.objective is Objective.WORST:
            return float(values.max())
        if self.objective is Objective.REGRET:
            return float((values / [s.best for s in self.scenarios]).max())
        weights = np.array([s.weight for s in self.scenarios])
        return float(np.sqrt(weights @ values**2 / weights.sum()))


def _summed(parts: Sequence[Disturbance]) -> Disturbance:
    """Return the disturbance whose density is the sum of several."""
    bands = [d.band for d in parts if d.band is not None]

    def density(omega: FloatArray) -> FloatArray:
        return np.asarray(np.sum([d.density(omega) for d in parts], axis=0), dtype=np.float64)

    whole = (min(b[0] for b in bands), max(b[1] for b in bands)) if bands else None
    return Disturbance(
        name=parts[0].name,
        density=density,
        band=whole if len(bands) == len(parts) else None,
        splits=tuple(sorted({w for d in parts for w in d.splits})),
    )
