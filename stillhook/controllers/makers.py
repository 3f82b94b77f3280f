"""How contenders become controllers: one function each, of the case and of its law.

    case, StoredDesign --> named, thesis, linear, linear_mpc, ... --> controller

Functions of a module, so that a contender can be sent to another process.  The controllers that
predict are imported when they are made, and not before.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from models.basics import InputError
from models.case import Case
from models.sensing import Controller
from synth.controllers import LinearFeedback, controller_named

from .stored_design import EAGER, StoredDesign

PROTOCOL = ("name", "sample_time", "reset", "step")
"""What a controller has."""


def named(name: str, case: Case, law: StoredDesign | None) -> Controller:
    """Return a controller of `synth.controllers.controllers` by its name."""
    del law
    return controller_named(name, case)


def thesis(case: Case, law: StoredDesign | None) -> Controller:
    """Return the feedback with the gains that the case has in use."""
    del law
    if case.gains is None:
        raise InputError(f"the case {case.name} has no gains in use")
    gains = {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}
    return LinearFeedback(case, gains, name="thesis")


def linear(name: str, anti_windup: bool, case: Case, law: StoredDesign | None) -> Controller:
    """Return the feedback of a law."""
    if law is None or not law.found:
        raise InputError("no design was found" if law is None else law.status)
    made = LinearFeedback(case, law.law, anti_windup=anti_windup, name=name)
    if not anti_windup and not made.dynamic:
        plain = f"{name.removesuffix('-no-antiwindup')}{EAGER}"
        raise InputError(f"static gains have no state that could wind up: the same as {plain}")
    return made


def given(name: str, fixed: StoredDesign, case: Case, law: StoredDesign | None) -> Controller:
    """Return the feedback of a law that was given once and for all."""
    del law
    return linear(name, True, case, fixed)


def linear_mpc(
    predictor: Literal["kalman", "ar", "preview"], case: Case, law: StoredDesign | None
) -> Controller:
    """Return the linear MPC with a predictor."""
    del law
    from mpc.linear import LinearMPC

    return LinearMPC(case, predictor=predictor)


def nonlinear_mpc(case: Case, law: StoredDesign | None) -> Controller:
    """Return the nonlinear MPC."""
    del law
    from mpc.nonlinear import NonlinearMPC

    return NonlinearMPC(case)


def as_it_is(controller: Controller, case: Case, law: StoredDesign | None) -> Controller:
    """Return a controller that was given."""
    del case, law
    return controller


def from_factory(
    name: str, factory: Callable[[Case], Any], case: Case, law: StoredDesign | None
) -> Controller:
    """Return what a function of the case returns."""
    del law
    made: Controller = factory(case)
    lacking = [part for part in PROTOCOL if not hasattr(made, part)]
    if lacking:
        raise InputError(
            f"{name}: the factory must return a controller with {', '.join(PROTOCOL)}; "
            f"got {type(made).__name__}, which has no {' and no '.join(lacking)}"
        )
    return made
