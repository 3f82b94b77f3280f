"""Nested starts of a structure's search: the best of the simpler structures within it.

    DesignQuestion -> simpler structures, searched -> the same controllers as its own parameters

A structure that contains another has at least its optimum, but its search has more dimensions to
get lost in.  So it begins at the simpler one's answer, and `no_worse` holds it to that.  Contained
are: feedback without filters in that behind a lead or a roll-off (nearly: a roll-off's corner has
an end), rolled-off feedback in that with a notch or (nearly) integral action and in a free
controller of order two or more, and feed-forward and drum feedback in both combined.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..question import GAINS, DesignQuestion, FamilyProblem, Problem, pose
from ..search import KEPT, Found, Progress, Solution, glanced, polish, search
from ..structures import TRANSPARENT, LowOrderFeedback, ParametrisedController, WinchLaw

_FEW = 4  # starts of a structure within another
_BETTER = 1e-6  # of the log cost that counts as better
_HAIR = 2e-5  # of the log cost that says nothing
_PLAIN, _ROLLED = "payload-feedback", "payload-feedback-rolloff"
#: By structure, the simpler ones within it.
WITHIN: Mapping[str, tuple[str, ...]] = {
    _ROLLED: (_PLAIN,),
    "payload-feedback-lead": (_PLAIN,),
    "payload-feedback-notch": (_ROLLED,),
    "payload-feedback-integral": (_ROLLED,),
    "combined": ("feed-forward", "drum-feedback"),
}
#: What makes the parts of a structure that another has not do nothing.
_NEUTRAL: Mapping[str, float] = {
    "payload.acceleration_gain": 0.0,
    "payload.velocity_gain": 0.0,
    "payload.position_gain": 0.0,
    "heave.gain": 0.0,
    "heave.lead": 0.0,
    "heave.bandwidth": 100.0,
    "rolloff.corner": TRANSPARENT,
    "rolloff.damping": 0.7,
    "lead.zero": 50.0,
    "lead.pole": 50.0,
    "notch.depth": 1.0,
    "integral.corner": 0.0,
}


def nested_starts(
    question: DesignQuestion, starts: int, seed: int, progress: Progress | None = None
) -> list[list[float]]:
    """Return parameter vectors to begin with: the best of each structure within this one.

    The parameters of a free controller get the sizes that go with the answer.  `starts` and `seed`
    are those of the search in question: the structures within get a few of its starts.  `progress`
    is called as progress(stage, done, total).
    """
    structure = question.structure
    within = WITHIN.get(structure.name, ())
    if isinstance(structure, LowOrderFeedback) and structure.order >= 2 and not question.held:
        within = (_ROLLED,)
    found: list[list[float]] = []
    for name in within:
        inner = pose(question.case, name, question.masses)
        known = nested_starts(inner, min(starts, _FEW), seed, progress)
        problem, count = inner.problem_with(inner.loop), min(starts, _FEW) + len(known)
        solved = search(problem, count, seed, known, progress, roughly=True).solved
        if solved is None:
            continue
        values = [float(v) for v in solved.values]
        parameters = problem.law.named(values)
        if isinstance(structure, LowOrderFeedback):
            controller = problem.law.controller(values)
            found.append(structure.start(question.law, parameters, controller))
            continue
        found += starts_from(question, [parameters])
    return found


def starts_from(
    question: DesignQuestion, guesses: Sequence[Mapping[str, float]]
) -> list[list[float]]:
    """Return parameter vectors of designs that are known by the names of their parameters.

    What they do not name does nothing; where that is the feed-forward, a second vector has the
    one that suits the rest best.
    """
    found = []
    for guess in guesses:
        own = question.amplifier
        if own is not None and "A" in guess:
            scale = guess["A"] / own
            guess = {**guess, **{n: scale * guess[n] for n in GAINS[1:] if n in guess}}
        values = as_values(question.law, guess)
        found.append(values)
        if isinstance(question.law, WinchLaw) and "heave.gain" not in guess:
            found += question.law.fed(values, question.problem_with(question.loop))
    return found


def gains_in_use(question: DesignQuestion) -> list[list[float]]:
    """Return the gains that the case has in use as a start, where the structure has such."""
    gains = question.case.gains
    if gains is None or question.amplifier is None:
        return []
    return starts_from(question, [{"a": gains.a, "a1": gains.a1, "a2": gains.a2}])


def as_values(law: ParametrisedController, known: Mapping[str, float]) -> list[float]:
    """Return a law's parameters where some are known by name and the others do nothing."""
    full = {**_NEUTRAL, **known}
    values = [full.get(p.name, p.scale) for p in law.parameters]
    limits = ((p.low, p.high) for p in law.parameters)
    return [float(np.clip(v, *pair)) for v, pair in zip(values, limits, strict=True)]


def no_worse(
    asked: FamilyProblem | Problem, found: Found, starts: Sequence[Sequence[float]]
) -> Found:
    """Return what was found, or the best of known points that keep the limits and are better.

    A search may leave the basin that it was shown; a point that is known already is then polished
    in its own.
    """
    family = FamilyProblem.of(asked)
    for values in starts:
        best = found.solved.objective if found.solved is not None else np.inf
        best = best if found.excess <= KEPT else np.inf
        solved = _as_it_is(family, values, best - _BETTER)
        if solved is None:
            continue
        again, assessments, excess = polish(family, solved, np.array(values, dtype=np.float64))
        if again.converged and excess <= KEPT and again.objective < best:
            found = replace(found, solved=again, assessments=assessments, excess=excess)
    return found


def _as_it_is(family: FamilyProblem, values: Sequence[float], most: float) -> Solution | None:
    """Return a known point as an answer; None if it is unstable, dearer or breaks a limit."""
    if not family.stable(values):
        return None
    seen = [glanced(s.problem, s.values(values)) for s in family.scenarios]
    loops = [(s.problem, g) for s, g in zip(family.scenarios, seen, strict=True) if g is not None]
    known = tuple(loop.coefficients for _, loop in loops)
    if len(loops) < len(seen) or not family.stable(values, known):
        return None
    costs = np.sqrt(
        [sum(w * loop.sigma(z) ** 2 for z, w in asked.minimise.items()) for asked, loop in loops]
    )
    if np.log(family.total(costs)) + _HAIR > most:
        return None
    if any(lim.use(lim.worst(loop)) > 1.0 + KEPT for asked, loop in loops for lim in asked.limits):
        return None
    return Solution(
        values=np.array(values, dtype=np.float64),
        coefficients=known,
        # A hair dearer than it is, so that a solve which arrives at the same point counts.
        objective=float(np.log(family.total(costs))) + _HAIR,
        converged=False,
        message="as it was",
        iterations=0,
        prices=tuple({lim.name: 0.0 for lim in s.problem.limits} for s in family.scenarios),
        costs=costs,
        pressure=np.full(len(costs), 1.0 / len(costs)),
    )
