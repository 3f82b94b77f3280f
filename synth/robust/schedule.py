r"""Gain schedule over the rope's length: smooth functions through optimised nodes.

    case + lengths -> gains at a few nodes -> spline in log L -> checked between the nodes
                   -> where it does not hold or costs too much: one more node -> GainSchedule

Every gain is a cubic spline over log L, linear between two nodes; at any length it is a fixed
combination of its values at the nodes.  So the nodes' gains are tuned together, by the
programme of a family whose members are lengths, each with its blend of the nodes
(`synth.question.family_problem`).  Lengths between the nodes at which a limit leaks become members.
The length changes slowly against the loop: each length is a loop of its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from models.basics import FloatArray, InputError, check_range, one_thread, read_only, shows_progress
from models.case import Case

from ..design import gains_in_use
from ..question import FamilyProblem, Objective
from ..search import KEPT, Progress, search
from ..sizing import Answer, best_of_each
from .family import Family, Member
from .family_plants import FamilyPlants
from .worst_case import Figures, exact_figures

LENGTH = "rope.length"
_FORMAT = 1  # version of the file
KEPT_BETWEEN = 1e-3  # relative excess over a limit that counts as kept between the nodes
_MOST_NODES = 9
_MOST_ROUNDS = 12
_CLOSE = 0.10  # what a schedule may lose against gains of its own at any length, relatively


@dataclass(frozen=True, kw_only=True)
class SchedulePoint(Figures):
    """What the schedule does at one length, and what the best gains would do, `best_rms` [m]."""

    best_rms: float

    @property
    def length(self) -> float:
        """The rope's length [m]."""
        return float(self.member.point[0])

    @property
    def ok(self) -> bool:
        """Whether the loop is stable and every limit is kept, to a part in a thousand."""
        return self.stable and self.use <= 1.0 + KEPT_BETWEEN


@dataclass(frozen=True, kw_only=True, eq=False)
class GainSchedule:
    """Gains over the rope's length."""

    case: Case  #: The case.
    #: Nodes [m], ascending (k,), and the gains there, (k, number of gains).
    lengths: FloatArray
    gains: FloatArray
    #: Names of the gains, and the fixed gain A.
    names: tuple[str, ...]
    amplifier: float = 1.0
    #: Whether it holds at every length that was looked at; in words.
    ok: bool = False
    status: str = ""
    points: tuple[SchedulePoint, ...] = ()  #: What it does at many lengths.
    #: How many lengths were checked by other code and passed, of how many.
    verified: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        lengths = np.asarray(self.lengths, dtype=np.float64)
        gains = np.asarray(self.gains, dtype=np.float64)
        if lengths.ndim != 1 or lengths.size < 1 or gains.shape != (lengths.size, len(self.names)):
            raise InputError(
                f"gain schedule: must have one row of {len(self.names)} gains for each length, got "
                f"{gains.shape} for {lengths.shape}"
            )
        finite = np.isfinite([*lengths, *gains.ravel(), self.amplifier]).all()
        if not finite or lengths.min() <= 0.0 or np.any(np.diff(np.log(lengths)) <= 0.0):
            raise InputError(
                "gain schedule: lengths must ascend from above 0, and all numbers be finite"
            )
        object.__setattr__(self, "lengths", read_only(lengths))
        object.__setattr__(self, "gains", read_only(gains))

    def at(self, length: float) -> dict[str, float]:
        """Return the gains ``A`` and by name at a length [m].

        Raises InputError if the length lies beyond the nodes: a spline is not to be extrapolated.
        """
        low, high = float(self.lengths[0]), float(self.lengths[-1])
        check_range("gain schedule", "length", length, low=low, high=high, unit="m")
        values = blend_of(self.lengths, length) @ self.gains
        return {"A": self.amplifier, **dict(zip(self.names, map(float, values), strict=True))}

    def to_csv(self, count: int = 0) -> str:
        """Return the schedule as CSV: its nodes, or `count` lengths for a drive's own table."""
        lengths = self.lengths
        if count:
            lengths = np.geomspace(self.lengths[0], self.lengths[-1], count)
            lengths[0], lengths[-1] = self.lengths[0], self.lengths[-1]
        lines = [f"rope.length,A,{','.join(self.names)}"]
        for length in lengths:
            values = self.at(float(length)).values()
            lines.append(",".join(f"{v:.10g}" for v in (length, *values)))
        return "\n".join(lines) + "\n"

    def to_yaml(self) -> str:
        """Return the schedule as YAML; `from_yaml` reads it again."""
        from models.casefile import yaml_text

        rows = [[float(v) for v in row] for row in self.gains]
        return yaml_text(
            {
                "stillhook_schedule": _FORMAT,
                "case": self.case.name,
                "over": LENGTH,
                "interpolation": "cubic spline in log(length), linear between two nodes",
                "amplifier": float(self.amplifier),
                "lengths": [float(v) for v in self.lengths],
                "gains": {name: [r[k] for r in rows] for k, name in enumerate(self.names)},
            }
        )

    @classmethod
    def from_yaml(cls, text: str, case: Case, source: str = "schedule") -> GainSchedule:
        """Return a schedule from its YAML text; what it does has to be looked at again.

        Raises InputError if the text is not a schedule.
        """
        from models.casefile import read_yaml

        data, _ = read_yaml(text, source)
        if not isinstance(data, Mapping) or not isinstance(data.get("gains"), Mapping):
            raise InputError(f"{source}: is not a gain schedule: it has no section gains")
        try:
            for key, wanted in (("stillhook_schedule", _FORMAT), ("over", LENGTH)):
                if data[key] != wanted:
                    raise InputError(f"{key} must be {wanted}, got {data[key]!r}")
            names = tuple(str(name) for name in data["gains"])
            return cls(
                case=case,
                lengths=np.array(data["lengths"], dtype=np.float64),
                gains=np.array(list(data["gains"].values()), dtype=np.float64).T,
                names=names,
                amplifier=float(data["amplifier"]),
                status="read from a file; not checked",
            )
        # An InputError is a ValueError: what is wrong with the numbers is told of the file.
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{source}: is not a gain schedule: {error}") from error
        except KeyError as error:
            raise InputError(f"{source}: is not a gain schedule: {error} is missing") from error

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [f"GainSchedule for {self.case.name}: {self.status}"]
        for length in self.lengths:
            gains = self.at(float(length))
            text = ", ".join(f"{n} = {v:.5g}" for n, v in gains.items())
            lines.append(f"├ {length:.0f} m: {text}")
        worst = max((p.payload_rms for p in self.points), default=float("nan"))
        lines.append(f"└ {len(self.points)} lengths looked at, {1e3 * worst:.4g} mm at most")
        return "\n".join(lines)


def blend_of(nodes: npt.ArrayLike, length: float) -> FloatArray:
    """Return the weights of the nodes' values in the spline at a length, (k,).

    A cubic spline over log L with the not-a-knot ends, a parabola of three nodes, a line of
    two: each is linear in its values, so it is the splines of the unit vectors.
    """
    lengths = np.asarray(nodes, dtype=np.float64)
    count = lengths.size
    if count == 1:
        return np.ones(1)
    return np.asarray(CubicSpline(np.log(lengths), np.eye(count))(np.log(length)))


@one_thread()
@shows_progress("searching")
def schedule_gains(
    case: Case,
    lengths: tuple[float, float],
    *,
    checks: int = 33,
    close: float = _CLOSE,
    seed: int = 0,
    progress: Progress | None = None,
) -> GainSchedule:
    """Return gains over the rope's length that hold everywhere between two lengths.

    The rope is damped as the case says; whether the gains hold with the least damping too, as
    designs of a hysteretic rope do, `evaluate_gains` says.

    Parameters
    ----------
    case
        The case; its own length does not matter.
    lengths
        Shortest and longest rope [m].
    checks
        Lengths, evenly in log L, at which the schedule has to hold.
    close
        What it may lose against gains of its own at any of them, relatively, before it gets
        one more node.
    seed
        Of the searches at the nodes.
    progress
        Called as progress(stage, done, total).

    Raises
    ------
    InputError
        If the lengths are not in order, or the case does not allow them.
    """
    shortest, longest = (float(v) for v in lengths)
    if not 0.0 < shortest < longest:
        raise InputError(f"gain schedule: lengths must be two ascending ones, got {lengths}")
    check_range("gain schedule", "checks", checks, low=5, high=500)
    work = _ScheduleSearch(case, np.geomspace(shortest, longest, int(checks)), seed, progress)
    return work.schedule(close)


class _ScheduleSearch:
    """The search for one schedule: the loop at each checked length, and its own best gains."""

    def __init__(
        self, case: Case, lengths: FloatArray, seed: int, progress: Progress | None
    ) -> None:
        self.case, self.lengths, self._seed = case, lengths, seed
        self._tell = progress or (lambda stage, done, total: None)
        family = Family.of(case, {LENGTH: [float(lengths[0]), float(lengths[-1])]})
        self.plants = FamilyPlants(family)
        self.members = [Member(point=(float(v),)) for v in lengths]
        self.middles = np.sqrt(lengths[1:] * lengths[:-1])

    @cached_property
    def own(self) -> list[Answer | None]:
        """The best gains of each checked length alone, by continuation from its neighbours."""
        problems = [self.plants.scenario(member).problem for member in self.members]
        found = best_of_each(
            problems,
            gains_in_use(self.plants.nominal),
            harder=True,  # a longer rope is softer
            seed=self._seed,
            known={},
            tell=self._tell,
        )
        return found or [None for _ in problems]

    def schedule(self, close: float) -> GainSchedule:
        """Return the schedule, its nodes added until it holds and costs little."""
        own = self.own
        lost = [float(v) for v, f in zip(self.lengths, own, strict=True) if f is None]
        names = tuple(p.name for p in self.plants.nominal.law.parameters)
        if lost:
            status = f"no gains keep the limits at a length of {lost[0]:.4g} m"
            return self._made([0, len(own) - 1], np.zeros((2, len(names))), [], False, status)
        # Two sets grow: the nodes, through which the gains go, and the members, at which the limits
        # are held.  A length that leaks becomes a member; where all hold and one still loses too
        # much against gains of its own, it becomes a node.
        nodes = [0, len(own) - 1]
        members = {float(self.lengths[i]) for i in (0, len(own) // 2, len(own) - 1)}
        best: tuple[list[int], FloatArray, list[SchedulePoint], int] | None = None
        for k in range(_MOST_ROUNDS):
            self._tell("tuning the nodes together", k, _MOST_ROUNDS)
            gains = self._tuned(nodes, sorted(members))
            more = _widest(nodes)
            if gains is not None:
                points = [self._point(nodes, gains, float(v)) for v in self.lengths]
                wrong = [p for p in points if not p.ok]
                looked = len(points)
                if not wrong:
                    between = [self._point(nodes, gains, float(v)) for v in self.middles]
                    wrong, looked = [p for p in between if not p.ok], looked + len(between)
                fresh = [p for p in wrong if p.length not in members]
                if fresh:
                    members |= _spread(fresh, self.lengths)
                    continue
                if not wrong:
                    best = nodes, gains, points, looked
                    losses = [p.payload_rms / p.best_rms - 1.0 for p in points]
                    if max(losses) <= close:
                        break
                    more = int(np.argmax(losses))
                    if more in nodes:
                        more = _widest(nodes)
            if more is None or len(nodes) >= _MOST_NODES:
                break
            nodes = sorted({*nodes, more})
            members |= {float(self.lengths[i]) for i in nodes}
        if best is None:
            status = f"no schedule of {_MOST_NODES} nodes keeps the limits at every length"
            values = np.array([f.solved.values for f in own if f is not None])
            return self._made(nodes, values[nodes], [], False, status)
        return self._finished(*best, close)

    def _finished(
        self,
        nodes: list[int],
        gains: FloatArray,
        points: list[SchedulePoint],
        looked: int,
        close: float,
    ) -> GainSchedule:
        chosen = np.unique(np.linspace(0, len(self.lengths) - 1, 5).astype(int))
        passed = 0
        for n, i in enumerate(chosen):
            self._tell("verify", n, len(chosen))
            passed += self._verified(nodes, gains, int(i))
        loss = max(p.payload_rms / p.best_rms for p in points) - 1.0
        status = (
            f"holds at {looked} lengths with {len(nodes)} nodes, at most "
            f"{100.0 * loss:.1f} % worse than gains of their own"
        )
        if passed < len(chosen):
            status = f"not verified: {passed} of {len(chosen)} lengths passed"
        elif loss > close:
            status += f", more than the {100.0 * close:.0f} % asked for"
        made = self._made(nodes, gains, points, passed == len(chosen), status)
        return replace(made, verified=(passed, len(chosen)))

    def _made(
        self,
        nodes: Sequence[int],
        gains: FloatArray,
        points: Sequence[SchedulePoint],
        ok: bool,
        status: str,
    ) -> GainSchedule:
        return GainSchedule(
            case=self.case,
            lengths=self.lengths[list(nodes)],
            gains=gains,
            names=tuple(p.name for p in self.plants.nominal.law.parameters),
            amplifier=self.plants.nominal.amplifier or 1.0,
            ok=ok,
            status=status,
            points=tuple(points),
        )

    def _tuned(self, nodes: Sequence[int], members: Sequence[float]) -> FloatArray | None:
        """Return the gains at the nodes that serve some lengths best together."""
        parameters = self.plants.nominal.law.parameters
        count = len(parameters)
        starts = np.array([f.solved.values for f in self.own if f is not None])
        scenarios = []
        for length in members:
            weights = blend_of(self.lengths[list(nodes)], length)
            scenario = self.plants.scenario(Member(point=(length,)))
            blend = np.asarray(np.kron(weights, np.eye(count)), dtype=np.float64)
            scenarios.append(replace(scenario, blend=blend, best=self._best(length)))
        every = tuple(
            replace(p, name=f"{p.name} at {self.lengths[node]:.4g} m")
            for node in nodes
            for p in parameters
        )
        problem = FamilyProblem(
            scenarios=tuple(scenarios), objective=Objective.REGRET, parameters=every
        )
        guesses = [starts[list(nodes)].ravel()]
        # Between nodes in different basins a spline may be unstable: then one set for all.
        guesses += [np.tile(starts[k], len(nodes)) for k in (0, len(starts) // 2, -1)]
        stable = [g for g in guesses if problem.stable(g)]
        if not stable:
            return None
        found = search(problem, len(stable), self._seed, stable, only_guesses=True)
        if found.solved is None or found.excess > 10.0 * KEPT:
            return None
        return np.asarray(found.solved.values.reshape(len(nodes), count))

    def _point(self, nodes: Sequence[int], gains: FloatArray, length: float) -> SchedulePoint:
        values = [float(v) for v in blend_of(self.lengths[list(nodes)], length) @ gains]
        figures = exact_figures(self.plants, values, Member(point=(length,)))
        # No worse than what is done: a search of its own may have missed it by a hair.
        best = min(self._best(length), figures.payload_rms)
        return SchedulePoint(**vars(figures), best_rms=best)

    def _best(self, length: float) -> float:
        """Return what gains of its own do at a length [m], between those looked at in between."""
        costs = [float(f.solved.objective) for f in self.own if f is not None]
        return float(np.exp(np.interp(np.log(length), np.log(self.lengths), costs)))

    def _verified(self, nodes: Sequence[int], gains: FloatArray, index: int) -> bool:
        """Return whether other code confirms the loop at one length."""
        problem = self.plants.scenario(self.members[index]).problem
        own = self.own[index]
        assert own is not None
        values = blend_of(self.lengths[list(nodes)], float(self.lengths[index])) @ gains
        assessment = problem.assess(values)
        known = (assessment.coefficients,)
        solved = replace(own.solved, values=np.asarray(values), coefficients=known)
        failed = replace(own, solved=solved, assessment=assessment).tuning.verify().failed
        return not [name for name in failed if not name.startswith("limits")]


def _widest(nodes: Sequence[int]) -> int | None:
    """Return the middle of the widest gap between nodes, if there is anything in it."""
    gap, first = max((b - a, a) for a, b in itertools.pairwise(nodes))
    return None if gap < 2 else first + gap // 2


def _spread(points: Sequence[SchedulePoint], lengths: FloatArray) -> set[float]:
    """Return the worst of each run of neighbouring lengths that do not hold."""
    step = 1.5 * float(np.log(lengths[1] / lengths[0]))
    runs: list[list[SchedulePoint]] = []
    for point in points:
        if runs and np.log(point.length / runs[-1][-1].length) < step:
            runs[-1].append(point)
        else:
            runs.append([point])
    return {max(run, key=lambda p: p.use).length for run in runs}
