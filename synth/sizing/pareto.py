"""Pareto fronts: how still the payload can be held against what it costs.

    question -> end points -> bounds in between -> warm-started continuation, both ways
             -> exchange of nodes over the whole front -> ParetoFront

The epsilon-constraint method: the payload's variance is minimised under a bound on the other
quantity, the bound moved in steps.  A bound is a number that the programme is given with each
solve, so one programme serves the whole front and every solve begins at its neighbour's
answer.  A front may change basins: it is walked from both ends and from every basin that the
search at its ends found, and the best answer at each bound counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.basics import FloatArray, InputError, SynthesisError, check_range, one_thread
from models.case import Case

from ..limits import DelayMargin, Limit, MaxSensitivity, Rms
from ..question import Problem, pose
from ..search import KEPT, Found, Progress, Solution, polish, search
from .pareto_point import ParetoPoint, point_of
from .pareto_walk import FrontWalk, exchanged, with_bound

#: What a front can be drawn against: name -> (limit's name, unit).
AGAINST: Mapping[str, tuple[str, str]] = {
    "torque": ("motor.torque.rms", "N m"),
    "speed": ("motor.speed.rms", "rad/s"),
    "max_sensitivity": ("max_sensitivity", ""),
    "delay_margin": ("delay_margin", "s"),
    "delay": ("telemetry delay", "s"),
}
_STARTS = 6  # of the searches at the ends and in the middle
_ENDS = 2  # distinct answers of each that a walk begins from
_FROM, _TO = 1.15, 3.0  # of M_s, where the user does not say
_LONGER = 4.0  # that of the best motion, which a front of delay margins ends at
_LONGEST = 0.2  # of a telemetry delay [s]
_DELAY_STARTS = 8  # of the searches of a front of delays, whose points share no programme
_SAME = 1e-6  # log costs that differ by less are the same answer


@dataclass(frozen=True, kw_only=True, eq=False)
class ParetoFront:
    """A front: points in the order of their bounds.

    Attributes
    ----------
    case, against, unit
        The question.
    points
        The points that hold, the bound ascending.
    lost
        Bounds at which no point was found.
    amplifier
        The fixed gain A of payload feedback.
    verified
        How many points were checked by other code and passed, of how many.
    """

    case: Case
    against: str
    unit: str
    points: tuple[ParetoPoint, ...]
    lost: tuple[float, ...]
    amplifier: float
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
    if against == "delay":
        found = delay_points(case, points, between or (0.0, _LONGEST), seed, tell)
    else:
        found = _bound_points(case, against, points, between, seed, tell)
    return _checked(case, against, found, checks, tell)


def _bound_points(
    case: Case,
    against: str,
    count: int,
    between: tuple[float, float] | None,
    seed: int,
    tell: Progress,
) -> list[tuple[float, ParetoPoint | None]]:
    question = pose(case)
    name = AGAINST[against][0]
    others = tuple(limit for limit in question.limits if limit.name != name)
    guesses = [[case.gains.a, case.gains.a1, case.gains.a2]] if case.gains is not None else []
    tell("ends of the front", 0, 4)
    known: dict[int, Found] = {}
    if between is None:
        between, known = _ends(question.problem_with(others), against, count, seed, guesses)
    low, high = between
    bounds = _spaced(low, high, count, against)
    # What a programme covers by the bound that it is made with, it must cover for all: the disc of
    # the loosest M_s, the arc of the longest delay.
    problem = question.problem_with((*others, _limit(against, float(bounds[-1]))))
    walk = FrontWalk(problem, name, bounds)
    for n, k in enumerate((0, count // 2, count - 1)):
        tell("ends of the front", n + 1, 4)
        if k not in known:
            here = with_bound(problem, name, float(bounds[k]))
            known[k] = search(here, _STARTS, seed, guesses)
        walk.begins += [(k, *end) for end in _ends_of(known[k])]
    if not walk.begins:
        raise SynthesisError(f"pareto: no gains keep the limits for any {name} in the range")
    walk.go(tell)
    return exchanged(walk, tell)


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
    best = search(problem, _STARTS, seed, guesses)
    if best.solved is None or best.assessment is None or best.excess > KEPT:
        raise SynthesisError("pareto: no gains keep the limits, whatever the other quantity")
    if against == "delay_margin":
        most = best.assessment.margins.delay
        return (most, _LONGER * most), {0: best}
    output = f"motor.{against}"
    least = search(replace(problem, minimise={output: 1.0}), _STARTS, seed, guesses)
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


def _ends_of(found: Found) -> list[tuple[FloatArray, float | None]]:
    """Return the best distinct ends of a search."""
    if found.solved is None:
        return []
    chosen: list[tuple[FloatArray, float]] = []
    for start in sorted((s for s in found.starts if s.converged), key=lambda s: s.cost):
        if all(abs(np.log(start.cost / cost)) > 1e-3 for _, cost in chosen):
            chosen.append((start.end, start.cost))
    ends: list[tuple[FloatArray, float | None]] = [(v, None) for v, _ in chosen[:_ENDS]]
    if found.excess <= KEPT:
        ends.insert(0, (found.solved.values, found.solved.coefficient))
    return ends


def _checked(
    case: Case,
    against: str,
    found: Sequence[tuple[float, ParetoPoint | None]],
    checks: int,
    tell: Progress,
) -> ParetoFront:
    points = [p for _, p in found if p is not None]
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
        lost=tuple(bound for bound, p in found if p is None),
        amplifier=case.gains.A if case.gains is not None else 1.0,
        verified=(passed, len(chosen) if points else 0),
    )


def delay_points(
    case: Case, count: int, between: tuple[float, float], seed: int, tell: Progress
) -> list[tuple[float, ParetoPoint | None]]:
    """Return the best answer at each delay [s], None where there is none."""
    delays = np.linspace(*between, count)
    problems = [pose(case.replace({"sensors.telemetry.delay": float(d)})).problem for d in delays]
    guesses = [[case.gains.a, case.gains.a1, case.gains.a2]] if case.gains is not None else []
    best: list[tuple[Solution, float] | None] = [None] * count
    begins: list[tuple[int, Solution, FloatArray]] = []
    for n, k in enumerate((0, count // 2, count - 1)):
        tell("ends of the front", n, 3)
        found = search(problems[k], _DELAY_STARTS, seed, guesses)
        if found.solved is not None and found.excess <= KEPT and found.reference is not None:
            begins.append((k, found.solved, found.reference))
            _keep(best, k, found.solved, found.excess)
    if not begins:
        raise SynthesisError("pareto: no gains keep the limits at any delay in the range")
    for n, (k, solved, reference) in enumerate(begins):
        tell("walking along the front", n, len(begins))
        _along(problems, best, range(k + 1, count), solved, reference)
        _along(problems, best, range(k - 1, -1, -1), solved, reference)
    points: list[tuple[float, ParetoPoint | None]] = []
    for delay, problem, kept in zip(delays, problems, best, strict=True):
        point = None if kept is None else point_of(problem, "", float(delay), kept[0])
        points.append((float(delay), point))
    return points


def _along(
    problems: Sequence[Problem],
    best: list[tuple[Solution, float] | None],
    order: Sequence[int],
    solved: Solution,
    reference: FloatArray,
) -> None:
    """Go on from delay to delay until another walk has been there with a better answer."""
    for i in order:
        problem = problems[i]
        if not problem.stable(solved.values, solved.coefficient):
            return
        again, _, excess = polish(problem, solved, solved.values)
        if again is solved or excess > KEPT:
            return
        if not _keep(best, i, again, excess):
            return
        solved = again


def _keep(
    best: list[tuple[Solution, float] | None], index: int, solved: Solution, e: float
) -> bool:
    known = best[index]
    if known is not None and known[0].objective <= solved.objective + _SAME:
        return False
    best[index] = solved, e
    return True
