"""Worst members of a family, and what thousands of random ones say.

    gains + family -> corners, Sobol points -> the worst of them, zoomed in on -> members to add
    gains + family -> 10 000 draws -> share that is stable, worst figures -> DrawCheck

Everything goes through the engine of sweeps, which no search uses.  Limits that need crossings
(gain and delay margins, roll-off) are looked at exactly, one by one, for the members that are worst
already.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import qmc

from models.basics import FloatArray, InputError, peak_factor, read_only, share

from ..limits import Limit, MaxSensitivity, Thermal
from ..question import PAYLOAD, Objective
from ..search import Progress
from ..sweeps import SIGNS, SolvedRows, of_signs
from .family import Member
from .family_plants import FamilyPlants

_SAMPLES = 256  # Sobol points of a search for the worst
_TOP = 6  # of them that are zoomed in on
_AROUND = 24  # points around each in a round of zooming
_ZOOMS = 3
_CHUNK = 1000  # draws that are looked at between two words of progress
_QUANTILES = (0.5, 0.9, 0.99, 1.0)
LOOSE = 5e-3  # relative excess over a limit that a draw on common nodes may have


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What gains do to one member."""

    member: Member  #: The member.
    stable: bool  #: Whether the loop is stable.
    #: [m] and [-]; infinite where the loop is unstable.
    payload_rms: float
    max_sensitivity: float
    #: Largest use of a limit, and which.
    use: float
    limit: str

    def hurt(self, level: float) -> float:
        """Return how much the member asks for more than a cost `level` and the limits give."""
        if not self.stable:
            return np.inf
        return float(np.log(max(self.payload_rms / level, self.use)))


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawCheck:
    """What random members of the family say about gains."""

    #: Draws, how many are stable, and how many keep every limit that was looked at (to 0.5 %).
    count: int
    stable: int
    kept: int
    #: 95 % confidence interval of the share that is stable (Clopper and Pearson 1934).
    interval: tuple[float, float]
    worst_rms: Figures  #: The draw with the largest payload motion.
    #: Payload rms [m] that 50, 90, 99 and 100 % of the stable draws stay below.
    quantiles: Mapping[float, float]
    #: Of the stable draws [m], [-].
    payload_rms: FloatArray
    max_sensitivity: FloatArray
    seed: int  #: Of the draws.

    def __str__(self) -> str:
        """Return the verdict in a line."""
        return (
            f"{self.stable} of {self.count} random draws are stable (95 % confidence: at least "
            f"{100.0 * self.interval[0]:.2f} %), {self.kept} keep the limits"
        )


def figures_of(
    plants: FamilyPlants, values: Sequence[float], members: Sequence[Member]
) -> list[Figures]:
    """Return what gains do to many members."""
    limits = [lim for lim in plants.nominal.limits if lim.drive or isinstance(lim, MaxSensitivity)]
    outputs = sorted({PAYLOAD, *(o for limit in limits for o in limit.outputs)})
    found: dict[int, Figures] = {}
    together = [(lim.output, lim.speed) for lim in limits if isinstance(lim, Thermal)]
    for at, loops in plants.loops(values, members, outputs, together):
        found |= {at[k]: _figures(limits, members[at[k]], loops, k) for k in range(len(at))}
    return [found[k] for k in range(len(members))]


def _figures(limits: Sequence[Limit], member: Member, loops: SolvedRows, index: int) -> Figures:
    """Return what gains do to a member, by its index among solved loops."""
    if not loops.stable[index]:
        return _unstable(member)
    at_rest, losses = (
        {name: float(v[index % v.size]) for name, v in side.items()} for side in loops.holding
    )
    assessment = _OneLoop(max_sensitivity=float(loops.peak[index]), loops=loops, index=index)
    use, name = 0.0, ""
    for limit in limits:
        own = _at_rest(limit, at_rest, losses)
        used = own.use(own.worst(assessment))  # type: ignore[arg-type]  # all that it asks for
        if used > use:
            use, name = used, limit.name
    return Figures(
        member=member,
        stable=True,
        payload_rms=assessment.sigma(PAYLOAD),
        max_sensitivity=assessment.max_sensitivity,
        use=use,
        limit=name,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _OneLoop:
    """One of many loops as the limits see it (`synth.limits.limits.Limit.measure`)."""

    max_sensitivity: float
    loops: SolvedRows
    index: int
    signs: tuple[float, ...] | None = None

    @property
    def members(self) -> list[_OneLoop]:
        """The loop with each combination of signs of the reference unit's errors; or itself."""
        hang = any(one == other for one, other in self.loops.products)
        return [replace(self, signs=signs) for signs in SIGNS] if hang else [self]

    def _both(self, output: str) -> FloatArray:
        """Return the variances of an output and of its rate, (2,)."""
        mean = self.loops.moments[output][self.index, :, 0]
        return np.asarray(mean + self._of_signs((output, output)))

    def _of_signs(self, pair: tuple[str, str]) -> FloatArray:
        if self.signs is None or pair not in self.loops.products:
            return np.zeros(2)
        of_pair = self.loops.products[pair][self.index, None]
        return np.asarray(of_signs(of_pair, self.signs)[0])

    def sigma(self, output: str) -> float:
        """Return the standard deviation of an output."""
        return float(np.sqrt(self._both(output)[0]))

    def covariance(self, one: str, other: str) -> float:
        """Return the covariance of two outputs."""
        mean = self.loops.products[one, other][self.index, 0]
        return float((mean + self._of_signs((one, other)))[0])

    def peak(self, output: str, duration: float) -> float:
        """Return the most probable maximum of an output in `duration` [s]."""
        m0, m2 = self._both(output)
        period = 2.0 * np.pi * np.sqrt(m0 / m2) if m2 > 0.0 else np.inf
        return peak_factor(float(period), duration) * self.sigma(output)


def exact_figures(plants: FamilyPlants, values: Sequence[float], member: Member) -> Figures:
    """Return what gains do to one member: every limit, refined nodes, exact delays."""
    problem = plants.scenario(member).problem
    assessment = problem.assess(values)
    if not assessment.stable:
        return _unstable(member)
    uses = {limit.name: limit.use(limit.worst(assessment)) for limit in problem.limits}
    name = max(uses, key=lambda n: uses[n], default="")
    return Figures(
        member=member,
        stable=True,
        payload_rms=assessment.sigma(PAYLOAD),
        max_sensitivity=assessment.max_sensitivity,
        use=uses.get(name, 0.0),
        limit=name,
    )


def worst_members(
    plants: FamilyPlants,
    values: Sequence[float],
    level: float,
    objective: Objective,
    *,
    tolerance: float,
    most: int = 2,
    seed: int = 0,
    known: Sequence[Member] = (),
) -> list[Figures]:
    """Return at most so many members that hurt more than a tolerance, the worst first, or none.

    The gains are said to hold the cost `level` [m], which counts for the worst case only; the
    tolerance is of the logarithm of cost over level, and of use of a limit.  Known members are in
    the set already; the seed is that of the Sobol points.
    """
    family = plants.family
    count_cost = objective is Objective.WORST
    level = level if count_cost else np.inf
    # The corners where there are few: extremes of a smooth thing are mostly at ends.
    try:
        members = family.corners()
    except InputError:
        members = []
    members = members[:_SAMPLES]
    if family.continuous:
        cube = qmc.Sobol(len(family.axes) + 1, seed=seed)
        members += family.at(cube.random_base2(int(np.log2(_SAMPLES))))
    found = figures_of(plants, values, members)
    best = sorted(found, key=lambda f: -f.hurt(level))[:_TOP]
    width = 0.25
    # Between the ends only where one looks: the worst so far are looked at more and more closely.
    for _ in range(_ZOOMS if family.continuous else 0):
        around = [m for f in best for m in _around(plants, f.member, width, seed)]
        seed += 1
        best = sorted([*best, *figures_of(plants, values, around)], key=lambda f: -f.hurt(level))
        best = best[:_TOP]
        width *= 0.35
    exact: list[Figures] = []
    for candidate in best:
        if candidate.member in known or any(candidate.member == f.member for f in exact):
            continue
        if all(_apart(plants, candidate.member, f.member) for f in exact):
            exact.append(exact_figures(plants, values, candidate.member))
    worse = [f for f in exact if f.hurt(level) > tolerance]
    return sorted(worse, key=lambda f: -f.hurt(level))[:most]


def draw_check(
    plants: FamilyPlants,
    values: Sequence[float],
    count: int,
    seed: int = 1,
    progress: Progress | None = None,
) -> DrawCheck:
    """Return what `count` random members say about gains."""
    members = plants.family.draw(count, seed)
    every: list[Figures] = []
    for at in range(0, count, _CHUNK):
        if progress is not None:
            progress("random draws", at, count)
        every += figures_of(plants, values, members[at : at + _CHUNK])
    if progress is not None:
        progress("random draws", count, count)
    stable = [f for f in every if f.stable]
    rms = np.array([f.payload_rms for f in stable])
    kept = sum(1 for f in stable if f.use <= 1.0 + LOOSE)
    unstable = [f for f in every if not f.stable]
    certain = share(len(stable), count)
    return DrawCheck(
        count=count,
        stable=len(stable),
        kept=kept,
        interval=(certain.low, certain.high),
        worst_rms=max(unstable or stable, key=lambda f: f.payload_rms),
        quantiles={q: float(np.quantile(rms, q)) if rms.size else np.inf for q in _QUANTILES},
        payload_rms=read_only(rms),
        max_sensitivity=read_only(np.array([f.max_sensitivity for f in stable])),
        seed=seed,
    )


def _unstable(member: Member) -> Figures:
    figures = dict.fromkeys(("payload_rms", "max_sensitivity", "use"), np.inf)
    return Figures(member=member, stable=False, limit="stability", **figures)


def _at_rest(limit: Limit, values: Mapping[str, float], losses: Mapping[str, float]) -> Limit:
    """Return a limit with the static value and the loss of one plant."""
    given = {"static": values, "loss": losses}
    own = {k: v.get(limit.outputs[0], 0.0) for k, v in given.items() if hasattr(limit, k)}
    changed: Limit = replace(limit, **own)  # type: ignore[arg-type]
    return changed


def _around(plants: FamilyPlants, member: Member, width: float, seed: int) -> list[Member]:
    """Return points about a member, as far as `width` of each range, in all seas by turns."""
    family, rng = plants.family, np.random.default_rng(seed)
    members = []
    for k in range(_AROUND):
        point = list(member.point)
        for i in family.continuous:
            axis = family.axes[i]
            step = width * (axis.high - axis.low) * rng.uniform(-1.0, 1.0)
            point[i] = min(max(float(point[i]) + step, axis.low), axis.high)
        sea = member.sea if k % 3 else int(rng.integers(len(family.seas)))
        members.append(Member(point=tuple(point), sea=sea))
    return members


def _apart(plants: FamilyPlants, a: Member, b: Member) -> bool:
    """Return whether two members differ by more than a hundredth of some range."""
    return a.sea != b.sea or any(
        abs(x - y) > 0.01 * (axis.high - axis.low) if axis.continuous else x != y
        for axis, x, y in zip(plants.family.axes, a.point, b.point, strict=True)
    )
