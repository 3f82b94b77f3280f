"""The search over a family: many starts, all loops at once, the best answers polished.

    FamilyProblem -> starts that stabilise every loop -> IPOPT from each
                  -> exchange of nodes on every loop -> FamilyFound

The same steps as `synth.search.multistart` and `synth.search.polishing` take for one loop, with
their candidates, nodes and assessments.  Scenarios that share a loop share its nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.basics import FloatArray

from ..limits import Limit
from ..loop import Assessment, Disturbance
from ..question import FamilyProblem, Problem, Values
from .family_programme import FamilyProgramme, FamilySolved
from .multistart import AGREE, Progress, Start, distinct
from .nodes import cost_nodes, margin_nodes
from .polishing import KEPT, assessment_of, thinned
from .programme import SolverPace
from .starts import candidates, pick_spread, stabilise, start_coefficient

_CANDIDATES = 512
_TRIES = 3  # starts that are tried for each that is to arrive
_SAMPLE = 4  # starts whose loops the nodes of the first pass are made for
_POLISHED = 12  # distinct answers that are polished at most: the best of the first may leak most
_BROKEN = 3.0  # weight of the largest broken limit in the merit of a candidate
_WORST = 20.0  # what broken limits may add to the merit of a candidate
_MOST_VIEWS = 40  # points of which each loop's merit is taken
_PER_DECADE = 16  # margin nodes of the first pass; the exchange finds what lies between
_ROUNDS = 10  # of the exchange of nodes
_EXCHANGED = 3  # rounds after which what is still broken is tightened
_REACH = 0.3  # how far, relatively, a round of the exchange may move a parameter
_HAIR = 1e-3  # relative excess that tightening may mend
_SETTLED = 2e-4  # change of the log objective below which the exchange has settled


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilyFound:
    """What a search over a family found.

    Attributes
    ----------
    solved
        The best answer, or None if nothing stabilises every loop.
    assessments
        The assessment of each scenario's loop.
    excess
        Largest relative excess over a limit of any scenario.
    starts, agreed
        Every start, and how many arrived at the best answer.
    reference
        Searched parameters at which every loop is briskly stable.
    """

    solved: FamilySolved | None
    assessments: tuple[Assessment, ...] = ()
    excess: float = np.inf
    starts: tuple[Start, ...] = ()
    agreed: int = 0
    reference: FloatArray | None = None

    @property
    def costs(self) -> FloatArray:
        """The scenarios' costs on refined quadrature."""
        if self.solved is None:
            return np.zeros(0)
        return self.solved.costs


@dataclass(frozen=True, kw_only=True, eq=False)
class _Simultaneous(Problem):
    """The first scenario's problem, whose loop counts as stable where every loop is."""

    family: FamilyProblem

    @classmethod
    def of(cls, family: FamilyProblem) -> _Simultaneous:
        first = family.scenarios[0].problem
        return cls(
            plant=first.plant,
            law=first.law,
            disturbances=first.disturbances,
            minimise=first.minimise,
            limits=first.limits,
            drag=first.drag,
            family=family,
        )

    def growth(self, values: Values) -> float:
        return self.family.growth(values)

    def stable(self, values: Values, coefficient: float | None = None) -> bool:
        del coefficient
        return self.family.stable(values)


def search_family(
    family: FamilyProblem,
    starts: int = 8,
    seed: int = 0,
    guesses: Sequence[Values] = (),
    progress: Progress | None = None,
    only_guesses: bool = False,
) -> FamilyFound:
    """Return the best answer of a multi-start search over a family.

    Parameters
    ----------
    family
        The scenarios and the objective.
    starts, seed
        Size and seed of the search.
    guesses
        Searched parameters to start from before any that are drawn.
    progress
        Called as progress(stage, done, total).
    only_guesses
        Draw nothing: start from the guesses alone, if any of them is stable.
    """
    tell = progress or (lambda stage, done, total: None)
    kept = [np.asarray(g, dtype=np.float64) for g in guesses]
    begins = [g for g in kept if family.stable(g)] if only_guesses else []
    if not begins:
        begins = begin_points(family, _TRIES * starts, seed, kept)
    if not begins:
        return FamilyFound(solved=None)
    reference = min(begins, key=family.abscissa)
    programme = coarse_programme(family, begins, reference)
    records: list[Start] = []
    first: list[FamilySolved] = []
    count = min(starts, len(begins))
    for begin in begins:
        if len(first) >= count:
            break
        tell("starts", len(first), count)
        solved = programme.solve(programme.pack(begin))
        stable = family.stable(solved.values, solved.coefficients)
        records.append(Start.of(begin, solved, stable=stable))
        if stable and solved.converged:
            first.append(solved)
    tell("starts", count, count)
    if not first:
        solved = min(
            (programme.solve(programme.pack(b), pace=SolverPace.NEAR) for b in begins[:2]),
            key=lambda s: (not s.converged, programme.violations(programme.pack(s.values))[1]),
        )
        assessments, excess = _assessments_of(family, solved)
        return FamilyFound(
            solved=solved,
            assessments=assessments,
            excess=max(excess, 1e-3),
            starts=tuple(records),
            reference=reference,
        )
    best: tuple[FamilySolved, tuple[Assessment, ...], float] | None = None
    sound = _second_pass(family, distinct(first, _POLISHED), reference)
    origin = sound[0][0]
    for k, (came_from, solved) in enumerate(sound):
        tell("polish", k, len(sound))
        if best is not None and best[2] <= KEPT and solved.objective > best[0].objective:
            break  # polishing only adds nodes, that is constraints: it cannot get better
        candidate = _polish_family(family, solved, reference)
        rank = candidate[2] > KEPT, candidate[0].objective
        if best is None or rank < (best[2] > KEPT, best[0].objective):
            best, origin = candidate, came_from
    assert best is not None
    tell("polish", 1, 1)
    return FamilyFound(
        solved=best[0],
        assessments=best[1],
        excess=best[2],
        starts=tuple(records),
        agreed=sum(1 for s in first if abs(s.objective - origin.objective) <= AGREE),
        reference=reference,
    )


def begin_points(
    family: FamilyProblem, count: int, seed: int, guesses: Sequence[Values] = ()
) -> list[FloatArray]:
    """Return points at which every loop is stable, the most promising first."""
    groups = [family.scenarios[g[0]] for g in family.groups]
    points = [np.asarray(g, dtype=np.float64)[None] for g in guesses]
    if all(s.blend is None for s in groups):
        chosen = groups[:: max(1, len(groups) // 4)]
        points += [candidates(s.problem, _CANDIDATES // len(chosen), seed) for s in chosen]
    if not points:
        return []
    every = np.vstack(points)
    growths = np.array([family.abscissa(p, enough=0.0) for p in every])
    stable = every[growths < -1e-9]
    if len(stable) < count:
        rest = np.where(growths < 0.0, np.inf, growths)
        found = stabilise(_Simultaneous.of(family), every, rest, count)
        stable = np.vstack([stable, *[f[None] for f in found if family.abscissa(f) < -1e-9]])
    if not len(stable):
        return []
    # The guesses stay in front: who gives one knows why.
    given = [p for p in stable[: len(guesses)] if any(np.array_equal(p, g) for g in guesses)]
    order = np.array([family.abscissa(p) for p in stable])
    kept = [stable[i] for i in pick_spread(stable, order, family.scales, _MOST_VIEWS)]
    programme = coarse_programme(family, kept, kept[0])
    merit = []
    for point in kept:
        costs, broken = programme.violations(programme.pack(point))
        total = family.total(np.exp(np.minimum(np.nan_to_num(costs, nan=_WORST), _WORST)))
        # A loop too fast for its margins has the least cost of all: it must not come first.
        merit.append(np.log(total) + min(_WORST, _BROKEN * broken))
    ranked = pick_spread(np.array(kept), np.array(merit), family.scales, count)
    return [*given, *(kept[i] for i in ranked)][: max(count, len(given))]


def _second_pass(
    family: FamilyProblem, first: Sequence[FamilySolved], reference: FloatArray
) -> list[tuple[FamilySolved, FamilySolved]]:
    """Return (where it came from, answer) again with nodes where any leaked, the best first."""
    held = [np.zeros(0) for _ in family.groups]
    for solved in first:
        assessments, _ = _assessments_of(family, solved)
        for k, group in enumerate(family.groups):
            limits = family.scenarios[group[0]].problem.limits
            held[k] = thinned([held[k], *(lim.critical(assessments[group[0]]) for lim in limits)])
    programme = coarse_programme(family, [s.values for s in first], reference, held)
    pairs = []
    for old in first:
        new = programme.solve(programme.pack(old.values, old.coefficients), pace=SolverPace.NEAR)
        sound = new.converged and family.stable(new.values, new.coefficients)
        pairs.append((old, new if sound else old))
    return sorted(pairs, key=lambda pair: pair[1].objective)


def coarse_programme(
    family: FamilyProblem,
    begins: Sequence[FloatArray],
    reference: FloatArray,
    held: Sequence[FloatArray] | None = None,
) -> FamilyProgramme:
    """Return a programme on nodes that suit the starts, with those `held` for each group."""
    nodes, omega = [], []
    for k, group in enumerate(family.groups):
        first = family.scenarios[group[0]]
        drag = start_coefficient(first.problem)
        assessments = [first.problem.assess(first.values(b), drag) for b in begins[:_SAMPLE]]
        nodes.append(cost_nodes(_shaken_by_all(family, group), assessments, rtol=1e-4))
        margins = margin_nodes(first.problem, [v.poles for v in assessments], _PER_DECADE)
        omega.append(margins if held is None else np.union1d(margins, held[k]))
    return FamilyProgramme(family, nodes, omega, reference=reference, tolerance=1e-6)


def _polish_family(
    family: FamilyProblem, solved: FamilySolved, reference: FloatArray
) -> tuple[FamilySolved, tuple[Assessment, ...], float]:
    """Return a solution on refined nodes, the assessment of each loop, and the largest excess.

    The exchange of `synth.search.polishing` on every loop: where a limit is pressed becomes a node.
    """
    assessments, excess = _assessments_of(family, solved)
    broken = [np.zeros(0) for _ in family.groups]
    before = [np.zeros(0) for _ in family.groups]
    best = (excess > KEPT, solved.objective, solved, assessments, excess)
    tighten: dict[tuple[int, str], float] = {}
    for k_round in range(_ROUNDS):
        nodes, omega = [], []
        for k, group in enumerate(family.groups):
            problem, assessment = family.scenarios[group[0]].problem, assessments[group[0]]
            before[k] = thinned([before[k], *(lim.critical(assessment) for lim in problem.limits)])
            broken[k] = np.concatenate([broken[k], *(m.worst(assessment) for m in problem.limits)])
            nodes.append(cost_nodes(_shaken_by_all(family, group), [assessment], rtol=1e-7))
            near = margin_nodes(problem, [assessment.poles], 2 * _PER_DECADE)
            omega.append(np.unique(np.concatenate([near, before[k], broken[k]])))
        programme = FamilyProgramme(family, nodes, omega, reference=reference, tolerance=1e-8)
        start = programme.pack(solved.values, solved.coefficients)
        again = _near(programme, start, tighten)
        if again is None:
            break
        moved, solved = abs(again.objective - solved.objective), again
        assessments, excess = _assessments_of(family, solved)
        if (excess > KEPT, solved.objective) < best[:2] or best[0]:
            best = (excess > KEPT, solved.objective, solved, assessments, excess)
        if excess <= KEPT and (moved < _SETTLED or k_round >= _EXCHANGED):
            break
        if k_round >= _EXCHANGED and excess < _HAIR:  # what is broken by a hair is mended by a hair
            for i, limit in _own_limits(family):
                over = limit.use(limit.measure(assessments[i])) - 1.0
                if over > 0.5 * KEPT:
                    key = (i, limit.name)
                    tighten[key] = tighten.get(key, 0.0) + 1.1 * over
    return best[2:]


def _near(
    programme: FamilyProgramme, start: FloatArray, tighten: dict[tuple[int, str], float]
) -> FamilySolved | None:
    for pace, reach in (
        (SolverPace.THERE, _REACH),
        (SolverPace.NEAR, _REACH),
        (SolverPace.FAR, None),
    ):
        solved = programme.solve(start, reach, tighten, pace)
        if solved.converged and programme.family.stable(solved.values, solved.coefficients):
            return solved
    return None


def _assessments_of(
    family: FamilyProblem, solved: FamilySolved
) -> tuple[tuple[Assessment, ...], float]:
    """Return each scenario's loop in numbers, and the largest relative excess over a limit."""
    assessments = tuple(
        assessment_of(scenario.problem, solved.of(i, scenario))
        for i, scenario in enumerate(family.scenarios)
    )
    own = [lim.use(lim.measure(assessments[i])) - 1.0 for i, lim in _own_limits(family)]
    return assessments, max([0.0, *own])


def _own_limits(family: FamilyProblem) -> Iterator[tuple[int, Limit]]:
    """Yield each scenario's limits, those on a loop that a group shares only once."""
    for group in family.groups:
        for i in group:
            for limit in family.scenarios[i].problem.limits:
                if limit.drive or i == group[0]:
                    yield i, limit


def _shaken_by_all(family: FamilyProblem, group: Sequence[int]) -> Problem:
    """Return a group's first problem, shaken by what shakes any of the group."""
    problems = [family.scenarios[i].problem for i in group]
    if len(problems) == 1:
        return problems[0]
    every = [d for problem in problems for d in problem.disturbances]
    names = dict.fromkeys(d.name for d in every)
    summed = tuple(_summed([d for d in every if d.name == name]) for name in names)
    return replace(problems[0], disturbances=summed)


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
