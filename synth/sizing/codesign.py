"""Co-design: gear ratio and drum radius together with the gains, for a given motor.

    case, ranges -> optimum of the gains behind each gear, from neighbour to neighbour
                 -> Brent's method on log n (and log r) -> CoDesign

The gear enters plant and limits: reflected inertia I_D/n^2, speed n/r of the haul, torque r/n of
the tension.  So it is searched around the gains, whose optimum behind a neighbouring gear is a
start that needs a few steps.  The best gear is a smooth optimum, an end of the range, or a corner,
where one limit hands over to another and the motion rises steeply on either side.

A drum of another radius keeps its width and the thickness of its wall: its inertia goes with the
cube.  Nearly everything hangs on n/r alone, so the pair is searched in n/r and r, whose optima
hardly depend on each other; a drum that gains nothing stays as it is.
"""

import math
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from models.basics import InputError, check_range, one_thread, shows_progress
from models.case import Case

from ..design import Design, optimise_gains
from ..question import Problem
from ..search import Progress
from .follow import (
    Answer,
    answer_of,
    asked_by,
    designed,
    end_text,
    follow,
    least_between,
    posed,
)

_GRID = 7  # gears that are tried before the Brent's method
_FINE = 2e-3  # of the logarithm of the gear
_RADII = 3  # Brent's methods along the radius and back
_GAIN = 1e-3  # share of the rms that another drum must gain at least
_DRUM = 3.0  # inertia of a drum over its radius


@dataclass(frozen=True, kw_only=True, eq=False)
class CoPoint:
    """The best gains behind one gear; `payload_rms` is infinite where no gains keep the limits."""

    gear: float
    radius: float
    payload_rms: float
    binding: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class CoDesign:
    """The answer of `co_design`."""

    #: The case given and the controller structure.
    case: Case
    structure: str
    #: Whether the design is verified; the sentence for the user.
    ok: bool = False
    status: str
    #: The best ratio [-] and drum radius [m].
    gear: float
    radius: float
    #: Of the payload there, and behind the case's own gear (infinite if its limits cannot be kept)
    #: [m].
    payload_rms: float = math.inf
    given_rms: float
    points: tuple[CoPoint, ...]  #: All gears that were tried, by ratio.
    #: The case with that gear, and its gains, verified.
    best_case: Case | None = None
    design: Design | None = None

    def to_csv(self) -> str:
        """Return the gears that were tried as CSV, SI units."""
        lines = ["gear,radius,payload_rms,limited_by"]
        for p in self.points:
            figures = f"{p.gear:.8g},{p.radius:.8g},{p.payload_rms:.8g}"
            lines.append(f"{figures},{' '.join(p.binding)}")
        return "\n".join(lines) + "\n"


@dataclass(kw_only=True)
class _Gears:
    """The optimum behind each gear, as far as it was looked at."""

    case: Case
    structure: str
    masses: int
    begin: Answer | None
    tell: Progress
    answers: dict[tuple[float, float], Answer | None] = field(default_factory=dict)

    def problem(self, gear: float, radius: float) -> Problem:
        """Return the problem behind a gear."""
        case = self.case.variant(
            {"limits.drive": "report", **gear_changes(self.case, gear, radius)}
        )
        return asked_by(self.case, posed(case, self.structure, self.masses))

    def at(self, gear: float, radius: float) -> Answer | None:
        """Return the optimum behind a gear, from the nearest that is known."""
        key = gear, radius
        if key not in self.answers:
            done = len(self.answers)
            self.tell("gears", done, done + 1)
            known = [k for k, answer in self.answers.items() if answer is not None]
            known.sort(key=lambda k: abs(math.log(k[0] / gear)) + abs(math.log(k[1] / radius)))
            near = self.answers[known[0]] if known else self.begin
            problem = self.problem(gear, radius)
            begins = dict.fromkeys(a for a in (near, self.begin) if a is not None)
            tried = (follow(problem, [answer]) for answer in begins)
            self.answers[key] = next((found for found in tried if found is not None), None)
        return self.answers[key]

    def cost(self, gear: float, radius: float) -> float:
        """Return the payload's rms there [m]; infinite where the limits cannot be kept."""
        answer = self.at(gear, radius)
        return answer.payload_rms if answer is not None else math.inf


@one_thread()
@shows_progress("searching")
def co_design(
    case: Case,
    *,
    gear: tuple[float, float] | None = None,
    radius: tuple[float, float] | None = None,
    structure: str = "payload-feedback",
    starts: int = 4,
    seed: int = 0,
    progress: Progress | None = None,
) -> CoDesign:
    """Return the gear, and the drum radius if asked for, with which the payload is stillest.

    The search that all begins from holds with the least damping of a hysteretic rope too; gears are
    compared with the damping of the case: `evaluate_gains` says whether the gains hold with less.

    Parameters
    ----------
    case
        The case, with its motor.
    gear
        Lowest and highest ratio; by default the case's over and times 2.5.
    radius
        Smallest and largest radius of the drum [m]; by default the case's own is kept.
    structure
        Controller structure, see `synth.structures.winch_structures.structure_names`.
    starts, seed
        Size and seed of the search that everything begins from.
    progress
        Called as progress(stage, done, total).

    Raises
    ------
    InputError
        If a range does not rise, or there is no such structure.
    """
    own, r0 = case.winch.gearbox.ratio, case.drum_radius
    low, high = _range("gear", gear or (own / 2.5, own * 2.5), 0.1, 1e4, "")
    radii = None if radius is None else _range("radius", radius, 0.02, 25.0, "m")
    tell: Progress = progress or (lambda stage, done, total: None)
    first = optimise_gains(case, structure, starts=starts, seed=seed, progress=progress)
    if not first.parameters:
        raise InputError(f"co-design: {first.status}")
    search = _Gears(
        case=case, structure=structure, masses=first.masses, begin=answer_of(first), tell=tell
    )
    given = search.cost(own, r0)
    r = r0 if radii is None else min(max(r0, radii[0]), radii[1])
    best = _best_gear(search, low, high, r)
    if radii is not None:
        for _ in range(_RADII):
            ratio = best / r
            inside = max(radii[0], low / ratio), min(radii[1], high / ratio)
            other = least_between(partial(_cost_at, search, ratio), *inside, _FINE)
            if search.cost(ratio * other, other) > (1.0 - _GAIN) * search.cost(best, r):
                break
            r, best = other, _best_gear(search, low, high, other, near=ratio * other)
    return _finished(search, best, r, given, (low, high), radii)


def gear_changes(case: Case, gear: float, radius: float | None = None) -> dict[str, float]:
    """Return the changes by dotted path that give a case another gear and drum radius [m]."""
    changes = {"winch.gearbox.ratio": gear}
    if radius is not None and radius != case.drum_radius:
        changes["winch.drum.radius"] = radius
        changes["winch.drum.inertia"] = (
            case.winch.drum.inertia * (radius / case.drum_radius) ** _DRUM
        )
    return changes


def _best_gear(
    search: _Gears, low: float, high: float, radius: float, near: float | None = None
) -> float:
    """Return the best gear at a radius: a grid, from the known outwards, then Brent's method."""
    if near is None:
        grid = np.geomspace(low, high, _GRID)
        own = search.case.winch.gearbox.ratio
    else:
        grid = np.geomspace(max(low, near / 1.3), min(high, near * 1.3), 5)
        own = near
    order = sorted((float(g) for g in grid), key=lambda g: abs(math.log(g / own)))
    for gear in order:
        search.at(gear, radius)
    # An edge of what is feasible lies between a gear that is and one that is not.
    known = sorted(g for g, r in search.answers if r == radius and low <= g <= high)
    at = min(range(len(known)), key=lambda i: search.cost(known[i], radius))
    ends = known[max(at - 1, 0)], known[min(at + 1, len(known) - 1)]
    best = least_between(lambda g: search.cost(g, radius), *ends, _FINE)
    return min((best, known[at]), key=lambda g: search.cost(g, radius))


def _cost_at(search: _Gears, ratio: float, radius: float) -> float:
    """Return the payload's rms with a drum radius at a given ratio of gear and radius [m]."""
    return search.cost(ratio * radius, radius)


def _finished(
    search: _Gears,
    gear: float,
    radius: float,
    given: float,
    ends: tuple[float, float],
    radii: tuple[float, float] | None,
) -> CoDesign:
    case, answer = search.case, search.at(gear, radius)
    points = tuple(
        CoPoint(
            gear=g,
            radius=r,
            payload_rms=search.cost(g, r),
            binding=_binding(a) if a is not None else (),
        )
        for (g, r), a in sorted(search.answers.items())
    )
    result = CoDesign(
        case=case,
        structure=search.structure,
        status="no gains keep the limits behind any of these gears",
        gear=gear,
        radius=radius,
        given_rms=given,
        points=points,
    )
    if answer is None:
        return result
    best_case = case.variant(gear_changes(case, gear, radius))
    design = designed(best_case, search.structure, answer, search.masses, search.tell)
    binding = _binding(answer)
    text = f"the best gear is {gear:.4g}" + (
        "" if radius == case.drum_radius else f", drum {radius:.4g} m"
    )
    text += f": the payload moves {1e3 * answer.payload_rms:.4g} mm rms"
    if math.isfinite(given):
        text += f" instead of {1e3 * given:.4g} mm behind {case.winch.gearbox.ratio:g}"
    if binding:
        text += f"; {', '.join(binding)} bind"
    at_end = end_text("the gear", gear, ends, 2.0 * _FINE)
    if radii is not None:
        at_end += end_text("the drum", radius, radii, 2.0 * _FINE)
    text += at_end
    if not at_end:
        beside = [
            a for (g, r), a in sorted(search.answers.items()) if r == radius and a is not None
        ]
        at = beside.index(answer)
        sides = [_binding(a)[:1] for a in (*beside[max(at - 1, 0) : at], *beside[at + 1 : at + 2])]
        names = dict.fromkeys(name for side in sides for name in side)
        text += f"; it stands at a corner, between {' and '.join(names)}" if len(names) > 1 else ""
    if design is not None and not design.ok:
        text += f"; {design.status}"
    return replace(
        result,
        ok=design is not None and design.ok,
        status=text,
        payload_rms=answer.payload_rms,
        best_case=best_case,
        design=design,
    )


def _binding(answer: Answer) -> tuple[str, ...]:
    prices = answer.prices
    return tuple(
        sorted((n for n, p in prices.items() if abs(p) > 1e-4), key=lambda n: -abs(prices[n]))
    )


def _range(
    name: str, ends: tuple[float, float], low: float, high: float, unit: str
) -> tuple[float, float]:
    first = check_range("co-design", name, ends[0], low=low, high=high, unit=unit)
    last = check_range("co-design", name, ends[1], low=low, high=high, unit=unit)
    if not first < last:
        raise InputError(f"co-design: {name} must rise from low to high, got {first:g} to {last:g}")
    return first, last
