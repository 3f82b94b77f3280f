"""Who takes part in a comparison: every controller by its name, what it is and what it knows.

    names, designs, controllers, (name, factory) --> contenders_of --> Contender ... --> compare

A contender is a recipe, not a controller: it goes to another process and makes the controller
there, for the case at hand.  What takes long to find, a design, is found once and handed to it as
a `StoredDesign`.
"""

from __future__ import annotations

import functools
import hashlib
import pickle
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from models.basics import InputError, pick
from models.case import Case
from models.sensing import Controller
from synth.design import GainDesign, StructureDesign, Tuning

from .makers import (
    PROTOCOL,
    as_it_is,
    from_factory,
    given,
    linear,
    linear_mpc,
    named,
    nonlinear_mpc,
    thesis,
)
from .stored_design import StoredDesign

Make = Callable[[Case, StoredDesign | None], Controller]

GROUPS = ("brake", "linear", "predictive", "own", "reference", "floor")
"""What contenders are: brake, linear laws, causal prediction, the user's own, those that know
what nobody can know, and the floor, which is no controller at all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contender:
    """One that takes part.

    Attributes
    ----------
    name
        What it is called in tables and figures.
    what, knows
        One line each: what it is, and what it knows.
    group
        One of `GROUPS`.
    needs
        The design that it is made of, as for `compare_law.design_law`; empty if none.
    make
        Returns the controller for a case and its law; None for the floor.
    portable
        Whether it can be sent to another process, and known again when a comparison goes on.
    identity
        A digest that changes when the contender does.
    """

    name: str
    what: str
    knows: str
    group: str
    needs: str = ""
    make: Make | None = None
    portable: bool = True
    identity: str = ""


def _built_in(
    name: str, what: str, knows: str, group: str, make: Make | None, needs: str = ""
) -> Contender:
    return Contender(
        name=name, what=what, knows=knows, group=group, make=make, needs=needs, identity=name
    )


_PAYLOAD = "payload by telemetry; plant and sea of the case when it was designed"
_BOTH = "payload and motion reference unit; plant and sea of the case when it was designed"
_SEEN = "all sensors, up to now; plant of the case"
_ALL = (
    _built_in(
        "none",
        "the drum held by its brake",
        "nothing",
        "brake",
        functools.partial(named, "none"),
    ),
    _built_in(
        "constant-tension",
        "the drive keeps the rope's tension",
        "load cell and motor",
        "linear",
        functools.partial(named, "constant-tension"),
    ),
    _built_in(
        "feed-forward",
        "the drum pays out 0.9 of the hook's speed",
        "motion reference unit",
        "linear",
        functools.partial(named, "feed-forward"),
    ),
    _built_in(
        "thesis", "the gains that the case has in use", "payload by telemetry", "linear", thesis
    ),
    _built_in(
        "feedback",
        "three optimised gains on the payload's motion, within the drive's limits",
        _PAYLOAD,
        "linear",
        functools.partial(linear, "feedback", True),
        "gains",
    ),
    _built_in(
        "feedback-half",
        "three optimised gains, within the drive's limits in a sea of half the height",
        _PAYLOAD,
        "linear",
        functools.partial(linear, "feedback-half", True),
        "gains-half",
    ),
    _built_in(
        "feedback-eager",
        "three optimised gains, as if the drive had no limits",
        _PAYLOAD,
        "linear",
        functools.partial(linear, "feedback-eager", True),
        "gains-eager",
    ),
    _built_in(
        "feedback-no-antiwindup",
        "the eager one without anti-windup",
        _PAYLOAD,
        "linear",
        functools.partial(linear, "feedback-no-antiwindup", False),
        "gains-eager",
    ),
    _built_in(
        "combined",
        "optimised feedback and feed-forward with anti-windup, within the drive's limits",
        _BOTH,
        "linear",
        functools.partial(linear, "combined", True),
        "combined",
    ),
    _built_in(
        "combined-half",
        "the same, within the drive's limits in a sea of half the height",
        _BOTH,
        "linear",
        functools.partial(linear, "combined-half", True),
        "combined-half",
    ),
    _built_in(
        "combined-eager",
        "the same, as if the drive had no limits",
        _BOTH,
        "linear",
        functools.partial(linear, "combined-eager", True),
        "combined-eager",
    ),
    _built_in(
        "combined-no-antiwindup",
        "the eager one without anti-windup",
        _BOTH,
        "linear",
        functools.partial(linear, "combined-no-antiwindup", False),
        "combined-eager",
    ),
    _built_in(
        "mpc",
        "linear MPC, the hook predicted by a Kalman filter",
        f"{_SEEN}; the sea's spectrum",
        "predictive",
        functools.partial(linear_mpc, "kalman"),
    ),
    _built_in(
        "mpc-ar",
        "linear MPC, the hook predicted by an adaptive AR model",
        f"{_SEEN}; nothing of the sea",
        "predictive",
        functools.partial(linear_mpc, "ar"),
    ),
    _built_in(
        "nonlinear-mpc",
        "MPC on the nonlinear plant",
        f"{_SEEN}, its limits and drag; the sea's spectrum",
        "predictive",
        nonlinear_mpc,
    ),
    _built_in(
        "mpc-preview",
        "linear MPC that is told the hook's future, for reference",
        f"{_SEEN}; the hook's motion to come",
        "reference",
        functools.partial(linear_mpc, "preview"),
    ),
    _built_in(
        "clairvoyant",
        "the least that any command within the drive's limits leaves: a floor, no controller",
        "everything, the whole record in advance",
        "floor",
        None,
    ),
)

CONTENDERS: Mapping[str, Contender] = MappingProxyType({each.name: each for each in _ALL})
"""Every contender by its name."""

# Names that are left out unless they are asked for.  `feedback-no-antiwindup` says only that
# static gains cannot wind up.
LEFT_OUT = ("feedback-no-antiwindup",)

DEFAULTS = tuple(name for name in CONTENDERS if name not in LEFT_OUT)
"""Who takes part unless others are named."""


def contenders_of(wanted: Sequence[object] | None) -> tuple[Contender, ...]:
    """Return the contenders that are meant.

    Parameters
    ----------
    wanted
        Names of `CONTENDERS`; designs (`GainDesign`, `StructureDesign`, `Tuning`); controllers;
        pairs of a name and any of these, or of a name and a function of the case that returns a
        controller.  None for `DEFAULTS`.

    Raises
    ------
    InputError
        If there is none, a name is unknown or comes twice, or one is none of these.
    """
    if wanted is not None and (isinstance(wanted, str) or not isinstance(wanted, Sequence)):
        wanted = [wanted]
    found = tuple(_contender(each) for each in (DEFAULTS if wanted is None else wanted))
    if not found:
        raise InputError("compare: at least one controller is wanted, got none")
    names = [each.name for each in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(
            f"compare: controllers must have names that differ, got {twice!r} twice; "
            "give a pair (name, controller)"
        )
    return found


def _contender(wanted: object) -> Contender:
    if isinstance(wanted, str):
        pick("compare", "controller", tuple(CONTENDERS), (wanted,))
        return CONTENDERS[wanted]
    name = None
    if isinstance(wanted, tuple) and len(wanted) == 2 and isinstance(wanted[0], str):
        name, wanted = wanted
        if isinstance(wanted, str):
            raise InputError(f"compare: {name}: must be a design, a controller or a function")
    if isinstance(wanted, GainDesign | StructureDesign | Tuning):
        return _of_design(name, wanted)
    make: Make
    if all(hasattr(wanted, part) for part in PROTOCOL):
        controller: Any = wanted
        own = str(name or controller.name)
        make, what = functools.partial(as_it_is, controller), type(wanted).__name__
    elif callable(wanted) and name is not None:
        own, make = name, functools.partial(from_factory, name, wanted)
        what = getattr(wanted, "__qualname__", type(wanted).__name__)
    else:
        raise InputError(
            "compare: a controller must be a name, a design, an object with "
            f"{', '.join(PROTOCOL)}, or a pair of a name and a function of the case; "
            f"got {type(wanted).__name__}"
        )
    identity, portable = _identity(make)
    return Contender(
        name=own,
        what=f"given: {what}",
        knows="what it was given",
        group="own",
        make=make,
        portable=portable,
        identity=identity,
    )


def _of_design(name: str | None, design: GainDesign | StructureDesign | Tuning) -> Contender:
    law = StoredDesign.of(design)
    usual = design.structure if isinstance(design, StructureDesign) else "design"
    own = name or usual
    return Contender(
        name=own,
        what=f"a design that was given: {law.status}",
        knows="what it was designed for",
        group="linear",
        make=functools.partial(given, own, law),
        identity=law.digest,
    )


def _identity(make: Make) -> tuple[str, bool]:
    """Return a digest of a recipe, and whether another process can use it.

    A function that was written at a prompt is known to its own process alone, and nobody can
    tell whether it is still the same tomorrow: it gets a digest that never comes again.
    """
    try:
        data = pickle.dumps(make)
    except (pickle.PicklingError, AttributeError, TypeError, RuntimeError):
        return uuid.uuid4().hex, False
    if b"__main__" in data:
        return uuid.uuid4().hex, False
    return hashlib.sha256(data).hexdigest()[:16], True
