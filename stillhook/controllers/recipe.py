"""Recipes for controllers in time (`Recipe`), for any process and any store.

    name, design, controller, (name, function) --> recipe_of --> Recipe --> controller(case)

A recipe goes to another process and makes the controller there: for the case that it knows (the
nominal one, while the plant is another: robustness of a fixed design), or for each case anew (what
redesign would be worth).  What takes long to find, a design, is found once and handed to it as a
`StoredDesign`.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import sys
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from models.basics import InputError, pick
from models.case import Case
from models.sensing import Controller
from synth.design import Design, Tuning

from .named import CONTROLLER_TEXTS, PROTOCOL, controller_by_name, feedback_of, gains_in_use
from .stored_design import StoredDesign, design_law

Make = Callable[[Case, StoredDesign | None], Controller]


@dataclass(frozen=True, kw_only=True, eq=False)
class Recipe:
    """How a controller is made."""

    name: str  #: What it is called.
    kind: str  #: "name", "law" (a design), "object" or "factory" (a function of the case).
    make: Make  #: Makes the controller for a case; of a design, from it.
    design: StoredDesign | None = None  #: The design, if it was given.
    needs: str = ""  #: What to design for a case, as for `design_law`; empty if it is not a design.
    #: Whether it can be sent to another process, and known again when work goes on.
    portable: bool = True
    identity: str = ""  #: A digest that changes when the recipe does.

    @property
    def gains(self) -> Mapping[str, float]:
        """The parameters by name of a design's structure; else nothing."""
        return {} if self.design is None else self.design.parameters

    def controller(self, case: Case, design: StoredDesign | None = None) -> Controller:
        """Return the controller for a case, of its own design or of one that was found for it.

        Raises InputError, SynthesisError, SolverError if there is none for the case.
        """
        return self.make(case, self.design if design is None else design)

    def with_gains(self, case: Case, gains: Mapping[str, float]) -> Recipe:
        """Return the recipe with some of its gains changed, for a case.

        Raises InputError if it has none.
        """
        if self.design is None or not self.gains:
            raise InputError(f"{self.name}: gains can be varied of a design of a winch")
        return replace(self, design=self.design.on(case, gains))

    def follow(self, case: Case, starts: int) -> Controller:
        """Return the controller made for a case; a design is designed anew.

        Raises InputError, SynthesisError, SolverError if there is none for the case, or it cannot
        follow.
        """
        if self.kind == "object":
            raise InputError(
                f"{self.name}: a controller that is given as an object cannot follow the case; "
                "give a pair (name, function of the case)"
            )
        if self.kind != "law":
            return self.make(case, None)
        if not self.needs:
            raise InputError(f"{self.name}: a tuning does not know how to be tuned again")
        return self.make(case, design_law(self.needs, case, starts))

    def to_dict(self) -> dict[str, Any]:
        """Return what a store keeps of it, as plain data."""
        about: dict[str, Any] = {"name": self.name, "kind": self.kind, "identity": self.identity}
        if self.design is not None:
            about |= {"law": self.design.to_dict(), "needs": self.needs}
        return about


def recipe_of(wanted: object, owner: str) -> Recipe:
    """Return the recipe that is meant.

    It may be meant by the name of a controller (`CONTROLLER_TEXTS`); a `Design` or a `Tuning`; a
    controller; or a pair of a name and a design, a controller or a function of the case that
    returns a controller.  Messages name the owner.

    Raises InputError if it is none of these, or the name is unknown.
    """
    if isinstance(wanted, str):
        pick(owner, "controller", tuple(CONTROLLER_TEXTS), (wanted,))
        make: Make = functools.partial(_named, wanted)
        return Recipe(name=wanted, kind="name", make=make, identity=wanted)
    name = None
    if isinstance(wanted, tuple) and len(wanted) == 2 and isinstance(wanted[0], str):
        name, wanted = wanted
        if isinstance(wanted, str):
            raise InputError(f"{owner}: {name}: must be a design, a controller or a function")
    if isinstance(wanted, Design):
        own = "feedback" if wanted.structure == "payload-feedback" else wanted.structure
        return _of_design(name or own, StoredDesign.of(wanted), wanted.structure)
    if isinstance(wanted, Tuning):
        return _of_design(name or "tuning", StoredDesign.of(wanted), "")
    if all(hasattr(wanted, part) for part in PROTOCOL):
        controller: Any = wanted
        own, kind = str(name or controller.name), "object"
        make = functools.partial(_as_it_is, controller)
    elif callable(wanted) and name is not None:
        own, kind = name, "factory"
        make = functools.partial(_from_function, name, wanted)
    else:
        raise InputError(
            f"{owner}: a controller must be a name, a design, an object with "
            f"{', '.join(PROTOCOL)}, or a pair of a name and a function of the case; "
            f"got {type(wanted).__name__}"
        )
    identity, portable = _identity(make)
    return Recipe(name=own, kind=kind, make=make, portable=portable, identity=identity)


def recipe_from(about: Mapping[str, Any]) -> Recipe:
    """Return the recipe that a store tells of.

    Raises InputError if it was an object or a function, which no store can keep.
    """
    if about["kind"] == "name":
        return recipe_of(str(about["name"]), "sweep")
    if about["kind"] == "law":
        return _of_design(str(about["name"]), StoredDesign(**about["law"]), str(about["needs"]))
    raise InputError(
        f"its controller {about['name']} was given as Python code, which is not kept: go on with "
        "the same call of sh.sweep(..., store=...) as before"
    )


def feedback(name: str, case: Case, design: StoredDesign | None) -> Controller:
    """Return the linear feedback of a design."""
    if design is None or not design.found:
        raise InputError(
            "no design was found" if design is None else f"the design has no law: {design.status}"
        )
    return feedback_of(name, case, design.law)


def thesis(case: Case, design: StoredDesign | None) -> Controller:
    """Return the feedback with the gains that the case has in use."""
    del design
    return feedback_of("thesis", case, gains_in_use(case))


def _of_design(name: str, design: StoredDesign, needs: str) -> Recipe:
    make = functools.partial(feedback, name)
    own = design.digest
    return Recipe(name=name, kind="law", make=make, design=design, needs=needs, identity=own)


# Functions of the module, so that a recipe can be sent to another process.


def _named(name: str, case: Case, design: StoredDesign | None) -> Controller:
    del design
    return controller_by_name(name, case)


def _as_it_is(controller: Controller, case: Case, design: StoredDesign | None) -> Controller:
    del case, design
    return controller


def _from_function(
    name: str, function: Callable[[Case], Any], case: Case, design: StoredDesign | None
) -> Controller:
    del design
    made: Controller = function(case)
    lacking = [part for part in PROTOCOL if not hasattr(made, part)]
    if lacking:
        raise InputError(
            f"{name}: the factory must return a controller with {', '.join(PROTOCOL)}; "
            f"got {type(made).__name__}, which has no {' and no '.join(lacking)}"
        )
    return made


def _identity(make: Make) -> tuple[str, bool]:
    """Return a digest of a recipe's function, and whether another process can use it.

    A function that was written at a prompt is known to its own process alone, and nobody can
    tell whether it is still the same tomorrow: it gets a digest that never comes again.  So does
    one of a module that only the current folder leads to, where other processes do not look.
    """
    try:
        data = pickle.dumps(make)
    except (pickle.PicklingError, AttributeError, TypeError, RuntimeError):
        return uuid.uuid4().hex, False
    if any(name.encode() in data for name in ("__main__", *_beside())):
        return uuid.uuid4().hex, False
    return hashlib.sha256(data).hexdigest()[:16], True


def _beside() -> list[str]:
    """Return the modules that were found in the current folder, which the path does not name."""
    here = os.getcwd()
    if here in sys.path:
        return []
    files = {n: getattr(m, "__file__", None) for n, m in sys.modules.items() if "." not in n}
    tops = {n: file.removesuffix(f"{os.sep}__init__.py") for n, file in files.items() if file}
    return [name for name, top in tops.items() if os.path.dirname(top) == here]
