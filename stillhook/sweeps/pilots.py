"""Who flies the cases of a sweep: a design, a controller by name, an object, or a factory.

    design, name, controller, (name, factory) --> pilot_of --> Pilot --> make(case) --> controller

A pilot is a recipe that goes to another process and makes the controller there: for the case that
it knows (the nominal one, while the plant is another: robustness of a fixed design), or for each
case anew (what redesign would be worth).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from models.basics import InputError, pick
from models.case import Case
from models.sensing import Controller
from synth.design import GainDesign, StructureDesign, Tuning

from ..controllers import (
    StoredDesign,
    contenders_of,
    controller_by_name,
    design_law,
    given,
    known_controllers,
)

Make = Callable[[Case, StoredDesign | None], Controller]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pilot:
    """A recipe for a controller.

    Attributes
    ----------
    name
        What it is called.
    kind
        "name", "law", "object" or "factory".
    make
        Makes the controller for a case; of a law, from it.
    law
        The law of a design; None for the others.
    needs
        What to design for a case if it follows, as for `compare_law.design_law`; empty if it is
        not a design.
    portable
        Whether it can be sent to another process.
    identity
        A digest that changes when the pilot does.
    """

    name: str
    kind: str
    make: Make
    law: StoredDesign | None = None
    needs: str = ""
    portable: bool = True
    identity: str = ""

    @property
    def gains(self) -> Mapping[str, float]:
        """Gains by name, where it is a law of payload feedback; else empty."""
        if self.law is None or self.law.kind != "gains":
            return {}
        return {name: float(value) for name, value in self.law.values.items()}

    def controller(self, case: Case, gains: Mapping[str, float] | None = None) -> Controller:
        """Return the controller for a case, with some of its gains changed.

        Raises
        ------
        InputError, SynthesisError, SolverError
            If there is none for the case, or it has no such gains.
        """
        if not gains:
            return self.make(case, self.law)
        if not self.gains:
            raise InputError(f"{self.name}: gains can be varied of a design of payload feedback")
        assert self.law is not None
        return self.make(case, replace(self.law, values={**self.law.values, **gains}))

    def follow(self, case: Case, starts: int) -> Controller:
        """Return the controller made for a case; a design is designed anew.

        Raises
        ------
        InputError, SynthesisError, SolverError
            If there is none for the case, or it cannot follow.
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
        law = design_law(self.needs, case, starts)
        if not law.found:
            raise InputError(f"no design was found: {law.status}")
        return self.make(case, law)

    def to_dict(self) -> dict[str, Any]:
        """Return what a store keeps of it, as plain data."""
        about: dict[str, Any] = {"name": self.name, "kind": self.kind, "identity": self.identity}
        if self.law is not None:
            about |= {"law": self.law.to_dict(), "needs": self.needs}
        return about


def pilot_of(wanted: object) -> Pilot:
    """Return the pilot that is meant.

    Parameters
    ----------
    wanted
        A `GainDesign`, `StructureDesign` or `Tuning`; the name of a controller
        (`stillhook.controllers.controllers`); a controller; or a pair of a name and one of these or
        of a function of the case that returns a controller.

    Raises
    ------
    InputError
        If it is none of these, or the name is unknown.
    """
    if isinstance(wanted, str):
        pick("sweep", "controller", known_controllers(), (wanted,))
        make = functools.partial(_named, wanted)
        return Pilot(name=wanted, kind="name", make=make, identity=wanted)
    own = wanted[1] if isinstance(wanted, tuple) and len(wanted) == 2 else wanted
    if isinstance(own, GainDesign | StructureDesign | Tuning):
        law = StoredDesign.of(own)
        needs = ""
        if isinstance(own, GainDesign):
            needs = "gains"
        elif isinstance(own, StructureDesign):
            needs = own.structure
        name = wanted[0] if isinstance(wanted, tuple) else (needs or "tuning")
        return _of_law("feedback" if name == "gains" else str(name), law, needs)
    (found,) = contenders_of([wanted])
    assert found.make is not None
    return Pilot(
        name=found.name,
        kind="factory" if callable(own) and not hasattr(own, "step") else "object",
        make=found.make,
        portable=found.portable,
        identity=found.identity,
    )


def pilot_from(about: Mapping[str, Any]) -> Pilot:
    """Return the pilot that a store tells of.

    Raises
    ------
    InputError
        If it was an object or a function, which no store can keep.
    """
    if about["kind"] == "name":
        return pilot_of(str(about["name"]))
    if about["kind"] == "law":
        return _of_law(str(about["name"]), StoredDesign(**about["law"]), str(about["needs"]))
    raise InputError(
        f"its controller {about['name']} was given as Python code, which is not kept: go on with "
        "the same call of sh.sweep(..., store=...) as before"
    )


def _of_law(name: str, law: StoredDesign, needs: str) -> Pilot:
    if not law.found:
        raise InputError(f"{name}: the design has no stable law: {law.status}")
    make = functools.partial(_given, name)
    return Pilot(name=name, kind="law", make=make, law=law, needs=needs, identity=law.digest)


def _named(name: str, case: Case, law: StoredDesign | None) -> Controller:
    del law
    return controller_by_name(name, case)


def _given(name: str, case: Case, law: StoredDesign | None) -> Controller:
    assert law is not None
    return given(name, law, case, None)
