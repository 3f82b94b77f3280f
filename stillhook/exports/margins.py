"""The margins of a law that leaves: in continuous time, as it is sampled, and a step later.

    law --> its recursion on the linear plant of its case --> LawMargins

What is analysed is the law by itself, as it commands the drive: while the operator's interface
holds the drum or blends, its own loop is at work, which is slower.  The drive is taken to follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from models.basics import InputError, SynthesisError, check_range
from models.case import Case
from models.plant import build_plant
from models.sensing import Controller, Recursion, recursion_of
from synth.controllers import ConstantTension, LinearFeedback, VelocityFeedForward
from synth.loop import Margins
from synth.structures import BrokenLoop, sampled_loop, sampled_margins

from .law import Law

ALLOWED = 0.1
"""What sampling may take of the loop's distance to -1, which is 1/M_s, in that of the limit."""

_SHORT = 1e-3  # at most, of times that leave a loop nearly as it is in continuous time [s]
_MOST_LATE = 1500  # samples
_LEAST = 3e-4  # no shorter sample time or step is asked for [s]
# Ratios of the times that are tried, and of two that are the same to two digits.
_RATIO, _CLOSE = 1.5, 1.01


@dataclass(frozen=True, kw_only=True, eq=False)
class LawMargins:
    """Margins of the loop broken at the command."""

    sample_time: float  #: [s]
    continuous: Margins | None  #: Of the design; None without one, or if its loop is unstable.
    sampled: Margins | None  #: As sampled; None if unstable.
    communication_step: float | None  #: A step of co-simulation by which the command is later [s].
    communicated: Margins | None  #: As sampled and so much later; None if unstable, or not asked.
    limit: float  #: What M_s may be by the case.
    warning: str  #: A sentence where the step of co-simulation is too long; else empty.


def margins_at(law: Law, communication_step: float | None = None) -> LawMargins | None:
    """Return the margins of a law; None where it has no loop to break.

    Predictive control, which is no recursion, has none, and neither has a law that hears nothing
    of what its command does.

    Parameters
    ----------
    law
        The law.
    communication_step
        Step h of a co-simulation [s] whose master steps its parts in parallel: what the controller
        commands reaches the plant a step later.

    Raises
    ------
    InputError
        If the step is out of its range.
    """
    if communication_step is not None:
        check_range("export", "communication_step", communication_step, low=0.0, unit="s")
    recursion = about_rest(law.inner, law.case)
    if recursion is None:
        return None
    sampled = _margins(law, recursion, law.sample_time)
    limit = law.case.limits.max_sensitivity
    later, warning = None, ""
    if communication_step is not None:
        later = _margins(law, recursion, law.sample_time, communication_step)
        before = math.inf if sampled is None else sampled.max_sensitivity
        warning = _too_long(law, recursion, communication_step, later, before)
    return LawMargins(
        sample_time=law.sample_time,
        continuous=law.design.margins if law.design is not None else None,
        sampled=sampled,
        communication_step=communication_step,
        communicated=later,
        limit=limit,
        warning=warning,
    )


def check_sample_time(law: Law) -> None:
    """Check that a law, as it is sampled, is stable and keeps its case's limit on M_s.

    The check is on the sample time: a law that breaks the limit in continuous time may leave, and
    one that meets it there, as most designs do, comes above it however fast it is sampled.  So
    sampling may take a tenth of the limit's distance to -1 (`ALLOWED`): with a limit of 2, M_s of 2
    may become 2.22.

    Raises
    ------
    InputError
        If it is not; the sentence says the longest sample time that would do, to two digits.
    """
    recursion = about_rest(law.inner, law.case)
    if recursion is None:
        return
    T, limit = law.sample_time, law.case.limits.max_sensitivity
    found = _sensitivity(law, recursion, T)
    if found <= limit:
        return
    unsampled = _resampled_sensitivity(law, min(_SHORT, 0.1 * T))
    if law.design is not None and law.design.margins is not None:
        unsampled = law.design.margins.max_sensitivity
    bound = _bound(unsampled, limit)
    if _stays(found, bound):
        return
    at = f"export: at a sample time of {T:g} s "
    if math.isinf(unsampled):
        raise InputError(f"{at}the loop is unstable, as it is at a shorter one")
    longest = _longest(lambda t: _stays(_resampled_sensitivity(law, t), bound), _LEAST, T)
    kept = f"the longest that keeps it is {longest} s" if longest else "ask for a much shorter one"
    raise InputError(f"{at}{_broken(found, unsampled, limit, 'sampling')}; {kept}")


def about_rest(inner: Controller, case: Case) -> Recursion | None:
    """Return the recursion of a controller about rest; None if it hears nothing of its plant."""
    found = recursion_of(inner)
    if isinstance(inner, ConstantTension):  # without its dead band, in which it does nothing
        found = inner.linear_loop(case).recursion
    if found is None:
        return None
    loop = sampled_loop(case, build_plant(case, 1), found, inner.sample_time)
    return found if BrokenLoop(loop=loop).hears else None


def _margins(
    law: Law, recursion: Recursion, sample_time: float, late: float = 0.0
) -> Margins | None:
    """Return margins on the plant that a design knows; without one there is no drag in it."""
    design = law.design
    return sampled_margins(
        law.case,
        recursion,
        sample_time,
        masses=int(getattr(law.inner, "masses", 0)) or None,
        drag=0.0 if design is None else design.drag,
        friction=0.0 if design is None else design.friction,
        more_delay=late,
    )


def _sensitivity(law: Law, recursion: Recursion, sample_time: float, late: float = 0.0) -> float:
    """Return M_s, infinite if the loop is unstable."""
    found = _margins(law, recursion, sample_time, late)
    return math.inf if found is None else found.max_sensitivity


def _resampled_sensitivity(law: Law, sample_time: float) -> float:
    """Return M_s of a law at another sample time; infinite if there is none that is stable.

    A delay of thousands of samples is not looked at: each would be a state.
    """
    late = law.case.sensors.telemetry.delay + law.case.winch.drive.command_delay
    if late > _MOST_LATE * sample_time:
        return math.inf
    try:
        other = resampled(law.inner, law.case, sample_time)
    except (InputError, SynthesisError):
        return math.inf
    recursion = None if other is None else about_rest(other, law.case)
    return math.inf if recursion is None else _sensitivity(law, recursion, sample_time)


def resampled(inner: Controller, case: Case, sample_time: float) -> Controller | None:
    """Return a law at another sample time T [s]; None if it is of no kind that is known here.

    Raises InputError or SynthesisError if the law cannot be sampled so.
    """
    if isinstance(inner, LinearFeedback):
        return LinearFeedback(
            case,
            inner.controller,
            sample_time=sample_time,
            anti_windup=inner.anti_windup,
            hold_for=inner.hold_for,
            name=inner.name,
            masses=inner.masses,
        )
    if isinstance(inner, VelocityFeedForward):
        return VelocityFeedForward(
            case,
            share=inner.share,
            lead=inner.lead,
            position_gain=inner.position_gain,
            fade=inner.fade,
            sample_time=sample_time,
            bandwidth=inner.loop.bandwidth,
            name=inner.name,
        )
    if isinstance(inner, ConstantTension):
        return ConstantTension(
            case,
            set_point=inner.set_point,
            dead_band=inner.dead_band,
            gain=inner.gain,
            centring=inner.centring,
            sample_time=sample_time,
            bandwidth=inner.loop.bandwidth,
        )
    return None


def _bound(before: float, limit: float) -> float:
    """Return what M_s may become by sampling, or by a step, from what it was before."""
    left = 1.0 / before - ALLOWED / limit
    return max(limit, 1.0 / left) if left > 0.0 else math.inf


def _broken(found: float, before: float, limit: float, by: str) -> str:
    """Return what an M_s above its bound is, in words."""
    bound = _bound(before, limit)
    if math.isinf(found):
        return "the loop is unstable"
    kept = f"its limit {limit:g}" if bound == limit else f"{bound:.3g}, the most that {by} may make"
    made = "" if bound == limit else f" of {before:.3g}"
    return f"M_s is {found:.3g}, above {kept}{made}"


def _too_long(
    law: Law, recursion: Recursion, step: float, later: Margins | None, before: float
) -> str:
    """Return the sentence that warns of a communication step, empty if it will do."""
    found = math.inf if later is None else later.max_sensitivity
    T, limit = law.sample_time, law.case.limits.max_sensitivity
    bound = _bound(before, limit)
    at = f"at a communication step of {step:g} s "
    if math.isinf(before):
        return f"{at}the loop is unstable, as it is without"
    if found <= bound and later is not None:
        return ""
    longest = _longest(lambda h: _stays(_sensitivity(law, recursion, T, h), bound), _LEAST, step)
    kept = f"the longest that keeps it is {longest} s" if longest else "hardly any will do"
    return f"{at}{_broken(found, before, limit, 'it')}; {kept}"


def _stays(sensitivity: float, bound: float) -> bool:
    return math.isfinite(sensitivity) and sensitivity <= bound


def _longest(keeps: Callable[[float], bool], shortest: float, longest: float) -> str:
    """Return the longest time that keeps something, two digits rounded down; empty if none does.

    The longest time given does not.  As M_s may fall again with ever more delay, shorter ones are
    tried one by one before the last step is halved.
    """
    high, low = longest, longest / _RATIO
    while not keeps(low):
        high, low = low, low / _RATIO
        if low < shortest:
            return ""
    while high > _CLOSE * low:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if keeps(middle) else (low, middle)
    digit = 10.0 ** (math.floor(math.log10(low)) - 1)
    return f"{math.floor(low / digit + 1e-9) * digit:.2g}"
