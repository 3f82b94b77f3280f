"""Recursive controllers: one formula for the compiled loop and for a step in Python.

    law (CasADi symbols) --> Recursion --> compiled into the loop, or RecursiveController.step

Every controller of this package derives from `RecursiveController`: it writes its law once, as
a symbolic function of its state and of what is measured (`models.sensing.control`).  `step`
evaluates that very function, so that a controller called from Python and one compiled into the
simulation give the same commands.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, check_range
from models.plant import OperatingPoint
from models.sensing import HEARD, STATUSES, Measurement, Recursion

Signals = Mapping[str, ca.SX]
RecursiveLaw = Callable[[ca.SX, Signals], tuple[ca.SX, ca.SX]]

_SHORTEST, _LONGEST = 1e-4, 10.0  # sample times [s]
_AGE = HEARD.index("payload.age")


def signals_of(vector: ca.SX) -> dict[str, ca.SX]:
    """Return the symbols of a vector by the names of `HEARD`, which it begins with."""
    return {name: vector[i] for i, name in enumerate(HEARD)}


def make_recursion(
    initial: npt.ArrayLike, law: RecursiveLaw, *, status: int | None = None
) -> Recursion:
    """Return the recursion of a law, from the state before the first sample, (nxc,).

    The law is called once, as law(state, measured) with symbols, `measured` by the names of
    `HEARD`; it returns the next state, (nxc, 1), of which `status` may be one, and the command.
    """
    start = np.atleast_1d(np.asarray(initial, dtype=np.float64))
    state, vector = ca.SX.sym("xc", start.size), ca.SX.sym("m", len(HEARD))
    following, command = law(state, signals_of(vector))
    function = ca.Function(
        "controller",
        [state, vector],
        [ca.densify(ca.SX(following)), ca.densify(ca.SX(command))],
        ["xc", "m"],
        ["xc_next", "u"],
    )
    return Recursion(function=function, initial=start, status=status)


def at_rest(point: OperatingPoint) -> Measurement:
    """Return what perfect sensors tell when nothing moves: static tension, torque, command."""
    return Measurement.of(
        {
            "payload.valid": 1.0,
            "mru.valid": 1.0,
            "rope.tension": point.tension,
            "motor.torque": point.torque,
            "drive.applied": point.command,
        }
    )


class Stepper:
    """A function (state, seen) -> (next state, made) with its state, which changes."""

    def __init__(
        self, function: ca.Function, initial: FloatArray, state: FloatArray | None = None
    ) -> None:
        self._function, self._initial = function, initial
        self.state = np.array(initial if state is None else state)
        self._next, self._made = np.empty_like(self.state), np.empty(function.numel_out(1))
        self.seen = np.zeros(function.numel_in(1))
        # The arrays' addresses are bound once: a call then costs a microsecond, not fifty.
        buffer: Any  # CasADi's stubs ask for an address and a size
        buffer, self._evaluate = function.buffer()
        given: tuple[Any, Any] = self.state, self.seen
        made: tuple[Any, Any] = self._next, self._made
        for i in (0, 1):
            buffer.set_arg(i, memoryview(given[i]))
            buffer.set_res(i, memoryview(made[i]))
        self._buffer = buffer  # which `evaluate` needs alive

    def reset(self) -> None:
        """Return to the state at first."""
        self.state[:] = self._initial

    def run(self, values: FloatArray) -> FloatArray:
        """Return what is made of values seen; the array is that of the next call too."""
        self.seen[:] = values
        self._evaluate()
        self.state[:] = self._next
        return self._made

    def __reduce__(self) -> tuple[Any, ...]:
        return Stepper, (self._function, self._initial, self.state.copy())


@dataclass(frozen=True, kw_only=True, eq=False)
class RecursiveController:
    """A controller made of a recursion; obeys `models.sensing.control.Controller`.

    What it is never changes; what it remembers from one step to the next does, and `reset`
    forgets it.

    Raises InputError if the sample time is out of its range.
    """

    name: str  #: What it is called in results.
    sample_time: float  #: Time from one step to the next [s], 0.0001 to 10.
    recursion: Recursion = field(repr=False)  #: The law.
    brake: bool = False  #: Whether the drum is held by its brake instead of the motor.
    deaf_after: float = math.inf  #: Age of the payload's signals from which it is blind [s].
    _stepper: Stepper = field(init=False, repr=False)

    def __post_init__(self) -> None:
        checked_sample_time(self.name, self.sample_time)
        stepper = Stepper(self.recursion.function, self.recursion.initial)
        object.__setattr__(self, "_stepper", stepper)

    def _set(self, **fields: object) -> None:
        """Set fields of a subclass that has an `__init__` of its own."""
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def _adopt(
        self, name: str, sample_time: float, initial: npt.ArrayLike, law: RecursiveLaw
    ) -> None:
        """Set the fields of this class; the last thing that such an `__init__` does."""
        self._set(name=name, sample_time=float(sample_time))
        self._set(recursion=make_recursion(initial, law))
        RecursiveController.__post_init__(self)

    def reset(self) -> None:
        """Forget every earlier measurement."""
        self._stepper.reset()

    def step(self, measurement: Measurement, time: float) -> float:
        """Return the drive command, its static part included [V, rad/s or N m]."""
        del time  # no law here depends on it
        return float(self._stepper.run(measurement.values)[0])

    @property
    def status(self) -> str:
        """What the last step was, as `models.sensing.STATUSES` has it.

        A law without the interface (`synth.controllers.operated`) knows whether it is blind.
        """
        if self.recursion.status is not None:
            return tuple(STATUSES)[int(self._stepper.state[self.recursion.status])]
        return "blind" if self._stepper.seen[_AGE] > self.deaf_after else "engaged"


def checked_sample_time(owner: str, sample_time: float) -> float:
    """Return a sample time that is within its range [s].

    Raises InputError if it is not.
    """
    return check_range(owner, "sample_time", sample_time, low=_SHORTEST, high=_LONGEST, unit="s")
