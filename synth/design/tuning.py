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

from models.basics import InputError, SolverError, White, check_range, one_thread
from models.plant import LinearPlant

from ..bound import lqg_bound
from ..limits import Limit, Rms
from ..loop import Assessment, DragElement, LinearController, Margins, disturbances
from ..question import Problem
from ..search import KEPT, Found, Progress, Start, search
from ..structures import Fixed, Structure
from ..verify import Verification, verify_tuning


@dataclass(frozen=True, kw_only=True)
class LimitUse:
    """How a design uses one limit.

    Attributes
    ----------
    value, bound
        In `unit`.
    use
        Share of the limit that is used; above 1 it is broken.
    price
        What the cost (in its own unit) would fall by if the bound were one percent looser; 0
        where the limit does not bind.
    enforced
        Whether the optimiser had to keep it.
    """

    name: str
    value: float
    bound: float
    use: float
    price: float = 0.0
    unit: str = ""
    enforced: bool = True

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
    """The answer of `tune`, with the question it answers.

    Attributes
    ----------
    ok
        Stable, all limits kept, converged and checked.
    status
        The sentence for the user.
    cost
        Square root of the weighted variance, in the unit of the outputs.
    parameters
        Parameters of the structure by name, those that were fixed among them.
    controller
        The controller in state space, u = +C y.
    margins
        Stability margins, refined (`synth.loop.margins`).
    limits
        Use of each limit by name.
    starts
        All starts of the search.
    agreed
        How many starts ended within 1e-4 of the best cost.
    assessment
        The closed loop in numbers; None if no stable one was found.
    found
        The search's raw answer.
    coefficient
        The drag coefficient that agrees with the response [N s/m], if drag was asked for.
    """

    problem: Problem
    ok: bool
    status: str
    cost: float
    parameters: Mapping[str, float]
    controller: LinearController | None
    margins: Margins | None
    limits: Mapping[str, LimitUse]
    starts: tuple[Start, ...] = ()
    agreed: int = 0
    coefficient: float | None = None
    assessment: Assessment | None = field(repr=False)
    found: Found = field(repr=False)

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
        """Check everything that is claimed by code that the optimiser did not use."""
        return verify_tuning(self)

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
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)


def tune(
    plant: LinearPlant,
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
    progress: Progress | None = None,
) -> Tuning:
    """Return the controller of a structure that minimises a weighted variance within limits.

    Parameters
    ----------
    plant
        Any linear plant with named signals; delays of its measurements are taken exactly.
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
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    Tuning
        With ``ok`` false and a status that says why if no stable design within the limits
        was found.

    Raises
    ------
    InputError
        If a name is unknown, a weight is negative or there is nothing to minimise or to search.
    """
    if fixed:
        structure = Fixed(structure=structure, values=fixed)
    problem = _problem(plant, structure, spectrum, minimise, limits, drag)
    check_range("tune", "starts", starts, low=1)
    with one_thread():
        answer = tuning_of(problem, search(problem, int(starts), seed, guesses, progress))
    return replace(answer, status=answer.status + _few(answer))


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
        value = limit.measure(assessment)
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


def tuning_of(problem: Problem, found: Found) -> Tuning:
    """Return what a search found as an answer in words and numbers."""
    solved, assessment = found.solved, found.assessment
    if solved is None or assessment is None:
        return Tuning(
            problem=problem,
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
    cost = float(np.sqrt(sum(w * assessment.sigma(o) ** 2 for o, w in problem.minimise.items())))
    # The programme prices the logarithm of the cost per logarithm of the bound.
    prices = {name: 0.01 * abs(price) * cost for name, price in solved.prices[0].items()}
    uses = limit_uses(problem.limits, assessment, prices)
    ok = bool(assessment.stable and solved.converged and found.excess <= KEPT and np.isfinite(cost))
    return Tuning(
        problem=problem,
        ok=ok,
        status=_status(ok, assessment, uses, cost),
        cost=cost,
        parameters=problem.law.named([float(v) for v in solved.values]),
        controller=problem.law.controller([float(v) for v in solved.values]),
        margins=assessment.margins,
        limits=uses,
        starts=found.starts,
        agreed=found.agreed,
        coefficient=solved.coefficient,
        assessment=assessment,
        found=found,
    )


def _status(ok: bool, assessment: Assessment, uses: Mapping[str, LimitUse], cost: float) -> str:
    if ok:
        binding = [u.name for u in uses.values() if u.price > 1e-5 * cost]
        if not binding:
            return "optimal; no limit binds"
        return f"optimal within the limits; {', '.join(binding)} bind{'s' * (len(binding) == 1)}"
    if not assessment.stable:
        return "the search ended at an unstable loop"
    broken = [u for u in uses.values() if not u.kept]
    if not broken:
        return "the solver did not converge"
    values = [f"{u.name} at {u.value:.4g} instead of {u.bound:.4g}" for u in broken]
    return f"the limits cannot all be kept; the least violation leaves {' and '.join(values)}"


def _few(answer: Tuning) -> str:
    """Return a remark on an answer that few starts reached."""
    if not answer.ok or answer.agreed >= _FEW:
        return ""
    return f"; only {answer.agreed} of {len(answer.starts)} starts reached it"


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
        drag=drag,
    )
