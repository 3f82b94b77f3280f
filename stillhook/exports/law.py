"""The law that leaves: a controller with the operator's interface, and all that is told of it.

design, case or controller --> law_of --> Law --> C, FMU, structured text, state space
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from models.basics import InputError
from models.case import Case
from models.plant import MEAN_LOSSES, DriveLimits, build_plant
from models.sensing import (
    Controller,
    Measurement,
    NativeLaw,
    Recursion,
    holds_brake,
    native_of,
    recursion_of,
)
from synth.controllers import highest_command, operated
from synth.design import Design, Tuning
from synth.structures import SteadyMotion, at_rest

from ..controllers import controller_of, with_c

_NO_C = (
    "export: {name} can be stepped from Python alone; what can be exported: linear laws, "
    "feed-forward, constant tension, and linear predictive control (mpc)"
)
#: Controllers by name that are, which are not made to find that out.
_FROM_PYTHON = ("mpc-clipped", "mpc-ar", "mpc-preview", "nonlinear-mpc")


@dataclass(frozen=True, kw_only=True, eq=False)
class Law:
    """A controller that can be exported; `law_of` makes it."""

    case: Case
    name: str  #: What its files and functions are called: an identifier of C.
    inner: Controller  #: The law by itself.
    controller: Controller  #: With the operator's interface about it, which is what is exported.
    native: NativeLaw  #: Its C, of that name.
    recursion: Recursion | None  #: As a CasADi function; None for predictive control.
    design: Design | None  #: Where it came from, if it was a design.
    unit: str  #: Unit of the command.
    highest: float  #: Highest size of the command, beyond which no drive gives more.
    rest: Measurement  #: What is measured where nothing moves.
    #: The operator's interface: time of taking over [s], highest rate of the set point [m/s] and of
    #: the command [per s].
    ramp: float
    rate: float
    slew: float

    @property
    def sample_time(self) -> float:
        """Time from one step to the next [s]."""
        return self.controller.sample_time

    @property
    def span(self) -> float:
        """The command's range, highest less lowest."""
        return 2.0 * self.highest


def law_of(
    what: Case | Design | Tuning | Controller,
    *,
    controller: str | Controller | None = None,
    case: Case | None = None,
    gains: Mapping[str, float] | None = None,
    sample_time: float | None = None,
    ramp: float = 5.0,
    rate: float = math.inf,
    slew: float = math.inf,
    name: str | None = None,
) -> Law:
    """Return the law that is to be exported.

    Parameters
    ----------
    what
        A design; or a case, with the controller meant.
    controller
        For a case: the name of a controller (`stillhook.controllers.CONTROLLER_TEXTS`), or one.
    case
        For a `Tuning` or a controller: the case that it is for.
    gains
        For the controller ``feedback`` of a case.
    sample_time
        T [s]; by default the controller's own.
    ramp, rate, slew
        The operator's interface (`synth.controllers.operated`).
    name
        What it is called; by default after the structure or the controller.

    Raises
    ------
    InputError
        If there is no controller, it holds the brake, or it can be stepped from Python alone.
    SynthesisError, SolverError
        If the controller cannot be made for the case.
    """
    design = what if isinstance(what, Design) else None
    if isinstance(what, Case):
        if controller is None:
            raise InputError(
                "export: of a case, say which controller is meant, or give a design of it"
            )
        case, wanted = what, controller
    elif controller is not None:
        raise InputError("export: a controller is for a case: a design brings its own")
    else:
        wanted = what  # type: ignore[assignment]
        if design is not None:
            case = design.case if case is None else case
            if not design.parameters:
                raise InputError(f"export: the design has no controller: {design.status}")
        if case is None:
            raise InputError("export: say which case the controller is for: case=...")
    if wanted in _FROM_PYTHON:
        raise InputError(_NO_C.format(name=wanted))
    options: dict[str, Any] = {"gains": gains} if gains is not None else {}
    inner = controller_of(wanted, case, sample_time=sample_time, **options)
    if holds_brake(inner):
        raise InputError(f"export: {inner.name} holds the drum with its brake: there is no law")
    called = name
    if called is None:
        called = design.structure if design is not None else inner.name
    called = identifier(called)
    about = operated(with_c(inner), case, ramp=ramp, rate=rate, slew=slew)
    native = native_of(about, called)
    if native is None:
        raise InputError(_NO_C.format(name=inner.name))
    plant = build_plant(case)
    data, point = plant.data, plant.operating_point(MEAN_LOSSES)
    return Law(
        case=case,
        name=called,
        inner=inner,
        controller=about,
        native=native.written,
        recursion=recursion_of(about),
        design=design,
        unit=plant.units["drive.command"],
        highest=highest_command(SteadyMotion.of(data), DriveLimits.from_case(case)),
        rest=at_rest(point),
        ramp=ramp,
        rate=rate,
        slew=slew,
    )


def identifier(name: str) -> str:
    """Return a name as an identifier of C, of structured text and of an FMU.

    Raises InputError if it has no letter to begin with.
    """
    found = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:32]
    if not re.match(r"[a-z]", found):
        raise InputError(f"export: name must begin with a letter, got {name!r}")
    return found
