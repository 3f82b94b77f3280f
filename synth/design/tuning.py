"""Tuning of a controller structure on any linear plant: `tune`, the entry point of synthesis.

    plant + structure + spectra + weights + limits -> Problem -> search -> Tuning

Here the question is checked and the answer is put into words; the work is done in
`synth.search.multistart`.  Nothing unstable and nothing that breaks a limit leaves as a success.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import (
    InputError,
    SolverError,
    White,
    check_range,
    digits_apart,
    one_thread,
    shows_progress,
)
from models.plant import LinearPlant

from ..bound import lqg_bound
from ..limits import Limit, Rms
from ..loop import Assessment, DragElement, LinearController, Margins, disturbances
from ..question import FamilyLoop, FamilyProblem, Objective, Problem
from ..search import KEPT, Found, Progress, Start, search, with_bests
from ..structures import Fixed, Structure
from ..verify import Verification, verify_tuning


@dataclass(frozen=True, kw_only=True)
class LimitUse:
    """How a design uses one limit."""

    name: str
    #: In `unit`.
    value: float
    bound: float
    use: float  #: Share of the limit that is used; above 1 it is broken.
    #: What the cost (in its own unit) would fall by if the bound were one percent looser; 0 where
    #: the limit does not bind.
    price: float = 0.0
    unit: str = ""
    enforced: bool = True  #: Whether the optimiser had to keep it.

    @property
    def kept(self) -> bool:
        """Whether the limit is kept."""
        return self.use <= 1.0 + KEPT


_FEW = 4  # starts that reached an answer to be relied on


@dataclass(frozen=True, kw_only=True)
class LqgFigure:
    """The best possible cost of a question, and why it is not known where it is None."""

    cost: float | None
    note: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuning:
    """The answer of `tune`, with the question it answers."""

    problem: Problem
    ok: bool  #: Stable, all limits kept, converged and checked.
    status: str  #: The sentence for the user.
    cost: float  #: Square root of the weighted variance, in the unit of the outputs.
    #: Parameters of the structure by name, those that were fixed among them.
    parameters: Mapping[str, float]
    controller: LinearController | None  #: The controller in state space, u = +C y.
    margins: Margins | None  #: Stability margins, refined (`synth.loop.margins`).
    limits: Mapping[str, LimitUse]  #: Use of each limit by name.
    starts: tuple[Start, ...] = ()  #: All starts of the search.
    agreed: int = 0  #: How many starts ended within 1e-4 of the best cost.
    #: Those of the problem's elements that agree with the response: of the drag [N s/m], if drag
    #: was asked for.
    coefficients: tuple[float, ...] = ()
    #: The same controller on each further plant that it was tuned for.
    members: tuple[Tuning, ...] = ()
    #: The closed loop in numbers; None if no stable one was found.
    assessment: Assessment | None = field(repr=False)
    found: Found = field(repr=False)  #: The search's raw answer.

    @cached_property
    def lqg(self) -> LqgFigure:
        """The best possible with this plant, these spectra and measurements (`synth.bound`).

        No linear controller of any order costs less, whatever its margins: of the limits those on
        an rms count.  Drag is that of the answer.  It is worked out when first asked for, and
        stands in `str` from then on.
        """
        problem, view = self.problem, self.assessment
        if view is None:
            return LqgFigure(cost=None, note="no stabilising controller is known")
        # A spectrum that is white is told by where its density comes from.
        origins = {d.name: (getattr(d.density, "__self__", None), d) for d in problem.disturbances}
        spectra = {
            name: origin if isinstance(origin, White) else d
            for name, (origin, d) in origins.items()
        }
        limits = {limit.output: limit.bound for limit in problem.limits if isinstance(limit, Rms)}
        try:
            found = lqg_bound(view.plant, spectra, problem.minimise, limits)
        except (InputError, SolverError) as reason:
            return LqgFigure(cost=None, note=str(reason))
        if not found.feasible:
            return LqgFigure(cost=None, note="no linear controller keeps the limits")
        return LqgFigure(cost=found.value)

    def verify(self) -> Verification:
        """Check everything that is claimed, on every plant, by code that the search did not use."""
        return verified_members([verify_tuning(one) for one in (self, *self.members)])

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [f"Tuning: {self.status}", f"├ cost {self.cost:.6g}"]
        if (lqg := vars(self).get("lqg")) is not None:  # known already
            best = f"{lqg.cost:.6g}" if lqg.cost is not None else f"not known: {lqg.note}"
            lines.append(f"├ best possible, whatever the margins: {best}")
        lines += [f"├ {name} = {value:.6g}" for name, value in self.parameters.items()]
        lines += [f"├ {u.name}: {100 * u.use:.1f} % of {u.bound:g}" for u in self.limits.values()]
        if self.margins is not None:
            m = self.margins
            lines.append(f"├ M_s {m.max_sensitivity:.3f}, delay margin {m.delay:.4g} s")
        for k, member in enumerate(self.members):
            peak = "" if member.margins is None else f", M_s {member.margins.max_sensitivity:.3f}"
            lines.append(f"├ plant {k + 2}: cost {member.cost:.6g}{peak}")
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)


@shows_progress("searching")
def tune(
    plant: LinearPlant | Sequence[LinearPlant],
    structure: Structure,
    *,
    spectrum: Mapping[str, Any],
    minimise: Mapping[str, float],
    limits: Sequence[Limit] = (),
    starts: int = 16,
    seed: int = 0,
    drag: DragElement | None = None,
    guesses: Sequence[Sequence[float]] = (),
    fixed: Mapping[str, float] | None = None,
    objective: str = "worst",
    progress: Progress | None = None,
) -> Tuning:
    """Return the controller of a structure that minimises a weighted variance within limits.

    Parameters
    ----------
    plant
        Any linear plant with named signals; delays of its measurements are taken exactly.  Or
        several with the same signals, for one controller that keeps the limits on all of them.
    structure
        `StaticGain`, `PayloadFeedback`, `LowOrder` or a structure of your own (`Structure`).
    spectrum
        One-sided spectra of disturbances by name: a callable of omega [rad/s], a table
        (omega, density), an object with ``density`` and ``band``, or `White`.
    minimise
        Weights on the variances of performance outputs by name.
    limits
        What may not be exceeded, see `synth.limits.limits`.
    starts
        How many starts are drawn, at least 1; some more go roughly where they lead.
    seed
        Seed of the Sobol set; the same seed gives the same answer.
    drag
        A quadratic drag to be linearised consistently with the response.
    guesses
        Vectors of the free parameters to start from, before any that are drawn.
    fixed
        Parameters of the structure that are held, by name; the others are searched.
    objective
        Of several plants: ``worst`` for the least worst cost, ``mean`` for the least root of the
        mean square, ``regret`` for the least worst ratio to what a controller for that plant alone
        would reach.
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    Tuning
        Of the first plant, with the others as its `members`; ``ok`` false and a status that says
        why if no design was found that is stable and within the limits on every plant.

    Raises
    ------
    InputError
        If a name is unknown, a weight is negative, there is nothing to minimise or to search, or
        the plants differ in their signals.
    """
    if fixed:
        structure = Fixed(structure=structure, values=fixed)
    plants = (plant,) if isinstance(plant, LinearPlant) else tuple(plant)
    if not plants:
        raise InputError("tune: plant must be a plant, or at least one, got none")
    for name in ("inputs", "measurements"):
        if len({getattr(one, name) for one in plants}) > 1:
            raise InputError(f"tune: plant: all must have the same {name}")
    wanted = Objective.of(objective)
    problems = [_problem(one, structure, spectrum, minimise, limits, drag) for one in plants]
    loops = (
        FamilyLoop(name=f"plant {k + 1}", problem=replace(problem, law=problems[0].law))
        for k, problem in enumerate(problems)
    )
    check_range("tune", "starts", starts, low=1)
    with one_thread():
        family = FamilyProblem(scenarios=tuple(loops), objective=wanted)
        if wanted is Objective.REGRET:
            family = with_bests(family, seed, guesses, progress)
        answer = tuning_of(family, search(family, int(starts), seed, guesses, progress))
    few = few_starts(answer.agreed, len(answer.starts)) if answer.ok else ""
    return replace(answer, status=f"{answer.status}; {few}" if few else answer.status)


def limit_uses(
    limits: Sequence[Limit],
    assessment: Assessment,
    prices: Mapping[str, float],
    *,
    enforced: bool = True,
) -> dict[str, LimitUse]:
    """Return the use of each limit by name; `prices` are in units of the cost per percent."""
    uses = {}
    for limit in limits:
        value = limit.worst(assessment)
        uses[limit.name] = LimitUse(
            name=limit.name,
            value=value,
            bound=limit.bound,
            use=limit.use(value),
            price=prices.get(limit.name, 0.0),
            unit=limit.unit,
            enforced=enforced,
        )
    return uses


def tuning_of(asked: FamilyProblem | Problem, found: Found) -> Tuning:
    """Return what a search found as an answer in words and numbers, with one for each member."""
    family = FamilyProblem.of(asked)
    first = family.scenarios[0].problem
    if found.solved is None or not found.assessments:
        return Tuning(
            problem=first,
            ok=False,
            status="no stabilising controller of this structure was found",
            cost=np.inf,
            parameters={},
            controller=None,
            margins=None,
            limits={},
            starts=found.starts,
            assessment=None,
            found=found,
        )
    every = [_of_member(family, found, i) for i in range(len(family.scenarios))]
    ok = all(member.ok for member in every)
    status = _status(ok, every, family)
    members = tuple(replace(member, ok=ok, status=status) for member in every[1:])
    return replace(
        every[0],
        ok=ok,
        status=status,
        starts=found.starts,
        agreed=found.agreed,
        members=members,
        found=found,
    )


def _of_member(family: FamilyProblem, found: Found, index: int) -> Tuning:
    """Return what the answer for a family is for one member alone."""
    scenario = family.scenarios[index]
    problem, own = scenario.problem, found.member(index, scenario)
    assessment, solved = own.assessments[0], own.solved
    assert solved is not None
    cost = float(np.sqrt(sum(w * assessment.sigma(o) ** 2 for o, w in problem.minimise.items())))
    # The programme prices the logarithm of the cost per logarithm of the bound.
    prices = {name: 0.01 * abs(price) * cost for name, price in solved.prices[0].items()}
    kept = assessment.stable and solved.converged and found.excess <= KEPT and np.isfinite(cost)
    values = [float(v) for v in solved.values]
    return Tuning(
        problem=problem,
        ok=bool(kept),
        status="",
        cost=cost,
        parameters=problem.law.named(values),
        controller=problem.law.controller(values),
        margins=assessment.margins,
        limits=limit_uses(problem.limits, assessment, prices),
        coefficients=solved.coefficient,
        assessment=assessment,
        found=own,
    )


def _apart(value: float, other: float) -> str:
    return f"{value:.{digits_apart(value, other, 4)}g}"


def _status(ok: bool, members: Sequence[Tuning], family: FamilyProblem) -> str:
    names = [scenario.name for scenario in family.scenarios]
    several = f" over {len(names)} members" if len(names) > 1 else ""
    if ok:
        every = [(u, member) for member in members for u in member.limits.values()]
        binding = dict.fromkeys(u.name for u, member in every if u.price > 1e-5 * member.cost)
        if not binding:
            return f"optimal{several}; no limit binds"
        bind = f"{', '.join(binding)} bind{'s' * (len(binding) == 1)}"
        return f"optimal{several} within the limits; {bind}"
    if not all(member.assessment and member.assessment.stable for member in members):
        return "the search ended at an unstable loop"
    broken = sorted(
        (
            (u, name)
            for name, member in zip(names, members, strict=True)
            for u in member.limits.values()
            if not u.kept
        ),
        key=lambda seen: seen[0].use,
    )
    worst = {u.name: (u, name) for u, name in broken}  # of a limit that several break, the worst
    values = [
        f"{u.name} at {_apart(u.value, u.bound)} instead of {_apart(u.bound, u.value)}"
        + (f" ({name})" if several else "")
        for u, name in worst.values()
    ]
    if not values:
        return "the solver did not converge"
    return f"the limits cannot all be kept; the least violation leaves {' and '.join(values)}"


def verified_members(each: Sequence[Verification]) -> Verification:
    """Return the checks of every member as one verification, that of the first if it is alone."""
    if len(each) == 1:
        return each[0]
    checks = tuple(
        replace(check, name=check.name if k == 0 else f"member {k + 1}.{check.name}")
        for k, one in enumerate(each)
        for check in one.checks
    )
    failed = (f"member {k + 1}: {one.status}" for k, one in enumerate(each) if not one.ok)
    status = next(failed, f"{each[0].status}; the other members hold too")
    return Verification(ok=all(one.ok for one in each), status=status, checks=checks)


def few_starts(agreed: int, starts: int) -> str:
    """Return the remark on an answer that fewer than four starts reached, "" if more did."""
    return f"only {agreed} of {starts} starts reached it" if agreed < _FEW else ""


def _problem(
    plant: LinearPlant,
    structure: Structure,
    spectrum: Mapping[str, Any],
    minimise: Mapping[str, float],
    limits: Sequence[Limit],
    drag: DragElement | None,
) -> Problem:
    for name, weight in minimise.items():
        if name not in plant.outputs:
            raise InputError(
                f"tune: minimise: there is no output {name!r}; there are: "
                f"{', '.join(plant.outputs) or 'none'}"
            )
        check_range("tune", f"minimise[{name}]", weight, low=0.0)
    if not any(weight > 0.0 for weight in minimise.values()):
        raise InputError("tune: minimise must give at least one output a weight above 0")
    names = [limit.name for limit in limits]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"tune: limits must have different names, got {name!r} twice")
    for limit in limits:
        for output in (*limit.outputs, *limit.signals):
            if output not in plant.outputs:
                raise InputError(
                    f"tune: limit {limit.name}: there is no output {output!r}; there are: "
                    f"{', '.join(plant.outputs) or 'none'}"
                )
        known = plant.independent_disturbances
        if limit.channel is not None and limit.channel[1] not in known:
            raise InputError(
                f"tune: limit {limit.name}: there is no disturbance {limit.channel[1]!r}; there "
                f"are: {', '.join(known) or 'none'}"
            )
    return Problem(
        plant=plant,
        law=structure.bind(plant),
        disturbances=disturbances(spectrum, plant.independent_disturbances),
        minimise={name: float(w) for name, w in minimise.items() if w > 0.0},
        limits=tuple(limits),
        elements=() if drag is None else (drag,),
    )
