r"""Loads in the rope: tensions at both of its ends, with the drum held and with a design at work.

    design -> drum held (exact rope, linear in the drag) -> tension at the drum, hook load
           -> compensated (the design's loop)            -> tension at the drum, hook load

Each end has three kinds of figures, which a design has as well.

*Linear*: standard deviation sigma and mean zero-crossing period T_z of a Gaussian signal; what
switches with the direction counts as friction.

*On the safe side*: what limits and criteria are held to, static -+ loss -+ k sigma with
k = sqrt(2 ln(T/T_z)) (`synth.limits.Peak`, `Minimum` and `Amplification`, which is the dynamic
amplification factor, DAF), with the worst signs that sensors' errors may have (`Limit.worst`).  The
margin to slack is (static - loss)/sigma = m, and the rope goes slack within T with the probability
1 - exp(-T/T_z exp(-m^2/2)), of a Gaussian signal's upcrossings as a Poisson process (Rice 1944;
`models.basics.exceedance_probability`).

*Expected*: of a design what `SwitchedLoop` says, with the losses as they switch and with drag that
grows with the swing, the figures of the reports' tables; with the drum held, where nothing turns,
the linear ones.  There quadratic drag keeps the largest swings lower, by a tenth on the bundled
crane.

A rope is slack first at its lower end, and first with the lightest load: figures with ``light`` in
their names are of the least weight that the load may have (`payload.weight_uncertainty`), whose
mass is taken to be the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from models.basics import exceedance_probability
from models.case import Case

from ..limits import LOWER_TENSION, Amplification, Minimum, Peak, Peaks
from ..question import held_motion

if TYPE_CHECKING:
    from .design import Design

RARE = 0.1  #: Probability with which rare extremes are exceeded in the exposure time.

_DRUM = "rope.tension"


@dataclass(frozen=True, kw_only=True, eq=False)
class EndLoads:
    """Tension at one end of the rope, in N."""

    output: str  #: Name of the signal.
    #: At rest, the mean of hauling in and paying out, or hauling in where the case has all losses
    #: so (`winch.losses`); and with the least weight of the load.
    static: float
    static_light: float
    loss: float  #: What the sheaves' losses carry it to either side of that, by the direction.
    #: Expected standard deviation, and mean zero-crossing period [s].
    rms: float
    period: float
    #: Those of the linear Gaussian signal.
    linear_rms: float
    linear_period: float
    #: Expected largest and least: the most probable ones in the exposure time, or, of a case with
    #: an exceedance of its own (`limits.exceedance`), those exceeded with that probability.  Below
    #: zero a linear rope pushes: one that is slack has no tension, and snaps taut beyond them.
    largest: float
    least: float
    #: Expected largest and least that are exceeded with the probability `RARE`.
    largest_rare: float
    least_rare: float
    #: Largest and least on the safe side, as limits have them, and the least with the least weight.
    safe_largest: float
    safe_least: float
    safe_least_light: float
    daf: float  #: Dynamic amplification factor, `safe_largest` over `static` [-].
    #: How many standard deviations it is from rest, losses taken off, to slack, for the worst signs
    #: of sensors' errors [-]; and with the least weight.
    margin: float
    margin_light: float
    #: Probability that the rope goes slack there within the exposure time [-]; and with the least
    #: weight.
    slack_probability: float
    slack_probability_light: float


@dataclass(frozen=True, kw_only=True, eq=False)
class RopeLoads:
    """Tensions at both ends of the rope."""

    drum: EndLoads  #: At the drum, behind the sheaves, of each fall.
    hook_load: EndLoads  #: At the load's end, below hook block and slings: what the hook carries.


@dataclass(frozen=True, kw_only=True, eq=False)
class Loads:
    """Loads of a design, in the sea that its figures hold for."""

    significant_height: float  #: H_s [m].
    #: Time that the largest values are of [s], and the probability with which they are exceeded in
    #: it [-].
    exposure_time: float
    exceedance: float
    rare: float  #: That of the rare ones, `RARE`.
    held: RopeLoads  #: With the drum held.
    compensated: RopeLoads | None  #: With the design at work; None of an unstable loop.


class _Linear(Peaks, Protocol):
    """A motion by the moments of its Gaussian signals."""

    @property
    def members(self) -> Sequence[_Linear]:
        """The motion with each combination of signs that sensors' errors may have; or itself."""

    def sigma(self, output: str) -> float:
        """Return the standard deviation of a signal, in its unit."""

    def mean_period(self, output: str) -> float:
        """Return the mean zero-crossing period of a signal [s]."""


@dataclass(frozen=True, kw_only=True)
class _Expected:
    """What is to be expected of a signal: deviation, period, and how far it goes in a time."""

    rms: float
    period: float
    extreme: Callable[[float, int], float]  #: Of a time [s] and a way, up (1) or down (-1).


def design_loads(design: Design) -> Loads:
    """Return the tensions at both ends of the rope, with the drum held and with a design at work.

    Examples
    --------
    >>> from models import load_case
    >>> from synth import evaluate_gains
    >>> gains = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
    >>> loads = design_loads(evaluate_gains(load_case("thesis-1975"), gains))
    >>> round(loads.held.hook_load.daf, 2), round(loads.compensated.hook_load.daf, 2)
    (5.73, 1.02)
    """
    case, question = design.sea_case, design.question
    held = held_motion(question.data, question.hook, design.drag_before)

    def still(output: str) -> _Expected:
        return _Expected(
            rms=held.sigma(output),
            period=held.mean_period(output),
            extreme=lambda duration, _: held.peak(output, duration),
        )

    def moving(output: str) -> _Expected:
        signal = design.switched.signal(output)
        return _Expected(
            rms=design.switched.deviation(output),
            period=signal.mean_period,
            extreme=signal.extreme,
        )

    limits = case.limits
    return Loads(
        significant_height=design.significant_height,
        exposure_time=limits.exposure_time,
        exceedance=limits.exceedance,
        rare=RARE,
        held=_loads(design, case, held, still),
        compensated=None
        if design.margins is None
        else _loads(design, case, design.assessment, moving),
    )


def _loads(
    design: Design, case: Case, linear: _Linear, expected: Callable[[str], _Expected]
) -> RopeLoads:
    payload, plant = case.payload, design.question.plant
    # At the drum the rope's own weight hangs too, which is what it is.
    uncertain = (payload.submerged_weight - payload.least_weight) / case.hung_weight

    def end(output: str, light: float) -> EndLoads:
        static, loss = plant.static[output], plant.loss.get(output, 0.0)
        return _end(output, static, light, loss, linear, expected(output), case)

    return RopeLoads(
        drum=end(_DRUM, (1.0 - uncertain) * plant.static[_DRUM]),
        hook_load=end(LOWER_TENSION, payload.least_weight),
    )


def _end(
    output: str,
    static: float,
    light: float,
    loss: float,
    linear: _Linear,
    expected: _Expected,
    case: Case,
) -> EndLoads:
    """Return the tension at an end, from that at rest [N], also of the least weight, and motion."""
    limits = case.limits
    usual, exposure = limits.equivalent_exposure, limits.exposure_time
    rare = exposure / -math.log1p(-RARE)  # as `Limits.equivalent_exposure`

    def most(kind: type[Peak]) -> float:
        limit = kind(bound=math.inf, output=output, static=static, loss=loss, duration=usual)
        return float(max(limit.measure(one) for one in linear.members))

    def least(rest: float) -> float:
        limit = Minimum(bound=0.0, output=output, static=rest, loss=loss, duration=usual)
        return float(min(limit.measure(one) for one in linear.members))

    def margin(rest: float, one: _Linear) -> float:
        sigma = one.sigma(output)
        return (rest - loss) / sigma if sigma > 0.0 else math.inf

    def slack(rest: float) -> float:
        return max(
            exceedance_probability(margin(rest, one), one.mean_period(output), exposure)
            for one in linear.members
        )

    return EndLoads(
        output=output,
        static=static,
        static_light=light,
        loss=loss,
        rms=expected.rms,
        period=expected.period,
        linear_rms=linear.sigma(output),
        linear_period=linear.mean_period(output),
        largest=static + expected.extreme(usual, 1),
        least=static - expected.extreme(usual, -1),
        largest_rare=static + expected.extreme(rare, 1),
        least_rare=static - expected.extreme(rare, -1),
        safe_largest=most(Peak),
        safe_least=least(static),
        safe_least_light=least(light),
        daf=most(Amplification),
        margin=min(margin(static, one) for one in linear.members),
        margin_light=min(margin(light, one) for one in linear.members),
        slack_probability=slack(static),
        slack_probability_light=slack(light),
    )
