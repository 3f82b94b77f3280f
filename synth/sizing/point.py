r"""Smallest motor behind one gear that meets a target, and what limits it.

    case -> least factor on the motor's ratings -> larger rotor -> again -> SizePoint

For a rotor of fixed inertia the least factor f on torque, current and power with which target and
all other limits can be kept is one programme (`Goal.RELAX`).  A motor that much larger has a
larger rotor, which takes torque to accelerate: the scale s sought is the first root of log f(s), f
the factor on the ratings of a motor of scale s.  Where f stays above one, falling and then rising
with the motor, it is the motor's own inertia that stops it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from models.basics import InputError, check_range, parse_quantity
from models.case import Case
from models.hook import HookMotion

from ..limits import Rms
from ..question import PAYLOAD, DesignQuestion, Goal, Problem
from ..search import Progress
from .follow import Answer, follow, posed
from .motor import MotorData, with_motor

TARGET = "payload.displacement.rms"  #: Name of the target among the limits.
AT_REST = "the load at rest"  #: What binds where any motor that holds the load does the rest too.
RATINGS = (
    "motor.torque.peak",
    "motor.torque.continuous",
    "motor.current.peak",
    "motor.current.continuous",
    "motor.power.peak",
    "motor.torque.breakdown",
)
"""Limits that grow with the motor; the others (speed, voltage, rope) stay."""

_SETTLED = 1e-3  # of the logarithm of the scale
_STEPS = 12
_LEAST_STEP = 0.1  # of the logarithm of the scale, where no motor was found yet
_LARGEST = 1e3  # scale that is looked at
_ABOVE = 1.0 + 1e-6  # the load at rest, at least
_BINDING = 5e-3  # a limit that is used up to this share of itself binds
_SEA_STEPS, _SEA_FINE = 8, 2e-3  # of the search
_LOWEST, _HIGHEST = 0.05, 6.0  # of the sea asked for, that are looked at


@dataclass(frozen=True, kw_only=True, eq=False)
class SizePoint:
    """The smallest motor behind one gear."""

    gear: float  #: Turns of the motor per turn of the drum.
    #: Continuous torque over that of the case's motor; infinite if no motor does it.
    scale: float = math.inf
    motor: MotorData | None = None  #: Its figures; None if no motor does it.
    payload_rms: float = math.inf  #: Of the payload [m].
    binding: tuple[str, ...]  #: Names of the limits that bind, or of those that stop it.
    #: The optimum there, or the last one looked at; None where there was none.
    answer: Answer | None = field(default=None, repr=False)

    @property
    def feasible(self) -> bool:
        """Whether there is such a motor."""
        return math.isfinite(self.scale)


def with_target(question: DesignQuestion, target: float) -> Problem:
    """Return the problem with all limits of a case and that of the payload's rms [m]."""
    return question.problem_with((*question.limits, Rms(bound=target, output=PAYLOAD)))


def least_motor(
    case: Case,
    structure: str,
    gear: float,
    target: float,
    *,
    masses: int,
    near: Answer,
    scale: float = 1.0,
) -> SizePoint:
    """Return the smallest motor behind a gear with which the payload moves `target` [m].

    The case's motor is that of scale 1; the search begins with `scale` and an answer nearby.
    """
    known: list[tuple[float, float]] = []
    rest = math.log(_at_rest(case, gear))
    size, answer = max(math.log(scale), rest), near
    while len(known) < _STEPS:
        sized = with_motor(case, math.exp(size), gear)
        problem = with_target(posed(sized, structure, masses), target)
        ratings = [m.name for m in problem.limits if m.name in RATINGS]
        found = follow(problem, [answer], goal=Goal.RELAX, relaxed=ratings)
        if found is None:
            return _stopped(problem, answer, gear)
        answer, extra = found, found.solved.extra
        known.append((size, extra))
        if abs(extra) < _SETTLED or (extra < 0.0 and size <= rest):
            return _point(case, gear, size, found, at_rest=extra <= -_SETTLED)
        step = _next(known, rest)
        if step is None or step > math.log(_LARGEST):
            break
        size = step
    return SizePoint(gear=gear, binding=("motor.inertia",), answer=answer)


def _at_rest(case: Case, gear: float) -> float:
    """Return the scale of the motor that just holds the load at rest, through the losses."""
    drive, box = case.winch.drive, case.winch.gearbox
    torque = case.static_torque_budget * box.ratio / gear
    rating = drive.torque_continuous
    if drive.current_continuous is not None:
        rating = min(rating, drive.current_continuous * case.winch.torque_constant)
    return _ABOVE * torque / rating


def _next(known: Sequence[tuple[float, float]], rest: float) -> float | None:
    """Return the next logarithm of the scale to look at, or None if no motor does it.

    The factor that is missing falls with the motor until its own rotor takes what it adds, and
    rises again: sought is the first root, from the left.
    """
    points = sorted(known)
    enough = [s for s, over in points if over <= 0.0]
    if enough:
        right, over = next(pair for pair in points if pair[1] <= 0.0)
        short = [pair for pair in points if pair[0] < right]
        if not short:
            return max(rest, right + min(over, -_SETTLED))  # exact if the rotor weighed nothing
        left, missing = short[-1]
        share = missing / (missing - over)
        return left + min(0.9, max(0.1, share)) * (right - left)
    at = min(range(len(points)), key=lambda i: points[i][1])
    size, missing = points[at]
    if at == len(points) - 1:
        return size + max(missing, _LEAST_STEP)
    if at == 0:
        return None if size <= rest else max(rest, size - max(missing, _LEAST_STEP))
    (x1, y1), (x2, y2), (x3, y3) = points[at - 1 : at + 2]
    # The parabola through the three; if it stays above zero by far, so does the factor.
    one, two = (y2 - y1) / (x2 - x1), (y3 - y2) / (x3 - x2)
    bend = (two - one) / (x3 - x1)
    if bend <= 0.0:
        return None
    lowest = 0.5 * (x1 + x2 - one / bend)
    value = y2 + (lowest - x2) * (one + bend * (lowest - x1))
    if value > 0.5 * y2 or x3 - x1 < _LEAST_STEP or abs(lowest - x2) < 0.1 * _LEAST_STEP:
        return None
    return lowest


def _point(case: Case, gear: float, size: float, answer: Answer, *, at_rest: bool) -> SizePoint:
    # The last factor is within 0.1 % of one, and counts.
    scale = math.exp(size + max(answer.solved.extra, 0.0))
    uses = answer.uses()
    factor = math.exp(answer.solved.extra)
    names = [n for n, use in uses.items() if use / (factor if n in RATINGS else 1.0) > 1 - _BINDING]
    # The target binds at every smallest motor: that goes without saying.
    names = [name for name in names if name != TARGET]
    prices = answer.prices
    return SizePoint(
        gear=gear,
        scale=scale,
        motor=MotorData.of(with_motor(case, scale, gear)),
        payload_rms=answer.payload_rms,
        binding=(*((AT_REST,) if at_rest else ()), *sorted(names, key=lambda n: -abs(prices[n]))),
        answer=answer,
    )


def _stopped(problem: Problem, near: Answer, gear: float) -> SizePoint:
    """Return a point that no motor of the family reaches, with what stops it.

    With all limits of the drive and the target relaxed by one factor, those that stay broken
    though they do not grow with the motor are what stops it.
    """
    relaxed = [m.name for m in problem.limits if m.drive and not m.at_least]
    wide = follow(problem, [near], goal=Goal.RELAX, relaxed=relaxed)
    if wide is None:
        return SizePoint(gear=gear, binding=("stability",))
    uses, prices = wide.uses(), wide.prices
    broken = {n: u for n, u in uses.items() if u > 1.0 + _BINDING and n not in RATINGS}
    fixed = sorted((n for n in broken if n != TARGET), key=lambda n: -broken[n])
    if fixed:
        return SizePoint(gear=gear, binding=tuple(fixed))
    loop = [m.name for m in problem.limits if not m.drive and uses[m.name] > 1.0 - _BINDING]
    loop.sort(key=lambda n: -abs(prices[n]))
    return SizePoint(gear=gear, binding=tuple(loop) or (TARGET,))


def target_of(target: float | str, hook_rms: float) -> float:
    """Return a target as an rms of the payload [m].

    It is a number in metres, a text with a unit of length (``20 mm``), with ``%`` of the hook's rms
    motion [m], or with ``dB`` below it.

    Raises InputError if it is none of these, or not between 0 and the hook's motion.
    """
    text = target.strip() if isinstance(target, str) else ""
    try:
        if text.endswith("%"):
            value = 0.01 * float(text[:-1]) * hook_rms
        elif text.lower().endswith("db"):
            value = hook_rms * 10.0 ** (-abs(float(text[:-2])) / 20.0)
        else:
            value = parse_quantity(target, "length")
    except ValueError as error:
        if isinstance(error, InputError) and not text:
            raise InputError(f"target: {error}") from None
        raise InputError(
            "target: must be a length, a share of the hook's motion or a reduction, as in 20 mm, "
            f"5 % or 26 dB, got {target!r}"
        ) from None
    return check_range("size", "target", value, low=0.0, high=100.0, unit="m", open_low=True)


def highest_sea(
    case: Case, structure: str, target: float | str, *, masses: int, near: Answer, tell: Progress
) -> float:
    """Return the highest H_s in which the winch of a case meets a target [m]; 0 if none does.

    The case is in the sea asked for, the target as `target_of` reads it; `near` is an answer to
    begin from.
    """
    asked = case.sea.significant_height
    known: list[tuple[float, float]] = []  # logarithms of H_s and of the factor that is missing
    size, answer = 0.0, near
    for k in range(_SEA_STEPS):
        tell("the highest sea for the winch as it is", k, _SEA_STEPS)
        height = asked * math.exp(size)
        sea = case.variant({"sea.significant_height": height})
        aim = target_of(target, float(HookMotion.from_case(sea).displacement.rms))
        problem = with_target(posed(sea, structure, masses), aim)
        relaxed = [m.name for m in problem.limits if m.drive and not m.at_least]
        # At a factor of one or less (`extra` at most 0) the winch meets the target there.
        found = follow(problem, [answer], goal=Goal.RELAX, relaxed=relaxed)
        if found is None:
            if size <= math.log(_LOWEST):
                break
            known.append((size, 10.0))
        else:
            answer = found
            known.append((size, found.solved.extra))
            if abs(found.solved.extra) < _SEA_FINE:
                break
        kept = [s for s, f in known if f <= 0.0]
        below = max(kept, default=-math.inf)
        above = min((s for s, f in known if f > 0.0), default=math.inf)
        over = known[-1][1]
        guess = size - max(-1.0, min(1.0, 1.2 * over))
        if len(known) > 1 and known[-1][1] != known[-2][1]:
            tilt = (known[-1][1] - known[-2][1]) / (known[-1][0] - known[-2][0])
            guess = size - over / tilt if tilt > 0.0 else guess
        if not below < guess < above:
            guess = (
                0.5 * (below + above)
                if math.isfinite(above - below)
                else (above - 1.0 if math.isfinite(above) else below + 1.0)
            )
        size = max(math.log(_LOWEST), min(math.log(_HIGHEST), guess))
        if any(abs(size - s) < 1e-4 for s, _ in known):
            break
    kept = [s for s, f in known if f <= _SEA_FINE]
    return asked * math.exp(max(kept)) if kept else 0.0
