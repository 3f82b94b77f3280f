"""Controllers in time by name or of a design (`controller_of`), linear and predictive.

    name, case [, design, gains] --> synth.controllers or mpc --> controller

`synth` and `mpc` do not know each other; here the names of both meet.  The predictive ones are
imported when one is made, as they bring a solver along.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from models.basics import InputError, pick
from models.case import Case
from models.sensing import Controller

if TYPE_CHECKING:
    from synth.controllers import LinearFeedback
    from synth.design import Design, Tuning
    from synth.loop import LinearController

PROTOCOL = ("name", "sample_time", "reset", "step")  #: What a controller has.


CONTROLLER_TEXTS: Mapping[str, str] = MappingProxyType(
    {
        "feedback": "a design, or the three gains that the case has in use",
        "feedback-no-antiwindup": "the same without anti-windup, for a controller with states",
        "feed-forward": "the drum pays out 0.9 of the hook's speed",
        "feed-forward-full": "the drum pays out all of the hook's speed",
        "feed-forward-lead": "0.9 of it, with the delays of sensor and drive made up for",
        "constant-tension": "the drive keeps the rope's tension within a dead band",
        "none": "the drum held by its brake",
        "mpc": "linear MPC, the hook foretold by the sea that is told and by others",
        "mpc-clipped": "the same filter and law without limits, cut off at the drive's",
        "mpc-ar": "linear MPC, the hook predicted by an adaptive AR model",
        "mpc-preview": "linear MPC that is told the hook's future, for reference",
        "nonlinear-mpc": "MPC on the nonlinear plant: drag, slack rope and the drive's limits",
    }
)
"""Every controller by its name, those of `synth.controllers` first, and what it is, in a line."""


def controller_by_name(
    name: str,
    case: Case,
    *,
    design: Design | Tuning | None = None,
    gains: Mapping[str, float] | None = None,
    sample_time: float | None = None,
) -> Controller:
    """Return the controller of a name of `CONTROLLER_TEXTS` for a case.

    Design and gains are for feedback only; the sample time T [s] is by default the controller's
    own.

    Raises InputError if there is no such controller, or what is given with it does not belong to
    it; SolverError, SynthesisError if it cannot be made for the case.
    """
    pick("controllers", "controller", tuple(CONTROLLER_TEXTS), (name,))
    if name.startswith("feedback"):
        given = gains if gains is not None else design
        law = gains_in_use(case) if given is None else given
        return feedback_of(name, case, law, sample_time=sample_time)
    if "mpc" not in name:
        from synth.controllers import BrakeOn, ConstantTension, VelocityFeedForward

        makers: Mapping[str, Callable[..., Controller]] = {
            "feed-forward": VelocityFeedForward,
            "feed-forward-full": functools.partial(
                VelocityFeedForward, share=1.0, name="feed-forward-full"
            ),
            "feed-forward-lead": VelocityFeedForward.with_lead,
            "constant-tension": ConstantTension,
            "none": BrakeOn,
        }
        return makers[name](case, **({} if sample_time is None else {"sample_time": sample_time}))
    if gains is not None:
        raise InputError(f"{name}: gains are for feedback; predictive control has none")
    T = 0.05 if sample_time is None else sample_time
    if name == "nonlinear-mpc":
        from mpc.nonlinear import NonlinearMPC

        return NonlinearMPC(case, sample_time=T)
    from mpc.linear import ClippedMPC, LinearMPC

    if name == "mpc-clipped":
        return ClippedMPC(case, sample_time=T)
    if name == "mpc":
        return LinearMPC(case, sample_time=T)
    return LinearMPC(case, sample_time=T, predictor="ar" if name == "mpc-ar" else "preview")


def feedback_of(
    name: str,
    case: Case,
    law: Mapping[str, float] | LinearController | Design | Tuning,
    *,
    sample_time: float | None = None,
) -> LinearFeedback:
    """Return linear feedback of gains, a controller or a design, by its name without anti-windup.

    The sample time [s] is by default that of `synth.controllers.LinearFeedback`.

    Raises InputError if it is to be without, but has no states; or as
    `synth.controllers.LinearFeedback`.
    """
    from synth.controllers import LinearFeedback
    from synth.loop import LinearController

    anti_windup = not name.endswith("-no-antiwindup")
    options: dict[str, Any] = {"anti_windup": anti_windup, "name": name}
    if sample_time is not None:
        options["sample_time"] = sample_time
    if isinstance(law, Mapping | LinearController):
        made = LinearFeedback(case, law, **options)
    else:
        made = LinearFeedback.from_design(law, case=case, **options)
    if not anti_windup and not made.dynamic:
        raise InputError(
            f"{name}: static gains have no state that could wind up, so that this is the same as "
            "with anti-windup; it is for a design with a dynamic controller"
        )
    return made


def gains_in_use(case: Case) -> dict[str, float]:
    """Return the gains that a case has in use, by name.

    Raises InputError if it has none.
    """
    if case.gains is None:
        raise InputError(f"the case {case.name} has no gains in use: optimise them, or give them")
    return {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}


def controller_of(
    controller: str | Design | Tuning | Controller,
    case: Case,
    *,
    design: Design | Tuning | None = None,
    gains: Mapping[str, float] | None = None,
    sample_time: float | None = None,
) -> Controller:
    """Return the controller that is meant: by its name, of a design, or the object itself.

    Raises InputError if it is none of these, or what is given with it does not belong to it.
    """
    from synth.design import Design, Tuning

    if isinstance(controller, str):
        return controller_by_name(
            controller, case, design=design, gains=gains, sample_time=sample_time
        )
    if design is not None or gains is not None:
        raise InputError("simulate: design and gains are for a controller by its name")
    if isinstance(controller, Design | Tuning):
        return feedback_of("feedback", case, controller, sample_time=sample_time)
    lacking = [name for name in PROTOCOL if not hasattr(controller, name)]
    if lacking:
        raise InputError(
            "simulate: controller must be a name, a design, or an object with "
            f"{', '.join(PROTOCOL)}; got {type(controller).__name__}, which has no "
            f"{' and no '.join(lacking)}"
        )
    if sample_time is not None:
        raise InputError(
            f"simulate: sample_time is for a controller by its name; {controller.name} has its "
            f"own, {controller.sample_time:g} s"
        )
    return controller
