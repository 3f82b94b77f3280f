"""Pareto fronts: how still the payload can be held against what it costs.

    question -> end points -> bounds in between -> continuation, both ways -> ParetoFront

The epsilon-constraint method: the payload's variance is minimised under a bound on the other
quantity, the bound moved in steps, and every descent begins at its neighbour's answer.  A front
may change basins: it is walked from both ends, from its middle and from every basin that the
searches there found, and the best answer at each bound counts (`best_of_each`).
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.basics import (
    FloatArray,
    InputError,
    SynthesisError,
    check_range,
    one_thread,
    shows_progress,
)
from models.case import Case

from ..limits import DelayMargin, Limit, MaxSensitivity, Rms
from ..question import Problem, pose
from ..search import KEPT, Found, Progress, search
from ..verify import Verification
from .follow import Answer, follow, with_bound

STARTS = 6  # of the searches at the ends and in the middle
_ENDS = 2  # distinct answers of each that a walk begins from
_OTHER = 1e-3  # difference of log costs that tells two ends apart
_SAME = 1e-6  # log costs that differ by less are the same answer


def best_of_each(
    problems: Sequence[Problem],
    guesses: Sequence[Sequence[float]],
    *,
    harder: bool,
    seed: int,
    known: Mapping[int, Found],
    tell: Progress,
) -> list[Answer | None] | None:
    """Return the best answer to each problem of a row, None where there is none.

    None alone where the searches at the ends and in the middle find nothing.  Searches begin with
    the guesses too; those that were made already are known by the index of their problem.  The
    problems get harder from the first to the last, or easier.
    """
    begins: list[tuple[int, Answer | FloatArray]] = []
    for n, k in enumerate((0, len(problems) // 2, len(problems) - 1)):
        tell("searches at the ends", n, 3)
        found = known.get(k) or search(problems[k], STARTS, seed, guesses)
        begins += [(k, begin) for begin in _begins(problems[k], found)]
    return _walked(problems, begins, harder, tell) if begins else None


def _begins(problem: Problem, found: Found) -> list[Answer | FloatArray]:
    """Return the best answer of a search, and its best distinct ends."""
    chosen: list[tuple[FloatArray, float]] = []
    for start in sorted((s for s in found.starts if s.converged), key=lambda s: s.cost):
        if all(abs(np.log(start.cost / cost)) > _OTHER for _, cost in chosen):
            chosen.append((start.end, start.cost))
    answer = Answer.of(problem, found)
    ends = [values for values, _ in chosen[:_ENDS]]
    return [*ends] if answer is None else [answer, *ends]


def _walked(
    problems: Sequence[Problem],
    begins: Sequence[tuple[int, Answer | FloatArray]],
    harder: bool,
    tell: Progress,
) -> list[Answer | None]:
    """Return the best answers along walks from the index of a problem and what is close to it."""
    every = range(len(problems))
    best: list[Answer | None] = [None for _ in every]
    for k, (at, begin) in enumerate(begins):
        tell("walking from one to the next", k, len(begins))
        own = _along(problems, best, every[at:], begin)
        _along(problems, best, every[:at][::-1], own or begin)
    # Once more where a point is missing or worse than its harder neighbour: what serves a tight
    # bound serves a looser one.
    easing = every[::-1] if harder else every
    for order in (easing, easing[::-1]):
        for k, (i, j) in enumerate(itertools.pairwise(order), 1):
            one, other = best[i], best[j]
            if one is not None and (other is None or (order is easing and _better(one, other))):
                _along(problems, best, order[k:], one)
    return best


def _along(
    problems: Sequence[Problem],
    best: list[Answer | None],
    order: Sequence[int],
    begin: Answer | FloatArray,
) -> Answer | None:
    """Go on from problem to problem until another walk has been there with a better answer.

    Returns the first answer.
    """
    first: Answer | None = None
    for i in order:
        answer, known = follow(problems[i], [begin]), best[i]
        if answer is None:
            break
        if known is None or _better(answer, known):
            best[i] = answer
        elif i != order[0] or _better(known, answer):
            # Where another walk has done as well this one would only follow it, but for its own
            # beginning, which it may share.
            break
        first, begin = first or answer, answer
    return first


def _better(one: Answer, other: Answer) -> bool:
    return one.solved.objective < other.solved.objective - _SAME


#: What a front can be drawn against: name -> (limit's name, unit).
AGAINST: Mapping[str, tuple[str, str]] = {
    "torque": ("motor.torque.rms", "N m"),
    "speed": ("motor.speed.rms", "rad/s"),
    "max_sensitivity": ("max_sensitivity", ""),
    "delay_margin": ("delay_margin", "s"),
    "delay": ("telemetry delay", "s"),
}
_FROM, _TO = 1.15, 3.0  # of M_s, where the user does not say
_LONGER = 4.0  # that of the best motion, which a front of delay margins ends at
_LONGEST = 0.2  # of a telemetry delay [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class ParetoPoint:
    """One point of a front."""

    bound: float  #: What the other quantity was held to.
    name: str  #: Name of the limit that it bounds, if it does.
    answer: Answer  #: The optimum.

    @cached_property
    def value(self) -> float:
        """What the other quantity is."""
        limits, loop = self.answer.problem.limits, self.answer.assessment
        return next((m.worst(loop) for m in limits if m.name == self.name), self.bound)

    @cached_property
    def payload_rms(self) -> float:
        """Standard deviation of the payload [m]."""
        return self.answer.payload_rms

    @property
    def parameters(self) -> Mapping[str, float]:
        """The gains by name."""
        return self.answer.parameters

    @property
    def max_sensitivity(self) -> float:
        """Largest sensitivity M_s [-]."""
        return self.answer.assessment.max_sensitivity

    @cached_property
    def torque_rms(self) -> float:
        """Standard deviation of the dynamic motor torque [N m]."""
        return self.answer.assessment.sigma("motor.torque")

    @property
    def price(self) -> float:
        """Relative change of the payload's rms per relative change of the bound."""
        return float(self.answer.prices.get(self.name, 0.0))

    @property
    def excess(self) -> float:
        """Largest relative excess over a limit."""
        return self.answer.excess

    def verify(self) -> Verification:
        """Check the point by code that no search uses."""
        return self.answer.tuning.verify()


@dataclass(frozen=True, kw_only=True, eq=False)
class ParetoFront:
    """A front: points in the order of their bounds."""

    #: The question.
    case: Case
    against: str
    unit: str
    points: tuple[ParetoPoint, ...]  #: The points that hold, the bound ascending.
    lost: tuple[float, ...]  #: Bounds at which no point was found.
    amplifier: float  #: The fixed gain A of payload feedback.
    #: How many points were checked by other code and passed, of how many.
    verified: tuple[int, int] = (0, 0)

    @property
    def ok(self) -> bool:
        """Whether there is a front, and all that was checked passed."""
        return len(self.points) >= 2 and self.verified[0] == self.verified[1]

    @property
    def knee(self) -> ParetoPoint:
        """The point farthest from the chord, on logarithmic axes: where it turns most."""
        x = np.log([max(p.bound, 1e-12) for p in self.points])
        y = np.log([p.payload_rms for p in self.points])
        if len(x) < 3 or x[-1] == x[0] or y[-1] == y[0]:
            return self.points[-1]
        gap = (x - x[0]) / (x[-1] - x[0]) - (y - y[0]) / (y[-1] - y[0])
        return self.points[int(np.argmax(np.abs(gap)))]

    @property
    def columns(self) -> dict[str, FloatArray]:
        """The front as columns: bound, value, payload rms, M_s, torque, price and gains."""
        names = list(self.points[0].parameters) if self.points else []
        plain = ("bound", "value", "payload_rms", "max_sensitivity", "torque_rms", "price")
        columns = {n: np.array([float(getattr(p, n)) for p in self.points]) for n in plain}
        return columns | {n: np.array([p.parameters[n] for p in self.points]) for n in names}

    def to_csv(self) -> str:
        """Return the front as CSV, SI units."""
        columns = self.columns
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(columns), *(",".join(f"{v:.8g}" for v in row) for row in rows)]
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [f"ParetoFront of {self.case.name}: payload rms against {self.against}"]
        for p in self.points[:: max(1, len(self.points) // 8)]:
            lines.append(f"├ {p.bound:.4g} {self.unit}: {1e3 * p.payload_rms:.4g} mm")
        lines.append(
            f"└ {len(self.points)} points, {self.verified[0]} of {self.verified[1]} checked"
        )
        return "\n".join(lines)


@one_thread()
@shows_progress("searching")
def pareto_front(
    case: Case,
    against: str = "torque",
    *,
    points: int = 30,
    between: tuple[float, float] | None = None,
    seed: int = 0,
    checks: int = 5,
    progress: Progress | None = None,
) -> ParetoFront:
    """Return the least payload rms against another quantity, for payload feedback.

    The rope is damped as the case says; whether the gains hold with the least damping too, as
    designs of a hysteretic rope do, `evaluate_gains` says.

    Parameters
    ----------
    case
        The case; its other limits are kept throughout.
    against
        ``torque`` or ``speed`` (rms of the motor's dynamic part), ``max_sensitivity``,
        ``delay_margin`` (further delay that the loop must stand) or ``delay`` (that of the
        telemetry, which each point is designed for).
    points
        How many, at least 2.
    between
        Ends of the front, in SI units; by default from the least that can be had to what the
        best payload motion takes.
    seed
        Of the searches at the ends.
    checks
        How many points, evenly over the front, are verified by other code.
    progress
        Called as progress(stage, done, total).

    Raises
    ------
    InputError
        If the quantity is unknown or the ends are not in order.
    SynthesisError
        If no design keeps the limits at either end.
    """
    if against not in AGAINST:
        raise InputError(f"pareto: against must be one of {', '.join(AGAINST)}, got {against!r}")
    check_range("pareto", "points", points, low=2, high=1000)
    if between is not None and not 0.0 <= between[0] < between[1]:
        raise InputError(f"pareto: between must be two ascending numbers, got {between}")
    tell = progress or (lambda stage, done, total: None)
    name = AGAINST[against][0]
    guesses = [[case.gains.a, case.gains.a1, case.gains.a2]] if case.gains is not None else []
    tell("ends of the front", 0, 4)
    bounds, problems, known = _posed(case, against, int(points), between, seed, guesses)
    harder = against in ("delay", "delay_margin")
    best = best_of_each(problems, guesses, harder=harder, seed=seed, known=known, tell=tell)
    if best is None:
        raise SynthesisError(f"pareto: no gains keep the limits for any {name} in the range")
    return _checked(case, against, list(zip(bounds, best, strict=True)), checks, tell)


def _posed(
    case: Case,
    against: str,
    count: int,
    between: tuple[float, float] | None,
    seed: int,
    guesses: Sequence[Sequence[float]],
) -> tuple[FloatArray, list[Problem], dict[int, Found]]:
    """Return the bounds of a front, the problem at each, and what is known already by index."""
    if against == "delay":
        delays = np.linspace(*(between or (0.0, _LONGEST)), count)
        cases = [case.replace({"sensors.telemetry.delay": float(d)}) for d in delays]
        return delays, [pose(late).problem for late in cases], {}
    question, name = pose(case), AGAINST[against][0]
    others = tuple(limit for limit in question.limits if limit.name != name)
    known: dict[int, Found] = {}
    if between is None:
        between, known = _ends(question.problem_with(others), against, count, seed, guesses)
    bounds = _spaced(*between, count, against)
    problem = question.problem_with((*others, _limit(against, float(bounds[0]))))
    return bounds, [with_bound(problem, name, float(bound)) for bound in bounds], known


def _limit(against: str, bound: float) -> Limit:
    if against == "max_sensitivity":
        return MaxSensitivity(bound=bound)
    if against == "delay_margin":
        return DelayMargin(bound=bound)
    return Rms(bound=bound, output=f"motor.{against}")


def _ends(
    problem: Problem, against: str, count: int, seed: int, guesses: Sequence[Sequence[float]]
) -> tuple[tuple[float, float], dict[int, Found]]:
    """Return where a front begins and ends, and what was found there by index of the point.

    That is the least of the other quantity that can be had, and what the best motion takes.
    """
    if against == "max_sensitivity":
        return (_FROM, _TO), {}
    best = search(problem, STARTS, seed, guesses)
    if best.solved is None or best.assessment is None or best.excess > KEPT:
        raise SynthesisError("pareto: no gains keep the limits, whatever the other quantity")
    if against == "delay_margin":
        most = best.assessment.margins.delay
        return (most, _LONGER * most), {0: best}
    output = f"motor.{against}"
    least = search(replace(problem, minimise={output: 1.0}), STARTS, seed, guesses)
    top = best.assessment.sigma(output)
    if least.assessment is None or least.excess > KEPT:
        return (0.1 * top, top), {count - 1: best}
    # Slightly above the least, where nothing is free any more.
    return (min(1.01 * least.assessment.sigma(output), 0.99 * top), top), {
        0: least,
        count - 1: best,
    }


def _spaced(low: float, high: float, count: int, against: str) -> FloatArray:
    if against == "max_sensitivity":  # even in 1/M_s, the module margin
        return np.asarray(1.0 / np.linspace(1.0 / low, 1.0 / high, count))
    return np.geomspace(low, high, count) if low > 0.0 else np.linspace(low, high, count)


def _checked(
    case: Case,
    against: str,
    found: Sequence[tuple[float, Answer | None]],
    checks: int,
    tell: Progress,
) -> ParetoFront:
    name = AGAINST[against][0]
    points = [
        ParetoPoint(bound=float(bound), name=name, answer=answer)
        for bound, answer in found
        if answer is not None
    ]
    chosen = np.unique(np.linspace(0, len(points) - 1, min(checks, len(points))).astype(int))
    passed = 0
    for n, k in enumerate(chosen if points else []):
        tell("verify", n, len(chosen))
        passed += points[int(k)].verify().ok
    return ParetoFront(
        case=case,
        against=against,
        unit=AGAINST[against][1],
        points=tuple(points),
        lost=tuple(float(bound) for bound, answer in found if answer is None),
        amplifier=case.gains.A if case.gains is not None else 1.0,
        verified=(passed, len(chosen) if points else 0),
    )
