"""Controllers with a weighed load: the static part of the true plant, all else as designed.

    measurement - shift --> controller made for the nominal case --> command + shift

Whoever engages a winch has the load on the load cell.  A controller that was made for another
weight would let the load fall in the first second, which says nothing about its loop.  The
controller keeps its model; command, motor torque and rope tension are told to it, and taken from
it, as deviations from a static state that is shifted to the true one.
"""

import math
from typing import NamedTuple

import casadi as ca
import numpy as np

from models.case import Case
from models.plant import MEAN_LOSSES, build_plant
from models.sensing import (
    HEARD,
    Controller,
    ControllerAround,
    Measurement,
    Recursion,
    holds_brake,
    recursion_of,
)
from synth.structures import RecursiveController, Signals, make_recursion

_SHIFTED = ("drive.applied", "rope.tension", "motor.torque")


class Shift(NamedTuple):
    """A static state, or by how much the true one is above that which a controller knows."""

    command: float  #: Drive command [V, rad/s or N m].
    tension: float  #: Rope tension at the drum [N].
    torque: float  #: Motor torque [N m].


def static_of(case: Case) -> Shift:
    """Return the static state of a case, as the controllers reckon it."""
    point = build_plant(case).operating_point(MEAN_LOSSES)
    return Shift(point.command, point.tension, point.torque)


def shift_between(known: Shift, true: Shift) -> Shift:
    """Return the shift from the static state that a controller knows to the true one."""
    return Shift(*np.subtract(true, known).tolist())


def trimmed(controller: Controller, shift: Shift) -> Controller:
    """Return a controller with its static part shifted; the same one if there is no shift."""
    if not any(shift) or holds_brake(controller):
        return controller
    recursion = recursion_of(controller)
    if recursion is None:
        return _Trimmed(controller, shift)
    return RecursiveController(
        name=controller.name,
        sample_time=controller.sample_time,
        recursion=_shifted(recursion, shift),
        deaf_after=getattr(controller, "deaf_after", math.inf),
    )


def _shifted(recursion: Recursion, shift: Shift) -> Recursion:
    """Return the recursion with the shift as states: the compiled loop is the same for any."""
    n = recursion.initial.size

    def law(state: ca.SX, m: Signals) -> tuple[ca.SX, ca.SX]:
        by = state[n:]
        seen = {**m, **{name: m[name] - by[i] for i, name in enumerate(_SHIFTED)}}
        following, command = recursion.function(state[:n], ca.vertcat(*seen.values()))
        return ca.vertcat(following, by), command + by[0]

    return make_recursion(np.concatenate([recursion.initial, shift]), law)


class _Trimmed(ControllerAround):
    """A controller in Python with its static part shifted."""

    def __init__(self, controller: Controller, shift: Shift) -> None:
        super().__init__(controller)
        self._shift = shift
        self._at = [HEARD.index(name) for name in _SHIFTED]

    def step(self, measurement: Measurement, time: float) -> float:
        values = measurement.values.copy()
        values[self._at] -= self._shift
        return self._controller.step(Measurement(values), time) + self._shift.command
