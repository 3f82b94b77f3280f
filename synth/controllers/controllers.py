"""Controllers in time by their names: what comparisons and the command line offer.

name, case [, gains or a design] --> controller
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import casadi as ca

from models.basics import InputError, pick
from models.case import Case

from ..design import Design, Tuning
from ..structures import RecursiveController
from .constant_tension import ConstantTension
from .feed_forward import VelocityFeedForward
from .linear_feedback import LinearFeedback


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class BrakeOn(RecursiveController):
    """No compensation at all: the brake is on and the drive is off.

    What every controller is compared with.  Zero is no voltage, no speed and no torque, whichever
    the drive is told: a standing motor then carries nothing and stays cold.

    Parameters
    ----------
    case
        The case; nothing of it is needed, but every controller is made from one.
    sample_time
        T [s].

    Raises
    ------
    InputError
        If the sample time is out of its range.
    """

    def __init__(self, case: Case, *, sample_time: float = 0.02) -> None:
        del case
        self._set(brake=True)
        self._adopt("none", sample_time, (), lambda xc, m: (xc, ca.SX(0.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ControllerRequest:
    """What a controller is made from.

    Attributes
    ----------
    case
        The case.
    design
        A design of its feedback, if there is one.
    gains
        Gains of the feedback, if they are given; they count before a design.
    sample_time
        T [s]; None for the controller's own.
    """

    case: Case
    design: Design | Tuning | None = None
    gains: Mapping[str, float] | None = None
    sample_time: float | None = None

    def time(self, usual: float) -> float:
        """Return the sample time, `usual` if none is asked for [s]."""
        return usual if self.sample_time is None else self.sample_time


def _feedback(request: ControllerRequest, *, anti_windup: bool = True) -> LinearFeedback:
    case, sample_time = request.case, request.time(0.01)
    name = "feedback" if anti_windup else "feedback-no-antiwindup"
    if request.gains is None and request.design is not None:
        made = LinearFeedback.from_design(
            request.design, case=case, sample_time=sample_time, anti_windup=anti_windup, name=name
        )
    else:
        gains = _own_gains(name, case) if request.gains is None else request.gains
        made = LinearFeedback(
            case, gains, sample_time=sample_time, anti_windup=anti_windup, name=name
        )
    if not anti_windup and not made.dynamic:
        raise InputError(
            f"{name}: static gains have no state that could wind up, so that this is the same "
            "as 'feedback'; it is for a design with a dynamic controller"
        )
    return made


def _own_gains(name: str, case: Case) -> Mapping[str, float]:
    if case.gains is None:
        raise InputError(
            f"{name}: case {case.name} has no gains in use: optimise them, or give them"
        )
    return {gain: getattr(case.gains, gain) for gain in ("A", "a", "a1", "a2")}


#: What makes a controller, by its name.
CONTROLLERS: Mapping[str, Callable[[ControllerRequest], RecursiveController]] = MappingProxyType(
    {
        "feedback": _feedback,
        "feedback-no-antiwindup": lambda request: _feedback(request, anti_windup=False),
        "feed-forward": lambda request: VelocityFeedForward(
            request.case, sample_time=request.time(0.02)
        ),
        "feed-forward-lead": lambda request: VelocityFeedForward.with_lead(
            request.case, sample_time=request.time(0.02)
        ),
        "constant-tension": lambda request: ConstantTension(
            request.case, sample_time=request.time(0.02)
        ),
        "none": lambda request: BrakeOn(request.case, sample_time=request.time(0.02)),
    }
)


def controller_named(
    name: str,
    case: Case,
    *,
    design: Design | Tuning | None = None,
    gains: Mapping[str, float] | None = None,
    sample_time: float | None = None,
) -> RecursiveController:
    """Return the controller of a name for a case.

    Parameters
    ----------
    name
        One of `CONTROLLERS`.
    case
        The case.
    design, gains
        For feedback: gains count before a design, and a design before the case's own gains.
    sample_time
        T [s]; by default the controller's own, 0.01 for feedback and 0.02 for the others.

    Raises
    ------
    InputError
        If there is no such controller, it has no gains, or a number is out of its range.
    SynthesisError
        If the controller is not stable on the linear plant of the case.
    """
    pick("controllers", "controller", tuple(CONTROLLERS), (name,))
    request = ControllerRequest(case=case, design=design, gains=gains, sample_time=sample_time)
    return CONTROLLERS[name](request)
