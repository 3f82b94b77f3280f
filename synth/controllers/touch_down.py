r"""The touch-down phase, around any controller: the ground has the load, and the winch gives way.

::

    controller --------------------------> command, until the load cell lacks some of the load
         |                                                       |
         +--> integral of a drum-speed loop that follows it      v
    MRU heave rate, slack to pay out ----> constant tension ---> command, from then on

No controller that holds a payload in place suits one that stands: feedback pays out rope for
ever, MPC hauls it taut, and a hook that rises lifts the payload again.  Once the tension at the
drum lacks a share of the load's weight for some time (`models.operation.TouchDown`), the winch
gives way for good, by `ConstantTension`, which is told that the set-point moves as the hook does:

* ``tension``: the drum pays out as the hook rises, and the tension's error makes up for the rest.
  The rope stays taut and carries a part of the load.
* ``release``: the drum pays out until the rope is slack by a stated length when the hook is in the
  middle of its motion, and stands still there: x_ref = c - s - (1 - s/S) Z, with s from 0 to S.
  The tension plays no part in it.

The handing over has no bump: until then the integral of the drum-speed loop takes on whatever makes
its command that of the controller, and from then on it takes away the difference.  A controller in
Python is no longer asked once the load stands.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from typing_extensions import override

from models.basics import FloatArray
from models.case import Case
from models.operation import TouchDown
from models.plant import build_plant
from models.sensing import (
    HEARD,
    Controller,
    ControllerAround,
    Measurement,
    Recursion,
    holds_brake,
    recursion_of,
)

from ..structures import RecursiveController, Signals, make_recursion
from .constant_tension import ConstantTension

_CENTRING = 0.5  # of the drum while slack is paid out [1/s]
_LANDED = 3  # where the state says that the ground has the load
_ABOUT = 1e-6  # a set-point that has moved by more has moved [m]


def touching_down(controller: Controller, case: Case, phase: TouchDown) -> Controller:
    """Return a controller with a touch-down phase, of the same name.

    One that is a recursion stays one, and is compiled into the loop as it was.  A closed brake
    needs no such phase, and what has one already has its own: they come back as they are.

    Raises SynthesisError if constant tension is not stable on the linear plant of the case.
    """
    if holds_brake(controller) or hasattr(controller, "touch_down"):
        return controller
    law = _Law.of(case, controller.sample_time, phase)
    inner = recursion_of(controller)
    if inner is None:
        return _Asked(controller, law, phase)
    return LandingController(
        name=controller.name,
        sample_time=controller.sample_time,
        recursion=_around(law, inner),
        masses=int(getattr(controller, "masses", 0)),
        touch_down=phase,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class LandingController(RecursiveController):
    """A recursive controller with a touch-down phase; `touching_down` makes it."""

    masses: int = 0  #: The rope masses that the controller within was found with.
    touch_down: TouchDown = field(default_factory=TouchDown)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Law:
    """The phase as a function: (state, m, command of the controller) -> (state, command)."""

    function: ca.Function
    initial: FloatArray

    @classmethod
    def of(cls, case: Case, sample_time: float, phase: TouchDown) -> _Law:
        plant = build_plant(case)
        rest, falls = plant.operating_point().tension, case.rope.falls
        load = case.payload.submerged_weight
        tension = ConstantTension(
            case,
            set_point=rest - (1.0 - phase.kept_tension) * load / falls,
            centring=_CENTRING,
            sample_time=sample_time,
        )
        # What the rope still carries when the phase begins stretches it.
        stretch = (1.0 - phase.unloaded) * load * plant.data.chain_compliance
        s, m, u = ca.SX.sym("s", 6), ca.SX.sym("m", len(HEARD)), ca.SX.sym("u")
        at = {name: m[i] for i, name in enumerate(HEARD)}
        inner, (lacking, landed, middle, paid) = s[:2], ca.vertsplit(s[2:])
        was = landed > 0.5
        lacks = ca.logic_and(
            at["rope.tension"] < rest - phase.unloaded * load / falls,
            at["reference.displacement"] < phase.armed_below - _ABOUT,
        )
        lacking = ca.if_else(lacks, lacking + sample_time, 0.0)
        landed = ca.logic_or(was, lacking > phase.unloaded_for)

        heave, rate = (at["mru.valid"] * at[name] for name in ("mru.heave", "mru.heave_rate"))
        told = m
        if phase.mode == "tension":
            speed, place = -rate, at["drum.haul"]
        else:
            middle = ca.if_else(was, middle, at["drum.haul"] + heave)
            whole = phase.slack + stretch
            left = 1.0 - paid / whole
            place = middle - paid - left * heave
            going = ca.if_else(paid < whole, phase.speed, 0.0)
            speed = -going * (1.0 - heave / whole) - left * rate
            paid = ca.if_else(was, ca.fmin(whole, paid + going * sample_time), 0.0)
            told = _with(told, "rope.tension", tension.set_point)
        told = _with(_with(told, "reference.velocity", speed), "reference.displacement", place)
        after, own = tension.recursion.function(inner, told)
        # Followed: with so much more in its integral the loop's command is the controller's.
        state = ca.if_else(was, after, after + (u - own))
        state = ca.vertcat(state, lacking, landed, middle, paid)
        function = ca.Function("touch_down", [s, m, u], [state, ca.if_else(was, own, u)])
        start = np.array([*tension.recursion.initial, 0.0, 0.0, 0.0, 0.0])
        return cls(function=function, initial=start)


def _with(m: ca.SX, name: str, value: Any) -> ca.SX:
    told = ca.SX(m)
    told[HEARD.index(name)] = value
    return told


def _around(law: _Law, inner: Recursion) -> Recursion:
    """Return a controller's recursion with the phase around it."""
    n = inner.initial.size

    def both(xc: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
        seen = ca.vertcat(*(m[name] for name in HEARD))
        following, command = inner.function(xc[:n], seen)
        phase, command = law.function(xc[n:], seen, command)
        return ca.vertcat(following, phase), command

    return make_recursion(np.concatenate([inner.initial, law.initial]), both)


class _Asked(ControllerAround):
    """A controller in Python with a touch-down phase."""

    def __init__(self, controller: Controller, law: _Law, phase: TouchDown) -> None:
        super().__init__(controller)
        self._law, self.touch_down = law, phase
        self._state, self._landed = law.initial, False

    @property
    def status(self) -> str:
        return "engaged" if self._landed else getattr(self._controller, "status", "")

    @override
    def reset(self) -> None:
        """Forget every earlier measurement."""
        super().reset()
        self._state, self._landed = self._law.initial, False

    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command, its static part included [V, rad/s or N m]."""
        asked = 0.0 if self._landed else self._controller.step(measurement, time)
        state, command = self._law.function(self._state, measurement.values, asked)
        self._state = np.asarray(state).ravel()
        self._landed = bool(self._state[_LANDED] > 0.5)
        return float(command)
