"""Controllers in time by their names: what comparisons and the command line offer.

name, case [, gains or a design] --> controller
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

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


def _feedback(
    case: Case,
    *,
    design: Design | Tuning | None = None,
    gains: Mapping[str, float] | None = None,
    anti_windup: bool = True,
    sample_time: float = 0.01,
) -> LinearFeedback:
    name = "feedback" if anti_windup else "feedback-no-antiwindup"
    if gains is None and design is not None:
        made = LinearFeedback.from_design(
            design, case=case, sample_time=sample_time, anti_windup=anti_windup, name=name
        )
    else:
        law = _own_gains(name, case) if gains is None else gains
        made = LinearFeedback(
            case, law, sample_time=sample_time, anti_windup=anti_windup, name=name
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


#: What makes a controller from a case, by its name.
CONTROLLERS: Mapping[str, Callable[..., RecursiveController]] = MappingProxyType(
    {
        "feedback": _feedback,
        "feedback-no-antiwindup": partial(_feedback, anti_windup=False),
        "feed-forward": VelocityFeedForward,
        "feed-forward-lead": VelocityFeedForward.with_lead,
        "constant-tension": ConstantTension,
        "none": BrakeOn,
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
    options: dict[str, Any] = {} if sample_time is None else {"sample_time": sample_time}
    if name.startswith("feedback"):
        options |= {"design": design, "gains": gains}
    return CONTROLLERS[name](case, **options)
