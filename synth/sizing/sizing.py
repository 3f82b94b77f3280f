"""Winch sizing: the smallest motor and gear that hold a payload still enough in a given sea.

    case, target, H_s -> best without a motor's limits (is it possible at all?)
        -> smallest motor behind each gear, from neighbour to neighbour -> Brent's method
        -> chosen motor and gear -> gains within its limits, verified -> Sizing

Motors are the case's own, scaled (`synth.sizing.motor`), or those of a catalogue
(`synth.sizing.catalogue`).  Speeds are the same all through the family, so the smallest torque is
the smallest power too.  The other way round the sizing says what the case's own winch can do: how
still it holds the payload in that sea, and in how high a sea it still meets the target.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError, check_range, one_thread, shows_progress
from models.case import Case
from models.plant import MAX_MASSES

from ..design import SOURCE_NAMES, Design, gains_in_use
from ..loop import Assessment
from ..question import HOOK, PAYLOAD, Problem
from ..search import KEPT, Progress, search
from .catalogue import ChosenMotor, choose, read_catalogue
from .follow import Answer, designed, end_text, follow, least_between, posed
from .motor import MotorData, with_motor
from .point import SizePoint, highest_sea, least_motor, target_of

_SPAN = 2.5  # gears that are tried: the case's over and times this
_FINE = 0.03  # of the logarithm of the gear, to which the best is found
_ROOM = 1.005  # by which the chosen motor is larger than the smallest


@dataclass(frozen=True, kw_only=True, eq=False)
class Sizing:
    """The answer of `size_winch`."""

    #: The case in the sea asked for, its own motor in it, and the controller structure.
    case: Case
    structure: str
    #: What the payload may move, and what the hook does (rms) [m].
    target: float
    hook_rms: float
    #: Whether a motor was found and verified; the sentence for the user.
    ok: bool = False
    status: str
    #: What the loop's margins and the sensors alone leave, with a motor without limits [m].
    unlimited_rms: float
    #: The smallest motor behind as many gears as were asked for, by ratio: the best one in the
    #: place of the nearest.
    points: tuple[SizePoint, ...] = ()
    #: The smallest of all; the case with it, its limits enforced; its gains, verified.
    chosen: SizePoint | None = None
    sized_case: Case | None = None
    design: Design | None = None
    #: What the payload moves with the case's own motor and gear in that sea [m]; infinite if they
    #: cannot keep their limits.
    given_rms: float = math.inf
    #: H_s up to which the case's own winch meets the target [m]; 0 if in none that was looked at.
    highest_height: float = 0.0
    choice: ChosenMotor | None = None  #: The motor out of the catalogue, if there is one.

    def to_csv(self) -> str:
        """Return the smallest motor over the gear as CSV, SI units."""
        lines = ["gear,scale,torque_continuous,torque_peak,power,inertia,payload_rms,limited_by"]
        for p in self.points:
            m = p.motor
            figures = (
                [m.torque_continuous, m.torque_peak, m.power, m.inertia, p.payload_rms]
                if m is not None
                else []
            )
            cells = [f"{v:.8g}" for v in (p.gear, p.scale, *figures)] + [""] * (5 - len(figures))
            lines.append(",".join([*cells, " ".join(p.binding).replace(",", "")]))
        return "\n".join(lines) + "\n"


@dataclass(kw_only=True)
class _Search:
    """What a sizing knows on its way."""

    case: Case
    structure: str
    target: float
    masses: int
    free: Answer
    tell: Progress
    found: dict[float, SizePoint]

    def at(self, gear: float) -> SizePoint:
        """Return the smallest motor behind a gear, from the nearest that is known."""
        if gear not in self.found:
            known = sorted(self.feasible, key=lambda p: abs(math.log(p.gear / gear)))
            self.found[gear] = least_motor(
                self.case,
                self.structure,
                gear,
                self.target,
                masses=self.masses,
                near=(known[0].answer if known else None) or self.free,
                scale=known[0].scale if known else 1.0,
            )
        return self.found[gear]

    @property
    def feasible(self) -> list[SizePoint]:
        """The gears behind which some motor does it."""
        return [point for point in self.found.values() if point.feasible]


@one_thread()
@shows_progress("searching")
def size_winch(
    case: Case,
    *,
    target: float | str,
    height: float | str | None = None,
    structure: str = "payload-feedback",
    gear: tuple[float, float] | None = None,
    points: int = 9,
    motors: str | Path | Sequence[Mapping[str, Any]] | None = None,
    starts: int = 4,
    seed: int = 0,
    progress: Progress | None = None,
) -> Sizing:
    """Return the smallest motor and gear with which the payload moves no more than a target.

    The rope is damped as the case says; whether the gains hold with the least damping too, as
    designs of a hysteretic rope do, `evaluate_gains` says.

    Parameters
    ----------
    case
        The case; its motor is the one that is scaled.  All its limits are enforced.
    target
        Rms of the payload [m], or a text: ``20 mm``, ``5 %`` of the hook's rms, ``26 dB`` below
        it.
    height
        Significant wave height H_s [m] or a text; by default the case's.
    structure
        Controller structure, see `synth.structures.winch_structures.structure_names`.
    gear
        Lowest and highest ratio of the gear; by default the case's over and times 2.5.
    points
        Gears on the curve, over the whole range; the best takes the place of the nearest.
    motors
        A catalogue: a CSV file or its rows, see `synth.sizing.catalogue.read_catalogue`.
    starts, seed
        Size and seed of the search that everything begins from.
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    Sizing
        Not ok, with the limit that stops it, if no motor meets the target.

    Raises
    ------
    InputError
        If the target, a range or the catalogue is wrong, or there is no such structure.
    """
    check_range("size", "points", points, low=3, high=101)
    check_range("size", "starts", starts, low=1, high=4096)
    ratio = case.winch.gearbox.ratio
    low, high = gear if gear is not None else (ratio / _SPAN, ratio * _SPAN)
    check_range("size", "gear", low, low=0.1, high=1e4)
    if not low < high <= 1e4:
        raise InputError(f"size: gear must rise to at most 10000, got {low:g} to {high:g}")
    changes: dict[str, Any] = {"limits.drive": "report"}
    if height is not None:
        changes["sea.significant_height"] = height
    base = case.variant(changes)
    catalogue = None if motors is None else read_catalogue(motors, base)
    tell: Progress = progress or (lambda stage, done, total: None)
    masses: int | None = None
    while True:
        sizing, used, near = _sized(
            base, target, structure, (low, high), int(points), masses, starts, seed, tell
        )
        design = sizing.design
        coarse = design is not None and not design.ok and base.rope.lumping != "thesis"
        if not coarse or 2 * used > MAX_MASSES:
            break
        masses = 2 * used  # it stands on its own rope only: once more on twice the masses
    if catalogue is None or near is None or sizing.unlimited_rms > sizing.target:
        return sizing
    choice = choose(
        base, structure, sizing.target, catalogue, (low, high), masses=used, near=near, tell=tell
    )
    if isinstance(choice, str):
        return replace(sizing, ok=False, status=f"{sizing.status}; {choice}")
    return _with_choice(sizing, structure, choice, (low, high), used, tell)


def _sized(
    base: Case,
    target: float | str,
    structure: str,
    gears: tuple[float, float],
    count: int,
    masses: int | None,
    starts: int,
    seed: int,
    tell: Progress,
) -> tuple[Sizing, int, Answer | None]:
    question = posed(base, structure, masses)
    hook = float(question.hook.displacement.rms)
    aim = target_of(target, hook)
    rope = [lim for lim in question.drive if lim.name.startswith("rope.")]
    problem = question.problem_with((*question.loop, *rope))
    found = search(problem, starts, seed, gains_in_use(question), tell)
    free = Answer.of(problem, found)
    empty = Sizing(
        case=base,
        structure=structure,
        target=aim,
        hook_rms=hook,
        status="no stable loop keeps the limits, whatever the motor",
        unlimited_rms=free.payload_rms if free is not None else math.inf,
    )
    if free is None:
        return empty, question.masses, None
    walk = _Search(
        case=base,
        structure=structure,
        target=aim,
        masses=question.masses,
        free=free,
        tell=tell,
        found={},
    )
    grid = np.geomspace(*gears, count)
    if free.payload_rms <= aim:
        _walked(walk, grid)
    given = _given(walk, question.problem)
    least = min(walk.feasible, key=lambda point: point.scale, default=None)
    result = replace(
        empty,
        points=_curve(walk, grid, least),
        given_rms=given.payload_rms if given is not None else math.inf,
        highest_height=highest_sea(
            base, structure, target, masses=question.masses, near=given or free, tell=tell
        ),
    )
    if least is None:
        return replace(result, status=_why_not(result, free)), question.masses, free
    return _chosen(result, walk, least, gears), question.masses, least.answer


def _curve(walk: _Search, grid: FloatArray, least: SizePoint | None) -> tuple[SizePoint, ...]:
    """Return the smallest motor, with its room, behind each gear of a grid, and behind the best."""
    if not walk.found:
        return ()
    gears = [float(gear) for gear in grid]
    if least is not None:
        off = [abs(math.log(gear / least.gear)) for gear in gears]
        gears[off.index(min(off))] = least.gear
    lost = [point for point in walk.found.values() if not point.feasible]
    points = []
    for gear in gears:
        if gear in walk.found:
            points.append(_roomy(walk.case, walk.found[gear]))
        else:  # beyond a gear that no motor can do, which was not looked at
            near = min(lost, key=lambda point: abs(math.log(point.gear / gear)))
            points.append(SizePoint(gear=gear, binding=near.binding))
    return tuple(points)


def _roomy(case: Case, point: SizePoint) -> SizePoint:
    """Return a point with the motor a little larger than the smallest, if there is one."""
    if not point.feasible:
        return point
    scale = point.scale * _ROOM
    return replace(point, scale=scale, motor=MotorData.of(with_motor(case, scale, point.gear)))


def _walked(walk: _Search, grid: FloatArray) -> None:
    """Walk over the gears from the case's own outwards, then home in on the best."""
    own = math.log(walk.case.winch.gearbox.ratio)
    order = np.argsort(np.abs(np.log(grid) - own), kind="stable")
    start = int(order[0])
    total = len(grid) + 6
    later: list[int] = []
    for way in (range(start, len(grid)), range(start - 1, -1, -1)):
        up, held = way.step > 0, False
        for i in way:
            walk.tell("the smallest motor behind each gear", len(walk.found), total)
            feasible = walk.at(float(grid[i])).feasible
            # What stops it there (speed, inertia, and below a motor that does) stops it further on.
            if not feasible and (up or held):
                later += way[way.index(i) + 1 :]
                break
            held = feasible
    if not walk.feasible:
        for i in later:
            walk.tell("the smallest motor behind each gear", len(walk.found), total)
            walk.at(float(grid[i]))
    if not walk.feasible:
        return
    known = sorted(walk.found)
    at = known.index(min(walk.feasible, key=lambda point: point.scale).gear)
    ends = known[max(at - 1, 0)], known[min(at + 1, len(known) - 1)]

    def size(gear: float) -> float:
        walk.tell("the best gear", min(len(walk.found), total), total)
        # Three digits: a gear is ordered by a number.
        return walk.at(float(f"{gear:.3g}")).scale

    least_between(size, *ends, _FINE)


def _given(walk: _Search, problem: Problem) -> Answer | None:
    """Return the best that the case's own winch does, or None if its limits cannot be kept."""
    walk.tell("the winch as it is", 0, 1)
    own = walk.case.winch.gearbox.ratio
    gears = sorted(walk.found, key=lambda g: abs(g / own - 1.0))
    known = [a for g in gears if (a := walk.found[g].answer) is not None]
    return follow(problem, [*known[:1], walk.free])


def _chosen(sizing: Sizing, walk: _Search, point: SizePoint, gears: tuple[float, float]) -> Sizing:
    """Return the sizing with the chosen motor, and with its gains, verified."""
    answer, point = point.answer, _roomy(walk.case, point)
    motor = point.motor
    assert answer is not None
    assert motor is not None
    walk.tell("the gains of the chosen motor", 0, 1)
    chosen_case = with_motor(walk.case, point.scale, point.gear)
    chosen_case = chosen_case.variant({"limits.drive": "enforce"})
    design = designed(chosen_case, walk.structure, answer, walk.masses, walk.tell)
    met = design is not None and design.payload_rms <= sizing.target * (1.0 + KEPT)
    text = (
        f"the smallest motor has {1e-3 * motor.power:.4g} kW ({1e-3 * motor.torque_continuous:.4g} "
        f"kN m, {1e-3 * motor.torque_peak:.4g} kN m at the peak) behind a gear of "
        f"{point.gear:g}; {' and '.join(point.binding[:2])} bind"
    )
    text += end_text("the gear", point.gear, gears, _FINE)
    if design is None:
        text += "; its gains could not be settled within its limits"
    elif not design.ok:
        text += f"; {design.status}"
    return replace(
        sizing,
        ok=design is not None and design.ok and met,
        status=text,
        chosen=point,
        sized_case=chosen_case,
        design=design,
    )


def _with_choice(
    sizing: Sizing,
    structure: str,
    choice: ChosenMotor,
    gears: tuple[float, float],
    masses: int,
    tell: Progress,
) -> Sizing:
    """Return the sizing with a motor out of the catalogue instead of one of any size."""
    design = designed(choice.case, structure, choice.answer, masses, tell)
    ok = design is not None and design.ok and design.payload_rms <= sizing.target * (1.0 + KEPT)
    text = (
        f"{choice.name} behind a gear of {choice.gear:g} is the smallest motor of the catalogue "
        f"that does it, with {100.0 * choice.spare:.3g} % of its limits to spare"
    )
    text += end_text("the gear", choice.gear, gears, _FINE)
    return replace(
        sizing,
        ok=ok,
        status=f"{text}; of any size: {sizing.status}",
        choice=choice,
        sized_case=choice.case,
        design=design,
    )


def _why_not(sizing: Sizing, free: Answer) -> str:
    """Return why no motor meets the target, from the optimum without a motor's limits."""
    if sizing.unlimited_rms > sizing.target:
        binding = [n for n, use in free.uses().items() if use > 1.0 - 5e-3]
        binding.sort(key=lambda n: -abs(free.prices[n]))
        assessment = free.assessment
        for d in free.problem.disturbances:
            share = (
                Assessment(assessment.plant, assessment.controller, [d]).sigma(PAYLOAD)
                / free.payload_rms
            )
            if d.name != HOOK and share**2 > 0.5:
                binding.insert(0, SOURCE_NAMES.get(d.name, d.name))
        stops = " and ".join(binding) or "the structure itself"
        return (
            f"no motor holds the payload to {_mm(sizing.target)} rms: without any limit of the "
            f"motor it moves {_mm(sizing.unlimited_rms)}; {stops} stops it"
        )
    names = dict.fromkeys(name for point in sizing.points for name in point.binding[:1])
    return (
        f"no motor of this kind holds the payload to {_mm(sizing.target)} rms behind any of these "
        f"gears: {', '.join(names) or 'stability'} stops it"
    )


def _mm(value: float) -> str:
    return f"{1e3 * value:.4g} mm"
