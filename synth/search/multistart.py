"""Multi-start search: many starts on moderate nodes, the best answers polished on fine ones.

    Family -> starts -> rough descents -> places -> starts far about the best -> more places
           -> descents to the end -> distinct answers -> polished -> Found

A single plant is a family of one.  The first descents stop once four of them, and most, come by
one place; what they all miss is looked for about the best, until four come back to one as good.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from models.basics import FloatArray, InputError

from ..loop import Assessment, Coefficients
from ..question import FamilyLoop, FamilyProblem, Goal, Problem, Values
from .polishing import KEPT, assess, polish, settle, stated
from .programme import Solution
from .sqp import UNFINISHED
from .starts import begin_points, briskest, others_of, scattered, start_coefficients

Progress = Callable[[str, int, int], None]

AGREE = 1e-4  # answers whose costs differ by less, relatively, are one answer
_LEAST = 8  # starts that are drawn at least, however many agree before
_ENOUGH, _MOST = 4, 0.6  # starts, and share of all, that come by one place: no more are needed
_SCATTER, _MOST_SCATTER = 2, 12  # starts about the best, by parameter, and most
_HOPS = (1.5, 1.5, 1.5, 2.5)  # how far they begin from it, in decades, as long as that helps
# A start so far above the best place's log cost after some steps led to no better one in any of the
# searches that were looked at.
_HOPELESS = 1.5
_AS_GOOD = 5e-3  # of the log cost, by which rough answers may differ that are as good
_AHEAD, _ALIKE = 3e-4, 2e-3  # ... before and behind the end that a rough answer is on the way to
_NEAR, _BESIDE = 0.05, 0.25  # of log cost and parameters, relative: on the way to one end
_POLISHED = 6  # distinct answers that are polished at most
_BEHIND = 0.2  # of the log cost, that a rough answer may lie behind the best one
_LONGER = 5  # how often a rough descent that ran out of steps goes on
_RESERVE = 16  # further starts for a search of which none arrived
_VIOLATION = 3  # starts of the least violation
_BROKEN = 1e-3  # least violation from which the limits exclude each other
_BEST_STARTS = 6  # of the search for the best of one member alone


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """One start of the search: where it began, where it ended, and how.

    `cost` is on the moderate nodes of the first pass, where a margin may leak between nodes; it is
    without end of a start that did not arrive, or arrived at a loop that is unstable.  `told` is
    what the nodes say of any.
    """

    begin: FloatArray
    end: FloatArray
    cost: float
    converged: bool
    stable: bool
    message: str
    iterations: int
    told: float = np.inf

    @classmethod
    def of(cls, begin: FloatArray, solved: Solution, *, stable: bool) -> Start:
        """Return the record of a solve; one that did not arrive costs without end."""
        return cls(
            begin=begin,
            end=solved.values,
            cost=float(np.exp(solved.objective)) if stable and solved.converged else np.inf,
            converged=solved.converged,
            stable=stable,
            message=solved.message,
            iterations=solved.iterations,
            told=float(np.exp(solved.objective)),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """What a search found: the best answer, its assessments, and every start."""

    solved: Solution | None  #: The best answer; None where nothing stable was found at all.
    assessments: tuple[Assessment, ...] = ()  #: The loop of each member in numbers.
    excess: float = np.inf  #: The largest relative excess over a limit of any member.
    #: The starts, and how many of them arrived at the best answer.
    starts: tuple[Start, ...] = ()
    agreed: int = 0
    reference: FloatArray | None = None  #: Parameters of briskly stable loops.

    @property
    def assessment(self) -> Assessment | None:
        """The loop of the first member in numbers."""
        return self.assessments[0] if self.assessments else None

    @property
    def costs(self) -> FloatArray:
        """The members' costs."""
        return np.zeros(0) if self.solved is None else self.solved.costs

    def member(self, index: int, scenario: FamilyLoop) -> Found:
        """Return the answer as that of one member's own problem."""
        assert self.solved is not None
        return Found(
            solved=replace(
                self.solved,
                values=scenario.values(self.solved.values),
                coefficients=self.solved.coefficients[index : index + 1],
                objective=float(np.log(self.solved.costs[index])),
                prices=self.solved.prices[index : index + 1],
                costs=self.solved.costs[index : index + 1],
                pressure=np.ones(1),
            ),
            assessments=self.assessments[index : index + 1],
            excess=self.excess,
        )


def search(
    asked: FamilyProblem | Problem,
    starts: int = 8,
    seed: int = 0,
    guesses: Sequence[Values] = (),
    progress: Progress | None = None,
    *,
    only_guesses: bool = False,
    kept_only: bool = False,
    roughly: bool = False,
) -> Found:
    """Return the best answer of a multi-start search over a family.

    `starts` and `seed` are its size and seed.  It begins with guesses of the searched
    parameters before any that are drawn.  With `only_guesses` nothing is drawn: it starts from the
    guesses alone, if any of them is stable.  With `kept_only` it looks for nothing else where no
    start roughly arrives at an answer that keeps the limits.  If `roughly`, the best place to which
    starts lead is the answer.  `progress` is called as progress(stage, done, total).
    """
    tell = progress or (lambda stage, done, total: None)
    family = FamilyProblem.of(asked)
    kept = [np.asarray(guess, dtype=np.float64) for guess in guesses]
    # Of a law that draws others besides its guesses, one optimum of several is soon agreed upon.
    share = 2 if not only_guesses and len(others_of(family.scenarios[0].problem, seed)) else 1
    count = len(kept) + max(starts - len(kept), share * _LEAST)
    begins = [guess for guess in kept if family.stable(guess)] if only_guesses else []
    if not begins and not kept_only:
        # The reserve is picked together with the starts, so that it lies apart from them.
        begins = begin_points(family, count + _RESERVE, seed, kept)
    if not begins:
        return Found(solved=None)
    reference = briskest(family, begins)
    places = _places(family, begins[:count], reference, len(kept), share * _ENOUGH, roughly, tell)
    if roughly:
        return Found(solved=min(places, key=lambda p: (not p.arrived, p.coarse.objective)).coarse)
    if not kept_only and not any(place.arrived for place in places):
        nearest = least_violation(family, begins, reference)
        if not nearest.objective <= _BROKEN:
            return _violated(family, nearest, _records(places), reference)
        for begin in [nearest.values, *begins[count:]]:
            if _come_by(family, places, begin, nearest.coefficients, reference).arrived:
                break
    if not only_guesses:
        _hopped(family, places, reference, starts, seed, tell)
    if kept_only:
        places = [place for place in places if place.arrived]
    records, first = _descents(family, places, reference, starts, tell)
    if not first and kept_only:
        return Found(solved=None, starts=records, reference=reference)
    if not first:
        return _violated(family, least_violation(family, begins, reference), records, reference)
    answers = distinct(first, _POLISHED)
    best: tuple[Solution, tuple[Assessment, ...], float] | None = None
    origin = answers[0]
    for k, solved in enumerate(answers):
        tell("polish", k, len(answers))
        if best is not None and best[2] <= KEPT and solved.objective > best[0].objective:
            break
        candidate = polish(family, solved, reference)
        rank = (candidate[2] > KEPT, candidate[0].objective)
        if best is None or rank < (best[2] > KEPT, best[0].objective):
            best, origin = candidate, solved
    tell("polish", len(answers), len(answers))
    assert best is not None
    return Found(
        solved=best[0],
        assessments=best[1],
        excess=best[2],
        starts=records,
        agreed=sum(1 for s in first if abs(s.objective - origin.objective) <= AGREE),
        reference=reference,
    )


def _violated(
    family: FamilyProblem, least: Solution, records: tuple[Start, ...], reference: FloatArray
) -> Found:
    """Return the least violation as what was found."""
    assessments, excess = assess(family, least)
    return Found(
        solved=least,
        assessments=assessments,
        excess=max(excess, 1.0),
        starts=records,
        reference=reference,
    )


def _places(
    family: FamilyProblem,
    begins: Sequence[FloatArray],
    reference: FloatArray,
    guesses: int,
    enough: int,
    roughly: bool,
    tell: Progress,
) -> list[_Place]:
    """Return where starts roughly lead, until enough of them agree, if `roughly` on the cost."""
    places: list[_Place] = []
    for k, begin in enumerate(begins):
        if k >= guesses + _LEAST and _agreed(places, enough):
            break
        if roughly and _as_good(places) >= enough:
            break
        tell("starts", k, len(begins))
        _come_by(family, places, begin, start_coefficients(family), reference)
    tell("starts", len(begins), len(begins))
    return places


def _come_by(
    family: FamilyProblem,
    places: list[_Place],
    begin: FloatArray,
    coefficients: Sequence[Coefficients],
    reference: FloatArray,
    worth: float = np.inf,
) -> _Place:
    """Return the place where a start leads, with the start added to it.

    One that costs more than `worth` (its logarithm) after some steps leads nowhere.
    """
    # By discs and by true margins in turns: each of them finds basins that the other misses.
    exact = sum(len(place.begins) for place in places) % 2 == 1
    best = min((p.coarse.objective for p in places if p.arrived), default=np.inf)
    rough = partial(settle, family, reference=reference, rounds=1)
    coarse = rough(begin, coefficients, exact=exact, worth=worth)
    for _ in range(_LONGER):
        # Along a flat valley a descent takes long; it is worth its while where it may be the best.
        if coarse.message != UNFINISHED or coarse.objective > best + _BEHIND:
            break
        if not family.stable(coarse.values, coarse.coefficients):
            break  # a resonance has become unstable between the nodes
        coarse = rough(coarse.values, coarse.coefficients, exact=exact)
    if coarse.converged and coarse.objective < best:
        # The best so far by nodes for the loop where it began, or a margin that leaks, maybe.
        coarse = rough(coarse.values, coarse.coefficients, exact=True)
    place = next((p for p in places if _same(family, p.coarse, coarse)), None)
    if place is None:
        place = _Place(coarse)
        places.append(place)
    place.begins.append(begin)
    return place


def _hopped(
    family: FamilyProblem,
    places: list[_Place],
    reference: FloatArray,
    starts: int,
    seed: int,
    tell: Progress,
) -> None:
    """Add the places that starts far about the best one lead to, and about any that is better."""
    count = min(_SCATTER * min(starts, len(family.parameters)), _MOST_SCATTER)
    about = dict.fromkeys(_HOPS, np.inf)  # log cost of the place that was looked about last
    for far in _HOPS:
        arrived = [place for place in places if place.arrived]
        if not arrived:
            return
        best = min(arrived, key=lambda p: p.coarse.objective)
        if best.coarse.objective > about[far] - _AS_GOOD:
            continue
        about[far] = now = best.coarse.objective
        begins = scattered(family, best.coarse.values, far, count, seed)
        back = 0
        for k, begin in enumerate(begins):
            tell("hops", k, len(begins))
            worth = now + _HOPELESS
            end = _come_by(family, places, begin, best.coarse.coefficients, reference, worth).coarse
            back += end.converged and abs(end.objective - now) < _AS_GOOD
            if back == _ENOUGH:
                break
        tell("hops", len(begins), len(begins))


def _descents(
    family: FamilyProblem,
    places: Sequence[_Place],
    reference: FloatArray,
    starts: int,
    tell: Progress,
) -> tuple[tuple[Start, ...], list[Solution]]:
    """Return the records of the starts, and the answers of those that arrived.

    Of the places where they come by, the best few are gone to the end of.
    """
    drags = start_coefficients(family)
    ranked = sorted(places, key=lambda p: (not p.arrived, p.coarse.objective))[: max(1, starts)]
    for k, place in enumerate(ranked):
        ends = [p.solved for p in ranked if p.solved is not None]
        best = min((end.objective for end in ends), default=np.inf)
        if place.coarse.objective > best + _BEHIND:
            break
        if not place.arrived and _agreed(places):
            break  # a descent that got stuck is no place of its own where others arrive
        tell("descents", k, len(ranked))
        # Discs may lead far off from a start that breaks its limits widely.
        near = place.coarse.converged
        values = place.coarse.values if near else place.begins[0]
        found = place.coarse.coefficients if near else drags
        if np.isfinite(best):
            # By true margins, but roughly still: along a flat valley it often comes by a known end.
            rough = settle(family, values, found, reference=reference, exact=True, rounds=1)
            if rough.converged:
                values, found = rough.values, rough.coefficients
                behind = ((rough.objective - end.objective, end) for end in ends)
                place.solved = next((s for b, s in behind if -_AHEAD < b < _ALIKE), None)
            if place.solved is not None:
                continue
        end = settle(family, values, found, reference=reference, exact=True)
        if end.converged and family.stable(end.values, end.coefficients):
            place.solved = end
    tell("descents", len(ranked), len(ranked))
    first = [p.solved for p in places if p.solved is not None for _ in p.begins]
    return _records(places), first


def _records(places: Sequence[_Place]) -> tuple[Start, ...]:
    """Return the records of the starts that came by some places."""
    return tuple(
        Start.of(begin, place.solved or place.coarse, stable=place.solved is not None)
        for place in places
        for begin in place.begins
    )


class _Place:
    """A place where descents come by: the rough answer, who came by, and where it leads."""

    def __init__(self, coarse: Solution) -> None:
        self.coarse = coarse
        self.begins: list[FloatArray] = []
        self.solved: Solution | None = None

    @property
    def arrived(self) -> bool:
        return self.coarse.converged


def _agreed(places: Sequence[_Place], enough: int = _ENOUGH) -> bool:
    """Return whether so many starts come by one place that more of their kind would too."""
    arrived = [len(place.begins) for place in places if place.arrived]
    return max(arrived, default=0) >= max(enough, _MOST * sum(arrived))


def _as_good(places: Sequence[_Place]) -> int:
    """Return how many starts arrived somewhere as good as the best place."""
    arrived = [place for place in places if place.arrived]
    best = min((place.coarse.objective for place in arrived), default=np.inf)
    return sum(len(p.begins) for p in arrived if p.coarse.objective < best + _AS_GOOD)


def _same(family: FamilyProblem, one: Solution, other: Solution) -> bool:
    """Return whether two descents are about to end in the same place."""
    if not abs(one.objective - other.objective) <= _NEAR:
        return False
    size = np.maximum(np.maximum(np.abs(one.values), np.abs(other.values)), 1e-12 * family.scales)
    return bool(np.max(np.abs(one.values - other.values) / size) <= _BESIDE)


def least_violation(
    asked: FamilyProblem | Problem, begins: Sequence[FloatArray], reference: FloatArray
) -> Solution:
    """Return the stable answer that breaks the limits least, for limits that exclude each other."""
    family = FamilyProblem.of(asked)
    drags = start_coefficients(family)
    found: list[Solution] = []
    for begin in begins[:_VIOLATION]:
        programme = stated(family, begin, drags, Goal.FEASIBLE, reference=reference)
        x = programme.pack(begin, drags)
        # Begin within the rows: the slack takes up the largest violation.
        worst = max([0.0, *programme.violations(x)[1].values()])
        solved = settle(family, begin, drags, Goal.FEASIBLE, reference=reference, extra=worst)
        if np.isfinite(solved.objective) and family.stable(solved.values, solved.coefficients):
            found.append(solved)
    if found:
        return min(found, key=lambda s: s.objective)
    free = tuple({lim.name: 0.0 for lim in s.problem.limits} for s in family.scenarios)
    return Solution(
        values=begins[0],
        coefficients=drags,
        objective=np.inf,
        converged=False,
        message="not solved",
        iterations=0,
        prices=free,
        costs=np.full(len(free), np.inf),
        pressure=np.full(len(free), 1.0 / len(free)),
    )


def with_bests(
    family: FamilyProblem,
    seed: int = 0,
    guesses: Sequence[Values] = (),
    progress: Progress | None = None,
) -> FamilyProblem:
    """Return a family with the best cost of its own for each member, for the regret.

    Raises InputError if no parameters of its own keep a member's limits.
    """
    scenarios = []
    for k, scenario in enumerate(family.scenarios):
        if progress is not None:
            progress("the best of each scenario", k, len(family.scenarios))
        found = search(scenario.problem, _BEST_STARTS, seed, guesses)
        if found.solved is None or found.excess > KEPT:
            raise InputError(
                f"regret: {scenario.name}: no gains of its own keep the limits, so there is no "
                "best to compare with"
            )
        scenarios.append(replace(scenario, best=float(found.costs[0])))
    return replace(family, scenarios=tuple(scenarios))


def distinct(solved: Sequence[Solution], most: int) -> list[Solution]:
    """Return the best few answers whose costs differ."""
    chosen: list[Solution] = []
    for item in sorted(solved, key=lambda s: s.objective):
        if all(abs(item.objective - other.objective) > AGREE for other in chosen):
            chosen.append(item)
        if len(chosen) == most:
            break
    return chosen
